"""Why there is no placement, in terms of what was asked."""

import math

from hsop_gcs.placement.coverage_only import cover
from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL
from hsop_gcs.placement.hsop import Search
from hsop_gcs.placement.problem import Formulation, Problem


def why_infeasible(problem: Problem, search: Search, *, n_hosts: int | None, available: int) -> str:
    """Return one sentence on what stands in the way: a threat that nobody can see, too few hosts, or too little time.

    search: the run that found nothing. available: how many hosts there are to place.
    """
    for index, threat in enumerate(problem.threats):
        if not search.poses.covers(1 << index):
            return _why_unseen(problem, search, index, threat.id)
    if n_hosts is not None and n_hosts > available:
        return f"{n_hosts} hosts were asked for, {_hosts(available)} available"
    restricted, search.observers = search.observers is not None, None
    tried = range(2, available + 1) if n_hosts is None else range(n_hosts, n_hosts + 1)
    for count in range(2, 2 * len(problem.threats) + 1):
        if search.late():
            return "the time limit passed before a placement was found"
        if (count in tried and not restricted) or cover(search, count) is None:
            continue
        if count in tried:
            return (
                f"no placement keeps every threat's initial observer; without that rule {count} hosts see every threat"
            )
        if n_hosts is not None:
            return f"no placement of {n_hosts} hosts sees every threat; {count} hosts can"
        return f"{_hosts(available)} available; at least {count} are needed to see every threat"
    return "each threat can be seen by itself, but no placement that sees all of them was found for any number of hosts"


def _hosts(count: int) -> str:
    return {0: "no host is", 1: "1 host is"}.get(count, f"{count} hosts are")


def _why_unseen(problem: Problem, search: Search, index: int, name: str) -> str:
    """Say why not even a host of its own sees a threat."""
    safe = problem.safety_distance_m
    peripheral, central = (float(search.screen.reach_m[camera, index]) for camera in (PERIPHERAL, CENTRAL))
    if max(peripheral, central) < safe:
        return (
            f"threat {name} is detected no farther than {max(peripheral, central):.1f} m away, "
            f"which is inside the safety distance of {safe:g} m"
        )
    start, end = search.instance.points_m[index]
    path = math.dist(start, end)
    span = float(search.screen.longest_central_span_m(central, central)) if central >= safe else 0.0
    longest = max(2 * peripheral, span)
    if path > longest:
        return (
            f"threat {name} flies {path:.1f} m within the horizon of {problem.horizon_s:g} s; "
            f"one host sees at most {longest:.1f} m of a path"
        )
    rule = "every threat's path" if problem.formulation is Formulation.OPERATIONAL else "both its points"
    return f"no hover point that keeps {safe:g} m from {rule} sees threat {name} now and after {problem.horizon_s:g} s"
