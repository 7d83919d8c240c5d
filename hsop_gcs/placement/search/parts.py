"""Parts of placements that share no host with the rest, and the least costly way to put the best of them together.

Hosts are nodes and threats edges of a graph; its components cost what they cost whatever stands beside them, so that
the best placement is made of the best parts, wherever each was found and however many hosts it has.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hsop_gcs.placement.search.model import Floats, Ints, Question
from hsop_gcs.placement.search.state import State, new_state, refresh, set_view

GAIN = 1e-6
"""What is not cheaper by this share is no better."""
PRICES = (0.0, 0.5, 1.0, 2.0, 4.0)
"""What a host may be worth in a bound, in costs of an average threat."""
MOST_NODES = 20_000
"""Of one search for a combination: a safeguard, hundreds are usual."""


@dataclass(frozen=True, slots=True)
class Part:
    """Some threats with hosts of their own, keeping every rule."""

    threats: tuple[int, ...]
    state: State
    """Its hosts and threats by themselves."""


def groups(state: State) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the threats and the hosts of each part of a state, both ascending."""
    pairs = state.pairs.tolist()
    left = list(range(len(pairs)))
    while left:
        threats = [left.pop(0)]
        hosts = set(pairs[threats[0]])
        grown = True
        while grown:
            joining = [t for t in left if not hosts.isdisjoint(pairs[t])]
            grown = bool(joining)
            for t in joining:
                hosts.update(pairs[t])
                threats.append(t)
                left.remove(t)
        yield sorted(threats), sorted(hosts)


def question_about(q: Question, threats: list[int]) -> Question:
    """Return the question for some of the threats; hosts still keep clear of the ways of all."""
    return q._replace(
        points_m=q.points_m[threats],
        weight=q.weight[threats],
        range_m=np.ascontiguousarray(q.range_m[:, threats]),
        factor=np.ascontiguousarray(q.factor[:, threats]),
    )


def taken_out(state: State, threats: list[int], hosts: list[int]) -> State:
    """Return a part of a state by itself."""
    part = new_state(len(threats), len(hosts))
    _copy_poses(state, hosts, part, range(len(hosts)))
    number = {host: n for n, host in enumerate(hosts)}
    for n, threat in enumerate(threats):
        for end in range(2):
            set_view(part, n, end, number[int(state.pairs[threat, end])], state.cameras[threat, end])
    part.cost[:] = state.cost[threats]
    part.violation[:] = state.violation[threats]
    part.window[:] = state.window[hosts]
    return part


def put_together(q: Question, parts: list[Part]) -> State:
    """Return the state that is made of parts."""
    whole = new_state(len(q.weight), sum(len(part.state.degree) for part in parts))
    first = 0
    for part in parts:
        count = len(part.state.degree)
        _copy_poses(part.state, range(count), whole, range(first, first + count))
        for n, threat in enumerate(part.threats):
            for end in range(2):
                set_view(whole, threat, end, first + part.state.pairs[n, end], part.state.cameras[n, end])
        first += count
    refresh(q, whole)
    return whole


def _copy_poses(source: State, hosts: list[int] | range, target: State, at: range) -> None:
    target.positions[at] = source.positions[hosts]
    target.axes[at] = source.axes[hosts]
    target.rigs[at] = source.rigs[hosts]


