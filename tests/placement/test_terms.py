"""The solver's arrays against the exact reference, and their gradients against finite differences."""

import numpy as np
import pytest

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.placement.feasibility import CENTRAL
from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.objective import evaluate as evaluate_exactly
from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.solution import HoverPose, View
from hsop_gcs.placement.terms import Terms, Views, evaluate
from tests.placement.examples import random_threats

PAIRS = [(0, 1), (1, 2), (3, 1)]
BATCH = 40


def decaying(margin: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.exp(-margin), -np.exp(-margin)


def case(formulation: Formulation, seed: int, rig: CameraRig | None = None) -> tuple[Problem, FloatArray, Views]:
    rng = np.random.default_rng(seed)
    problem = Problem(threats=random_threats(3, rng), formulation=formulation, rig=rig or CameraRig())
    batch = np.concatenate([rng.uniform(-20, 80, (BATCH, 4, 2)), rng.uniform(0, 2 * np.pi, (BATCH, 4, 2))], axis=2)
    host = np.tile(np.array(PAIRS).ravel(), (BATCH, 1))
    return problem, batch, Views(np.repeat(np.arange(3), 2), host, rng.integers(0, 2, host.shape))


@pytest.mark.parametrize("formulation", list(Formulation))
def test_cost_and_feasibility_are_those_of_the_exact_reference(formulation: Formulation) -> None:
    problem, batch, views = case(formulation, seed=1)
    terms = evaluate(Instance.of(problem), batch, views, decaying)
    for k in range(BATCH):
        hosts = [
            HoverPose(
                host=str(h),
                position_m=(float(x), float(y), 0.0),
                heading_deg=float(np.degrees(heading)),
                pan_deg=float(np.degrees(pan)),
            )
            for h, (x, y, heading, pan) in enumerate(batch[k])
        ]
        seen = {}
        for t, threat in enumerate(problem.threats):
            kinds = [CameraKind.CENTRAL if c == CENTRAL else CameraKind.PERIPHERAL for c in views.camera[k, 2 * t :]]
            first, second = (View(host=str(h), camera=c) for h, c in zip(PAIRS[t], kinds[:2], strict=True))
            seen[threat.id] = (first, second)
        worth = evaluate_exactly(problem, hosts, seen)
        assert np.exp(terms.log_cost[k]) == pytest.approx(worth.cost, rel=1e-9)
        np.testing.assert_allclose(terms.pair_cost[k], list(worth.pair_costs.values()), rtol=1e-9)
        relative = min(
            worth.margins.distance_m / problem.safety_distance_m,
            worth.margins.fov_deg / (problem.rig.central.fov_deg / 2),
            worth.margins.separation_m / problem.min_separation_m,
        )
        assert terms.margin[k] <= relative + 1e-9
        assert (terms.margin[k] >= 0) == worth.margins.feasible


@pytest.mark.parametrize("formulation", list(Formulation))
@pytest.mark.parametrize("name", ["log_cost", "shaped"])
@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.05, 0.01, -0.001, 0.0)])
def test_slopes_are_finite_differences(
    formulation: Formulation, name: str, distortion: tuple[float, float, float, float]
) -> None:
    rig = CameraRig(peripheral=FisheyeCamera(distortion=distortion))
    problem, batch, views = case(formulation, seed=2, rig=rig)
    instance = Instance.of(problem)

    def at(poses: FloatArray) -> Terms:
        return evaluate(instance, poses, views, decaying)

    slope, step = getattr(at(batch), f"{name}_slope"), 1e-6
    for host in range(batch.shape[1]):
        for variable in range(4):
            ahead, behind = batch.copy(), batch.copy()
            ahead[:, host, variable] += step
            behind[:, host, variable] -= step
            difference = (getattr(at(ahead), name) - getattr(at(behind), name)) / (2 * step)
            np.testing.assert_allclose(slope[:, host, variable], difference, rtol=1e-4, atol=1e-5)
