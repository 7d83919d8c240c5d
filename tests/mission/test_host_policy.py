"""How many hosts a decision places, what it starts from, and that it is made again from its iterations alone."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from hsop_gcs.assignment import Mover
from hsop_gcs.mission.inputs import MissionStarted, Rules
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Sigma, Situation, TargetError
from hsop_gcs.mission.records import from_record, to_record
from hsop_gcs.placement.problem import Threat
from hsop_gcs.placement.solution import worst_error_m
from tests.placement.examples import random_threats

TEN_S = 10.0
Hosts = int | Literal["fewest", "all"] | TargetError


def movers(count: int) -> tuple[Mover, ...]:
    return tuple(Mover(id=f"h{k}", position_m=(-60.0, 12.0 * k, 40.0), speed_mps=8.0) for k in range(count))


def situation(threats: int, hosts: int) -> Situation:
    aloft = tuple(
        replace(threat, position_m=(*threat.position_m[:2], 40.0))
        for threat in random_threats(threats, np.random.default_rng(4))
    )
    return Situation(now_s=1e9, threats=aloft, movers=movers(hosts))


def decided(asked: Situation, hosts: Hosts, *, rounds: tuple[int, ...] = (4, 4)) -> Decision:
    rules = PlanningRules(hosts=hosts)
    return decide(asked, rules, now=lambda: 0.0, iterations=rounds)


def test_fewest_all_and_a_number_place_so_many_hosts() -> None:
    asked = situation(2, 5)
    counts = [len(decided(asked, hosts).placement.hosts) for hosts in ("fewest", "all", 3, 9)]
    assert counts == [2, 4, 3, 4]


@pytest.mark.parametrize(("hosts", "reason"), [(0, "0 can be sent"), (1, "1 host is available")])
def test_too_few_hosts_for_any_plan_are_an_answer(hosts: int, reason: str) -> None:
    decision = decided(situation(2, hosts), "all")
    assert decision.orders == ()
    assert reason in decision.reason


@pytest.mark.parametrize(("sigma_m", "away_m"), [(0.5, 24.0), (6.0, 32.0), (40.0, 40.0)])
def test_the_less_is_known_of_a_threat_the_farther_away_its_hosts_hover(sigma_m: float, away_m: float) -> None:
    asked = situation(1, 2)
    unsure = replace(asked, sigmas=(Sigma(position_m=sigma_m, velocity_mps=0.0),))
    (threat,) = asked.threats
    at_rest = replace(unsure, threats=(replace(threat, velocity_mps=(0.0, 0.0, 0.0)),))
    poses = decided(at_rest, "all").placement.hosts
    assert min(math.dist(pose.position_m, threat.position_m) for pose in poses) == pytest.approx(away_m, rel=0.05)


def test_a_target_error_takes_no_more_hosts_than_it_needs() -> None:
    asked = situation(3, 6)
    target_m = 1.01 * worst_error_m(decided(asked, 5).placement)
    within = decided(asked, TargetError(target_error_m=target_m)).placement
    assert worst_error_m(within) <= target_m
    assert len(within.hosts) <= 5
    assert worst_error_m(decided(asked, len(within.hosts) - 1).placement) > target_m


def test_all_hosts_are_placed_for_an_error_that_none_reach() -> None:
    assert len(decided(situation(3, 4), TargetError(target_error_m=0.001)).placement.hosts) == 4


def test_the_target_is_the_default_and_survives_the_journal() -> None:
    started = MissionStarted(time_s=1e9, rules=Rules(), hosts=())
    assert started.rules.planning.hosts == TargetError(target_error_m=1.0)
    kind, data = to_record(started)
    assert from_record(kind, data, 1e9) == started


class Clock:
    """A clock that gains 5 ms with every look."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 0.005
        return self.now_s


@pytest.mark.parametrize("hosts", ["fewest", "all", TargetError()])
def test_a_decision_that_starts_from_the_flying_plan_is_made_again_from_its_iterations(hosts: Hosts) -> None:
    asked = situation(3, 8)
    first = decide(asked, PlanningRules(hosts=hosts), now=Clock())
    new = Threat(id="new", position_m=(20.0, 75.0, 40.0), velocity_mps=(1.0, -2.0, 0.0))
    later = replace(
        asked,
        threats=(*(replace(t, position_m=t.predicted_m(TEN_S)) for t in asked.threats), new),
        flying=first.placement,
    )
    rules = PlanningRules(hosts=hosts)
    made = decide(later, rules, now=Clock())
    again = decide(later, rules, now=lambda: math.nan, iterations=made.iterations)
    assert made.placement.cost is not None
    assert again.placement.cost == made.placement.cost
    assert again.orders == made.orders
    assert again.placement.hosts == made.placement.hosts
    assert again.iterations == made.iterations


def test_a_settled_search_ends_before_its_time() -> None:
    rules = PlanningRules(time_limit_s=math.inf)
    assert decide(situation(1, 2), rules, now=lambda: 0.0).iterations[0] < 20
