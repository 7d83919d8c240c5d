"""Nearer: among placements of about the same cost, one that its hosts are sooner at.

What a threat costs hardly depends on the side and the altitude from which its hosts look at it, and the search does not
ask where they come from. So what it found is turned, part by part, around the threats that each part sees, hosts stay
short of hover points that are far, and the placement that flies is mended as an alternative.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, product

import numpy as np
from scipy.optimize import linear_sum_assignment

from hsop_gcs.placement.answer import PROVEN_GAP
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.search.anneal import anneal
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.frame import turned
from hsop_gcs.placement.search.model import Floats, Ints, Question
from hsop_gcs.placement.search.moves import mend
from hsop_gcs.placement.search.neighbourhood import COLD_AGAIN, MENDING_STIFFNESS
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of, state_of
from hsop_gcs.placement.search.state import State, copied, copy_state, totals
from hsop_gcs.placement.solution import Placement, Status

_TURNS = 48
_SWEEPS = 3
_SHARES = (0.0, 0.25, 0.5, 0.75)
"""How much of a way, or of its climb, is tried."""
_CLIMB, _WAY = slice(2, 3), slice(0, 3)
_REACHES_M = (2.0, 5.0, 10.0, 20.0)
"""How far hosts of an earlier placement are moved at first."""
_MOVES_PER_HOST = 1000
_WARM = 0.03


def nearer(
    problem: Problem,
    placement: Placement,
    *,
    tolerance: float,
    climb: float,
    flying: Placement | None = None,
    late: Callable[[], bool] = lambda: False,
) -> Placement | None:
    """Return the placement with parts of it turned and lifted, for shorter ways from where the problem's hosts are.

    tolerance: the share by which it may cost more. climb: how many metres a host flies in the time in which it climbs
    one. flying: the earlier placement at which hosts are, or to which they are on their way. late: from then on nothing
    more is tried. None: nothing was gained.
    """
    if not problem.hosts:
        return None
    frame = frame_of(problem)
    q = question_of(problem, frame)
    state = state_of(problem, frame, q, placement, len(placement.hosts))
    homes = _Homes(
        places_m=frame.inward(np.array([host.position_m for host in problem.hosts])),
        rigs=np.array([problem.rigs.index(host.rig or problem.rig) for host in problem.hosts]),
        climb=climb,
    )
    most = (1 + tolerance) * totals(q, state)[0]
    before = least = homes.ways(state)
    mended = () if flying is None else _mended(q, state_of(problem, frame, q, flying, len(placement.hosts)))
    for sweep in range(_SWEEPS):
        swept = least
        # the state moves on meanwhile, and what is tried next with it
        for tried in chain(mended if sweep == 0 else (), _turned(q, state), _shortened(q, state, homes)):
            if late():
                break
            if _is_good(q, tried, most) and (ways := homes.ways(tried)) < least:
                least = ways
                copy_state(tried, state)
        if least == swept:
            break
    if least == before:
        return None
    found = placement_of(problem, frame, q, state)
    assert found.cost is not None
    proven = found.cost <= placement.lower_bound * (1 + PROVEN_GAP)
    return replace(
        found,
        status=Status.OPTIMAL if proven else Status.FEASIBLE,
        lower_bound=placement.lower_bound,
        method=placement.method,
        seed=placement.seed,
        iterations=placement.iterations,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Homes:
    """Where hosts come from, in the frame of the search."""

    places_m: Floats
    rigs: Ints
    climb: float

    def ways(self, state: State) -> tuple[float, float]:
        """The longest way and all ways together when the hosts share the hover points out, metres of level flight."""
        ways_m, chosen = self._shared(state)
        return float(ways_m[chosen].max()), float(ways_m[chosen].sum())

    def of(self, state: State) -> Floats:
        """Where the host comes from that takes each hover point, (hosts, 3)."""
        _, (_, takers) = self._shared(state)
        return np.asarray(self.places_m[takers])

    def _shared(self, state: State) -> tuple[Floats, tuple[Ints, Ints]]:
        apart_m = state.positions[:, None] - self.places_m[None]
        ways_m = np.maximum(np.linalg.norm(apart_m, axis=2), self.climb * np.abs(apart_m[:, :, 2]))
        fits = state.rigs[:, None] == self.rigs[None]
        points, takers = linear_sum_assignment(np.where(fits, ways_m**2, 1e12))
        return ways_m, (points, takers)


def _turned(q: Question, state: State) -> Iterator[State]:
    """Copies with one part turned around the middle of its threats."""
    for hosts, threats in _parts(state):
        middle = q.points_m[threats].reshape(-1, 3).mean(axis=0)[:2]
        for step in range(1, _TURNS):
            angle = 2 * np.pi * step / _TURNS
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            tried = copied(state)
            tried.positions[hosts, :2] = turned(state.positions[hosts, :2] - middle, turn.T) + middle
            tried.axes[hosts] = turned(state.axes[hosts], turn.T)
            yield tried


def _shortened(q: Question, state: State, homes: _Homes) -> Iterator[State]:
    """Copies with one host only part of the way, or of the climb, to its hover point."""
    for host, home_m in enumerate(homes.of(state)):
        for axes, share in product((_CLIMB, _WAY), _SHARES):
            tried = copied(state)
            tried.positions[host, axes] = home_m[axes] + share * (state.positions[host, axes] - home_m[axes])
            tried.positions[host, 2] = np.clip(tried.positions[host, 2], q.floor_m, q.ceiling_m)
            yield tried


def _mended(q: Question, state: State) -> Iterator[State]:
    """Copies of an earlier placement, brought to keep the rules of now by small moves of all its hosts."""
    hosts, threats = np.arange(len(state.degree)), np.arange(len(state.pairs))
    mend(q, state)
    for attempt, reach_m in enumerate(_REACHES_M):
        trial, best = copied(state), copied(state)
        moves, chance = _MOVES_PER_HOST * len(hosts), seeded(0, len(hosts), attempt, 0)
        anneal(q, trial, best, hosts, threats, moves, _WARM, COLD_AGAIN, reach_m, MENDING_STIFFNESS, chance)
        yield best


def _parts(state: State) -> Iterator[tuple[list[int], list[int]]]:
    """The hosts and the threats of each part of the placement that shares no host with another."""
    left = set(range(len(state.pairs)))
    while left:
        threats = {min(left)}
        while True:
            hosts = {int(host) for threat in threats for host in state.pairs[threat]}
            more = {threat for threat in left if hosts & set(state.pairs[threat].tolist())}
            if more == threats:
                break
            threats = more
        left -= threats
        yield sorted(hosts), sorted(threats)


def _is_good(q: Question, state: State, most: float) -> bool:
    """Whether a state, its hosts pushed to where they may hover, keeps every rule and costs no more than this."""
    mend(q, state)
    cost, violation = totals(q, state)
    return bool(violation <= 0 and cost <= most)
