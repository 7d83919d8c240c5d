"""A threat that nobody can see does not cost the others their plan."""

from dataclasses import replace

from hsop_gcs.assignment import Mover
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.placement.problem import Threat

CALM = Threat(id="calm", position_m=(0.0, 60.0, 40.0), velocity_mps=(0.5, -0.5, 0.0))
HIGH = Threat(id="high", position_m=(0.0, 60.0, 400.0), velocity_mps=(3.0, 0.0, 0.0))
FAST = Threat(id="fast", position_m=(-500.0, 40.0, 40.0), velocity_mps=(90.0, 0.0, 0.0))


def decided(*threats: Threat) -> Decision:
    movers = tuple(Mover(id=f"h{k}", position_m=(-40.0, 12.0 * k, 40.0), speed_mps=8.0) for k in range(2))
    return decide(
        Situation(now_s=1e9, threats=threats, movers=movers), PlanningRules(), now=lambda: 0.0, iterations=(2, 4)
    )


def test_the_others_are_planned_for_as_if_it_were_not_there() -> None:
    decision = decided(CALM, HIGH)
    assert [pair.threat for pair in decision.placement.pairs] == ["calm"]
    assert decision.placement.hosts == decided(CALM).placement.hosts
    assert [threat.id for threat in decision.threats] == ["calm", "high"]
    assert list(decision.left_out) == ["high"]
    assert "high is 280.0 m beyond the ceiling of 120 m" in decision.left_out["high"]


def test_no_host_hovers_in_the_way_of_one_that_is_left_out() -> None:
    decision = decided(CALM, FAST)
    assert decision.orders == ()
    assert "from the path of a threat to be left out: threat fast flies 900.0 m" in decision.reason


def test_one_that_passes_far_away_is_left_out() -> None:
    decision = decided(CALM, replace(FAST, position_m=(-500.0, 900.0, 40.0)))
    assert len(decision.orders) == 2
    assert list(decision.left_out) == ["fast"]


def test_if_nobody_can_see_any_the_reason_says_so() -> None:
    decision = decided(HIGH)
    assert (decision.orders, decision.left_out) == ((), {})
    assert "high is 280.0 m beyond" in decision.reason
