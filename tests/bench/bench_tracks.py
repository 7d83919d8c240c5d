"""How long the tracker takes beside Stone Soup, and how much of a core: 50 threats at 10 Hz, in scans or one by one,
with and without ids, also late.

python -m tests.bench.bench_tracks

In an environment with stonesoup and this package, Stone Soup is run side by side, on 50 threats as well; in another,
what it took on the machine that made the file stands for it.
"""

import json
import runpy
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks import Picture, TrackRules, prune, track_kernels, update
from tests.tracks.world import vector

THREATS, RATE_HZ, DURATION_S, SIGMA_M = 50, 10, 10, 2.0
RULES = TrackRules()
GOLDEN = Path(__file__).parents[1] / "data" / "tracks" / "scans.json"
"""The same scenarios for both, and what Stone Soup took for them; see the script beside it."""


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


def seconds_per_scan(scenario: dict[str, Any], rules: TrackRules, sigma_m: float) -> float:
    """Return the processor time that one scan of plots without ids takes."""
    scans: list[tuple[float, list[Measurement]]] = [
        (
            1e9 + scan["time_s"],
            [
                Report(
                    source="radar",
                    threat_id=None,
                    time_s=1e9 + scan["time_s"],
                    position_m=vector(plot),
                    sigma_m=sigma_m,
                )
                for plot in scan["plots_m"]
            ],
        )
        for scan in scenario["scans"]
    ]
    picture, began_s = Picture(), time.process_time()
    for now_s, scan in scans:
        picture, _ = prune(update(picture, scan, now_s, rules)[0], now_s, rules)
    return (time.process_time() - began_s) / len(scans)


def beside_stone_soup() -> None:
    golden = json.loads(GOLDEN.read_text())
    given = golden["rules"]
    rules = TrackRules(timeout_s=given["timeout_s"], tentative_timeout_s=given["tentative_timeout_s"])
    scenarios: dict[str, Any] = golden["scenarios"]
    run: Callable[[Any], tuple[float, float]] | None = None
    if find_spec("stonesoup") is not None:
        run = runpy.run_path(str(GOLDEN.with_name("make_golden.py")))["stone_soup"]
        scenarios["crowd"] = crowd()
    for name, scenario in scenarios.items():
        ours_s = min(seconds_per_scan(scenario, rules, given["sigma_m"]) for _ in range(5))
        theirs_s = scenario["stone_soup"]["per_scan_s"] if run is None else run(scenario["scans"])[1]
        sys.stdout.write(
            f"{name}: {1e6 * ours_s:.0f} us a scan, Stone Soup {'took' if run is None else 'takes'}"
            f" {1e3 * theirs_s:.1f} ms: {theirs_s / ours_s:.0f} times as fast\n"
        )


def crowd() -> dict[str, Any]:
    """Plots of 50 threats, two scans a second."""
    found = [
        {
            "time_s": now_s - 1e9,
            "truth_m": [],
            "plots_m": [each.position_m for each in scan if isinstance(each, Report)],
        }
        for now_s, scan in scans(ids=False, late_s=0.0)[::5]
    ]
    return {"scans": found}


def main() -> None:
    track_kernels.warm_up()
    beside_stone_soup()
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
