"""The search as a question and an answer: ``search``, ``frontier`` and ``warm_up``."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.answer import PROVEN_GAP
from hsop_gcs.placement.fusion import fused_lower_bound, fuses
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat
from hsop_gcs.placement.search.bounds import fewest_hosts, lower_bound, own_bounds
from hsop_gcs.placement.search.effort import Effort, OutOfTime
from hsop_gcs.placement.search.frame import Frame
from hsop_gcs.placement.search.growth import Grown, Growth, Target
from hsop_gcs.placement.search.model import Floats, Question
from hsop_gcs.placement.search.numbers import ROUNDS_TO_REFUSE, Courses, least_acceptable
from hsop_gcs.placement.search.parts import question_about
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of, state_of
from hsop_gcs.placement.search.rounds import LANES, Course, run
from hsop_gcs.placement.search.shared import shared_bounds
from hsop_gcs.placement.search.state import State, new_state
from hsop_gcs.placement.search.wanted import Wanted
from hsop_gcs.placement.solution import Placement, Status

ROUNDS_OF_EVERY_KIND, STEPS_OF_EVERY_KIND = 2, 12
"""After so many, everything that a round, or growth, can do has been done once."""
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
MOST_FOR_ROUNDS = 24
"""With more threats a round of a course takes long, and what is found grows in smaller steps."""
SHARE_OF_ROUNDS = 0.5
"""The share of the time in which rounds have to come to a first placement where the answer may be partial."""
CUT = 1_000_000
"""Iterations of an answer: above 0, rounds of the course of its number of hosts; below 0, one more than the steps of
growth; and so much lower, steps after which there was no time to settle the number."""
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
    partial: bool = False,
    most_rounds: int | None = None,
) -> Placement:
    """Find the least costly placement, as far as the time goes.

    n_hosts: exactly so many; None is the smallest number for which a placement is found. deadline: on the clock
    ``now``; what is not finished then is given up. iterations: exactly so many rounds with that number instead,
    whatever the time; or those of an answer, which then comes again. warm_start: an earlier placement of almost the
    same threats and number of hosts. target_error_m: without ``n_hosts``, the smallest number that brings every
    threat's expected error to this, metres, and if none does, the largest. until_settled: stop before the deadline when
    nothing has been gained for a while. thorough_bound: whether a placement near the lower bound is worth a tighter
    one, if there is time, to prove it optimal and end the search. partial: where nothing is found that sees every
    threat, see as many as was found, the most valuable first, with no more than ``n_hosts``; the rest is not in the
    answer's pairs. most_rounds: no more than these, also if there is time.
    The same arguments give the same placement; more time only improves it.
    """
    started = now()
    frame = frame_of(problem)
    q = question_of(problem, frame)
    target_m = None if n_hosts is not None else target_error_m
    asked = _Asked(problem, frame, q, n_hosts, seed, target_m, warm_start, until_settled, partial, most_rounds)
    found: _Found | None = None
    with ThreadPoolExecutor(LANES) as executor:
        again = iterations is not None and -CUT < iterations < 0
        growth = _Growing(asked, executor, deadline, now, iterations)
        if partial or again:
            # it takes little time, and there is something at hand whatever the rounds come to
            growth.start()
        if not again:
            found = _in_rounds(asked, executor, deadline, now, iterations, thorough_bound)
        if found is None:
            found = growth.result()
        own = q if found is None else question_about(q, found.threats)
        bound = found.bound if found is not None else None
        if bound is None:
            bound = lower_bound(own, executor, thorough=False, late=lambda: iterations is None and now() > deadline)
    if found is None:
        nothing = _none_found(problem, bound, seed, now() - started, n_hosts)
        return replace(nothing, iterations=growth.iterations)
    seen = _seeing(problem, found.threats)
    placement = _answer(seen, frame, own, found.state, bound, seed, now() - started)
    status = placement.status if seen is problem else Status.PARTIAL
    hopeless = {problem.threats[n].id: "no two hover points see it" for n in found.hopeless}
    return replace(placement, status=status, iterations=found.iterations, left_out=hopeless)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of a search."""

    problem: Problem
    frame: Frame
    q: Question
    n_hosts: int | None
    seed: int
    target_m: float | None
    warm_start: Placement | None
    until_settled: bool
    partial: bool
    most_rounds: int | None


