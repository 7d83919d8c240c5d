"""A placement that may be partial sees what can be seen, the most valuable first, in its time, and names the rest."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hsop_gcs.placement import place
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon
from hsop_gcs.placement.objective import margins
from hsop_gcs.placement.partial import without
from hsop_gcs.placement.problem import AvailableHost, Objective, Problem, Threat
from hsop_gcs.placement.scenario import plan_to_json
from hsop_gcs.placement.solution import Placement, Status
from tests.oracles.check_plan import check
from tests.placement.examples import random_threats

FENCE: Polygon = ((-100.0, -100.0), (100.0, -100.0), (100.0, 100.0), (-100.0, 100.0))
NEAR = Threat(id="near", position_m=(0.0, 60.0, 40.0), velocity_mps=(0.5, -0.5, 0.0))
FAR = Threat(id="far", position_m=(400.0, 0.0, 40.0))


def hosts(count: int) -> tuple[AvailableHost, ...]:
    return tuple(AvailableHost(id=f"h{k}", position_m=(-60.0, 12.0 * k, 40.0)) for k in range(count))


def cluster(name: str, count: int, east_m: float, weight: float = 1.0) -> tuple[Threat, ...]:
    return tuple(
        Threat(id=f"{name}{k}", position_m=(east_m + 15.0 * k, 60.0, 40.0), weight=weight) for k in range(count)
    )


def asked(*threats: Threat, count: int = 4, airspace: Airspace | None = None) -> Problem:
    return Problem(
        threats=threats, hosts=hosts(count), max_hosts=count, objective=Objective.RMS, airspace=airspace or Airspace()
    )


def placed(problem: Problem, **given: Any) -> Placement:
    settings: dict[str, Any] = {"iterations": 1, "now": lambda: 0.0, "until_settled": True} | given
    placement = place(problem, partial=True, **settings)
    if placement.hosts:
        keeps_every_rule(problem, placement)
    seen = {pair.threat for pair in placement.pairs}
    assert seen.isdisjoint(placement.left_out)
    assert placement.status is not Status.PARTIAL or seen | set(placement.left_out) == {t.id for t in problem.threats}
    assert all(threat in why for threat, why in placement.left_out.items())
    return placement


def keeps_every_rule(problem: Problem, placement: Placement) -> None:
    """Also those for the threats that it does not see: every host keeps clear of them."""
    rest = without(problem, placement.left_out)
    views = {pair.threat: pair.views for pair in placement.pairs}
    assert margins(rest, placement.hosts, views).feasible


def seen(placement: Placement) -> set[str]:
    return {pair.threat for pair in placement.pairs}


class Clock:
    """A clock that gains a hundredth of a second with every look, and remembers the last one."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 0.01
        return self.now_s


def test_a_threat_beyond_the_fence_is_left_out_and_the_rest_is_placed_for() -> None:
    placement = placed(asked(NEAR, FAR, airspace=Airspace(inside=(FENCE,))))
    assert (placement.status, seen(placement)) == (Status.PARTIAL, {"near"})
    assert placement.left_out["far"].startswith("threat far is 300.0 m outside the fence")


@pytest.mark.parametrize(
    ("airspace", "threat", "why"),
    [
        (
            Airspace(keep_outs=(KeepOut(polygon=tuple((x + 400.0, y) for x, y in FENCE)),)),
            FAR,
            "the keep-out areas leave no hover point",
        ),
        (Airspace(ceiling_m=120.0), replace(FAR, position_m=(0.0, 90.0, 400.0)), "beyond the ceiling of 120 m"),
        (Airspace(), replace(FAR, velocity_mps=(90.0, 0.0, 0.0)), "flies 900.0 m within the horizon"),
        (Airspace(), replace(FAR, size_m=0.1), "inside the safety distance"),
    ],
)
def test_whatever_keeps_one_threat_from_being_seen_does_not_cost_the_others(
    airspace: Airspace, threat: Threat, why: str
) -> None:
    placement = placed(asked(NEAR, threat, airspace=airspace))
    assert seen(placement) == {"near"}
    assert why in placement.left_out["far"]


