"""The compiled kernels against the numpy reference and against differences."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.holding import middle_direction
from hsop_gcs.placement.objective import evaluate
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat
from hsop_gcs.placement.search.anneal import anneal, scatter
from hsop_gcs.placement.search.chance import seeded, uniform
from hsop_gcs.placement.search.elements import (
    CEILING,
    CONE,
    COST,
    FENCE,
    FLOOR,
    KEEP_OUT,
    PAN,
    PATH,
    PIXELS,
    element,
    list_elements,
    poses_of,
)
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL, Floats, Ints, Question, central_cone
from hsop_gcs.placement.search.moves import keep_clear
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.question import aimed_at, frame_of, placement_of, question_of
from hsop_gcs.placement.search.state import State, new_state, refresh, set_view, totals
from tests.placement.examples import random_threats

METRE = 1.0


def annealed(problem: Problem, hosts: int, seed: int, moves: int = 20_000) -> tuple[Question, State]:
    """A short anneal from random poses, valid or not."""
    q = question_of(problem, frame_of(problem))
    state, best, chance = new_state(len(q.weight), hosts), new_state(len(q.weight), hosts), seeded(seed)
    scatter(q, state, chance)
    everybody, everything = np.arange(hosts), np.arange(len(q.weight))
    anneal(q, state, best, everybody, everything, moves, 0.5, 1e-3, 25.0, 15.0, chance)
    return q, best


def some_problem(formulation: Formulation, objective: Objective, seed: int = 4) -> Problem:
    return Problem(threats=random_threats(3, np.random.default_rng(seed)), formulation=formulation, objective=objective)


def require_agreement(problem: Problem, q: Question, state: State) -> None:
    """A state without violation costs what the reference says, and breaks none of its rules."""
    cost, violation = totals(q, state)
    assert violation == 0
    placement = placement_of(problem, frame_of(problem), q, state)
    worth = evaluate(problem, placement.hosts, {pair.threat: pair.views for pair in placement.pairs})
    expected = worth.cost if problem.objective is Objective.LETTER else sum(worth.expected_errors_m.values())
    assert cost == pytest.approx(expected, rel=1e-6)
    assert placement.cost == pytest.approx(expected, rel=1e-12)
    assert worth.margins.feasible


def test_the_same_seed_draws_the_same_numbers_and_another_seed_others() -> None:
    first, again, other = seeded(7, 1), seeded(7, 1), seeded(7, 2)
    draws = [[uniform(state) for _ in range(50)] for state in (first, again, other)]
    assert draws[0] == draws[1]
    assert draws[0] != draws[2]
    assert all(0 <= draw < 1 for row in draws for draw in row)


@pytest.mark.parametrize("formulation", list(Formulation))
@pytest.mark.parametrize("objective", list(Objective))
def test_a_states_cost_and_rules_are_those_of_the_reference(formulation: Formulation, objective: Objective) -> None:
    problem = some_problem(formulation, objective)
    q, state = annealed(problem, 4, seed=1)
    require_agreement(problem, q, state)


def test_the_energies_kept_during_a_run_are_those_of_its_last_state() -> None:
    q, state = annealed(some_problem(Formulation.OPERATIONAL, Objective.LETTER), 5, seed=3)
    kept = totals(q, state)
    refresh(q, state)
    assert totals(q, state) == pytest.approx(kept, rel=1e-12)


@pytest.mark.parametrize("hosts", [2, 3, 5, 6])
def test_every_host_is_listed_with_exactly_the_views_it_has(hosts: int) -> None:
    for seed in range(5):
        _, state = annealed(some_problem(Formulation.LETTER, Objective.LETTER), hosts, seed, moves=4_000)
        for host in range(hosts):
            listed = sorted(int(view) for view in state.incident[host, : state.degree[host]])
            assert listed == [2 * t + end for t, end in np.argwhere(state.pairs == host).tolist()]
            assert listed
        assert (state.pairs[:, 0] != state.pairs[:, 1]).all()


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("formulation", list(Formulation))
def test_gradients_are_the_slopes_of_costs_and_margins(formulation: Formulation, objective: Objective) -> None:
    plane, state = annealed(some_problem(formulation, objective), 4, seed=0)
    q = plane._replace(plane=False, floor_m=-5.0, ceiling_m=5.0)
    rows = list_elements(q, state, np.ones(4, dtype=np.int64))
    poses = poses_of(q, state)
    poses[:, 2] = [1.0, 2.0, -3.0, 0.5]
    assert_gradients(q, rows, poses)


def test_gradients_of_errors_against_a_target_are_the_slopes_too() -> None:
    problem = problem_in_space(Objective.RMS)
    q = aimed_at(problem, frame_of(problem), 1.3)
    state = annealed(problem, 4, seed=0)[1]
    refresh(q, state)
    costs = [math.sqrt(square) for square in (state.cost ** (2 / q.power)).tolist()]
    placement = placement_of(problem, frame_of(problem), q, state)
    assert [1.3 * cost for cost in costs] == pytest.approx(
        [pair.expected_error_m for pair in placement.pairs], rel=1e-6
    )
    assert_gradients(q, list_elements(q, state, np.ones(4, dtype=np.int64)), poses_of(q, state))


def assert_gradients(q: Question, rows: Ints, poses: Floats) -> None:
    """Hold the gradients of elements against differences of their values."""
    gradient, unused, work = np.empty(8), np.empty(8), np.empty((6, 5))
    step = 1e-5
    for row in rows:
        element(q, row, poses, gradient, work)
        for k in range(8):
            host = row[1] if k < 4 else row[2]
            if host < 0:
                assert gradient[k] == 0
                continue
            ahead, behind = poses.copy(), poses.copy()
            ahead[host, k % 4] += step
            behind[host, k % 4] -= step
            slope = (element(q, row, ahead, unused, work) - element(q, row, behind, unused, work)) / (2 * step)
            assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-8), (row, k)


def problem_in_space(objective: Objective) -> Problem:
    """Climbing threats at several altitudes, a fence, a keep-out area and hosts that know their pose only roughly."""
    threats = tuple(
        replace(t, position_m=(*t.position_m[:2], 30.0 + 6.0 * k), velocity_mps=(*t.velocity_mps[:2], 0.7))
        for k, t in enumerate(random_threats(3, np.random.default_rng(4)))
    )
    airspace = Airspace(
        inside=(((-60.0, -70.0), (130.0, -60.0), (120.0, 140.0), (-70.0, 120.0)),),
        keep_outs=(KeepOut(polygon=((25.0, 25.0), (34.0, 27.0), (28.0, 36.0)), floor_m=10.0, ceiling_m=40.0),),
        floor_m=5.0,
        ceiling_m=90.0,
    )
    return Problem(
        threats=threats,
        objective=objective,
        airspace=airspace,
        position_sigma_m=0.3,
        attitude_sigma_rad=0.01,
        lead_s=3.0,
    )


@pytest.mark.parametrize("objective", list(Objective))
def test_a_states_cost_in_space_is_that_of_the_reference(objective: Objective) -> None:
    problem = problem_in_space(objective)
    q, state = annealed(problem, 4, seed=1, moves=60_000)
    require_agreement(problem, q, state)


@pytest.mark.parametrize("objective", list(Objective))
def test_gradients_in_space_among_areas_are_the_slopes_too(objective: Objective) -> None:
    problem = problem_in_space(objective)
    kinds: set[int] = set()
    for seed in range(4):
        q, state = annealed(problem, 4, seed)
        rows = list_elements(q, state, np.ones(4, dtype=np.int64))
        kinds |= {int(row[0]) for row in rows}
        assert_gradients(q, rows, poses_of(q, state))
    assert {COST, PIXELS, PATH, CONE, FLOOR, CEILING, FENCE, KEEP_OUT} <= kinds
    assert PAN not in kinds


@pytest.mark.parametrize("seed", range(5))
def test_the_cone_around_what_a_central_camera_sees_is_the_narrowest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    threats = tuple(
        Threat(id=str(k), position_m=(float(x), 60.0 + float(y), 40.0 + float(z)), velocity_mps=(1.0, 0.5, -0.5))
        for k, (x, y, z) in enumerate(rng.uniform(-15, 15, (3, 3)))
    )
    problem = Problem(threats=threats, airspace=Airspace(floor_m=5.0, ceiling_m=90.0))
    frame = frame_of(problem)
    q, state = question_of(problem, frame), new_state(3, 2)
    state.positions[:] = frame.inward(np.array([[0.0, 0.0, 30.0], [0.0, 130.0, 30.0]]))
    for threat in range(3):
        set_view(state, threat, 0, 0, CENTRAL)
        set_view(state, threat, 1, 1, PERIPHERAL)
    x, y, z, across = central_cone(q, state.positions, 0, state.incident[0], 3, state.cameras)
    rays = q.points_m.reshape(-1, 3) - state.positions[0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert across == pytest.approx(2 * float(np.arccos(rays @ (x, y, z)).max()), abs=1e-9)
    trials = rays.mean(axis=0) + 0.2 * rng.normal(size=(20_000, 3))
    trials /= np.linalg.norm(trials, axis=1, keepdims=True)
    narrowest = 2 * float(np.arccos((trials @ rays.T).min(axis=1)).min())
    assert across <= narrowest + math.radians(1.0)
    assert np.allclose(middle_direction(rays), (x, y, z), atol=0.02)


@pytest.mark.parametrize("formulation", list(Formulation))
def test_polishing_ends_where_no_small_valid_step_gains_anything(formulation: Formulation) -> None:
    rng = np.random.default_rng(5)
    q, state = annealed(some_problem(formulation, Objective.LETTER), 4, seed=2)
    before, _ = totals(q, state)
    assert polish(q, state, np.ones(4, dtype=np.int64), 80)
    after, violation = totals(q, state)
    assert violation == 0
    assert after < before
    positions, axes = state.positions.copy(), state.axes.copy()
    for _ in range(3000):
        scale = 10 ** rng.uniform(-4, -1)
        state.positions[:, :2] = positions[:, :2] + scale * METRE * rng.normal(size=(4, 2))
        turn = 0.05 * scale * rng.normal(size=4)
        state.axes[:, 0] = axes[:, 0] * np.cos(turn) + axes[:, 1] * np.sin(turn)
        state.axes[:, 1] = axes[:, 1] * np.cos(turn) - axes[:, 0] * np.sin(turn)
        refresh(q, state)
        cost, violation = totals(q, state)
        assert violation > 0 or cost > after * (1 - 1e-5)


def test_polishing_some_hosts_leaves_the_others_where_they_are() -> None:
    q, state = annealed(some_problem(Formulation.OPERATIONAL, Objective.LETTER), 4, seed=2)
    positions: Floats = state.positions.copy()
    polish(q, state, np.array([1, 0, 0, 1], dtype=np.int64), 80)
    assert (state.positions[1:3] == positions[1:3]).all()
    assert totals(q, state)[1] == 0


def test_a_host_inside_a_safety_zone_is_put_outside() -> None:
    q, state = annealed(some_problem(Formulation.OPERATIONAL, Objective.LETTER), 4, seed=2)
    middle = q.points_m[0].mean(axis=0)
    state.positions[1] = middle + np.array([0.5, 0.3, 0.0])
    keep_clear(q, state, 1)
    assert math.dist(state.positions[1], middle) >= q.safety_m
    refresh(q, state)
    assert state.window[1] >= 0
