"""A threat that nobody can see, or too many for the hosts and the time, do not cost the others their plan."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.assignment import Mover
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.objective import segment_distance
from hsop_gcs.placement.problem import Threat
from tests.placement.examples import random_threats

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
    for pose, alone in zip(decision.placement.hosts, decided(CALM).placement.hosts, strict=True):
        assert pose.position_m == pytest.approx(alone.position_m, abs=1e-6)
    assert [threat.id for threat in decision.threats] == ["calm", "high"]
    assert list(decision.left_out) == ["high"]
    assert "high is 280.0 m beyond the ceiling of 120 m" in decision.left_out["high"]


def test_no_host_hovers_in_the_way_of_one_that_is_left_out() -> None:
    decision = decided(CALM, FAST)
    assert "threat fast flies 900.0 m" in decision.left_out["fast"]
    way = np.array([FAST.position_m, FAST.predicted_m(30.0)])
    assert len(decision.orders) == 2
    assert min(segment_distance(order.position_m, *way) for order in decision.orders) >= 20.0


def test_one_that_passes_far_away_is_left_out() -> None:
    decision = decided(CALM, replace(FAST, position_m=(-500.0, 900.0, 40.0)))
    assert len(decision.orders) == 2
    assert list(decision.left_out) == ["fast"]


def test_if_nobody_can_see_any_the_reason_says_so() -> None:
    decision = decided(HIGH)
    assert (decision.orders, decision.left_out) == ((), {})
    assert "high is 280.0 m beyond" in decision.reason


class Clock:
    """A clock that gains a hundredth of a second with every look at it."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 0.01
        return self.now_s


def crowd(threats: int, hosts: int, side_m: float) -> Situation:
    aloft = tuple(
        replace(threat, position_m=(*threat.position_m[:2], 40.0))
        for threat in random_threats(threats, np.random.default_rng(5), side_m)
    )
    movers = tuple(Mover(id=f"h{k}", position_m=(-60.0, 12.0 * k, 40.0), speed_mps=8.0) for k in range(hosts))
    return Situation(now_s=1e9, threats=aloft, movers=movers)


def is_whole(decision: Decision, asked: Situation) -> bool:
    """Whether every threat is seen or named, and every order is for what is seen."""
    seen = {pair.threat for pair in decision.placement.pairs}
    viewed = {threat for order in decision.orders for threat, _ in order.views}
    named = all(threat in why for threat, why in decision.left_out.items())
    return named and viewed == seen and sorted([*seen, *decision.left_out]) == sorted(t.id for t in asked.threats)


@pytest.mark.parametrize(("threats", "hosts", "side_m", "least"), [(40, 20, 400.0, 8), (12, 5, 300.0, 2)])
def test_a_decision_within_its_time_limit_gives_a_plan(threats: int, hosts: int, side_m: float, least: int) -> None:
    asked, clock = crowd(threats, hosts, side_m), Clock()
    rules = PlanningRules(time_limit_s=3.0)
    decision = decide(asked, rules, now=clock)
    assert decision.orders, decision.reason
    assert len(decision.placement.pairs) >= least
    assert clock.now_s < 3.3
    assert is_whole(decision, asked)
    again = decide(asked, rules, now=lambda: math.nan, iterations=decision.iterations)
    assert (again.orders, again.iterations) == (decision.orders, decision.iterations)
    assert set(again.left_out) == set(decision.left_out)


def test_a_decision_that_is_come_to_late_takes_what_is_left_of_its_time() -> None:
    asked, clock = crowd(12, 5, 300.0), Clock()
    decision = decide(asked, PlanningRules(time_limit_s=3.0), now=clock, late_s=2.0)
    assert clock.now_s < 1.3
    assert is_whole(decision, asked) or not decision.orders


def test_after_a_loss_three_hosts_watch_one_of_two_threats_that_are_far_apart() -> None:
    asked = crowd(1, 3, 60.0)
    far = Threat(id="far", position_m=(900.0, 0.0, 40.0))
    both = replace(asked, threats=(*asked.threats, far))
    decision = decide(both, PlanningRules(), now=lambda: 0.0, iterations=(1, 1))
    assert [pair.threat for pair in decision.placement.pairs] == ["t1"]
    assert "left for the other" in decision.left_out["far"]
    assert is_whole(decision, both)


def test_a_plan_for_some_of_the_threats_is_kept_while_no_other_sees_more() -> None:
    asked = crowd(2, 2, 60.0)
    others = tuple(Threat(id=f"far{k}", position_m=(900.0 + 15.0 * k, 0.0, 40.0)) for k in range(2))
    two = replace(asked, threats=(*asked.threats, *others))
    rules = PlanningRules()
    first = decide(two, rules, now=lambda: 0.0, iterations=(1, 1))
    again = decide(replace(two, flying=first.placement), rules, now=lambda: 0.0, iterations=(1, 1))
    assert again.keeps
    assert is_whole(again, two)
    others = tuple(Threat(id=f"far{k}", position_m=(900.0 + 15.0 * k, 0.0, 40.0)) for k in range(2, 5))
    more = replace(two, threats=(*two.threats, *others), flying=first.placement)
    seen = {pair.threat for pair in decide(more, rules, now=lambda: 0.0, iterations=(1, 1)).placement.pairs}
    assert seen == {"far0", "far1", "far2", "far3", "far4"}


def test_a_threat_whose_hosts_cannot_get_there_is_left_out_and_the_others_are_flown_for() -> None:
    """A wall of keep-outs, too high to fly over, between the hosts and one of two threats."""
    wall = KeepOut(polygon=((200.0, -3000.0), (210.0, -3000.0), (210.0, 3000.0), (200.0, 3000.0)))
    fence = ((-500.0, -2900.0), (1200.0, -2900.0), (1200.0, 2900.0), (-500.0, 2900.0))
    asked = crowd(1, 4, 60.0)
    behind = Threat(id="behind", position_m=(600.0, 0.0, 40.0))
    both = replace(asked, threats=(*asked.threats, behind))
    rules = PlanningRules(airspace=Airspace(inside=(fence,), keep_outs=(wall,)))
    decision = decide(both, rules, now=lambda: 0.0, iterations=(1, 1))
    assert [pair.threat for pair in decision.placement.pairs] == ["t1"]
    assert "can reach" in decision.left_out["behind"]
    assert is_whole(decision, both)
