"""How far ahead threats are planned for: as far as their velocities are known."""

import pytest

from hsop_gcs.assignment import Mover
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Sigma, Situation
from hsop_gcs.placement.problem import Point, Threat
from tests.detections.examples import METRE

MOVERS = tuple(Mover(id=f"h{k}", position_m=(-150.0, 12.0 * k, 40.0), speed_mps=8.0) for k in range(2))
RULES = PlanningRules(horizon_s=10.0, safety_distance_m=20.0)


def decided(velocity_mps: Point, velocity_sigma_mps: float) -> Decision:
    threat = Threat(id="t1", position_m=(0.0, 60.0, 40.0), velocity_mps=velocity_mps)
    sigmas = (Sigma(position_m=1.0, velocity_mps=velocity_sigma_mps),)
    asked = Situation(now_s=1e9, threats=(threat,), sigmas=sigmas, movers=MOVERS)
    return decide(asked, RULES, now=lambda: 0.0, iterations=(2, 2))


def test_a_velocity_that_is_known_is_planned_for() -> None:
    decision = decided((0.5, 0.0, 0.0), 0.1)
    (then,) = decision.threats
    assert then.velocity_mps == (0.5, 0.0, 0.0)
    assert then.position_m[0] == pytest.approx(0.5 * (decision.window_start_s - 1e9), abs=1e-6 * METRE)


def test_a_climb_that_is_hardly_known_takes_no_threat_out_of_sight() -> None:
    decision = decided((0.0, 0.0, 3.0), 3.0)
    (then,) = decision.threats
    reached_m = then.predicted_m(RULES.horizon_s)[2]
    assert reached_m == pytest.approx(40.0 + 3.0 * RULES.safety_distance_m / 3.0, abs=1e-6 * METRE)
    assert len(decision.orders) == 2
