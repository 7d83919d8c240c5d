"""Several numbers of hosts searched side by side: what is found for one number seeds the next one up."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np

from hsop_gcs.placement.search.effort import Effort, OutOfTime
from hsop_gcs.placement.search.model import CENTRAL, Floats, Question
from hsop_gcs.placement.search.moves import keep_clear
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.rounds import Course
from hsop_gcs.placement.search.state import State, left_over, new_state, refresh, set_view, totals

ROUNDS_TO_REFUSE = 6
"""How many rounds it takes to give a number of hosts up that has no placement."""
ROUNDS_TO_MISS = 2
"""The same for one that has, but none that is acceptable."""
PARENTS = 3
"""How many views a host that is added is tried with, the costliest threats' first."""
BEARINGS = 12
POLISH_STEPS = 80

Accept = Callable[[Course], bool]


class Courses:
    """The courses of one problem, made when they are first asked for. ``rounds`` counts those of all."""

    def __init__(
        self,
        q: Question,
        seed: int,
        warm: Callable[[int], State] | None = None,
        effort: Effort | None = None,
    ) -> None:
        """effort: how many rounds there may be, of these courses and others."""
        self.q, self.seed = q, seed
        self._effort = effort
        self.by_number: dict[int, Course] = {}
        self.rounds = 0
        self._warm = warm
        self._lifted: dict[int, float] = {}

    def course(self, number: int) -> Course:
        """Return the course for a number of hosts, with what is known from the start and from one host less."""
        if number not in self.by_number:
            self.by_number[number] = Course(self.q, number, self.seed)
            if self._warm is not None:
                self.by_number[number].start_from(self._warm(number))
        self._lift(number)
        return self.by_number[number]

    def advance(self, number: int, executor: ThreadPoolExecutor) -> None:
        """Run one round for a number of hosts. Raises OutOfTime, with nothing changed, if there is none to be run."""
        course = self.course(number)
        if self._effort is None:
            course.advance(executor)
        else:
            self._effort.begin()
            try:
                course.advance(executor, self._effort.late)
            except OutOfTime:
                self._effort.give_up()
        self.rounds += 1

    def numbers(self) -> list[int]:
        """Return the numbers of hosts for which a placement is known, ascending."""
        return sorted(number for number, course in self.by_number.items() if course.pool.best is not None)

    def _lift(self, number: int) -> None:
        below = self.by_number.get(number - 1)
        best = None if below is None else below.pool.best
        if best is None or self._lifted.get(number) == best.cost.sum():
            return
        self._lifted[number] = best.cost.sum()
        for state in with_another_host(self.q, best):
            self.by_number[number].start_from(state)


def least_acceptable(
    courses: Courses, numbers: range, accept: Accept, executor: ThreadPoolExecutor, first: int | None = None
) -> int | None:
    """Return the least of the numbers of hosts whose course comes to an acceptable placement in a few rounds.

    first: the number that is tried before the largest. If none is acceptable, the largest with any placement; None if
    there is no placement at all. Takes rounds as the logarithm of how many numbers there are. Raises OutOfTime.
    """
    if not numbers:
        return None
    low, largest = numbers.start, numbers.stop - 1
    for number in dict.fromkeys((largest if first is None else min(max(first, low), largest), largest)):
        if _persists(courses, number, accept, executor):
            found = number
            break
        low = number + 1
    else:
        # where hosts must keep apart, fewer may find room where many do not
        if courses.course(largest).pool.best is None and courses.q.separation_m > 0:
            for number in numbers:
                courses.advance(number, executor)
                if accept(courses.course(number)):
                    return number
        return max(courses.numbers(), default=None)
    while found != first and low < found:
        middle = (low + found) // 2
        courses.advance(middle, executor)
        if accept(courses.course(middle)):
            found = middle
        else:
            low = middle + 1
    while found > numbers.start and _persists(courses, found - 1, accept, executor):
        found -= 1
    return found


def _persists(courses: Courses, number: int, accept: Accept, executor: ThreadPoolExecutor) -> bool:
    """Whether a number of hosts becomes acceptable within the rounds it is given."""
    course = courses.course(number)
    while not (accepted := accept(course)):
        if course.round >= (ROUNDS_TO_REFUSE if course.pool.best is None else ROUNDS_TO_MISS):
            break
        courses.advance(number, executor)
    return accepted


def with_another_host(q: Question, state: State) -> list[State]:
    """Return copies of a placement with one host more, which takes one view over from a shared host.

    It stands where that host stands, so that the cost stays the same with the same rig, or beside it if hosts must keep
    apart.
    """
    threats, hosts = len(q.weight), len(state.degree)
    order = np.argsort(-state.cost, kind="stable")
    shared = [(int(t), end) for t in order for end in range(2) if state.degree[state.pairs[t, end]] > 1]
    rigs = [rig for rig in range(len(q.hosts_of_rig)) if left_over(q, state, rig) > 0]
    results = []
    for threat, end in shared[:PARENTS]:
        tried: list[tuple[float, float, int, State]] = []
        for offset_m in _offsets_m(q.separation_m):
            for rig, camera in product(rigs, {int(state.cameras[threat, end]), CENTRAL}):
                more = new_state(threats, hosts + 1)
                more.positions[:hosts], more.axes[:hosts] = state.positions, state.axes
                parent = state.pairs[threat, end]
                more.positions[hosts] = state.positions[parent] + offset_m
                more.axes[hosts] = state.axes[parent]
                more.rigs[:hosts], more.rigs[hosts] = state.rigs, rig
                for t in range(threats):
                    for e in range(2):
                        new = (t, e) == (threat, end)
                        set_view(
                            more, t, e, hosts if new else state.pairs[t, e], camera if new else state.cameras[t, e]
                        )
                keep_clear(q, more, hosts)
                refresh(q, more)
                cost, violation = totals(q, more)
                tried.append((violation, cost, len(tried), more))
        violation, _, _, best = min(tried)
        if violation <= 0:
            polish(q, best, np.ones(hosts + 1, np.int64), POLISH_STEPS)
        results.append(best)
    return results


def _offsets_m(separation_m: float) -> list[Floats]:
    if separation_m <= 0:
        return [np.zeros(3)]
    angles = 2 * np.pi * np.arange(BEARINGS) / BEARINGS
    return [
        1.001 * times * separation_m * np.array([np.sin(angle), np.cos(angle), 0.0])
        for times in (1.0, 1.5, 2.0)
        for angle in angles
    ]
