"""Growth: a placement that sees as many threats as its hosts can, the most valuable first, and is then made better.

For questions that are too large for the rounds of a course, for too few hosts, and for too little time: every step is a
small one, and what was found is at hand after each. It begins with a choice of posts. Threats that are left are then
tried to be seen besides, hosts that are left relieve those that are shared, and parts are annealed again by themselves.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from hsop_gcs.placement.search.anneal import anneal
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, seeded, uniform
from hsop_gcs.placement.search.cover import choose, keeps_rules, placed
from hsop_gcs.placement.search.effort import Effort
from hsop_gcs.placement.search.known import NO_POSES
from hsop_gcs.placement.search.model import PERIPHERAL, Floats, Question
from hsop_gcs.placement.search.neighbourhood import (
    COLD_AGAIN,
    GROWING_MOVES,
    JOINT,
    MENDING_STIFFNESS,
    fresh,
    improve,
    mark_nearest,
    marked,
)
from hsop_gcs.placement.search.parts import groups, question_about, taken_out
from hsop_gcs.placement.search.posts import Posts, posts_around, together
from hsop_gcs.placement.search.relief import exclude_place, relieve, widened
from hsop_gcs.placement.search.rounds import LANES, MOVES_PER_HOST, REACH_M
from hsop_gcs.placement.search.state import State, copied, new_state, set_view, totals

MOST_POSTS, LEAST_TRIES, MOST_TRIES = 5_000, 24, 160
"""Places drawn in all, and for each threat."""
ALONE_MOVES, ALONE_STARTS = 3_000, 3
"""Moves and starts of anneals of two hosts for a threat of which no two posts were found."""
ATTEMPTS = 3
"""How often a threat that is left is tried to be seen besides."""
TOGETHER = 10
"""Parts with more threats than this are made better in place."""
TRIALS, AFRESH = 2, 0.3
"""Neighbourhoods annealed in one step, and the share of the steps that anneal a part from random poses instead."""
NEAR_M = 60.0
"""Ways that are farther than this from a part's hosts and threats do not count while it is annealed by itself."""
LEAST_STEPS = 12
"""Steps that are taken also when it is late: something for the most valuable threats is found in some hundredths of a
second."""
ADDED = 8
"""Hosts that relieve others in one step."""
SETTLED = 3
"""Growth is settled when so many steps for each part have gained nothing."""


Part = tuple[list[int], list[int]]
"""Threats and hosts, by their numbers in a state."""


@dataclass(slots=True)
class Grown:
    """Some of a question's threats, ascending, and a state of these that keeps every rule."""

    threats: list[int]
    state: State

    @property
    def cost(self) -> float:
        return float(self.state.cost.sum())


@dataclass(frozen=True, slots=True)
class Target:
    """An expected error that no threat is to exceed."""

    q: Question
    """The question whose costs are expected errors times weights."""
    error_m: float


class Growth:
    """A placement of some of a question's threats that grows as far as an effort goes, in two stretches."""

    def __init__(self, q: Question, *, most_hosts: int, homes_m: Floats, seed: int, effort: Effort) -> None:
        """most_hosts: no more are placed. homes_m: (hosts, 3), where they are now: threats near them come first among
        those that weigh alike; there may be none."""
        self._q, self._most_hosts, self._seed, self._effort = q, most_hosts, seed, effort
        self._weights, self._nearness = q.weight / q.weight.max(), _nearness(q, homes_m)
        self._order = np.lexsort((-self._nearness, -self._weights)).tolist()
        self._posts: Posts | None = None
        self.hopeless: list[int] = []
        """Threats of which no two hover points were found, whatever the others need."""
        self.grown: Grown | None = None
        """What has come of it so far; None: no threat is seen."""

    def start(self, executor: ThreadPoolExecutor) -> None:
        """Choose posts from which as many threats as possible are seen."""
        q, effort = self._q, self._effort
        effort.least = LEAST_STEPS
        self._posts, looked_at = _posts(q, self._order, self._seed, executor, effort)
        chosen = choose(q, self._posts, self._most_hosts, self._weights, self._nearness, effort.ends)
        first = placed(q, self._posts, chosen)
        self.grown = None if first is None else _lawful(q, Grown(*first))
        sighted = (self._posts.seen > 0).sum(axis=0)
        self.hopeless = [threat for threat in looked_at if sighted[threat] < 2]

    def go_on(
        self,
        executor: ThreadPoolExecutor,
        *,
        exactly: bool,
        target: Target | None,
        rounds: int | None,
        until_settled: bool,
    ) -> None:
        """See more threats besides, use hosts that are left, and anneal parts again.

        exactly: as many hosts as there may be and are of use, else as few as the threats need, or the target. rounds:
        parts are annealed so often, on the average, if there is time.
        """
        if self.grown is None or self._posts is None:
            return
        q, seed, effort = self._q, self._seed, self._effort
        grown = _with_others(q, self.grown, self._order, seed, executor, effort)
        self.grown = _relieved(q, grown, self._posts, self._most_hosts, exactly, target, effort)
        self.hopeless = [threat for threat in self.hopeless if threat not in grown.threats]
        effort.least = 0
        _better(q, self.grown, seed, executor, effort, rounds, until_settled)


