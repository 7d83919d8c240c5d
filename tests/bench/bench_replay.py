"""How long a long mission takes to replay: ten minutes, five threats, ten hosts, flown headless in virtual time.

python -m tests.bench.bench_replay record JOURNAL      some minutes of work
hsop-gcs replay JOURNAL                                twice
"""

import math
import sys
import time
from pathlib import Path

import numpy as np

from hsop_gcs.journal import Journal
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.search.rounds import LANES
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import Flight, Moment, fly

DURATION_S = 600.0
THREATS, HOSTS = 5, 10
LOITER_M = 25.0


def loitering(time_s: float) -> list[TrueState]:
    """Threats that circle at 1 m/s, each about a place of its own."""
    states = []
    for number in range(THREATS):
        angle = time_s * 1.0 / LOITER_M + number
        east = 60.0 * number + LOITER_M * math.sin(angle)
        north = 80.0 + 30.0 * (number % 2) + LOITER_M * math.cos(angle)
        states.append(
            TrueState(
                id=f"t{number + 1}",
                position_m=(east, north, 35.0 + 2.0 * number),
                velocity_mps=(math.cos(angle), -math.sin(angle), 0.0),
                size_m=1.0,
            )
        )
    return states


def decide_in_time(asked: Situation, rules: PlanningRules) -> Decision:
    """Decide with the work that an idle machine would have time for."""
    return decide(asked, rules, now=lambda: time.process_time() / LANES)


def main() -> None:
    _, verb, name = sys.argv
    assert verb == "record", verb
    minutes: list[float] = []

    def watch(moment: Moment) -> None:
        if moment.time_s >= 60.0 * (len(minutes) + 1):
            minutes.append(time.process_time())
            tracks = moment.mission.state.picture.tracks
            errors = [
                math.dist(tracks[true.id].position_at(moment.mission.clock()), true.position_m)
                for true in moment.truth
                if true.id in tracks
            ]
            sys.stdout.write(
                f"{len(minutes)} min: {len(tracks)} tracks, median error {np.median(errors):.2f} m,"
                f" {moment.mission.state.plans.made} plans; {minutes[-1]:.0f} s\n"
            )
            sys.stdout.flush()

    flight = Flight(
        truth=loitering,
        hosts=HOSTS,
        duration_s=DURATION_S,
        rules=Rules(autonomy=Autonomy.AUTO, planning=PlanningRules(hosts="all")),
    )
    with Journal(Path(name)) as journal:
        fly(flight, watch, decide_in_time, journal)


if __name__ == "__main__":
    main()
