"""Hosts of several placements are candidates: the table is right, the choice is the best, and it can be flown."""

from itertools import combinations, combinations_with_replacement

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.known import NO_POSES, KnownPoses
from hsop_gcs.placement.search.model import Floats, Ints, Question
from hsop_gcs.placement.search.neighbourhood import MOST_TOGETHER, fresh, gathered
from hsop_gcs.placement.search.poses import VIEW, pair_energy, sight_of
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.recombine import (
    Singles,
    best_exchange,
    choose,
    chosen_of,
    exchange,
    look_around,
    recombined,
    tabulate,
)
from hsop_gcs.placement.search.state import State, copied, new_state, refresh, totals
from tests.placement.examples import random_threats

THREATS, HOSTS = 5, 5
PENALTY, DEAREST = 50.0, 10.0


def asked() -> Question:
    problem = Problem(threats=random_threats(THREATS, np.random.default_rng(3), 70.0), formulation=Formulation.LETTER)
    return question_of(problem, frame_of(problem))


def found(q: Question, seed: int) -> State:
    state = new_state(THREATS, HOSTS)
    fresh(q, state, new_state(THREATS, HOSTS), 2_000, 25.0, NO_POSES, seeded(seed))
    return state


def poses_of(states: list[State]) -> Floats:
    known = KnownPoses()
    known.take([(state, range(THREATS)) for state in states])
    return known.rows


def tabulated(q: Question, poses: Floats) -> tuple[Floats, Singles]:
    candidates = new_state(THREATS, len(poses))
    candidates.positions[:, :2], candidates.axes[:] = poses[:, :2], poses[:, 2:4]
    views = np.empty((len(poses), THREATS, VIEW))
    look_around(q, sight_of(q), candidates, poses[:, 4:].astype(np.int64), views)
    table = np.full((len(poses), len(poses), THREATS), np.nan, np.float32)
    tabulate(q, np.ascontiguousarray(views.transpose(1, 2, 0)), PENALTY, DEAREST, table)
    return views, table


def energy(q: Question, views: Floats, chosen: Ints) -> float:
    """What those chosen cost, by the geometry: each threat with the two that serve it best."""
    pairs = list(combinations(dict.fromkeys(chosen.tolist()), 2))
    return sum(
        min([DEAREST] + [pair_energy(q, t, views[i, t], views[j, t], PENALTY, np.inf) for i, j in pairs])
        for t in range(THREATS)
    )


def test_an_exchange_costs_by_the_table_what_it_costs_by_the_geometry() -> None:
    q = asked()
    views, table = tabulated(q, poses_of([found(q, seed) for seed in range(4)]))
    rng = np.random.default_rng(0)
    chosen = chosen_of(table, rng.integers(len(views), size=HOSTS))
    rows, totals_of = np.empty((HOSTS, THREATS), np.float32), np.empty(HOSTS, np.float32)
    for _ in range(200):
        candidate = int(rng.integers(len(views)))
        least, host = best_exchange(table, chosen, candidate, rows, totals_of)
        every = np.tile(chosen.candidates, (HOSTS, 1))
        np.fill_diagonal(every, candidate)
        costs = [energy(q, views, each) for each in every]
        assert least == pytest.approx(min(costs), rel=1e-5)
        assert costs[host] == pytest.approx(least, rel=1e-5)
        other = int(rng.integers(HOSTS))
        assert exchange(chosen, other, candidate, rows) == pytest.approx(costs[other], rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_the_best_of_all_choices_is_found(seed: int) -> None:
    q = asked()
    views, table = tabulated(q, poses_of([found(q, seed), found(q, seed + 10)]))
    chosen, allowed = np.zeros(3, np.int64), np.arange(len(views))
    choose(table, allowed, chosen, 5_000, 1.0, 0.01, seeded(seed))
    every = combinations_with_replacement(range(len(views)), 3)
    assert energy(q, views, chosen) == pytest.approx(min(energy(q, views, np.array(each)) for each in every), rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_hosts_of_several_placements_make_one_that_is_no_worse(seed: int) -> None:
    q = asked()
    placements = [found(q, 10 * seed + n) for n in range(6)]
    least = min(cost for cost, violation in map(totals, [q] * 6, placements) if violation <= 0)
    home = min((s for s in placements if totals(q, s)[1] <= 0), key=lambda s: totals(q, s)[0])
    states = recombined(q, home, poses_of(placements), seeded(seed))
    for state in states:
        again = copied(state)
        refresh(q, again)
        assert totals(q, again) == pytest.approx(totals(q, state))
    assert min(cost for cost, violation in map(totals, [q] * len(states), states) if violation <= 0) <= least * (
        1 + 1e-4
    )


def test_a_few_threats_near_one_another_are_placed_as_if_there_were_no_others() -> None:
    q = asked()
    drawn = [gathered(q, 25.0, seeded(seed)) for seed in range(30)]
    assert {len(threats) for _, threats in drawn} == set(range(2, MOST_TOGETHER + 1))
    for state, threats in drawn:
        assert list(threats) == sorted(set(threats))
        assert state.pairs.shape[0] == len(threats)
        assert 2 <= len(state.degree) <= len(threats) + 1
