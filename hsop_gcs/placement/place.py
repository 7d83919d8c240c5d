"""``place``: the public entry. A problem in, a placement out; infeasible is an answer."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.placement.answer import chosen, compass_deg, hover_pose, names_of
from hsop_gcs.placement.bounds import lower_bound
from hsop_gcs.placement.coverage_only import cover
from hsop_gcs.placement.feasibility import members
from hsop_gcs.placement.hsop import Best, Search
from hsop_gcs.placement.instance import Instance
from hsop_gcs.placement.objective import threat_points_m
from hsop_gcs.placement.pair_sets import PlanePoint, observed_threats
from hsop_gcs.placement.pair_sets import initial_observers as initial_observers_of
from hsop_gcs.placement.partial import is_possible, place_some, without
from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.reasons import why_infeasible, why_not_flown
from hsop_gcs.placement.solution import HoverPose, Method, Placement, Status

REASONING_S, LATE_REASONING_S = 3.0, 1.0
"""What it may take to say why the search found nothing, and how much of that after the deadline."""


def place(
    problem: Problem,
    *,
    n_hosts: int | None = None,
    seed: int = 0,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    now: Callable[[], float],
    method: Method | None = None,
    initial_observers: bool = False,
    letters_cameras: bool = False,
    target_error_m: float | None = None,
    warm_start: Placement | None = None,
    until_settled: bool = False,
    thorough_bound: bool = True,
    partial: bool = False,
    most_rounds: int | None = None,
    reasoning_s: float = LATE_REASONING_S,
) -> Placement:
    """Say where hosts hover, where they look and which camera sees which threat.

    n_hosts: exactly so many; None is the smallest number that sees every threat. now: the clock of the time limit,
    seconds. iterations: exactly so many of the search's rounds instead of a time limit. method: None is the global
    search, or the letter's own where something only it can do is asked for. initial_observers: only the letter's
    (N_h - 1)^N_t pair sets, from the hosts' current positions, in which hosts keep their places. letters_cameras: only
    the letter's choice of cameras. target_error_m: instead of ``n_hosts``, the smallest number that brings every
    threat's expected error to this, metres, and if none does, the largest. warm_start: an earlier placement, of almost
    the same threats, to start the search from. until_settled: the search may stop before its time when nothing has been
    gained for a while. thorough_bound: False spares the time of a tight lower bound. partial: where not all threats
    can be seen, or not in this time, the others are placed for, the most valuable first: by weight, then by how many
    can be seen together and how near they are; ``left_out`` says which are not, and why. That goes in the operational
    formulation and by the global search only. most_rounds: no more than these, also if there is time. reasoning_s: what
    finding out why there is no placement may take beyond the time limit. Poses carry the ids of ``problem.hosts``,
    shared out for short flights, or h1, h2, ... if there are none.
    Raises BadInput for no threats, a number of hosts outside 2 .. 2 N_t, initial observers without positions, and
    what the method cannot do.
    """
    letters_own = initial_observers or letters_cameras
    method = method or (Method.LETTER if letters_own else Method.SEARCH)
    _check(problem, n_hosts, method, letters_own=letters_own)
    if target_error_m is not None:
        _check_target(target_error_m, n_hosts, method)
    if initial_observers and not problem.hosts:
        raise BadInput("hosts", "current positions are needed to choose initial observers, and none were given")
    started = now()
    deadline = started + time_limit_s
    if partial and method is Method.SEARCH and problem.formulation is Formulation.OPERATIONAL:
        placement = place_some(
            problem,
            n_hosts=n_hosts,
            seed=seed,
            deadline=deadline,
            now=now,
            iterations=iterations,
            warm_start=warm_start,
            target_error_m=target_error_m,
            until_settled=until_settled,
            thorough_bound=thorough_bound,
            most_rounds=most_rounds,
        )
        placement = replace(placement, method=method, seed=seed, solve_time_s=now() - started)
        if placement.status is not Status.INFEASIBLE or len(placement.left_out) == len(problem.threats):
            return placement
        problem = without(problem, placement.left_out)
        return replace(placement, reason=_why_none(problem, n_hosts, seed, now, deadline, reasoning_s))
    search = Search(
        Instance.of(problem),
        seed=seed,
        deadline=deadline,
        now=now,
        observers=(lambda count: _observers(problem, count)) if initial_observers else None,
        letters_cameras=letters_cameras,
    )
    most = 2 * len(problem.threats)
    available = min(most, _available(problem, most))
    if method is Method.SEARCH:
        # Compiled kernels take a second to load, which the other methods need not pay.
        from hsop_gcs.placement.search import search as search_globally

        placement = search_globally(
            problem,
            n_hosts=n_hosts,
            seed=seed,
            deadline=deadline,
            now=now,
            iterations=iterations,
            warm_start=warm_start,
            target_error_m=target_error_m,
            until_settled=until_settled,
            thorough_bound=thorough_bound,
        )
        reasoning_until = now() + REASONING_S
        if iterations is None:
            reasoning_until = min(reasoning_until, max(deadline, now()) + reasoning_s)
        search.deadline = reasoning_until
    else:
        counts = range(2, available + 1) if n_hosts is None else range(n_hosts, min(n_hosts, available) + 1)
        placement = _fewest_first(problem, search, method, counts, by_role=initial_observers)
    if placement.status is Status.INFEASIBLE:
        letters_own = problem.formulation is Formulation.LETTER and len(problem.rigs) == 1
        if method is Method.SEARCH and not letters_own:
            reason = why_not_flown(
                problem,
                search,
                n_hosts=n_hosts,
                available=available,
                possible=lambda asked, count: is_possible(asked, count, seed, now),
            )
        else:
            reason = why_infeasible(problem, search, n_hosts=n_hosts, available=available)
        placement = replace(placement, reason=reason)
    return replace(placement, method=method, seed=seed, solve_time_s=now() - started)


def _why_none(
    problem: Problem, n_hosts: int | None, seed: int, now: Callable[[], float], deadline: float, reasoning_s: float
) -> str:
    """Say why not even one threat is seen."""
    until = min(now() + REASONING_S, max(deadline, now()) + reasoning_s)
    search = Search(Instance.of(problem), seed=seed, deadline=until, now=now)
    return why_not_flown(
        problem,
        search,
        n_hosts=n_hosts,
        available=min(2 * len(problem.threats), _available(problem, 2 * len(problem.threats))),
        possible=lambda asked, count: is_possible(asked, count, seed, now),
    )


def _fewest_first(problem: Problem, search: Search, method: Method, counts: range, *, by_role: bool) -> Placement:
    """Add hosts until they see every threat (Algorithm 3)."""
    for count in counts:
        best = search.solve_all(count) if method is Method.LETTER else cover(search, count)
        if best is not None:
            return _placement(problem, best, by_role=by_role, bound=lower_bound(search.instance))
        if search.late():
            break
    return Placement(status=Status.INFEASIBLE, formulation=problem.formulation, objective=problem.objective)


def _check(problem: Problem, n_hosts: int | None, method: Method, *, letters_own: bool) -> None:
    most = 2 * len(problem.threats)
    if not problem.threats:
        raise BadInput("threats", "there are none to place hosts for")
    for threat in problem.threats:
        # compiled kernels would not notice, and look for hosts outside their arrays
        if not all(map(math.isfinite, (*threat.position_m, *threat.velocity_mps, threat.size_m, threat.weight))):
            raise BadInput("threats", f"{threat.id!r} has a number that is not finite: {threat}")
    if n_hosts is not None and not 2 <= n_hosts <= most:
        raise BadInput(
            "n_hosts",
            f"{n_hosts} is outside 2..{most}: a threat takes two hosts, and {len(problem.threats)} "
            f"threat{'s' if most > 2 else ''} cannot use more than {most}",
        )
    if letters_own and method is Method.SEARCH:
        raise BadInput("method", f"{method.value!r} knows neither initial observers nor the letter's cameras")
    if problem.objective is not Objective.LETTER and method is not Method.SEARCH:
        raise BadInput("objective", f"{problem.objective.value!r} is not what method {method.value!r} minimises")
    if method is not Method.SEARCH and len(problem.rigs) > 1:
        raise BadInput("hosts", f"carry {len(problem.rigs)} different rigs, and method {method.value!r} knows only one")
    if method is not Method.SEARCH and any(not _looks_around(rig) for rig in problem.rigs):
        raise BadInput(
            "tilt_deg", f"method {method.value!r} knows no limits of gimbals that keep it from looking around"
        )
    if method is not Method.SEARCH and not _is_plane(problem):
        raise BadInput(
            "method", f"{method.value!r} knows only threats at one altitude, and neither fence nor keep-outs nor travel"
        )


def _is_plane(problem: Problem) -> bool:
    """Return whether the problem is the letter's plane one, or an operational one that differs in no more than that."""
    if problem.formulation is Formulation.LETTER:
        return True
    up, airspace = threat_points_m(problem)[:, :, 2], problem.airspace
    limited = airspace.inside or airspace.keep_outs or problem.lead_s
    return bool(np.ptp(up) < 1e-9) and not limited and airspace.altitude_room_m(float(up.mean())) >= 0


