"""The interior-point method on problems whose answers are known."""

import math

import numpy as np
import pytest

from hsop_gcs.placement.feasibility import CENTRAL
from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.interior_point import INSIDE, Rows, margins, minimise, reach_feasibility, solve
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.terms import Views

METRE = 1.0


def two_central_hosts(count: int) -> Views:
    return Views(np.array([0, 0]), np.tile([0, 1], (count, 1)), np.full((count, 2), CENTRAL))


def at_rest(formulation: Formulation = Formulation.LETTER) -> Instance:
    return Instance.of(Problem(threats=(Threat(id="t1", position_m=(0.0, 0.0, 0.0)),), formulation=formulation))


def test_every_row_of_a_batch_finds_the_minimum_of_its_own_quadratic() -> None:
    rng = np.random.default_rng(0)
    roots = rng.normal(size=(20, 6, 6))
    matrices = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(6)
    minima = rng.normal(size=(20, 6))

    def quadratic(points: FloatArray, rows: Rows) -> tuple[FloatArray, FloatArray]:
        away = points - minima[rows]
        slope = (matrices[rows] @ away[:, :, None])[:, :, 0]
        return (away * slope).sum(axis=1) / 2, slope

    found = minimise(quadratic, np.zeros((20, 6)), steps=200, tolerance=1e-20)
    np.testing.assert_allclose(found, minima, atol=1e-6)


def test_hosts_around_a_threat_at_rest_stand_at_the_safety_distance_and_look_at_right_angles() -> None:
    rng = np.random.default_rng(1)
    start = np.concatenate([rng.uniform(-30, 30, (16, 2, 2)), rng.uniform(0, 2 * np.pi, (16, 2, 2))], axis=2)
    solution = solve(at_rest(), start, two_central_hosts(16), steps=200)
    best = solution.batch[solution.cost.argmin()]
    assert solution.cost.min() == pytest.approx(2 * (400 / 1280) ** 2, rel=1e-4)
    np.testing.assert_allclose(np.hypot(best[:, 0], best[:, 1]), 20.0, atol=1e-2 * METRE)
    turn = math.atan2(*best[0, :2]) - math.atan2(*best[1, :2])
    assert abs(math.sin(turn)) == pytest.approx(1.0, abs=1e-3)


def test_a_start_that_breaks_the_rules_is_moved_until_it_keeps_them() -> None:
    instance = at_rest(Formulation.OPERATIONAL)
    too_near = np.array([[[3.0, 1.0, 0.0, 2.0], [2.0, 4.0, 0.0, 1.0]]])
    views = two_central_hosts(1)
    assert margins(instance, too_near, views).margin[0] < 0
    assert margins(instance, reach_feasibility(instance, too_near, views), views).margin[0] > INSIDE


def test_solutions_keep_every_rule_and_are_no_dearer_than_their_feasible_starts() -> None:
    instance = Instance.of(
        Problem(threats=(Threat(id="t1", position_m=(0.0, 0.0, 0.0), velocity_mps=(2.0, 1.0, 0.0)),))
    )
    rng = np.random.default_rng(2)
    start = np.concatenate([rng.uniform(-40, 60, (200, 2, 2)), rng.uniform(0, 2 * np.pi, (200, 2, 2))], axis=2)
    views = two_central_hosts(200)
    start = reach_feasibility(instance, start, views)
    before = margins(instance, start, views)
    solution = solve(instance, start, views)
    solved = np.isfinite(solution.cost)
    after = margins(instance, solution.batch, views)
    assert solved.sum() > 100
    assert (after.margin[solved] > 0).all()
    comparable = solved & (before.margin > INSIDE)
    assert comparable.sum() > 100
    assert (solution.cost[comparable] <= np.exp(before.log_cost[comparable]) * (1 + 1e-2)).all()


def test_what_no_pose_can_do_ends_without_a_cost() -> None:
    fast = Problem(
        threats=(Threat(id="t1", position_m=(0.0, 0.0, 0.0), velocity_mps=(5.0, 0.0, 0.0)),),
        formulation=Formulation.LETTER,
    )
    rng = np.random.default_rng(3)
    start = np.concatenate([rng.uniform(-40, 60, (20, 2, 2)), rng.uniform(0, 2 * np.pi, (20, 2, 2))], axis=2)
    assert np.isinf(solve(Instance.of(fast), start, two_central_hosts(20)).cost).all()
