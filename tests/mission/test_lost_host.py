"""A host that is lost on its way: the others keep clear of where it may be, and the mission goes on without it."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from hsop_gcs.assignment import Flight, Mover, in_the_way
from hsop_gcs.assignment.separation import gap_m
from hsop_gcs.journal import Journal
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.problem import Threat
from hsop_gcs.replay import replay
from hsop_gcs.simulator.faults import parse_fault
from hsop_gcs.simulator.fleet import Autopilot
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import Flight as Mission
from tests.mission.headless import Moment, decide_in_rounds, fly, straight

SEPARATION_M = 10.0
RULES = PlanningRules(min_separation_m=SEPARATION_M)
CALM = Threat(id="calm", position_m=(0.0, 60.0, 40.0), velocity_mps=(0.0, 0.0, 0.0))
ROUNDS = (2, 2)


def decided(asked: Situation) -> Decision:
    return decide(asked, RULES, now=lambda: 0.0, iterations=ROUNDS)


def asked(*standing: Flight) -> Situation:
    movers = tuple(Mover(id=f"h{k}", position_m=(-60.0, 14.0 * k, 40.0), speed_mps=8.0) for k in range(3))
    return Situation(now_s=1e9, threats=(CALM,), movers=movers, standing=standing)


def test_hover_points_and_ways_keep_clear_of_where_a_lost_host_may_be_and_it_gets_no_order() -> None:
    before = decided(asked())
    goal_m = before.orders[0].position_m
    lost = Flight(host="h9", points_m=((goal_m[0], goal_m[1] - 50.0, goal_m[2]), goal_m))
    after = decided(asked(lost))
    assert len(after.orders) == 2
    places = {mover.id: mover.position_m for mover in asked().movers}
    for order in after.orders:
        way = Flight(host=order.host, points_m=(places[order.host], *order.via_m, order.position_m))
        assert in_the_way(way, [lost], SEPARATION_M) is None


@pytest.mark.parametrize("at_a_hover_point", [True, False])
def test_a_plan_is_kept_unless_somebody_who_cannot_be_sent_is_where_it_leads(at_a_hover_point: bool) -> None:
    before = decided(asked())
    east, north, up = before.orders[0].position_m
    stands = Flight(host="h9", points_m=((east + (4.0 if at_a_hover_point else 200.0), north, up),))
    again = decided(replace(asked(stands), flying=before.placement))
    assert again.keeps is not at_a_hover_point


def test_a_plan_is_not_kept_when_a_hosts_way_to_its_hover_point_is_barred() -> None:
    before = decided(asked())
    corners = [(20.0, 95.0, 5.0), (20.0, 10.0, 115.0), (-45.0, 10.0, 5.0), (-45.0, 95.0, 115.0), (20.0, 95.0, 5.0)]
    walls = [Flight(host=f"h{9 + k}", points_m=ends) for k, ends in enumerate(pairwise(corners))]
    assert decided(replace(asked(*walls[2:3]), flying=before.placement)).keeps
    assert not decided(replace(asked(*walls), flying=before.placement)).keeps


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_the_mission_goes_on_at_once_without_a_host_that_is_lost_on_its_way(
    autopilot: Autopilot, tmp_path: Path
) -> None:
    """Another would hover best where it is to hover: nobody comes near it, and the others arrive elsewhere."""
    lost, cut_s = "h3", 8.0
    at_rest = [
        TrueState(id=name, position_m=place, velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)
        for name, place in (("t1", (-40.0, 90.0, 40.0)), ("t2", (50.0, 100.0, 40.0)))
    ]
    without_s: list[float] = []
    settled_s: list[float] = []
    gaps_m: list[float] = []

    def watch(moment: Moment) -> None:
        mission, state = moment.mission, moment.mission.state
        if moment.time_s < cut_s:
            return
        if moment.time_s < cut_s + 0.1:
            assert state.progress[lost].flying, "it is cut off on its way"
        flying, closed = state.plans.flying, mission.unavailable()
        if flying is not None and lost not in {order.host for order in flying.decision.orders}:
            without_s.append(moment.time_s)
            if all(state.progress[order.host].status is OrderStatus.ON_STATION for order in flying.decision.orders):
                settled_s.append(moment.time_s)
        others = [Flight(host=each.id, points_m=(each.position_m,)) for each in mission.sky.movers(closed)]
        gaps_m.extend(gap_m(each, flight) for each in others for flight in mission.sky.standing(state, closed))

    flight = Mission(
        truth=straight(at_rest),
        hosts=5,
        duration_s=40.0,
        seed=2,
        rules=Rules(autonomy=Autonomy.AUTO, planning=replace(RULES, hosts="all", horizon_s=20.0)),
        altitude_m=40.0,
        autopilot=autopilot,
        radar_sigma_m=0.3,
        faults=(parse_fault(f"{lost}:link-cut@{cut_s}", 5),),
    )
    journal = tmp_path / "journal"
    with Journal(journal) as kept:
        fly(flight, watch, decide_in_rounds(2), kept)
    assert without_s[0] < cut_s + 5.0
    assert min(gaps_m) >= SEPARATION_M - 1.5
    assert settled_s, "all its hosts were on station"
    outcome = replay(journal, jobs=1)
    assert (outcome.decisions > 1, outcome.differences) == (True, ())