def _looks_around(rig: CameraRig) -> bool:
    """Return whether a level gimbal can look to all sides, with either end of the fisheye axis as the nose."""
    tilts, pans = rig.tilt_deg, rig.pan_deg
    return tilts[0] <= 0 <= tilts[1] and pans[0] <= -90 and pans[1] >= 90


def _check_target(target_error_m: float, n_hosts: int | None, method: Method) -> None:
    if not 0 < target_error_m < math.inf:
        raise BadInput("target_error_m", f"must be above 0 and finite, not {target_error_m!r}")
    if n_hosts is not None:
        raise BadInput("target_error_m", f"decides how many hosts there are, and {n_hosts} were asked for")
    if method is not Method.SEARCH:
        raise BadInput("target_error_m", f"method {method.value!r} does not aim at an error")


def _available(problem: Problem, most: int) -> int:
    given = len(problem.hosts) if problem.hosts else most
    return given if problem.max_hosts is None else min(given, problem.max_hosts)


def _by_nearness(problem: Problem, count: int) -> list[int]:
    """Return the hosts that take part when only ``count`` do: initial observers first, then who is near a threat."""
    hosts_m, threats_m = _positions(problem)
    nearest = cdist(hosts_m, threats_m).min(axis=1)
    observers = dict.fromkeys(initial_observers_of(threats_m, hosts_m))
    others = sorted(set(range(len(hosts_m))) - set(observers), key=lambda host: (nearest[host], host))
    return [*observers, *others][:count]