@dataclass(frozen=True, slots=True)
class _Found:
    """What a search came to."""

    threats: list[int]
    state: State
    """The placement of these threats."""
    iterations: int
    bound: float | None = None
    hopeless: Sequence[int] = ()
    """Threats that cannot be seen at all."""


def _in_rounds(
    asked: _Asked,
    executor: ThreadPoolExecutor,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None,
    thorough_bound: bool,
) -> _Found | None:
    """Settle the number of hosts, and run its course to the deadline; None if no placement was found that sees all.

    Where an answer may be partial, a share of the time is left for that until a placement is found.
    """
    problem, q = asked.problem, asked.q
    if len(q.weight) > MOST_FOR_ROUNDS and (iterations is None or iterations > 0):
        return None
    left_s = deadline - now()
    first_until = deadline - (1 - SHARE_OF_ROUNDS) * left_s if asked.partial and left_s < math.inf else deadline
    if iterations is None:
        effort = Effort(first_until, now)
    else:
        deadline = math.inf
        effort = Effort(math.inf, now, -iterations - CUT if iterations <= -CUT else None)
    most = most_hosts(problem)
    least = max(2, fewest_hosts(q))
    numbers = range(least, most + 1) if asked.n_hosts is None else range(asked.n_hosts, min(asked.n_hosts, most) + 1)
    if not numbers:
        return None
    flown = asked.warm_start if asked.warm_start is not None and asked.warm_start.hosts else None
    warm = None if flown is None else lambda count: state_of(problem, asked.frame, q, flown, count)
    courses = Courses(q, asked.seed, warm, effort)
    wanted = Wanted(problem, asked.frame, q, asked.target_m, seed=asked.seed, executor=executor, effort=effort)
    everything = list(range(len(q.weight)))
    number = asked.n_hosts

    def accepts(course: Course) -> bool:
        if course.pool.best is not None:
            effort.deadline = deadline
        return wanted.accepts(course)

    try:
        if number is None:
            first = None if flown is None else len(flown.hosts)
            number = least_acceptable(courses, numbers, accepts, executor, first)
        elif asked.partial:
            while courses.course(number).pool.best is None and courses.course(number).round < ROUNDS_TO_REFUSE:
                courses.advance(number, executor)
    except OutOfTime:
        number = wanted.least(courses)
        best = None if number is None else wanted.best(courses.course(number))
        return None if best is None else _Found(everything, best, -CUT - effort.taken)
    if number is None or (asked.partial and courses.course(number).pool.best is None):
        return None
    course = courses.course(number)
    most_rounds = asked.most_rounds if iterations is None else iterations
    left = None if most_rounds is None else max(0, most_rounds - course.round)
    patience = PATIENCE_PER_THREAT * len(problem.threats) if asked.until_settled else None
    bound = _run_until_proven(course, executor, deadline, now, left, patience, thorough_bound)
    best = wanted.best(course)
    if best is None:
        return None
    # what is chosen from the whole pool hangs on every round, the best of it on those that changed it
    only_best = asked.until_settled and asked.target_m is None and not fuses(problem)
    return _Found(everything, best, min(max(1, course.settled), course.round) if only_best else course.round, bound)


