"""The search as a question and an answer: ``search``, ``frontier`` and ``warm_up``."""

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.answer import PROVEN_GAP
from hsop_gcs.placement.fusion import fused_lower_bound, fuses
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search.bounds import fewest_hosts, lower_bound, own_bounds
from hsop_gcs.placement.search.frame import Frame
from hsop_gcs.placement.search.model import Floats, Question
from hsop_gcs.placement.search.numbers import ROUNDS_TO_REFUSE, Courses, least_acceptable
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of, state_of
from hsop_gcs.placement.search.rounds import LANES, Course, run
from hsop_gcs.placement.search.shared import shared_bounds
from hsop_gcs.placement.search.state import State, new_state
from hsop_gcs.placement.search.wanted import Wanted
from hsop_gcs.placement.solution import Placement, Status

ROUNDS_OF_EVERY_KIND = 2
"""After so many, everything that a round can do has been done once."""
ROUNDS_BEFORE_PROOF = 6
WORTH_A_PROOF = 1.3
"""A placement within this factor of the first bound may be optimal: then a thorough bound is worth its time."""
PROOF_S_PER_THREAT = 0.3
"""What must be left for a thorough bound, several times what it takes."""
CELLS_TO_SHARE, MOST_TO_SHARE, SHARED_S_PER_THREAT = 2_000, 4, 0.4
"""Into how many cells a bound for shared hosts splits their places, for at most so many threats, and what must be left
of the time for it, several times what it takes."""
MOST_FOR_BOUNDS = 0.4
"""The share of a frontier's time that is kept for its bounds, at most."""
PATIENCE_PER_THREAT = 1
"""A search is settled when so many rounds for each threat have gained nothing: more seldom find what others missed."""


def search(
    problem: Problem,
    *,
    n_hosts: int | None,
    seed: int,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None = None,
    warm_start: Placement | None = None,
    target_error_m: float | None = None,
    until_settled: bool = False,
    thorough_bound: bool = True,
) -> Placement:
    """Find the least costly placement, as far as the time goes.

    n_hosts: exactly so many; None is the smallest number for which a placement is found. deadline: on the clock
    ``now``; one round of the search is always run, and however many it takes to settle the number of hosts.
    iterations: exactly so many rounds with that number instead, whatever the time.
    warm_start: an earlier placement of almost the same threats and number of hosts. target_error_m: without
    ``n_hosts``, the smallest number that brings every threat's expected error to this, metres, and if none does, the
    largest. until_settled: stop before the deadline when nothing has been gained for a while. thorough_bound: whether a
    placement near the lower bound is worth a tighter one, if there is time, to prove it optimal and end the search.
    The same arguments give the same placement; more time only improves it.
    """
    started = now()
    if iterations is not None:
        deadline = math.inf
    frame = frame_of(problem)
    q = question_of(problem, frame)
    most = most_hosts(problem)
    least = max(2, fewest_hosts(q))
    numbers = range(least, most + 1) if n_hosts is None else range(n_hosts, min(n_hosts, most) + 1)
    flown = warm_start if warm_start is not None and warm_start.hosts else None
    warm = None if flown is None else lambda count: state_of(problem, frame, q, flown, count)
    courses = Courses(q, seed, warm)
    with ThreadPoolExecutor(LANES) as executor:
        target_m = None if n_hosts is not None else target_error_m
        wanted = Wanted(problem, frame, q, target_m, seed=seed, executor=executor)
        number = n_hosts if numbers else None
        if n_hosts is None:
            first = None if flown is None else len(flown.hosts)
            number = least_acceptable(courses, numbers, wanted.accepts, executor, first)
        course = None if number is None else courses.course(number)
        if course is not None:
            left = None if iterations is None else max(0, iterations - course.round)
            patience = PATIENCE_PER_THREAT * len(problem.threats) if until_settled else None
            bound = _run_until_proven(course, executor, deadline, now, left, patience, thorough_bound)
        else:
            bound = lower_bound(q, executor, thorough=False)
    best = None if course is None else wanted.best(course)
    answer = _answer(problem, frame, q, best, bound, seed, now() - started, n_hosts, most)
    if course is None:
        return answer
    # what is chosen from the whole pool hangs on every round, the best of it on those that changed it
    only_best = until_settled and target_m is None and not fuses(problem)
    return replace(answer, iterations=max(1, course.settled) if only_best else course.round)