def _observers(problem: Problem, count: int) -> tuple[int, ...]:
    """Return each threat's initial observer, counted among the ``count`` hosts that take part."""
    hosts_m, threats_m = _positions(problem)
    return initial_observers_of(threats_m, [hosts_m[host] for host in _by_nearness(problem, count)])


def _positions(problem: Problem) -> tuple[list[PlanePoint], list[PlanePoint]]:
    """Return where hosts and threats are now, in the plane, metres."""
    return [h.position_m[:2] for h in problem.hosts], [t.position_m[:2] for t in problem.threats]


def _placement(problem: Problem, best: Best, *, by_role: bool, bound: float) -> Placement:
    """Name the solver's poses and value them; by role: hosts keep their places among those that take part."""
    if by_role:
        names = [problem.hosts[k].id for k in _by_nearness(problem, len(best.poses))]
    else:
        names = names_of(problem, best.poses, problem.rigs * len(best.poses))
    hosts = [_hover_pose(problem, best, host, name) for host, name in enumerate(names)]
    return chosen(problem, best.choice, hosts, lower_bound=bound)


def _hover_pose(problem: Problem, best: Best, host: int, name: str) -> HoverPose:
    """Hover at the threats' mean altitude; tilt to the middle of what the central camera sees, now and later.

    Where no fisheye view is used the heading follows the pan.
    """
    east, north, heading, pan = (float(value) for value in best.poses[host])
    points = threat_points_m(problem)
    up = float(points[:, :, 2].mean())
    held = members(best.choice.central[host])
    by_fisheye = observed_threats(best.choice.pair_set)[host] != best.choice.central[host]
    aim = None
    if held:
        middle = points[held].reshape(-1, 3).mean(axis=0)
        tilt = math.atan2(middle[2] - up, math.dist(middle[:2], (east, north)))
        aim = Aim(pan_deg=compass_deg(pan), tilt_deg=math.degrees(tilt))
    return hover_pose(
        name, np.array([east, north, up]), compass_deg(heading if by_fisheye else pan), problem.rigs[0], aim
    )
