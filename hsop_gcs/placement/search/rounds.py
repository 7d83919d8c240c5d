"""The course of a search: rounds of independent tasks, one per core, and the pool of the best they found.

What a task does depends only on its seed, its place in the course and the pool at the start of its round, so that time
decides how many rounds there are and nothing else.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.effort import OutOfTime
from hsop_gcs.placement.search.known import NO_POSES, KnownPoses
from hsop_gcs.placement.search.model import Floats, Question
from hsop_gcs.placement.search.moves import mend
from hsop_gcs.placement.search.neighbourhood import Found, fresh, gathered, improve, regrown, shake, starts_quickly
from hsop_gcs.placement.search.parts import Parts
from hsop_gcs.placement.search.poses import decided_by_poses
from hsop_gcs.placement.search.recombine import recombined
from hsop_gcs.placement.search.state import State, copied, copy_state, new_state, totals

LANES = 2
POOL = 8
STARTS = 2
"""Anneals from random poses in one task, of which the best is improved."""
SHORTEST_START, MOVES_PER_THREAT = 3_000, 2_400
MOVES_PER_PAIR = 120
"""Of threats, where starts are quick; as many for each of more than ten threats as for each of ten."""
EVERY_LANE = -1
RESTART_EVERY = 6
"""One lane starts afresh in every so many rounds, unless starts are quick: then every task ends with one."""
TRIALS, TRIALS_AFTER_START, TRIALS_MEANWHILE = 5, 4, 12
"""Neighbourhoods that are annealed again in one task, in about two hundredths of a second; while another starts afresh,
as many as take the same time."""
QUICK_TRIALS, TRIALS_AFTER_QUICK_START = 3, 6
"""The same where starts are quick. Three threats then mostly come to their best in the first round."""
GATHERINGS = 5
"""In one task."""
MOVES_PER_HOST = 500
WARM_TRIALS, SHAKE_MOVES = 3, 8_000
"""The first round from an earlier placement is a short one: little may be left to do."""
MANY_VIEWS = 4
"""Where hosts have so many, fresh starts do without known poses: one is too much of a placement, and they would come to
what is known every time."""
REACH_M = 25.0
"""The longest steps of hosts at the start of an anneal."""
WORTH_GOING_ON = 1e-4
"""A round that gains less than this share of the cost has gained nothing."""


class Pool:
    """The best placements of one search, different in cost, best first."""

    def __init__(self) -> None:
        self.states: list[State] = []
        self.worth: list[tuple[float, float]] = []
        """Violation and cost of each."""

    def offer(self, q: Question, state: State) -> bool:
        """Take a state in if it is among the best; True if it is the best."""
        cost, violation = totals(q, state)
        worth = (violation, cost)
        if any(abs(cost - c) <= 1e-6 * c and abs(violation - v) <= 1e-9 for v, c in self.worth):
            return False
        at = sum(other < worth for other in self.worth)
        if at >= POOL:
            return False
        self.states.insert(at, copied(state))
        self.worth.insert(at, worth)
        del self.states[POOL:], self.worth[POOL:]
        return at == 0

    @property
    def best(self) -> State | None:
        """The best placement if it keeps every rule."""
        return self.states[0] if self.states and self.worth[0][0] <= 0 else None

    @property
    def cost(self) -> float:
        """That of the best placement; infinite while none keeps every rule."""
        return math.inf if self.best is None else self.worth[0][1]


class Course:
    """One search for one number of hosts. ``advance`` runs a round; ``pool`` holds what was found."""

    def __init__(self, q: Question, n_hosts: int, seed: int) -> None:
        self.q, self.n_hosts, self.seed = q, n_hosts, seed
        self.pool = Pool()
        self.parts = Parts(q)
        self.known = KnownPoses()
        self.round = 0
        self.settled = 0
        """The round in which the best changed last: no more than these are needed to find it again."""
        self._scratch = [[new_state(len(q.weight), n_hosts) for _ in range(3)] for _ in range(LANES)]
        self._quick = starts_quickly(q, self._scratch[0][0])
        """Fresh starts are so quick that every task ends with one."""
        self._warm = False

    def start_from(self, state: State) -> None:
        """Put a state into the pool; broken safety distances are mended first."""
        mended = copied(state)
        mend(self.q, mended)
        self.pool.offer(self.q, mended)
        self._warm = True

    def advance(self, executor: ThreadPoolExecutor, late: Callable[[], bool] = lambda: False) -> bool:
        """Run one round; True if there is a new best.

        late: raises OutOfTime, and nothing has changed, if this is so before the round has come to its end.
        """
        results = list(executor.map(lambda lane: self._task(lane, late), range(LANES)))
        if late():
            raise OutOfTime
        self.round += 1
        before, gained = self.pool.cost, False
        for state, found in results:
            gained |= self.pool.offer(self.q, state)
            for part, threats in found:
                self.parts.take(part, threats)
            if self._quick:  # else nothing is annealed over poses
                self.known.take(found)
        together = self.parts.combined(self.n_hosts, self.pool.cost)
        if together is not None:
            gained |= self.pool.offer(self.q, together)
        if gained:
            self.settled = self.round
        return self.pool.cost < before

    def _task(self, lane: int, late: Callable[[], bool]) -> tuple[State, list[Found]]:
        """Start afresh, or improve the best, or one of the others, as the course has it; then grow a part again.

        Returns the state this comes to, and everything that was found on the way; anything if it is late.
        """
        state, trial, spare = self._scratch[lane]
        chance = seeded(self.seed, self.n_hosts, self.round, lane)
        states = self.pool.states
        starting = self._starting_lane()
        found: list[Found] = []
        if not states or starting in (EVERY_LANE, lane):
            self._start(state, trial, spare, chance, found, late)
            trials = TRIALS_AFTER_QUICK_START if self._quick else TRIALS_AFTER_START
        elif self._warm and self.round == 0:
            trials = WARM_TRIALS
            copy_state(states[0], state)
            if lane > 0:
                copy_state(states[0], trial)
                shake(self.q, state, trial, SHAKE_MOVES, 0.2, REACH_M, chance)
        else:
            trials = TRIALS_MEANWHILE if starting is not None else QUICK_TRIALS if self._quick else TRIALS
            choice = 0 if lane == 0 or self.round % 2 == 0 else (self.round // 2) % len(states)
            copy_state(states[choice], state)
        improve(self.q, state, trial, spare, trials, MOVES_PER_HOST, REACH_M, self.known.rows, chance, found, late)
        if self.round > 0 and not late():
            found.append(regrown(self.q, state, REACH_M, self.known.rows, chance))
            if decided_by_poses(self.q, state):
                found += [gathered(self.q, REACH_M, chance) for _ in range(GATHERINGS)]
                if not late() and len(self.q.hosts_of_rig) == 1 and len(self.known.rows):
                    every = range(len(self.q.weight))
                    found += [(s, every) for s in recombined(self.q, state, self.known.rows, chance)]
            if self._quick and not late():
                known = self.known.rows if 2 * len(self.q.weight) < MANY_VIEWS * self.n_hosts else NO_POSES
                found.append(self._fresh(spare, trial, known, chance, mending=self.pool.best is None))
        return state, found

    @property
    def effort(self) -> int:
        """How long the next round takes, in trials."""
        return TRIALS if self._starting_lane() is None else TRIALS_MEANWHILE

    def _starting_lane(self) -> int | None:
        """Return which lane starts afresh in this round: in turns, soon after an earlier placement, at first all."""
        if self.round == 0:
            return None if self._warm else EVERY_LANE
        if self._warm and self.round == 1:
            return LANES - 1
        turn, step = divmod(self.round, RESTART_EVERY)
        return turn % LANES if step == RESTART_EVERY - 1 and not self._quick else None

    def _start(
        self,
        state: State,
        trial: State,
        spare: State,
        chance: Chance,
        found: list[Found],
        late: Callable[[], bool],
    ) -> None:
        """Leave the best of some short anneals from random poses in ``state``."""
        least = (math.inf, math.inf)
        for _ in range(STARTS):
            if late():
                break
            found.append(self._fresh(spare, trial, NO_POSES, chance, mending=0 < least[0] < math.inf))
            cost, violation = totals(self.q, spare)
            if (violation, cost) < least:
                least = (violation, cost)
                copy_state(spare, state)

    def _fresh(self, state: State, trial: State, known: Floats, chance: Chance, *, mending: bool) -> Found:
        """Leave a short anneal from random poses in ``state``; return a copy."""
        threats = len(self.q.weight)
        each = min(MOVES_PER_PAIR * threats, MOVES_PER_THREAT) if self._quick else MOVES_PER_THREAT
        moves = max(SHORTEST_START, threats * each)
        fresh(self.q, state, trial, moves, REACH_M, known, chance, mending=mending)
        return copied(state), range(threats)


def run(
    course: Course,
    executor: ThreadPoolExecutor,
    *,
    deadline: float,
    now: Callable[[], float],
    rounds: int | None,
    patience: int | None = None,
) -> None:
    """Advance until the deadline is near, at most so many rounds; a round that takes longer is given up.

    patience: end after so many rounds in a row that gained nothing.
    """
    count, idle, per_trial_s = 0, 0, 0.0
    while True:
        started = now()
        if (rounds is not None and count >= rounds) or (patience is not None and idle >= patience):
            return
        if course.round > 0 and started + per_trial_s * course.effort > deadline:
            return
        before, effort = course.pool.cost, course.effort
        try:
            course.advance(executor, lambda: now() > deadline)
        except OutOfTime:
            return
        count += 1
        idle = 0 if course.pool.cost < before * (1 - WORTH_GOING_ON) else idle + 1
        per_trial_s = max(0.7 * per_trial_s, (now() - started) / effort)