def _nearness(q: Question, homes_m: Floats) -> Floats:
    """(threats,): 1 for the threat that is nearest to two hosts, 0 for the farthest."""
    if len(homes_m) < 2:
        return np.zeros(len(q.weight))
    away_m = np.linalg.norm(q.points_m.mean(axis=1)[:, None] - homes_m, axis=2)
    second_m = np.partition(away_m, 1, axis=1)[:, 1]
    widest_m = float(np.ptp(second_m))
    return np.asarray((second_m.max() - second_m) / widest_m if widest_m > 0 else np.zeros(len(second_m)))


def _posts(
    q: Question, order: list[int], seed: int, executor: ThreadPoolExecutor, effort: Effort
) -> tuple[Posts, list[int]]:
    """Posts about every threat, and where few are found, those of an anneal of the threat by itself; and the threats
    that there was time for."""
    threats = len(q.weight)
    tries = max(LEAST_TRIES, min(MOST_TRIES, MOST_POSTS // threats))

    def around(threat: int) -> Posts:
        posts = posts_around(q, threat, tries, seeded(seed, threat, 0, 0))
        if len(posts.rigs) >= 4:
            return posts
        return together([posts, *_alone(q, threat, seed)], threats)

    found: list[Posts] = []
    for n in range(0, threats, LANES):
        if not effort.goes_on():
            break
        found += executor.map(around, order[n : n + LANES])
    return together(found, threats), order[: len(found)]


def _alone(q: Question, threat: int, seed: int) -> list[Posts]:
    """The posts of two hosts that see a threat, if an anneal finds any."""
    own, s = question_about(q, [threat]), new_state(1, 2)
    for start in range(ALONE_STARTS):
        fresh(own, s, new_state(1, 2), ALONE_MOVES, REACH_M, NO_POSES, seeded(seed, threat, 1, start), mending=True)
        if totals(own, s)[1] <= 0:
            seen = np.zeros((2, len(q.weight)), np.int64)
            for end in range(2):
                seen[s.pairs[0, end], threat] = 1 + s.cameras[0, end]
            return [Posts(s.positions, s.axes, s.rigs, seen)]
    return []


def _lawful(q: Question, grown: Grown) -> Grown | None:
    """Return a placement without the threats and hosts that break a rule together; None if nothing is left."""
    while grown.threats:
        own = question_about(q, grown.threats)
        if keeps_rules(own, grown.state):
            return grown
        state = grown.state
        broken = state.violation + state.window[state.pairs].sum(axis=1)
        worst = int(broken.argmax())
        kept = [n for n in range(len(grown.threats)) if n != worst]
        hosts = sorted({int(host) for n in kept for host in state.pairs[n]})
        if not kept:
            break
        grown = Grown([grown.threats[n] for n in kept], taken_out(state, kept, hosts))
    return None


def _with_others(
    q: Question, grown: Grown, order: list[int], seed: int, executor: ThreadPoolExecutor, effort: Effort
) -> Grown:
    """Try to see the threats that are left besides, in their order, with the hosts that are placed."""
    for attempt in range(ATTEMPTS):
        left = [threat for threat in order if threat not in grown.threats]
        for n in range(0, len(left), LANES):
            if len(grown.state.degree) < 2 or not effort.goes_on():
                return grown
            now = grown

            def tried(threat: int, now: Grown = now, attempt: int = attempt) -> Grown | None:
                return _with(q, now, threat, seeded(seed, threat, 2, attempt))

            for threat, found in zip(left[n : n + LANES], executor.map(tried, left[n : n + LANES]), strict=True):
                if found is not None and grown is not now:
                    # the other lane was faster, and what this one found holds for what there was before
                    found = _with(q, grown, threat, seeded(seed, threat, 3, attempt))
                grown = found or grown
    return grown


def _with(q: Question, grown: Grown, threat: int, chance: Chance) -> Grown | None:
    """Return a placement with one threat more, seen by the hosts there are, if an anneal of those near it finds how."""
    threats = [*grown.threats, threat]
    own = question_about(q, threats)
    state, hosts = new_state(len(threats), len(grown.state.degree)), len(grown.state.degree)
    state.positions[:], state.axes[:], state.rigs[:] = grown.state.positions, grown.state.axes, grown.state.rigs
    for n in range(len(grown.threats)):
        for end in range(2):
            set_view(state, n, end, grown.state.pairs[n, end], grown.state.cameras[n, end])
    middle = q.points_m[threat].mean(axis=0)
    near = np.argsort(np.linalg.norm(state.positions - middle, axis=1), kind="stable")
    if np.linalg.norm(state.positions[near[0]] - middle) > q.range_m[:, threat].max() + NEAR_M:
        return None
    first = below(chance, min(2, hosts - 1))
    for end, host in enumerate(near[first : first + 2]):
        set_view(state, len(threats) - 1, end, host, PERIPHERAL)
    marks = np.zeros(hosts, np.int64)
    mark_nearest(own, state, len(threats) - 1, 2 + below(chance, 3), marks)
    chosen, inside = marked(marks), marked(marks[state.pairs].min(axis=1))
    keeps_rules(own, state)
    best = copied(state)
    moves, reach_m = MOVES_PER_HOST * chosen.size, REACH_M * uniform(chance)
    anneal(own, state, best, chosen, inside, moves, 0.3, COLD_AGAIN, reach_m, MENDING_STIFFNESS, chance)
    if not keeps_rules(own, best):
        return None
    ascending = np.argsort(threats, kind="stable").tolist()
    return Grown(sorted(threats), taken_out(best, ascending, list(range(hosts))))


def _relieved(
    q: Question, grown: Grown, posts: Posts, most: int, exactly: bool, target: Target | None, effort: Effort
) -> Grown:
    """Give views of shared hosts to hosts of their own: those of the threats that cost most, or miss the target."""
    state, own = grown.state, question_about(q, grown.threats)
    count, threats = len(state.degree), np.array(grown.threats)
    most = min(most, 2 * len(threats))
    if count >= most or not (exactly or target is not None):
        return grown
    measure, limits = own, np.zeros(len(threats))
    if target is not None:
        measure = question_about(target.q, grown.threats)
        limits = target.error_m * measure.weight
    usable = np.ones(len(posts.rigs), np.bool_)
    rigs_left = q.hosts_of_rig - np.bincount(state.rigs, minlength=len(q.hosts_of_rig))
    for host in range(count):
        exclude_place(q, posts, state.positions[host], usable)
    wide, gained = widened(state, most), np.ones((len(threats), 2), np.bool_)
    while count < most and effort.goes_on():
        before = count
        count = relieve(
            measure, posts, posts.seen[:, threats], usable, rigs_left, limits, wide, count, gained, ADDED, exactly
        )
        if count == before:
            break
    more = Grown(grown.threats, taken_out(wide, list(range(len(threats))), list(range(count))))
    return more if keeps_rules(own, more.state) else grown


def _better(
    q: Question,
    grown: Grown,
    seed: int,
    executor: ThreadPoolExecutor,
    effort: Effort,
    rounds: int | None,
    until_settled: bool,
) -> None:
    """Make parts better in place, the costlier ones more often."""
    own, idle, step = question_about(q, grown.threats), 0, 0
    parts = list(groups(grown.state))
    while (rounds is None or step * LANES < rounds * len(parts)) and effort.goes_on():
        before, now = grown.cost, copied(grown.state)
        picked = _picked(own, parts, grown.state, seeded(seed, step, 4, 0))
        tasks = [
            executor.submit(_annealed, own, now, *part, seeded(seed, step, 5, lane)) for lane, part in enumerate(picked)
        ]
        for task, part in zip(tasks, picked, strict=True):
            if (found := task.result()) is not None and _put_back(own, grown.state, found, *part):
                parts = list(groups(grown.state))
        step += 1
        idle = 0 if grown.cost < before * (1 - 1e-4) else idle + 1
        if until_settled and idle > SETTLED * len(parts):
            break


def _picked(q: Question, parts: Sequence[Part], state: State, chance: Chance) -> list[Part]:
    """A part for each lane, of two that are drawn the costlier one, often with the one beside it: all different."""
    left = list(parts)
    picked: list[Part] = []
    while left and len(picked) < LANES:
        drawn = [left[below(chance, len(left))] for _ in range(2)]
        part = max(drawn, key=lambda one: float(state.cost[one[0]].sum()))
        left.remove(part)
        if left and uniform(chance) < JOINT:
            places = q.points_m.mean(axis=1)
            away_m = [float(cdist(places[part[0]], places[threats]).min()) for threats, _ in left]
            beside = left[int(np.argmin(away_m))]
            if len(part[0]) + len(beside[0]) <= TOGETHER:
                left.remove(beside)
                part = sorted(part[0] + beside[0]), sorted(part[1] + beside[1])
        picked.append(part)
    return picked


def _annealed(q: Question, state: State, threats: list[int], hosts: list[int], chance: Chance) -> State | None:
    """A part by itself that costs less than it does in the state; None: none was found."""
    part = taken_out(state, threats, hosts)
    rigs = np.bincount(part.rigs, minlength=len(q.hosts_of_rig))
    own = question_about(q, threats)._replace(hosts_of_rig=rigs, paths_m=_near_ways(q, part.positions, threats))
    trial, spare = new_state(len(threats), len(hosts)), new_state(len(threats), len(hosts))
    before = float(part.cost.sum())
    if len(threats) <= TOGETHER and uniform(chance) < AFRESH:
        fresh(own, part, trial, GROWING_MOVES * len(threats), REACH_M, NO_POSES, chance)
    else:
        improve(own, part, trial, spare, TRIALS, MOVES_PER_HOST, REACH_M, NO_POSES, chance, [])
    cost, violation = totals(own, part)
    return part if violation <= 0 and cost < before * (1 - 1e-9) else None


def _near_ways(q: Question, positions: Floats, threats: list[int]) -> Floats:
    """The ways that lead through the neighbourhood of a part."""
    places = np.concatenate([positions, q.points_m[threats].reshape(-1, 3)])
    low, high = places.min(axis=0) - q.safety_m - NEAR_M, places.max(axis=0) + q.safety_m + NEAR_M
    near = (q.paths_m.max(axis=1) >= low).all(axis=1) & (q.paths_m.min(axis=1) <= high).all(axis=1)
    return np.ascontiguousarray(q.paths_m[near])


def _put_back(q: Question, state: State, part: State, threats: list[int], hosts: list[int]) -> bool:
    """Put a part into the state it was taken from; False, and nothing changes, if it stands in somebody's way."""
    whole = copied(state)
    whole.positions[hosts], whole.axes[hosts], whole.rigs[hosts] = part.positions, part.axes, part.rigs
    for n, threat in enumerate(threats):
        for end in range(2):
            set_view(whole, threat, end, hosts[int(part.pairs[n, end])], int(part.cameras[n, end]))
    if not keeps_rules(q, whole):
        return False
    for array, new in zip(state, whole, strict=True):
        array[:] = new
    return True
