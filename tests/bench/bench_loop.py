"""The closed loop on 20 seeded scenarios, in virtual time: errors, NEES, lost and swapped tracks beside their limits.

python -m tests.bench.bench_loop [FIRST LAST [SECONDS [HOSTS_PER_THREAT]]]

With one host a threat, hosts are shared, and some see their threats through their fisheyes.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from tests.mission.closed_loop import Score, consistency, fly_seed

SEEDS = 20
DURATION_S = 120.0
WORKERS = 2


def _fly(job: tuple[int, float, int]) -> Score:
    seed, duration_s, hosts_per_threat = job
    return fly_seed(seed, duration_s, hosts_per_threat=hosts_per_threat)


def _line(seed: int, score: Score) -> str:
    medians = ", ".join(f"{name} {np.median(errors):.2f} m" for name, errors in score.errors_m.items() if errors)
    firsts = sorted(score.first_s.values())
    reached = f"first {firsts[0]:.0f} s, all {firsts[-1]:.0f} s" if len(firsts) == score.threats else "not all reached"
    means = [np.mean(np.concatenate(visits)) if any(visits) else np.nan for visits in score.nees.values()]
    return (
        f"| {seed} | {score.threats} | {score.nearest_m:.0f} m | {score.plans} | {reached} |"
        f" {score.station_s / score.watched_s:.0%} | {medians} | {means[0]:.1f} / {means[1]:.1f} |"
        f" {sum(score.lost.values())} | {sum(score.swapped.values())} | {sum(score.strange.values())} |"
    )


def _summary(scores: list[Score]) -> list[str]:
    lines = []
    for name, limit_m in (("central", 0.5), ("peripheral", 2.5)):
        errors = [error for score in scores for error in score.errors_m[name]]
        if errors:
            lines.append(
                f"{name}: median {np.median(errors):.2f} m (limit {limit_m} m), 95 % {np.quantile(errors, 0.95):.2f} m,"
                f" {len(errors)} samples"
            )
    for size, what in ((3, "position"), (6, "state")):
        visits = [visit for score in scores for visit in score.nees[size] if visit]
        found = consistency(visits, size)
        lines.append(
            f"NEES of the {what}: mean {found.mean:.2f} (bounds {found.low:.2f} to {found.high:.2f}),"
            f" worth {found.samples:.0f} independent samples"
        )
    lines += [
        f"moments {what}: {sum(sum(getattr(score, what).values()) for score in scores)} (limit 0)"
        for what in ("lost", "swapped", "strange")
    ]
    firsts = [time for score in scores for time in score.first_s.values()]
    lines.append(
        f"to a threat's station: median {np.median(firsts):.0f} s, 90 % {np.quantile(firsts, 0.9):.0f} s, {len(firsts)}"
        f" of {sum(score.threats for score in scores)} threats;"
        f" {sum(score.station_s for score in scores) / sum(score.watched_s for score in scores):.0%} of all time there"
    )
    return lines


def main() -> None:
    first, last = (int(text) for text in sys.argv[1:3]) if len(sys.argv) >= 3 else (0, SEEDS - 1)
    duration_s = float(sys.argv[3]) if len(sys.argv) >= 4 else DURATION_S
    hosts_per_threat = int(sys.argv[4]) if len(sys.argv) == 5 else 2
    seeds = range(first, last + 1)
    scores = []
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        jobs = [(seed, duration_s, hosts_per_threat) for seed in seeds]
        for seed, score in zip(seeds, pool.map(_fly, jobs), strict=True):
            scores.append(score)
            sys.stdout.write(_line(seed, score) + "\n")
            sys.stdout.flush()
    sys.stdout.write("\n".join(_summary(scores)) + "\n")


if __name__ == "__main__":
    main()
