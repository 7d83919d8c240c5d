"""Why there is no placement, in terms of what was asked."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.beyond import why_beyond_airspace
from hsop_gcs.placement.coverage_only import cover
from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL, Screen
from hsop_gcs.placement.hsop import Search
from hsop_gcs.placement.instance import Instance
from hsop_gcs.placement.objective import hover_altitudes_m, threat_points_m
from hsop_gcs.placement.problem import AvailableHost, Formulation, Problem


def why_infeasible(problem: Problem, search: Search, *, n_hosts: int | None, available: int) -> str:
    """Return one sentence on what stands in the way: a threat that nobody can see, too few hosts, or too little time.

    search: the run that found nothing. available: how many hosts there are to place.
    """
    for index, threat in enumerate(problem.threats):
        if not search.poses.covers(1 << index):
            return _beyond_cameras(problem, [search.screen], index) or (
                f"no hover point that keeps {problem.safety_distance_m:g} m from {_kept_from(problem)} sees threat "
                f"{threat.id} now and after {problem.horizon_s:g} s"
            )
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


def why_not_flown(
    problem: Problem,
    search: Search,
    *,
    n_hosts: int | None,
    available: int,
    possible: Callable[[Problem, int], bool],
) -> str:
    """Return one sentence on why nothing that can be flown was found, in the operational formulation or by mixed rigs.

    possible: whether a placement of a problem with exactly so many hosts is found. A threat that not even two hosts of
    its own can see comes first, then the number of hosts and their rigs, then the rule without which more would do.
    """
    screens = [Screen(Instance.of(problem, rig)) for rig in problem.rigs]
    unlimited = _with_any_host(problem)
    if available < 2 and n_hosts is None:
        return f"{_hosts(available)} available; at least 2 are needed to see every threat"
    for index, threat in enumerate(problem.threats):
        if beyond := _beyond_cameras(problem, screens, index):
            return beyond
        alone = replace(unlimited, threats=(threat,))
        if not search.late() and not possible(alone, 2):
            return f"threat {threat.id} cannot be seen by any two hosts: {_in_the_way(alone, 2, possible, search.late)}"
    if n_hosts is not None and n_hosts > available:
        return f"{n_hosts} hosts were asked for, {_hosts(available)} available"
    most = 2 * len(problem.threats)
    tried = available if n_hosts is None else n_hosts
    for count in range(max(2, tried + (len(screens) == 1)), most + 1):
        if search.late():
            return "the time limit passed before a placement was found"
        if possible(unlimited, count):
            if count == tried:
                return (
                    f"{_counted(count)} cannot see every threat with their rigs; with the best of these rigs they could"
                )
            if n_hosts is not None:
                return f"no placement of {n_hosts} hosts sees every threat; {count} hosts can"
            return f"{_hosts(available)} available; at least {count} are needed to see every threat"
    asked = min(most, available) if n_hosts is None else n_hosts
    more = f", nor can up to {most}" if asked < most else ""
    obstacle = _in_the_way(unlimited, max(2, asked), possible, search.late)
    return f"{_counted(asked)} cannot see every threat{more}: {obstacle}"


def out_of_sight(problem: Problem) -> dict[str, str]:
    """Return the threats that nobody can see, whatever the others do, and for each a sentence that says why."""
    screens = [Screen(Instance.of(problem, rig)) for rig in problem.rigs]
    found = {}
    for index, threat in enumerate(problem.threats):
        why = _beyond_cameras(problem, screens, index)
        if why is None and problem.formulation is Formulation.OPERATIONAL:
            why = why_beyond_airspace(problem, threat, max(float(screen.reach_m[:, index].max()) for screen in screens))
        if why is not None:
            found[threat.id] = why
    return found


def why_unseen(problem: Problem, *, possible: Callable[[Problem, int], bool], late: Callable[[], bool]) -> str | None:
    """Return one sentence on why the problem's only threat cannot be seen by two hosts of its own; None if it can, or
    if there is no time to find out.

    possible: whether a placement of a problem with exactly so many hosts is found.
    """
    (threat,) = problem.threats
    alone = _with_any_host(problem)
    if late() or possible(alone, 2):
        return None
    return f"threat {threat.id} cannot be seen by any two hosts: {_in_the_way(alone, 2, possible, late)}"


def why_left(threat_id: str, hosts: int, seen: int, threats: int) -> str:
    """Return one sentence on why a threat is left that could be seen if there were no others."""
    others = "the other" if seen == 1 else f"{seen} others"
    return f"threat {threat_id} is left for {others}: no placement of {_counted(hosts)} for all {threats} was found"


def why_not_two(threat_id: str) -> str:
    """Return one sentence on a threat for which no two hover points were found, and no time to find out why not."""
    return f"threat {threat_id} cannot be seen by any two hosts: no hover points that keep all rules were found"


def _in_the_way(
    problem: Problem, n_hosts: int, possible: Callable[[Problem, int], bool], late: Callable[[], bool]
) -> str:
    """Name the rule that stands in the way: the first without which a placement is found."""
    airspace = problem.airspace
    free = replace(airspace, inside=())
    rules: list[tuple[str, Problem]] = []
    if airspace.inside:
        rules.append(("the fence", replace(problem, airspace=free)))
    areas = tuple(area for area in airspace.keep_outs if not area.host)
    if areas:
        named = "the keep-out area" if len(areas) == 1 else "the keep-out areas"
        around_hosts = tuple(area for area in airspace.keep_outs if area.host)
        rules.append((named, replace(problem, airspace=replace(airspace, keep_outs=around_hosts))))
    if hosts := sorted({area.host for area in airspace.keep_outs if area.host}):
        rules.append((" and ".join(hosts), replace(problem, airspace=replace(airspace, keep_outs=areas))))
    if airspace.floor_m is not None or airspace.ceiling_m is not None:
        # What the threats' own altitudes would allow, and what is allowed now.
        low, high = hover_altitudes_m(replace(problem, airspace=Airspace()))
        now_low, now_high = hover_altitudes_m(problem)
        wider = replace(airspace, floor_m=min(low, now_low), ceiling_m=max(high, now_high))
        limits = " and ".join(
            f"the {name} of {limit:g} m"
            for name, limit in (("floor", airspace.floor_m), ("ceiling", airspace.ceiling_m))
            if limit is not None
        )
        rules.append((limits, replace(problem, airspace=wider)))
    if problem.min_separation_m > 0:
        apart = f"the separation of {problem.min_separation_m:g} m between hosts"
        rules.append((apart, replace(problem, min_separation_m=0.0)))
    if problem.lead_s > 0:
        rules.append((f"the threats' ways in the next {problem.lead_s:.0f} s", replace(problem, lead_s=0.0)))
    near = replace(problem, safety_distance_m=min(1.0, problem.safety_distance_m))
    rules.append((f"the safety distance of {problem.safety_distance_m:g} m from {_kept_from(problem)}", near))
    for name, without in rules:
        if late():
            return "there was no time to find out which rule is in the way"
        if possible(without, n_hosts):
            verb = "are" if " and " in name or name.endswith(("areas", " s")) else "is"
            return f"{name} {verb} in the way"
    if len(rules) > 1:
        everything = replace(near, airspace=Airspace(), min_separation_m=0.0, lead_s=0.0)
        if possible(everything, n_hosts):
            return "no single rule is in the way, but " + ", ".join(name for name, _ in rules) + " together are"
    return "no hover points are near enough for the least pixels that the cameras need"


def _with_any_host(problem: Problem) -> Problem:
    """Return the problem with as many hosts of each of its rigs as a placement can use."""
    each = range(2 * len(problem.threats))
    hosts = [AvailableHost(id="", position_m=(0.0, 0.0, 0.0), rig=rig) for rig in problem.rigs for _ in each]
    named = (replace(host, id=f"any{k}") for k, host in enumerate(hosts))
    return replace(problem, hosts=tuple(named), max_hosts=None)


def _kept_from(problem: Problem) -> str:
    return "every threat's path" if problem.formulation is Formulation.OPERATIONAL else "both its points"


def _counted(count: int) -> str:
    return "1 host" if count == 1 else f"{count} hosts"


def _hosts(count: int) -> str:
    return {0: "no host is", 1: "1 host is"}.get(count, f"{count} hosts are")


def _beyond_cameras(problem: Problem, screens: Sequence[Screen], index: int) -> str | None:
    """Say why not even a host of its own sees a threat if its size, altitude or path alone forbid it; else None."""
    threat, safe = problem.threats[index], problem.safety_distance_m
    reach_m = np.array([screen.reach_m[:, index] for screen in screens])
    peripheral, central = float(reach_m[:, PERIPHERAL].max()), float(reach_m[:, CENTRAL].max())
    farthest = max(peripheral, central)
    if farthest < safe:
        return (
            f"threat {threat.id} is detected no farther than {farthest:.1f} m away, "
            f"which is inside the safety distance of {safe:g} m"
        )
    operational = problem.formulation is Formulation.OPERATIONAL
    start, end = threat_points_m(problem)[index]
    low, high = hover_altitudes_m(problem)
    for up in (float(start[2]), float(end[2])):
        off = max(low - up, up - high)
        if operational and off > farthest:
            limit = f"the floor of {low:g} m" if up < low else f"the ceiling of {high:g} m"
            return (
                f"threat {threat.id} is {off:.1f} m beyond {limit}, and is detected no farther than "
                f"{farthest:.1f} m away"
            )
    path = math.dist(start, end) if operational else math.dist(start[:2], end[:2])
    spans = [
        float(s.longest_central_span_m(r, r)) for s, r in zip(screens, reach_m[:, CENTRAL], strict=True) if r >= safe
    ]
    span = max(spans, default=0.0)
    longest = max(2 * peripheral, span)
    if path > longest:
        return (
            f"threat {threat.id} flies {path:.1f} m within the horizon of {problem.horizon_s:g} s; "
            f"one host sees at most {longest:.1f} m of a path"
        )
    return None