def frontier(
    problem: Problem,
    *,
    seed: int,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None = None,
    numbers: range | None = None,
    progress: Callable[[int], None] = lambda _rounds: None,
    thorough_bound: bool = True,
) -> dict[int, Placement]:
    """Find a placement for every number of hosts, from the smallest possible to two per threat.

    The numbers take turns, and the best placement for each seeds the next one up with one view given to a host of its
    own: at the same place, so that the cost never rises with the number of hosts, or beside it and improved where
    hosts must keep apart. Numbers without a placement are left out. iterations: so many rounds for each number instead
    of a deadline; each is always given one. progress: told the rounds done after each. thorough_bound: False spares the
    time of a tight lower bound.
    """
    started = now()
    if iterations is not None:
        deadline = math.inf
    frame = frame_of(problem)
    q = question_of(problem, frame)
    bound_s = (PROOF_S_PER_THREAT + SHARED_S_PER_THREAT) * len(q.weight) if thorough_bound and _may_share(q) else 0.0
    last_round = deadline - min(bound_s, MOST_FOR_BOUNDS * (deadline - started))
    most = most_hosts(problem)
    wanted = numbers if numbers is not None else range(max(2, fewest_hosts(q)), most + 1)
    courses = Courses(q, seed)
    with ThreadPoolExecutor(LANES) as executor:
        turn, slowest = 0, 0.0
        while iterations is None or turn < iterations:
            for count in (n for n in wanted if n <= most):
                began = now()
                if iterations is None and turn > 0 and began + slowest > last_round:
                    break
                if turn > ROUNDS_TO_REFUSE and not courses.course(count).pool.best and count < max(courses.numbers()):
                    continue
                courses.advance(count, executor)
                progress(courses.rounds)
                slowest = max(0.7 * slowest, now() - began)
            turn += 1
            if iterations is None and now() + slowest > last_round:
                break
        costs = {count: course.pool.cost for count, course in sorted(courses.by_number.items())}
        own = own_bounds(q, executor, thorough=thorough_bound and now() < deadline)
        if thorough_bound:
            bounds = _bounds(q, own, costs, executor, deadline, now)
        else:
            bounds = dict.fromkeys(costs, float(own.sum()))
        least_costly = Wanted(problem, frame, q, None, seed=seed, executor=executor)
    found = {count: least_costly.best(courses.course(count)) for count in sorted(courses.by_number)}
    return {
        count: _answer(problem, frame, q, best, bounds[count], seed, now() - started, count, most)
        for count, best in found.items()
        if best is not None
    }


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, on a small problem of each kind."""
    for problem in _small_problems():
        search(problem, n_hosts=4, seed=0, deadline=0.0, now=lambda: 0.0, iterations=ROUNDS_OF_EVERY_KIND)


def warm_up_beside() -> None:
    """Compile what ``warm_up`` comes to last: beside it, in a second process, for whichever comes first."""
    with ThreadPoolExecutor(1) as executor:
        for problem in _small_problems():
            q = question_of(problem, frame_of(problem))
            unseen = new_state(len(problem.threats), 4)
            unseen.violation[:] = 1.0  # nothing to polish: this is for the compiler
            polish(q, unseen, np.ones(4, np.int64), 0)
            lower_bound(q, executor, thorough=False)


def _small_problems() -> list[Problem]:
    threats = tuple(
        Threat(id=f"t{k}", position_m=(30.0 * k, 5.0 * k, 0.0), velocity_mps=(1.0, 0.5 * k, 0.0)) for k in range(3)
    )
    # The letter's problem is plane, the other one has room above and below: they are bounded by different kernels.
    airspace = Airspace(floor_m=-10.0, ceiling_m=10.0)
    return [Problem(threats=threats, formulation=formulation, airspace=airspace) for formulation in Formulation]


def most_hosts(problem: Problem) -> int:
    """Return how many hosts can be used: two per threat, and no more than there are."""
    most = 2 * len(problem.threats)
    if problem.hosts:
        most = min(most, len(problem.hosts))
    return most if problem.max_hosts is None else min(most, problem.max_hosts)


def _run_until_proven(
    course: Course,
    executor: ThreadPoolExecutor,
    deadline: float,
    now: Callable[[], float],
    rounds: int | None,
    patience: int | None,
    prove: bool,
) -> float:
    """Run the course to its end, or until its best is proven optimal. Returns the bound, raised for a proof."""
    q, threats = course.q, len(course.q.weight)
    own = own_bounds(q, executor, thorough=False)
    if not prove:
        run(course, executor, deadline=deadline, now=now, rounds=rounds, patience=patience)
        return float(own.sum())
    first = ROUNDS_BEFORE_PROOF if rounds is None else min(rounds, ROUNDS_BEFORE_PROOF)
    run(course, executor, deadline=deadline, now=now, rounds=first)
    cost = course.pool.cost
    if cost <= own.sum() * WORTH_A_PROOF and now() + PROOF_S_PER_THREAT * threats < deadline:
        own = own_bounds(q, executor, thorough=True)
    bound = _bounds(q, own, {course.n_hosts: cost}, executor, deadline, now)[course.n_hosts]
    if cost <= bound * (1 + PROVEN_GAP):
        return bound
    rest = None if rounds is None else rounds - first
    run(course, executor, deadline=deadline, now=now, rounds=rest, patience=patience)
    return bound


def _bounds(
    q: Question,
    own: Floats,
    costs: Mapping[int, float],
    executor: ThreadPoolExecutor,
    deadline: float,
    now: Callable[[], float],
) -> dict[int, float]:
    """Return the lower bound for each number of hosts, of which the best cost is known, with regard to hosts that are
    shared where that is cheap and there is time."""
    threats, bound = len(own), float(own.sum())
    bounds = dict.fromkeys(costs, bound)
    if _may_share(q) and now() + SHARED_S_PER_THREAT * threats < deadline:
        open_costs = {
            number: cost
            for number, cost in costs.items()
            if number < 2 * threats and bound * (1 + PROVEN_GAP) < cost < math.inf
        }
        if open_costs:
            bounds |= shared_bounds(q, open_costs, own, executor, most_cells=CELLS_TO_SHARE)
    return bounds


def _may_share(q: Question) -> bool:
    return q.plane and len(q.weight) <= MOST_TO_SHARE


def _answer(
    problem: Problem,
    frame: Frame,
    q: Question,
    best: State | None,
    bound: float,
    seed: int,
    elapsed_s: float,
    n_hosts: int | None,
    most: int,
) -> Placement:
    if best is None:
        asked = "any number of hosts" if n_hosts is None else f"{n_hosts} hosts"
        reason = f"no placement of {asked} that sees every threat was found ({most} can be used)"
        return Placement(
            status=Status.INFEASIBLE,
            formulation=problem.formulation,
            objective=problem.objective,
            lower_bound=bound if math.isfinite(bound) else 0.0,
            seed=seed,
            solve_time_s=elapsed_s,
            reason=reason,
        )
    placement = placement_of(problem, frame, q, best)
    if fuses(problem):
        bound = fused_lower_bound(problem)
    proven = placement.cost is not None and placement.cost <= bound * (1 + PROVEN_GAP)
    return replace(
        placement,
        status=Status.OPTIMAL if proven else Status.FEASIBLE,
        lower_bound=bound,
        seed=seed,
        solve_time_s=elapsed_s,
    )
