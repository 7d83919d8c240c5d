"""How near threats come to hosts, beside a host that flees at its limit, on seeded circles and turns, in virtual time.

python -m tests.bench.bench_giving_way [FIRST LAST]

Even seeds: a threat on a circle of 20 to 50 m at 1 to 4 m/s that leads past two hosts that hover, or through where they
do; odd ones: one that flies past them and turns towards them. Every third seed flies ArduPilots.
"""

import sys

import numpy as np

from hsop_gcs.simulator.fleet import Autopilot
from tests.mission.closing import TICK_S, Outcome, circle, flown, flown_ways

SEEDS = 30
DURATION_S = 45.0
GOALS_M = [(0.0, 60.0, 30.0), (14.0, 60.0, 30.0)]


def fly_seed(seed: int) -> tuple[str, Outcome]:
    """Fly one mission; return what it was and what came of it."""
    rng = np.random.default_rng([seed, 7])
    autopilot = Autopilot.ARDUPILOT if seed % 3 == 0 else Autopilot.PX4
    speed_mps = float(rng.uniform(1.0, 4.0))
    if seed % 2 == 0:
        radius_m, there_s = float(rng.uniform(20.0, 50.0)), float(rng.uniform(18.0, 28.0))
        phase_deg = 180.0 - float(np.degrees(speed_mps * there_s / radius_m))
        centre_m = (float(rng.uniform(-20.0, 20.0)), 60.0 + radius_m + float(rng.uniform(-10.0, 15.0)), 32.0)
        truth = circle(centre_m, radius_m, speed_mps, phase_deg=phase_deg)
        what = f"circle of {radius_m:.0f} m at {speed_mps:.1f} m/s"
    else:
        aside_m, at_s = float(rng.uniform(22.0, 40.0)), float(rng.uniform(14.0, 24.0))
        rate_deg_s = -float(rng.uniform(15.0, 60.0))
        turn = {"at_s": at_s, "for_s": 90.0 / -rate_deg_s, "rate_deg_s": rate_deg_s}
        start = [14.0 + aside_m, 60.0 - speed_mps * at_s, 30.0]
        truth = flown_ways({"position_m": start, "velocity_mps": [0.0, speed_mps, 0.0], "turns": [turn]})
        what = f"turns at {speed_mps:.1f} m/s, {aside_m:.0f} m beside"
    return f"{what}, {autopilot.value}", flown(truth, GOALS_M, duration_s=DURATION_S, autopilot=autopilot, seed=seed)


def main() -> None:
    first, last = (int(text) for text in sys.argv[1:3]) if len(sys.argv) == 3 else (0, SEEDS - 1)
    sys.stdout.write("| seed | threat | nearest | short of the limit | closing in | gave way | stops | on station |\n")
    sys.stdout.write("|---" * 8 + "|\n")
    worst_m, closing = -np.inf, 0
    for seed in range(first, last + 1):
        what, outcome = fly_seed(seed)
        worst_m, closing = max(worst_m, outcome.short_of_the_limit_m()), closing + len(outcome.closing())
        sys.stdout.write(
            f"| {seed} | {what} | {outcome.nearest_m():.1f} m | {outcome.short_of_the_limit_m():.1f} m |"
            f" {len(outcome.closing()) * TICK_S:.1f} s | {outcome.moves['HostGaveWay']} | {outcome.stops()} |"
            f" {outcome.on_station / outcome.watched:.0%} |\n"
        )
        sys.stdout.flush()
    sys.stdout.write(f"at worst {worst_m:.1f} m short of the limit; closing in for {closing * TICK_S:.1f} s\n")


if __name__ == "__main__":
    main()