class Parts:
    """The best part known for every set of threats and number of hosts (of each rig), and what they make together."""

    def __init__(self, q: Question) -> None:
        self.q = q
        self._number: dict[tuple[tuple[int, ...], tuple[int, ...]], int] = {}
        self._parts: list[Part] = []
        self._totals: list[float] = []
        self._costs: list[Floats] = []
        """(threats,) of each part: what each of its threats costs, infinite for others."""
        self._rigs: list[Ints] = []
        """(rigs,) of each part: how many hosts carry each."""
        self._newest: dict[int, None] = {}
        """Numbers of the parts that changed since the last combination."""

    def take(self, state: State, threats: Sequence[int]) -> None:
        """Remember what parts of a state keep every rule and are the best of their kind; ``threats``: which it has."""
        for inside, hosts in groups(state):
            self._keep(state, inside, hosts, [threats[n] for n in inside])

    def _keep(self, state: State, inside: list[int], hosts: list[int], threats: list[int]) -> None:
        """Remember what a state's rows ``inside`` and ``hosts`` hold, if it is the best for these threats."""
        cost = state.cost[inside]
        rigs = np.bincount(state.rigs[hosts], minlength=len(self.q.hosts_of_rig))
        key = tuple(threats), tuple(rigs.tolist())
        number = self._number.get(key)
        if number is not None and cost.sum() >= self._totals[number] * (1 - GAIN):
            return
        if state.violation[inside].sum() + state.window[hosts].sum() > 0:
            return
        if number is None:
            number = self._number[key] = len(self._parts)
            self._parts.append(Part((), state))
            self._totals.append(0.0)
            self._costs.append(np.full(len(self.q.weight), np.inf))
            self._rigs.append(rigs)
        self._parts[number] = Part(key[0], taken_out(state, inside, hosts))
        self._totals[number] = cost.sum()
        self._costs[number][threats] = cost
        self._newest[number] = None

    def combined(self, n_hosts: int, below: float) -> State | None:
        """Return the least costly combination with so many hosts that costs less than ``below``, if there is one.

        Looks only at what holds a part that is new since the last time.
        """
        newest, self._newest = list(self._newest), {}
        found: list[int] | None = None
        if not newest:
            return None
        costs = np.array(self._costs)
        if below == np.inf:
            below = 1 + float(np.where(np.isfinite(costs), costs, 0.0).max(axis=0).sum())
        cover = _Cover(costs, np.array(self._rigs), self.q.hosts_of_rig, n_hosts, below)
        for number in newest:
            found = cover.cheapest_with(number) or found
        return None if found is None else put_together(self.q, [self._parts[number] for number in found])


class _Cover:
    """Branch and bound over exact covers: every threat in one part, and so many hosts in all.

    The bound: with a price λ on every host, a part's cost and price are shared out among its threats, and no cover is
    below the sum over threats of their least shares, less λ for each host there is. Any λ is valid.
    """

    def __init__(self, costs: Floats, rigs: Ints, available: Ints, n_hosts: int, below: float) -> None:
        self._available, self._n_hosts, self._below = available, n_hosts, below * (1 - GAIN)
        self._rigs, self._hosts = rigs, rigs.sum(axis=1)
        inside = np.isfinite(costs)
        self._cost = np.where(inside, costs, 0.0).sum(axis=1)
        share = (self._hosts / inside.sum(axis=1))[:, None]
        best = -np.inf
        for price in PRICES:
            worth = price * below / costs.shape[1]
            least = (costs + worth * share).min(axis=0)
            bound = least.sum() - worth * n_hosts
            if bound > best:
                best, self._price, self._least = bound, worth, least
        dear = self._cost + self._price * self._hosts - np.where(inside, self._least, 0.0).sum(axis=1)
        useful = np.flatnonzero(best + dear < self._below)
        order = useful[np.argsort(dear[useful], kind="stable")]
        self._members = [frozenset(np.flatnonzero(row).tolist()) for row in inside]
        self._dear = dear
        self._with: list[list[int]] = [[n for n in order if t in self._members[n]] for t in range(costs.shape[1])]
        self._useful = set(useful.tolist())
        self._bound = best
        self._nodes = 0

    def cheapest_with(self, number: int) -> list[int] | None:
        """Return the parts of the cheapest cover that holds this one, if it is below all found so far."""
        if number not in self._useful:
            return None
        self._nodes, self._found = 0, None
        left = frozenset(range(len(self._with))) - self._members[number]
        self._extend([number], left, self._n_hosts - int(self._hosts[number]), self._bound + self._dear[number])
        return self._found

    _found: list[int] | None

    def _extend(self, chosen: list[int], left: frozenset[int], hosts: int, bound: float) -> None:
        """Cover the threats that are left with so many hosts; ``bound``: what the cover costs at least."""
        if bound >= self._below or self._nodes > MOST_NODES:
            return
        if not left:
            if hosts == 0 and (self._rigs[chosen].sum(axis=0) <= self._available).all():
                self._below, self._found = float(self._cost[chosen].sum()) * (1 - GAIN), chosen
            return
        if not 2 <= hosts <= 2 * len(left):
            return
        self._nodes += 1
        for number in self._with[min(left)]:
            if bound + self._dear[number] >= self._below:
                return
            if self._members[number] <= left:
                self._extend(
                    [*chosen, number],
                    left - self._members[number],
                    hosts - int(self._hosts[number]),
                    bound + self._dear[number],
                )
