"""What is wanted of a search: the least cost, or the least cost whose expected errors are all within a target."""

from concurrent.futures import ThreadPoolExecutor

from hsop_gcs.placement.fusion import fuses
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.search.bounds import CELLS, own_pair_bound_in_space
from hsop_gcs.placement.search.effort import Effort
from hsop_gcs.placement.search.frame import Frame
from hsop_gcs.placement.search.model import Question
from hsop_gcs.placement.search.numbers import Courses
from hsop_gcs.placement.search.question import aimed_at, placement_of
from hsop_gcs.placement.search.rounds import Course
from hsop_gcs.placement.search.state import State, copied, refresh, totals
from hsop_gcs.placement.solution import worst_error_m


class Wanted:
    """What makes a placement acceptable: it is valid, and with a target every expected error is within it.

    The least cost is not the least error. Where no placement of a course is within the target, a second search for the
    same number of hosts, which makes the largest errors small, keeps pace with it.
    """

    def __init__(
        self,
        problem: Problem,
        frame: Frame,
        q: Question,
        target_error_m: float | None,
        *,
        seed: int,
        executor: ThreadPoolExecutor,
        effort: Effort | None = None,
    ) -> None:
        self._problem, self._frame, self._q = problem, frame, q
        self._target_m = target_error_m
        self._executor = executor
        self._worst_m: dict[tuple[int, float], float] = {}
        self._within: dict[int, tuple[float, State]] = {}
        """By number of hosts, the least costly placement that is within the target."""
        self._aimed: Courses | None = None
        if target_error_m is not None:
            aimed = aimed_at(problem, frame, target_error_m)
            threats = range(len(q.weight))
            # A pair of its own bounds the error of two views; a threat that this puts beyond the target stays there.
            if problem.max_views > 2 or all(own_pair_bound_in_space(aimed, t, CELLS) <= 1 for t in threats):
                self._aimed = Courses(aimed, seed, effort=effort)

    def accepts(self, course: Course) -> bool:
        """Whether the course has an acceptable placement, or the search beside it finds one."""
        if self._target_m is None:
            return course.pool.best is not None
        number = course.n_hosts
        self._look_at(course)
        if number not in self._within and course.pool.best is not None and self._aimed is not None:
            aimed = self._aimed.course(number)
            if aimed.round == 0:
                aimed.start_from(course.pool.best)
            if aimed.round < course.round:
                self._aimed.advance(number, self._executor)
            self._look_at(aimed)
        return number in self._within

    def least(self, courses: Courses) -> int | None:
        """Return the least number of hosts with an acceptable placement so far, else the one that comes nearest to it:
        the largest with any; None if there is none."""
        numbers = courses.numbers()
        if self._target_m is None:
            return min(numbers, default=None)
        return min(self._within, default=max(numbers, default=None))

    def best(self, course: Course) -> State | None:
        """Return the least costly acceptable placement, else the least costly one."""
        self._look_at(course)
        if course.n_hosts in self._within:
            return self._within[course.n_hosts][1]
        valid = [s for s, (violation, _) in zip(course.pool.states, course.pool.worth, strict=True) if violation <= 0]
        if len(valid) > 1 and fuses(self._problem):
            return min(valid, key=lambda s: placement_of(self._problem, self._frame, self._q, s).cost or 0.0)
        return valid[0] if valid else None

    def _look_at(self, course: Course) -> None:
        """Remember the least costly placement within the target."""
        if self._target_m is None:
            return
        number = course.n_hosts
        for state in course.pool.states:
            least = self._within[number][0] if number in self._within else float("inf")
            own = copied(state)
            refresh(self._q, own)
            cost, violation = totals(self._q, own)
            if violation > 0 or cost >= least:
                continue
            key = (number, cost)
            if key not in self._worst_m:
                self._worst_m[key] = worst_error_m(placement_of(self._problem, self._frame, self._q, own))
            if self._worst_m[key] <= self._target_m:
                self._within[number] = cost, own