class _Growing:
    """Growth for what is asked, until the deadline, or as far as it went before."""

    def __init__(
        self,
        asked: _Asked,
        executor: ThreadPoolExecutor,
        deadline: float,
        now: Callable[[], float],
        iterations: int | None,
    ) -> None:
        self._asked, self._executor = asked, executor
        self._rounds = asked.most_rounds if iterations is None else iterations if iterations > 0 else None
        self.effort = Effort(deadline, now) if iterations is None else Effort(math.inf, now)
        if iterations is not None and iterations < 0:
            self.effort = Effort(math.inf, now, -iterations - 1)
        problem, most = asked.problem, most_hosts(asked.problem)
        homes = np.array([host.position_m for host in problem.hosts]).reshape(-1, 3)
        self._growth = Growth(
            asked.q,
            most_hosts=most if asked.n_hosts is None else min(most, asked.n_hosts),
            homes_m=asked.frame.inward(homes),
            seed=asked.seed,
            effort=self.effort,
        )
        self._started = False

    def start(self) -> None:
        """See what can be seen."""
        self._growth.start(self._executor)
        self._started = True
        if (grown := self._growth.grown) is not None:
            with self.effort.set_aside():
                self._placed(grown)

    def result(self) -> _Found | None:
        """Return what it comes to; None if it does not see every threat, or has not as many hosts, and has to."""
        asked = self._asked
        if not self._started:
            self.start()
        target = None
        if asked.target_m is not None:
            measured = question_of(replace(asked.problem, objective=Objective.RMS), asked.frame)
            target = Target(measured, asked.target_m)
        self._growth.go_on(
            self._executor,
            exactly=asked.n_hosts is not None,
            target=target,
            rounds=self._rounds,
            until_settled=asked.until_settled,
        )
        if (grown := self._growth.grown) is None:
            return None
        whole = len(grown.threats) == len(asked.q.weight)
        if not asked.partial and not (whole and asked.n_hosts in (None, len(grown.state.degree))):
            return None
        return _Found(grown.threats, grown.state, self.iterations, hopeless=self._growth.hopeless)

    @property
    def iterations(self) -> int:
        """What makes it come to the same again."""
        return -1 - self.effort.taken

    def _placed(self, grown: Grown) -> Placement:
        seen, q = _seeing(self._asked.problem, grown.threats), question_about(self._asked.q, grown.threats)
        return placement_of(seen, self._asked.frame, q, grown.state)


def _seeing(problem: Problem, threats: list[int]) -> Problem:
    """The problem of some of the threats; nobody has to see the others."""
    if len(threats) == len(problem.threats):
        return problem
    seen = set(threats)
    others = tuple(threat for n, threat in enumerate(problem.threats) if n not in seen)
    return replace(
        problem, threats=tuple(problem.threats[n] for n in threats), bystanders=(*problem.bystanders, *others)
    )


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
    hosts must keep apart. Numbers without a placement are left out, and those that there was no time for.
    iterations: so many rounds for each number instead of a deadline. progress: told the rounds done after each.
    thorough_bound: False spares the time of a tight lower bound.
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
                if iterations is None and (began > deadline or (turn > 0 and began + slowest > last_round)):
                    break
                placed = courses.numbers()
                if turn > ROUNDS_TO_REFUSE and not courses.course(count).pool.best and placed and count < placed[-1]:
                    continue
                courses.advance(count, executor)
                progress(courses.rounds)
                slowest = max(0.7 * slowest, now() - began)
            turn += 1
            if turn > ROUNDS_TO_REFUSE and not courses.numbers():
                break
            if iterations is None and now() + slowest > last_round:
                break
        costs = {count: course.pool.cost for count, course in sorted(courses.by_number.items())}
        own = own_bounds(q, executor, thorough=thorough_bound and bool(courses.numbers()) and now() < deadline)
        if thorough_bound:
            bounds = _bounds(q, own, costs, executor, deadline, now)
        else:
            bounds = dict.fromkeys(costs, float(own.sum()))
        least_costly = Wanted(problem, frame, q, None, seed=seed, executor=executor)
    found = {count: least_costly.best(courses.course(count)) for count in sorted(courses.by_number)}
    return {
        count: _answer(problem, frame, q, best, bounds[count], seed, now() - started)
        for count, best in found.items()
        if best is not None
    }


def warm_up(only: Formulation | None = None) -> None:
    """Compile the kernels, or load them from the cache, on a small problem of each kind, or of one kind only."""
    for problem in _small_problems():
        if only not in (None, problem.formulation):
            continue
        for iterations in (ROUNDS_OF_EVERY_KIND, -STEPS_OF_EVERY_KIND):
            search(problem, n_hosts=4, seed=0, deadline=0.0, now=lambda: 0.0, iterations=iterations)


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


def _none_found(problem: Problem, bound: float, seed: int, elapsed_s: float, n_hosts: int | None) -> Placement:
    asked = "any number of hosts" if n_hosts is None else f"{n_hosts} hosts"
    reason = f"no placement of {asked} that sees every threat was found ({most_hosts(problem)} can be used)"
    return Placement(
        status=Status.INFEASIBLE,
        formulation=problem.formulation,
        objective=problem.objective,
        lower_bound=bound if math.isfinite(bound) else 0.0,
        seed=seed,
        solve_time_s=elapsed_s,
        reason=reason,
    )


def _answer(
    problem: Problem, frame: Frame, q: Question, best: State, bound: float, seed: int, elapsed_s: float
) -> Placement:
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
