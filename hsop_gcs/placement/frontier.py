"""The frontier: what every number of hosts gains, from the fewest that see every threat to two per threat."""

from collections.abc import Callable, Mapping
from typing import Any

from hsop_gcs.errors import BadInput
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.scenario import plan_to_json
from hsop_gcs.placement.solution import Placement, mean_error_m, worst_error_m


def frontier(
    problem: Problem,
    *,
    seed: int = 0,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    now: Callable[[], float],
    progress: Callable[[int], None] = lambda _rounds: None,
) -> Mapping[int, Placement]:
    """Find a placement for every number of hosts that has one, ascending; empty if none does.

    The numbers share one search and its time limit, seconds on the clock ``now``, the fewest hosts first.
    iterations: so many rounds for each instead. Raises BadInput for no threats.
    """
    if not problem.threats:
        raise BadInput("threats", "there are none to place hosts for")
    from hsop_gcs.placement.search import frontier as search_frontier

    return search_frontier(
        problem, seed=seed, deadline=now() + time_limit_s, now=now, iterations=iterations, progress=progress
    )


def frontier_to_json(placements: Mapping[int, Placement]) -> dict[str, Any]:
    """Return a frontier file's content: for every number of hosts its cost, expected errors and plan."""
    return {
        "frontier": [
            {
                "n_hosts": number,
                "cost": placement.cost,
                "worst_expected_error_m": worst_error_m(placement),
                "mean_expected_error_m": mean_error_m(placement),
                "plan": plan_to_json(placement),
            }
            for number, placement in placements.items()
        ]
    }
