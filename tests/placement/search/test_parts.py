"""Placements fall apart where they share no host, and the best parts make the best whole."""

import itertools
import math

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.known import NO_POSES
from hsop_gcs.placement.search.model import Question
from hsop_gcs.placement.search.neighbourhood import fresh
from hsop_gcs.placement.search.parts import Parts, groups, question_about
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.state import State, copied, new_state, refresh, set_view, totals
from tests.placement.examples import random_threats

THREATS = 5


def question(formulation: Formulation = Formulation.LETTER) -> Question:
    problem = Problem(threats=random_threats(THREATS, np.random.default_rng(4), 80.0), formulation=formulation)
    return question_of(problem, frame_of(problem))


def annealed(q: Question, hosts: int, seed: int) -> State:
    state, trial = new_state(len(q.weight), hosts), new_state(len(q.weight), hosts)
    fresh(q, state, trial, 2_000, 25.0, NO_POSES, seeded(seed))
    return state


def test_a_state_falls_apart_where_no_host_is_shared() -> None:
    state = new_state(4, 6)
    for threat, (first, second) in enumerate([(0, 1), (2, 3), (4, 1), (3, 5)]):
        set_view(state, threat, 0, first, 0)
        set_view(state, threat, 1, second, 0)
    assert list(groups(state)) == [([0, 2], [0, 1, 4]), ([1, 3], [2, 3, 5])]


@pytest.mark.parametrize("formulation", list(Formulation))
def test_what_is_taken_apart_and_put_together_again_costs_the_same(formulation: Formulation) -> None:
    q = question(formulation)
    state = annealed(q, 8, 1)
    parts = Parts(q)
    parts.take(state, range(THREATS))
    again = parts.combined(8, math.inf)
    assert again is not None
    assert totals(q, again) == pytest.approx(totals(q, state), rel=1e-12)
    assert parts.combined(8, math.inf) is None, "nothing is new"


def test_a_threat_costs_the_same_in_the_question_about_it_alone() -> None:
    q = question(Formulation.OPERATIONAL)
    state = annealed(q, 2 * THREATS, 1)
    threats, hosts = next((t, h) for t, h in groups(state) if len(t) == 1)
    own = question_about(q, threats)
    alone = new_state(1, 2)
    alone.positions[:], alone.axes[:] = state.positions[hosts], state.axes[hosts]
    for end in range(2):
        set_view(alone, 0, end, hosts.index(int(state.pairs[threats[0], end])), state.cameras[threats[0], end])
    refresh(own, alone)
    assert alone.cost[0] == pytest.approx(state.cost[threats[0]], rel=1e-12)
    assert alone.window == pytest.approx(state.window[hosts])


def test_the_combination_is_the_cheapest_of_all_exact_covers() -> None:
    q = question()
    found = [annealed(q, hosts, seed) for hosts in (5, 6, 7, 8) for seed in range(3)]
    parts = Parts(q)
    best: dict[tuple[frozenset[int], int], float] = {}
    for state in found:
        parts.take(state, range(THREATS))
        for threats, hosts in groups(state):
            if state.violation[threats].sum() + state.window[hosts].sum() <= 0:
                key = frozenset(threats), len(hosts)
                best[key] = min(best.get(key, math.inf), float(state.cost[threats].sum()))
    least = math.inf
    for count in range(1, THREATS + 1):
        for chosen in itertools.combinations(best, count):
            covered = sorted(t for threats, _ in chosen for t in threats)
            if covered == list(range(THREATS)) and sum(hosts for _, hosts in chosen) == 7:
                least = min(least, sum(best[key] for key in chosen))
    whole = parts.combined(7, math.inf)
    assert whole is not None
    cost, violation = totals(q, whole)
    assert violation <= 0
    assert cost == pytest.approx(least, rel=1e-5)
    assert len(whole.degree) == 7


def test_no_more_hosts_of_a_rig_are_put_together_than_there_are() -> None:
    q = question()
    scarce = q._replace(hosts_of_rig=np.array([5]))
    state = annealed(q, 6, 0)
    parts = Parts(scarce)
    parts.take(state, range(THREATS))
    assert parts.combined(6, math.inf) is None


def test_parts_of_a_part_are_known_by_the_numbers_of_the_whole() -> None:
    q = question()
    parts = Parts(q)
    for threats in ([0, 3], [1, 2, 4]):
        parts.take(annealed(question_about(q, threats), 2 * len(threats), 0), threats)
    whole = parts.combined(2 * THREATS, math.inf)
    assert whole is not None
    again = copied(whole)
    refresh(q, again)
    assert totals(q, again) == totals(q, whole)
