"""How much of a core the tracker takes: 50 threats at 10 Hz, in scans or one by one, with and without ids, also late.

python -m tests.bench.bench_tracks
"""

import sys
import time
from collections.abc import Sequence

import numpy as np

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks import Picture, TrackRules, prune, update
from tests.tracks.world import vector

THREATS, RATE_HZ, DURATION_S, SIGMA_M = 50, 10, 10, 2.0
RULES = TrackRules()


def scans(*, ids: bool, late_s: float) -> list[tuple[float, list[Measurement]]]:
    """Arrival time and reports of each scan; every second one is of a source that is ``late_s`` behind the other."""
    rng = np.random.default_rng(0)
    start, velocity = rng.uniform(-500, 500, (THREATS, 3)), rng.uniform(-5, 5, (THREATS, 3))
    made: list[tuple[float, list[Measurement]]] = []
    for number in range(RATE_HZ * DURATION_S):
        arrival_s = 1e9 + number / RATE_HZ
        time_s = arrival_s - (late_s if number % 2 else 0.0)
        places = start + velocity * (time_s - 1e9) + rng.normal(0, SIGMA_M, (THREATS, 3))
        scan: list[Measurement] = [
            Report(
                source=f"radar-{number % 2}" if late_s else "radar",
                threat_id=f"t{threat}" if ids else None,
                time_s=time_s,
                position_m=vector(place),
                sigma_m=SIGMA_M,
            )
            for threat, place in enumerate(places)
        ]
        made.append((arrival_s, scan))
    return made


def share_of_a_core(scans: Sequence[tuple[float, list[Measurement]]], *, one_by_one: bool) -> tuple[float, int]:
    """Return processor time over the time the scans span, and how many tracks there are at the end."""
    picture = Picture()
    began_s = time.process_time()
    for now_s, scan in scans:
        for part in [[each] for each in scan] if one_by_one else [scan]:
            picture, _ = update(picture, part, now_s, RULES)
        picture, _ = prune(picture, now_s, RULES)
    return (time.process_time() - began_s) / DURATION_S, len(picture.tracks)


def main() -> None:
    for late_s in (0.0, 0.55):
        for ids in (True, False):
            for one_by_one in (False, True):
                share, tracks = share_of_a_core(scans(ids=ids, late_s=late_s), one_by_one=one_by_one)
                sys.stdout.write(
                    f"{'one by one' if one_by_one else 'in scans':>10}, {'with ids' if ids else 'no ids':>8},"
                    f" {f'half {late_s:g} s late' if late_s else 'in order':>16}: {share:6.2%} of a core,"
                    f" {tracks} tracks of {THREATS} threats\n"
                )


if __name__ == "__main__":
    main()
