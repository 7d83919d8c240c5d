"""The search as a question and an answer: ``search``, ``frontier`` and ``warm_up``."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search.anneal import State, new_state, refresh, set_view
from hsop_gcs.placement.search.bounds import fewest_hosts, lower_bound
from hsop_gcs.placement.search.frame import Frame
from hsop_gcs.placement.search.model import Question
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of, state_of
from hsop_gcs.placement.search.rounds import LANES, Course, run
from hsop_gcs.placement.solution import Placement, Status

PROVEN_GAP = 1e-3
ROUNDS_BEFORE_PROOF = 3
WORTH_A_PROOF = 1.1
"""A placement within this factor of the first bound may be optimal: then a thorough bound is worth its time."""
FEASIBILITY_ROUNDS = 4
"""How many rounds without a valid placement it takes to try one host more."""


def search(
    problem: Problem,
    *,
    n_hosts: int | None,
    seed: int,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None = None,
    warm_start: Placement | None = None,
) -> Placement:
    """Find the least costly placement, as far as the time goes.

    n_hosts: exactly so many; None is the smallest number for which a placement is found. deadline: on the clock
    ``now``; one round of the search is always run. iterations: exactly so many rounds instead, whatever the time.
    warm_start: an earlier placement of almost the same threats and number of hosts. The same arguments give the same
    placement; more time only improves it.
    """
    started = now()
    if iterations is not None:
        deadline = math.inf
    frame = frame_of(problem)
    q = question_of(problem, frame)
    most = most_hosts(problem)
    with ThreadPoolExecutor(LANES) as executor:
        course = None
        counts = range(max(2, fewest_hosts(q)), most + 1) if n_hosts is None else range(n_hosts, min(n_hosts, most) + 1)
        for count in counts:
            course = Course(q, count, seed)
            if warm_start is not None and warm_start.hosts:
                course.start_from(state_of(problem, frame, q, warm_start, count))
            if n_hosts is not None or _found(course, executor, deadline, now):
                break
        bound = lower_bound(q, executor, thorough=False)
        if course is not None:
            rounds_left = None if iterations is None else max(0, iterations - course.round)
            bound = _run_until_proven(course, executor, deadline, now, rounds_left, bound)
    best = None if course is None else course.pool.best
    answer = _answer(problem, frame, q, best, bound, seed, now() - started, n_hosts, most)
    return replace(answer, iterations=0 if course is None else course.round)


def frontier(
    problem: Problem,
    *,
    seed: int,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None = None,
    numbers: range | None = None,
) -> dict[int, Placement]:
    """Find a placement for every number of hosts, from the smallest possible to two per threat.

    The numbers take turns, and the best placement for each seeds the next one up with one view given to a host of its
    own; so the cost never rises with the number of hosts. Numbers without a placement are left out.
    """
    started = now()
    if iterations is not None:
        deadline = math.inf
    frame = frame_of(problem)
    q = question_of(problem, frame)
    most = most_hosts(problem)
    wanted = numbers if numbers is not None else range(max(2, fewest_hosts(q)), most + 1)
    courses = {count: Course(q, count, seed) for count in wanted if count <= most}
    with ThreadPoolExecutor(LANES) as executor:
        rounds, slowest = 0, 0.0
        while iterations is not None or rounds < 2 or now() + slowest < deadline:
            if iterations is not None and rounds >= iterations:
                break
            began = now()
            for count, course in courses.items():
                if (
                    course.pool.best is None
                    and rounds > FEASIBILITY_ROUNDS
                    and any(other.pool.best is not None for n, other in courses.items() if n > count)
                ):
                    continue
                below = courses.get(count - 1)
                if below is not None and below.pool.best is not None:
                    for state in with_another_host(q, below.pool.best):
                        course.start_from(state)
                course.advance(executor)
                if now() > deadline and iterations is None and rounds >= 2:
                    break
            rounds += 1
            slowest = max(0.7 * slowest, now() - began) / max(1, len(courses))
        bound = lower_bound(q, executor, thorough=iterations is not None or now() < deadline)
    answers = {}
    for count, course in courses.items():
        below = courses.get(count - 1)
        if below is not None and below.pool.best is not None:
            for state in with_another_host(q, below.pool.best):
                course.start_from(state)
        if course.pool.best is not None:
            answers[count] = _answer(problem, frame, q, course.pool.best, bound, seed, now() - started, count, most)
    return answers


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, on a small problem of each kind."""
    threats = tuple(
        Threat(id=f"t{k}", position_m=(30.0 * k, 5.0 * k, 0.0), velocity_mps=(1.0, 0.5 * k, 0.0)) for k in range(3)
    )
    for formulation in Formulation:
        problem = Problem(threats=threats, formulation=formulation)
        search(problem, n_hosts=4, seed=0, deadline=0.0, now=lambda: 0.0, iterations=1)


def most_hosts(problem: Problem) -> int:
    """Return how many hosts can be used: two per threat, and no more than there are."""
    most = 2 * len(problem.threats)
    if problem.hosts:
        most = min(most, len(problem.hosts))
    return most if problem.max_hosts is None else min(most, problem.max_hosts)


def with_another_host(q: Question, state: State) -> list[State]:
    """Return copies of a placement with one host more, which takes one view over from where a shared host stands.

    Without separation between hosts the new host may stand in the same place, and the cost stays the same.
    """
    threats, hosts = len(q.weight), len(state.degree)
    order = np.argsort(-state.cost, kind="stable")
    shared = [(int(t), end) for t in order for end in range(2) if state.degree[state.pairs[t, end]] > 1]
    results = []
    for threat, end in shared[:2]:
        more = new_state(threats, hosts + 1)
        more.positions[:hosts], more.axes[:hosts] = state.positions, state.axes
        parent = state.pairs[threat, end]
        more.positions[hosts], more.axes[hosts] = state.positions[parent], state.axes[parent]
        for t in range(threats):
            for e in range(2):
                host = hosts if (t, e) == (threat, end) else state.pairs[t, e]
                set_view(more, t, e, host, state.cameras[t, e])
        refresh(q, more)
        results.append(more)
    return results


def _found(course: Course, executor: ThreadPoolExecutor, deadline: float, now: Callable[[], float]) -> bool:
    """Try to find any placement for the course's number of hosts."""
    for _ in range(FEASIBILITY_ROUNDS):
        if course.pool.best is not None or (course.round > 0 and now() > deadline):
            break
        course.advance(executor)
    return course.pool.best is not None


def _run_until_proven(
    course: Course,
    executor: ThreadPoolExecutor,
    deadline: float,
    now: Callable[[], float],
    rounds: int | None,
    bound: float,
) -> float:
    """Run the course to its end, or until its best is proven optimal. Returns the bound, raised for a proof."""
    first = ROUNDS_BEFORE_PROOF if rounds is None else min(rounds, ROUNDS_BEFORE_PROOF)
    run(course, executor, deadline=deadline, now=now, rounds=first)
    best = course.pool.best
    if best is not None and best.cost.sum() <= bound * WORTH_A_PROOF and now() < deadline:
        bound = lower_bound(course.q, executor, thorough=True)
        if best.cost.sum() <= bound * (1 + PROVEN_GAP):
            return bound
    rest = None if rounds is None else rounds - first
    run(course, executor, deadline=deadline, now=now, rounds=rest)
    return bound


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
    proven = placement.cost is not None and placement.cost <= bound * (1 + PROVEN_GAP)
    return replace(
        placement,
        status=Status.OPTIMAL if proven else Status.FEASIBLE,
        lower_bound=bound,
        seed=seed,
        solve_time_s=elapsed_s,
    )
