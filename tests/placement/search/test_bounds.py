"""Bounds hold for whatever is placed at random."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat
from hsop_gcs.placement.search.bounds import fewest_hosts, lower_bound, own_pair_bound, own_pair_bound_in_space
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.solve import search
from hsop_gcs.placement.search.state import new_state, refresh, set_view, totals
from hsop_gcs.placement.solution import Status
from tests.placement.examples import random_threats


@pytest.mark.parametrize("seed", range(4))
def test_no_placement_goes_below_the_bound(seed: int) -> None:
    problem = Problem(threats=random_threats(2, np.random.default_rng(seed)), formulation=Formulation.LETTER)
    with ThreadPoolExecutor(1) as executor:
        bound = lower_bound(question_of(problem, frame_of(problem)), executor, thorough=False)
    placement = search(problem, n_hosts=4, seed=seed, deadline=math.inf, now=lambda: 0.0, iterations=2)
    assert placement.cost is not None
    assert 0 < bound <= placement.cost


def test_threats_that_no_host_sees_together_need_two_hosts_each() -> None:
    places = (0.0, 50.0, 400.0, 450.0, 900.0)
    threats = tuple(Threat(id=f"t{k}", position_m=(x, 0.0, 0.0)) for k, x in enumerate(places))
    problem = Problem(threats=threats, formulation=Formulation.LETTER)
    assert fewest_hosts(question_of(problem, frame_of(problem))) == 6


def test_threats_side_by_side_need_no_more_than_two_hosts() -> None:
    threats = tuple(Threat(id=f"t{k}", position_m=(10.0 * k, 0.0, 0.0)) for k in range(4))
    problem = Problem(threats=threats, formulation=Formulation.LETTER)
    assert fewest_hosts(question_of(problem, frame_of(problem))) == 2


@pytest.mark.parametrize("formulation", list(Formulation))
@pytest.mark.parametrize("speed_mps", [0.5, 1.7, 2.9, 4.6])
def test_no_two_hosts_at_random_places_go_below_a_threats_bound(formulation: Formulation, speed_mps: float) -> None:
    threat = Threat(id="a", position_m=(3.0, 4.0, 0.0), velocity_mps=(0.6 * speed_mps, -0.8 * speed_mps, 0.0))
    problem = Problem(threats=(threat,), formulation=formulation)
    q = question_of(problem, frame_of(problem))
    rng = np.random.default_rng(0)
    bound = own_pair_bound(q, 0, 5_000)
    assert bound <= own_pair_bound(q, 0, 50_000)
    bound = own_pair_bound(q, 0, 50_000)
    state, valid = new_state(1, 2), 0
    for end in range(2):
        set_view(state, 0, end, end, 0)
    for _ in range(20_000):
        state.positions[:, :2] = rng.uniform(-60, 60, (2, 2))
        angles = rng.uniform(0, 2 * np.pi, 2)
        state.axes[:, 0], state.axes[:, 1] = np.sin(angles), np.cos(angles)
        state.cameras[0] = rng.integers(0, 2, 2)
        refresh(q, state)
        cost, violation = totals(q, state)
        valid += violation == 0
        assert violation > 0 or cost >= bound
    assert valid > 10


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("speed_mps", [0.0, 1.5, 4.0])
def test_no_two_hosts_anywhere_in_space_go_below_a_threats_bound(objective: Objective, speed_mps: float) -> None:
    velocity = (0.6 * speed_mps, -0.7 * speed_mps, 0.4 * speed_mps)
    threat = Threat(id="a", position_m=(3.0, 4.0, 30.0), velocity_mps=velocity, size_m=1.2)
    airspace = Airspace(floor_m=10.0, ceiling_m=90.0)
    problem = Problem(threats=(threat,), objective=objective, airspace=airspace, position_sigma_m=0.1)
    q = question_of(problem, frame_of(problem))
    bound = own_pair_bound_in_space(q, 0, 400)
    assert bound >= own_pair_bound_in_space(q, 0, 50)
    rng = np.random.default_rng(1)
    state, valid, least = new_state(1, 2), 0, math.inf
    for end in range(2):
        set_view(state, 0, end, end, 0)
    for _ in range(20_000):
        away = rng.normal(size=(2, 3))
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        middle = q.points_m[0].mean(axis=0)
        state.positions[:] = middle + away * rng.uniform(20, 50, (2, 1))
        state.positions[:, 2] = np.clip(state.positions[:, 2], 10.0, 90.0)
        state.axes[:] = -away[:, :2] / np.linalg.norm(away[:, :2], axis=1, keepdims=True)
        state.cameras[0] = rng.integers(0, 2, 2)
        refresh(q, state)
        cost, violation = totals(q, state)
        valid += violation == 0
        least = min(least, cost if violation == 0 else math.inf)
        assert violation > 0 or cost >= bound
    assert valid > 10
    assert least < 20 * bound


def test_two_hosts_per_threat_are_proven_optimal_in_the_letters_problem() -> None:
    threats = tuple(
        Threat(id=f"t{k}", position_m=(30.0 * k, 10.0 * k, 0.0), velocity_mps=(1.0, -1.5, 0.0)) for k in range(2)
    )
    problem = Problem(threats=threats, formulation=Formulation.LETTER)
    placement = search(problem, n_hosts=4, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=8)
    assert placement.status is Status.OPTIMAL
    assert placement.cost is not None
    assert placement.lower_bound <= placement.cost <= 1.001 * placement.lower_bound
