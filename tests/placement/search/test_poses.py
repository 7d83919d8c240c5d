"""Annealing over poses alone: what it leaves keeps every rule and cannot be shared out better."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.search.anneal import scatter
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.known import NO_POSES, KnownPoses
from hsop_gcs.placement.search.model import PERIPHERAL, Floats, Question, edge_energy
from hsop_gcs.placement.search.poses import anneal_poses, decided_by_poses, sight_of
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.rounds import LANES, Course
from hsop_gcs.placement.search.state import State, copied, new_state, refresh, totals
from tests.placement.examples import random_threats

HOSTS, THREATS = 5, 5


def annealed(seed: int = 1) -> tuple[Question, State]:
    problem = Problem(threats=random_threats(THREATS, np.random.default_rng(3), 70.0), formulation=Formulation.LETTER)
    q = question_of(problem, frame_of(problem))
    state = new_state(THREATS, HOSTS)
    chance = seeded(seed)
    scatter(q, state, chance)
    anneal_some(q, state, range(HOSTS), 20_000, NO_POSES, chance)
    return q, state


def anneal_some(q: Question, state: State, hosts: range, moves: int, known: Floats, chance: Chance) -> None:
    anneal_poses(q, sight_of(q), state, np.array(hosts), moves, 0.5, 1e-3, 25.0, 15.0, 1_500.0, known, chance)


@pytest.mark.parametrize("seed", range(4))
def test_an_anneal_over_poses_keeps_every_rule_and_uses_every_host(seed: int) -> None:
    q, state = annealed(seed=seed)
    again = copied(state)
    refresh(q, again)
    assert totals(q, again) == totals(q, state)
    assert totals(q, state)[1] == 0
    assert state.degree.min() >= 1
    assert state.degree.sum() == 2 * THREATS


def test_only_the_hosts_that_are_named_move() -> None:
    q, before = annealed()
    state = copied(before)
    anneal_some(q, state, range(2), 2_000, NO_POSES, seeded(2))
    moved = np.abs(state.positions - before.positions).max(axis=1) > 0
    assert moved[:2].any()
    assert not moved[2:].any()


def test_an_anneal_comes_nearer_to_the_best_when_it_knows_where_hosts_stood_there() -> None:
    q, best = min((annealed(seed=seed) for seed in range(8)), key=lambda each: totals(*each))
    known = KnownPoses()
    known.take([(best, range(THREATS))])
    costs: dict[bool, list[float]] = {True: [], False: []}
    for knows, seed in itertools.product(costs, range(12)):
        state, chance = new_state(THREATS, HOSTS), seeded(100 + seed)
        scatter(q, state, chance)
        anneal_some(q, state, range(HOSTS), 3_000, known.rows if knows else NO_POSES, chance)
        costs[knows].append(totals(q, state)[0])
    assert np.median(costs[True]) < 0.9 * np.median(costs[False])


def test_two_hosts_that_can_see_eight_threats_are_found_in_the_second_round() -> None:
    problem = Problem(threats=random_threats(8, np.random.default_rng(8800), 131.43), formulation=Formulation.LETTER)
    course = Course(question_of(problem, frame_of(problem)), 2, 0)
    with ThreadPoolExecutor(LANES) as executor:
        course.advance(executor)
        course.advance(executor)
    assert course.pool.best is not None


def test_no_other_pair_of_fisheyes_would_serve_a_threat_better() -> None:
    q, state = annealed()
    for threat in range(THREATS):
        for i, j in itertools.combinations(range(HOSTS), 2):
            cost, violation = edge_energy(
                q, state.positions, state.axes, state.rigs, threat, i, j, PERIPHERAL, PERIPHERAL
            )
            assert violation > 0 or cost > state.cost[threat] * (1 - 1e-3)


def test_poses_decide_where_hosts_are_free_to_stand_anywhere_and_not_each_threat_is_by_itself() -> None:
    q, state = annealed()
    assert decided_by_poses(q, state)
    assert not decided_by_poses(q, new_state(THREATS, 2 * THREATS))
    assert not decided_by_poses(q._replace(whole_path=True), state)
    assert decided_by_poses(q._replace(hosts_of_rig=np.array([3, 2])), new_state(THREATS, 2 * THREATS))