def test_a_threat_that_hosts_see_from_the_fence_is_seen() -> None:
    beyond = Threat(id="beyond", position_m=(150.0, 0.0, 40.0))
    assert seen(placed(asked(NEAR, beyond, airspace=Airspace(inside=(FENCE,))))) == {"near", "beyond"}


def test_if_none_can_be_seen_each_is_named_and_the_placement_is_infeasible() -> None:
    farther = replace(FAR, id="farther", position_m=(900.0, 0.0, 40.0))
    placement = placed(asked(FAR, farther, airspace=Airspace(inside=(FENCE,))))
    assert placement.status is Status.INFEASIBLE
    assert set(placement.left_out) == {"far", "farther"}
    assert "outside the fence" in placement.reason


@pytest.mark.parametrize("count", [0, 1])
def test_a_host_by_itself_sees_nothing(count: int) -> None:
    problem = replace(asked(NEAR, FAR, count=count), max_hosts=count)
    placement = placed(problem)
    assert placement.status is Status.INFEASIBLE
    assert "at least 2 are needed" in placement.reason


def test_of_two_clusters_far_apart_two_hosts_see_the_larger_one() -> None:
    placement = placed(asked(*cluster("a", 2, 0.0), *cluster("b", 4, 900.0), count=2))
    assert seen(placement) == {"b0", "b1", "b2", "b3"}
    assert len(placement.hosts) == 2
    assert placement.left_out["a0"] == "threat a0 is left for 4 others: no placement of 2 hosts for all 6 was found"


def test_of_two_that_are_alike_the_nearer_one_is_seen() -> None:
    assert seen(placed(asked(*cluster("a", 2, 900.0), *cluster("b", 2, 0.0), count=3))) == {"b0", "b1"}


def test_one_that_weighs_more_comes_before_any_number_of_others() -> None:
    placement = placed(asked(*cluster("light", 4, 0.0), *cluster("heavy", 1, 900.0, weight=3.0), count=3))
    assert seen(placement) == {"heavy0"}


def test_five_hosts_see_some_of_sixty_threats() -> None:
    threats = random_threats(60, np.random.default_rng(1), side_m=500.0)
    placement = placed(asked(*threats, count=5))
    assert placement.status is Status.PARTIAL
    assert len(placement.pairs) >= 10
    assert len(placement.hosts) <= 5


@pytest.mark.parametrize("time_limit_s", [0.3, 0.6])
def test_what_is_found_in_the_time_is_a_placement_and_is_found_again_by_its_iterations(time_limit_s: float) -> None:
    """The clock gains with every look at it: steps of the search take no time, and are counted by it."""
    problem = asked(*random_threats(40, np.random.default_rng(2), side_m=400.0), count=20)
    clock = Clock()
    placement = placed(problem, iterations=None, time_limit_s=time_limit_s, now=clock)
    assert len(placement.pairs) >= 5
    assert clock.now_s < time_limit_s + 0.3
    again = placed(problem, iterations=placement.iterations, now=lambda: math.nan)
    assert (again.hosts, again.pairs) == (placement.hosts, placement.pairs)


def test_time_for_a_few_steps_is_enough_for_a_hundred_threats_and_the_oracle_takes_the_plan() -> None:
    side_m = 506.0
    threats = random_threats(100, np.random.default_rng(3), side_m=side_m)
    rng = np.random.default_rng(4)
    homes = tuple(
        AvailableHost(id=f"h{k}", position_m=(float(x), float(y), 0.0))
        for k, (x, y) in enumerate(rng.uniform(0.0, side_m, (150, 2)))
    )
    problem = Problem(threats=threats, hosts=homes)
    clock = Clock()
    placement = placed(problem, iterations=None, time_limit_s=1.2, now=clock)
    assert placement.status is Status.FEASIBLE
    assert clock.now_s < 1.5
    verdict = check(_scenario(problem), plan_to_json(placement), segment=True)
    assert verdict["ok"], verdict["problems"]


def _scenario(problem: Problem) -> dict[str, Any]:
    return {
        "threats": [
            {"id": t.id, "position_m": list(t.position_m), "velocity_mps": list(t.velocity_mps)}
            for t in problem.threats
        ]
    }
