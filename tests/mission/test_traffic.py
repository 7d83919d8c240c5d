"""Traffic: who departs, who waits, who is turned aside or stopped, and what becomes of an order that failed."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from hsop_gcs.assignment import Departure, Flight, HostOrder, in_the_way, why_outside
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.enums import MavType
from hsop_gcs.link.events import Arrived, CommandFinished, Event, OrderAccepted, OrderFailed, OrderSuperseded
from hsop_gcs.link.protocol.telemetry import VehicleState
from hsop_gcs.mission.core import MissionState, Wish, apply, situation
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.gates import Aircraft, Closed
from hsop_gcs.mission.inputs import (
    DecisionMade,
    HostDeparted,
    HostRetried,
    HostSetAside,
    HostsHeld,
    HostSpoke,
    HostsRecalled,
    HostsReleased,
    HostStopped,
    Input,
    LegFlown,
    MissionStarted,
    PlanFlew,
    ReportsArrived,
    Rules,
    SolverAsked,
    ThreatDismissed,
    WishLapsed,
)
from hsop_gcs.mission.planning import Decision, PlanningRules
from hsop_gcs.mission.records import from_record, to_record
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.mission.traffic import Blocked, Faulty, Traffic
from hsop_gcs.mission.whereabouts import whereabouts
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Formulation, Objective, Point
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.reports import Report

NOW_S = 1000.0
LOW = Closed(gate="battery", reason="the battery is low")
HELD = CommandFinished(system=1, command="hold", problem=None)
SOMEWHERE = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
PLACES: dict[str, Point] = {"h1": (0.0, 0.0, 40.0), "h2": (60.0, 0.0, 40.0)}


def flying(*goals: tuple[str, Point], via: tuple[Point, ...] = (), airspace: Airspace | None = None) -> MissionState:
    """A mission with one threat far away, and a plan that flies to these goals, in this order."""
    rules = Rules(autonomy=Autonomy.AUTO, planning=PlanningRules(airspace=airspace or Airspace()))
    mission = apply(MissionState(), MissionStarted(time_s=NOW_S, rules=rules, hosts=("h1", "h2", "h3")))
    mission = reported(mission, (0.0, 500.0, 40.0), NOW_S, "t1")
    orders = tuple(HostOrder(host=host, position_m=goal, heading_deg=0, aim=None, views=()) for host, goal in goals)
    placement = Placement(status=Status.FEASIBLE, formulation=Formulation.OPERATIONAL, objective=Objective.LETTER)
    asked = situation(mission, (), NOW_S)
    decision = Decision(placement=placement, threats=asked.threats, window_start_s=NOW_S + 5, orders=orders)
    departures = tuple(Departure(host=host, route_m=(*via, goal)) for host, goal in goals)
    for given in (
        SolverAsked(time_s=NOW_S, trigger="", situation=asked),
        DecisionMade(time_s=NOW_S, decision=decision),
        PlanFlew(time_s=NOW_S, plan_id="P1", departures=departures),
    ):
        mission = apply(mission, given)
    return mission


def reported(mission: MissionState, position_m: Point, time_s: float, threat: str = "t2") -> MissionState:
    report = Report(
        source="radar", threat_id=threat, time_s=time_s, position_m=position_m, velocity_mps=(0, 0, 0), sigma_m=0.5
    )
    return apply(mission, ReportsArrived(time_s=time_s, measurements=(report,)))


def aircraft(
    host: str, position_m: Point | None, *, obeys: bool = True, reached: str | None = None, **changes: Any
) -> Aircraft:
    heard = VehicleState(
        system=1,
        link_up=True,
        autopilot="ardupilot",
        type=MavType.QUADROTOR,
        armed=True,
        in_air=True,
        mode="Guided",
        position=SOMEWHERE,
        position_heard_s=0.0,
        heading_deg=0.0,
        home=SOMEWHERE,
    )
    state = replace(heard, **changes)
    return Aircraft(id=host, state=state, now_s=0.0, position_m=position_m, obeys=obeys, reached=reached)


def traffic(mission: MissionState, now_s: float = NOW_S, *others: Aircraft, closed: str = "", **at: Point) -> Traffic:
    """closed: the host that stands at a gate. others: aircraft that are not just somewhere."""
    fleet = {host: aircraft(host, place) for host, place in (PLACES | at).items()} | {each.id: each for each in others}
    gates = {closed: LOW} if closed else {}
    return Traffic(mission=mission, aircraft=fleet, closed=gates, limits=FlightLimits(), now_s=now_s)


def moved(
    mission: MissionState, now_s: float = NOW_S, *others: Aircraft, closed: str = "", **at: Point
) -> tuple[MissionState, list[Input]]:
    """The mission after what traffic does with it, each input having been through the journal."""
    seen = traffic(mission, now_s, *others, closed=closed, **at).moves()
    moves: list[Input] = [each for each in seen if not isinstance(each, Blocked | Faulty)]
    for given in moves:
        assert from_record(*to_record(given), given.time_s) == given
        mission = apply(mission, given)
    return mission, moves


def blocked(
    mission: MissionState, host: str, now_s: float = NOW_S, *others: Aircraft, closed: str = "", **at: Point
) -> str | None:
    """Why a host that waits does not depart."""
    found = [
        each for each in traffic(mission, now_s, *others, closed=closed, **at).moves() if isinstance(each, Blocked)
    ]
    return next((each.reason for each in found if each.host == host), None)


def spoke(mission: MissionState, kind: type[Any], host: str = "h1", **details: Any) -> MissionState:
    event: Event = kind(system=1, order_id=mission.progress[host].leg_id, **details)
    return apply(mission, HostSpoke(time_s=NOW_S, host=host, event=event))


def statuses(mission: MissionState) -> dict[str, str]:
    return {host: str(progress.status) for host, progress in mission.progress.items()}


def test_orders_wait_until_they_are_sent_and_hosts_that_do_not_meet_leave_together() -> None:
    mission = flying(("h1", (0, 50, 40)), ("h2", (60, 50, 40)))
    assert statuses(mission) == {"h1": "waiting", "h2": "waiting"}
    mission, moves = moved(mission)
    assert [type(move) for move in moves] == [HostDeparted, HostDeparted]
    assert statuses(mission) == {"h1": "sent", "h2": "sent"}
    assert moved(mission)[1] == []


def test_the_second_waits_until_what_is_left_of_the_first_ones_line_is_clear() -> None:
    mission = flying(("h1", (100, 0, 40)), ("h2", (60, 50, 40)))
    waits = (60.0, -50.0, 40.0)
    mission, moves = moved(mission, h2=waits)
    assert [move.host for move in moves if isinstance(move, HostDeparted)] == ["h1"]
    assert blocked(mission, "h2", h2=waits) == "waits for h1 to pass"
    mission, moves = moved(mission, h1=(65.0, 0.0, 40.0), h2=waits)
    assert moves == []
    mission, moves = moved(mission, h1=(71.0, 0.0, 40.0), h2=waits)
    assert [move.host for move in moves if isinstance(move, HostDeparted)] == ["h2"]


def test_a_host_behind_a_closed_gate_and_a_stale_order_stay() -> None:
    mission = flying(("h1", (0, 50, 40)))
    assert moved(mission, closed="h1")[1] == []
    assert blocked(mission, "h1", closed="h1") == "the battery is low"
    late_s = NOW_S + 15.1
    assert moved(mission, late_s)[1] == []
    assert blocked(mission, "h1", late_s) == "its order is stale: the plan has run out"


def test_a_gate_that_closes_in_flight_stops_the_host_and_its_order_goes_on_when_it_opens() -> None:
    mission, _ = moved(flying(("h1", (0, 50, 40)), ("h2", (60, 50, 40))))
    mission, moves = moved(mission, NOW_S + 1, closed="h1")
    assert moves == [HostStopped(time_s=NOW_S + 1, host="h1", gate="battery", reason="the battery is low")]
    assert statuses(mission) == {"h1": "waiting", "h2": "sent"}
    assert mission.progress["h1"].note == "the battery is low"
    assert mission.pending["h1"].wish is Wish.HOLD
    assert blocked(mission, "h1", NOW_S + 4, closed="h1") == "the battery is low"
    mission, moves = moved(mission, NOW_S + 4)
    assert [type(move) for move in moves] == [HostDeparted]
    assert mission.pending == {}


def test_a_host_without_a_position_is_stopped_too() -> None:
    mission, _ = moved(flying(("h1", (0, 50, 40))))
    _, moves = moved(mission, NOW_S + 1, aircraft("h1", None), closed="h1")
    assert [type(move) for move in moves] == [HostStopped]


@pytest.mark.parametrize("stopped", [False, True], ids=["flying", "stopped on the way"])
def test_a_host_that_its_autopilot_has_taken_over_is_given_up_and_not_commanded(stopped: bool) -> None:
    mission, _ = moved(flying(("h1", (0, 50, 40))))
    if stopped:
        mission, _ = moved(mission, NOW_S + 1, closed="h1")
        mission = apply(mission, HostSpoke(time_s=NOW_S + 1, host="h1", event=HELD))
    failsafe = aircraft("h1", (0, 20, 40), mode="RTL", obeys=False)
    mission, moves = moved(mission, NOW_S + 2, failsafe, closed="h1")
    assert moves == [
        HostSetAside(time_s=NOW_S + 2, host="h1", reason="somebody else flies it (mode RTL)", until_s=None)
    ]
    assert mission.pending == {}
    assert moved(mission, NOW_S + 9, failsafe, closed="h1")[1] == []


def silent_on_its_way(silent_s: float) -> tuple[MissionState, Aircraft, Aircraft]:
    """A mission in which h1 has fallen silent on its way east, h1, and h2, which is to fly north across that way."""
    mission = flying(("h2", (60, 50, 40)), ("h1", (180, 0, 40)))
    order = replace(mission.progress["h1"].order, via_m=((100, 0, 40),))
    on_its_way = replace(mission.progress["h1"], order=order, status=OrderStatus.SENT, departures=1)
    mission = replace(mission, progress={**mission.progress, "h1": on_its_way})
    silent = aircraft("h1", (20.0, 0.0, 40.0), link_up=False, position_heard_s=-silent_s)
    h2 = aircraft("h2", (60.0, -50.0, 40.0))
    mission, moves = moved(mission, NOW_S + 1, silent, h2, closed="h1")
    assert [type(move) for move in moves] == [HostStopped]
    return mission, silent, h2


def test_an_unheard_host_may_be_on_its_leg_and_later_at_one_of_its_ends() -> None:
    limits = FlightLimits(speed_mps=8.0)
    mission, silent, _ = silent_on_its_way(3.0)
    on_the_leg, here, there = (((20, 0, 40), (100, 0, 40)), ((20, 0, 40),), ((100, 0, 40),))
    assert [each.points_m for each in whereabouts(mission, silent, limits)] == [on_the_leg], "not its later legs"
    for silent_s, places in ((2 * 80 / 8, [on_the_leg]), (3.5 * 80 / 8, [here, there])):
        later = replace(silent, now_s=silent_s - 3.0)
        assert [each.points_m for each in whereabouts(mission, later, limits)] == places
    heard = aircraft("h1", (70.0, 0.0, 40.0))
    assert [each.points_m for each in whereabouts(mission, heard, limits)] == [((70, 0, 40),)]
    held = apply(mission, HostSpoke(time_s=NOW_S + 4, host="h1", event=HELD))
    assert held.pending == {}
    assert [each.points_m for each in whereabouts(held, silent, limits)] == [here]
    landed = aircraft("h1", (70.0, 0.0, 40.0), in_air=False)
    assert whereabouts(mission, landed, limits) == ()


def test_others_go_around_where_an_unheard_host_may_be_and_straight_on_when_it_must_have_passed() -> None:
    mission, silent, h2 = silent_on_its_way(3.0)
    (around,) = moved(mission, NOW_S + 3, silent, h2, closed="h1")[1]
    assert isinstance(around, HostDeparted)
    lines = Flight(host="h2", points_m=((60, -50, 40), *around.route_m))
    assert in_the_way(lines, [Flight(host="h1", points_m=((20, 0, 40), (100, 0, 40)))], 10.0) is None
    mission, silent, h2 = silent_on_its_way(40.0)
    (straight_on,) = moved(mission, NOW_S + 3, silent, h2, closed="h1")[1]
    assert isinstance(straight_on, HostDeparted)
    assert straight_on.route_m == ((60, 50, 40),)


def test_nobody_waits_for_a_host_that_cannot_be_sent_to_depart_first() -> None:
    mission = flying(("h1", (100, 0, 40)), ("h2", (60, 50, 40)))
    south = (60.0, -50.0, 40.0)
    assert blocked(mission, "h2", h2=south) == "waits for h1 to pass"
    assert [move.host for move in moved(mission, closed="h1", h2=south)[1] if isinstance(move, HostDeparted)] == ["h2"]


TOWER = Airspace(keep_outs=(KeepOut(polygon=((-30.0, 60.0), (30.0, 60.0), (30.0, 70.0), (-30.0, 70.0))),))


def test_a_flight_towards_a_forbidden_area_is_turned_aside_or_stopped_before_it_enters() -> None:
    mission, _ = moved(flying(("h1", (-40, 90, 40)), airspace=TOWER), h1=(-40.0, 0.0, 40.0))
    assert moved(mission, NOW_S + 1, h1=(-40.0, 38.0, 40.0))[1] == []
    assert moved(mission, NOW_S + 1, h1=(0.0, 0.0, 40.0))[1] == [], "there is time"
    (stop,) = moved(mission, NOW_S + 1, h1=(-20.0, 50.0, 40.0))[1]
    assert isinstance(stop, HostStopped)
    assert (stop.gate, stop.reason) == ("airspace", "its flight leads through a keep-out area")
    (turned,) = moved(mission, NOW_S + 3, h1=(-20.0, 50.0, 40.0))[1]
    assert isinstance(turned, HostDeparted)
    assert why_outside(TOWER, ((-20.0, 50.0, 40.0), *turned.route_m)) is None


def test_a_host_is_sent_along_its_route_as_long_as_its_order_and_its_gates_allow_it() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40)), via=((40, 40, 40),)))
    mission = spoke(mission, OrderAccepted)
    there = aircraft("h1", (38.0, 39.0, 40.0), reached=mission.progress["h1"].leg_id)
    assert moved(mission, NOW_S + 6, aircraft("h1", (38.0, 39.0, 40.0), reached="another"))[1] == []
    on, moves = moved(mission, NOW_S + 6, there)
    assert [type(move) for move in moves] == [LegFlown]
    assert on.progress["h1"].on_last_leg
    (late,) = moved(mission, NOW_S + 15.1, there)[1]
    assert isinstance(late, HostStopped)
    assert (late.gate, late.reason) == ("order", "its order is stale: the plan has run out")
    (closed,) = moved(mission, NOW_S + 6, there, closed="h1")[1]
    assert isinstance(closed, HostStopped)
    assert closed.gate == "battery"


def test_a_threat_that_moves_into_the_way_turns_a_flight_aside() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    mission = reported(spoke(mission, OrderAccepted), (0.0, 45.0, 40.0), NOW_S + 1)
    mission, moves = moved(mission, NOW_S + 2, h1=(0.0, 10.0, 40.0))
    (turned,) = moves
    assert isinstance(turned, HostDeparted)
    assert len(turned.route_m) > 1
    points = ((0.0, 10.0, 40.0), *turned.route_m)
    for a, b in pairwise(points):
        for share in (k / 100 for k in range(101)):
            at = [x + share * (y - x) for x, y in zip(a, b, strict=True)]
            assert math.dist(at, (0.0, 45.0, 40.0)) >= 20
    assert mission.progress["h1"].leg_id == "P1/h1/again1/via1"


def test_without_a_way_around_the_host_stops_and_goes_on_when_there_is_one() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    over_goal = reported(mission, (0.0, 95.0, 40.0), NOW_S + 1)
    assert moved(over_goal, NOW_S + 1, h1=(0.0, 40.0, 40.0))[1] == [], "there is time for a way around to be found"
    stopped, moves = moved(over_goal, NOW_S + 1, h1=(0.0, 56.0, 40.0))
    (stop,) = moves
    assert isinstance(stop, HostStopped)
    assert (stop.gate, stop.reason) == ("threat", "its flight comes to 15 m from threat t2")
    assert statuses(stopped) == {"h1": "waiting"}
    old = OrderSuperseded(system=1, order_id="P1/h1")
    assert statuses(apply(stopped, HostSpoke(time_s=NOW_S, host="h1", event=old))) == {"h1": "waiting"}
    assert moved(stopped, NOW_S + 4, h1=(0.0, 58.0, 40.0))[1] == []
    gone = apply(stopped, ThreatDismissed(time_s=NOW_S + 2, threat_id="t2"))
    assert moved(gone, NOW_S + 2.9, h1=(0.0, 58.0, 40.0))[1] == [], "it rests for a moment"
    _, moves = moved(gone, NOW_S + 3, h1=(0.0, 58.0, 40.0))
    assert [type(move) for move in moves] == [HostDeparted]


def test_a_host_that_would_be_nearer_to_the_threat_if_it_stopped_flies_on() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    behind = Report(
        source="radar",
        threat_id="t2",
        time_s=NOW_S + 3,
        position_m=(2.0, 18.0, 40.0),
        velocity_mps=(0, 4, 0),
        sigma_m=0.5,
    )
    mission = apply(mission, ReportsArrived(time_s=NOW_S + 3, measurements=(behind,)))
    mission, moves = moved(mission, NOW_S + 3, h1=(0.0, 30.0, 40.0))
    assert moves == []
    assert statuses(mission) == {"h1": "sent"}


def test_a_host_that_somebody_puts_in_the_way_stops_the_one_that_flies_which_then_goes_around_it() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    mission, moves = moved(mission, h2=(4.0, 50.0, 40.0))
    (stop,) = moves
    assert isinstance(stop, HostStopped)
    assert (stop.gate, stop.reason) == ("separation", "comes too near to h2")
    (around,) = moved(mission, NOW_S + 2, h2=(4.0, 50.0, 40.0))[1]
    assert isinstance(around, HostDeparted)
    way = Flight(host="h1", points_m=(PLACES["h1"], *around.route_m))
    assert in_the_way(way, [Flight(host="h2", points_m=((4.0, 50.0, 40.0),))], 10.0) is None
    (on,) = moved(mission, NOW_S + 2, h2=(14.0, 50.0, 40.0))[1]
    assert isinstance(on, HostDeparted)
    assert on.route_m == ((0, 90, 40),)


def test_one_that_hovers_at_a_hosts_hover_point_is_in_its_way_for_good() -> None:
    mission = flying(("h1", (0, 90, 40)))
    (found,) = [each for each in traffic(mission, h2=(4.0, 90.0, 40.0)).moves() if isinstance(each, Blocked)]
    assert (found.reason, found.for_good) == ("h2 is in its way", True)
    mission = reported(mission, (0.0, 95.0, 40.0), NOW_S)
    (found,) = [each for each in traffic(mission, h2=(4.0, 90.0, 40.0)).moves() if isinstance(each, Blocked)]
    assert (found.reason, found.for_good) == ("comes to 5 m from threat t2", False), "threats move on"


def test_a_host_that_was_stopped_and_cannot_go_on_for_long_is_planned_without() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    mission, _ = moved(mission, h2=(4.0, 88.0, 40.0))
    plan = mission.plans.flying
    assert plan is not None
    kept = replace(mission.plans, flying=replace(plan, expires_at_s=NOW_S + 60))
    at_its_goal = aircraft("h2", (4.0, 88.0, 40.0))
    assert moved(mission, NOW_S + 31, at_its_goal)[1] == [], "its plan has run out: it is not the host's fault"
    mission = replace(mission, plans=kept)
    assert moved(mission, NOW_S + 29, at_its_goal)[1] == []
    mission, moves = moved(mission, NOW_S + 31, at_its_goal)
    assert [type(move) for move in moves] == [HostSetAside]
    assert mission.why_aside("h1", NOW_S + 90) == "it could not go on for 30 s"
    assert mission.why_aside("h1", NOW_S + 92) is None


def test_an_order_that_fails_is_tried_again_and_then_the_host_is_planned_without() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    for again in (1, 2):
        mission, moves = moved(spoke(mission, OrderFailed, reason="not there"))
        assert [type(move) for move in moves] == [HostRetried]
        mission, moves = moved(mission, NOW_S + 2 * again)
        assert [type(move) for move in moves] == [HostDeparted]
        assert mission.progress["h1"].leg_id == f"P1/h1/again{again}"
    mission, moves = moved(spoke(mission, OrderFailed, reason="not there"))
    assert [type(move) for move in moves] == [HostSetAside]
    assert mission.why_aside("h1", NOW_S + 59) == "its order failed 3 times: not there"
    assert mission.why_aside("h1", NOW_S + 60) is None
    assert moved(mission)[1] == []


def test_a_host_that_somebody_else_flies_is_left_to_him_until_it_is_released() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40))))
    mission = spoke(mission, OrderFailed, reason="the vehicle is in mode Loiter")
    mission, moves = moved(mission, NOW_S, aircraft("h1", PLACES["h1"], mode="Loiter", obeys=False))
    assert [type(move) for move in moves] == [WishLapsed, HostSetAside]
    assert mission.pending == {}
    assert mission.why_aside("h1", NOW_S + 1e6) == "somebody else flies it (mode Loiter)"
    released = apply(mission, HostsReleased(time_s=NOW_S, hosts=("h1",), everyone=False))
    assert released.why_aside("h1", NOW_S) is None


@pytest.mark.parametrize("order", [HostsHeld, HostsRecalled])
def test_after_a_hold_or_recall_nothing_flies_unasked_not_even_after_a_restart(order: type[Any]) -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40)), ("h2", (60, 90, 40))))
    assert mission.autonomy is Autonomy.AUTO
    stopped = apply(mission, order(time_s=NOW_S, hosts=("h1", "h2")))
    restarted = apply(stopped, MissionStarted(time_s=NOW_S + 1, rules=mission.rules, hosts=("h1", "h2", "h3")))
    for each in (stopped, restarted):
        assert each.autonomy is Autonomy.CONFIRM
        assert moved(each)[1] == []
        assert (each.why_aside("h1", NOW_S) is None) is (order is HostsHeld)
    one = apply(stopped, HostsReleased(time_s=NOW_S, hosts=("h1",), everyone=False))
    assert (one.autonomy, one.why_aside("h1", NOW_S)) == (Autonomy.CONFIRM, None)
    everyone = apply(stopped, HostsReleased(time_s=NOW_S, hosts=("h1", "h2"), everyone=True))
    assert everyone.autonomy is Autonomy.AUTO
    assert everyone.aside == {}


class Unsound(dict[str, Aircraft]):
    """Aircraft, of which one cannot be looked at."""

    def __getitem__(self, host: str) -> Aircraft:
        if host == "h1":
            raise RuntimeError("thrown in by a test")
        return super().__getitem__(host)


def test_a_host_that_cannot_be_supervised_is_stopped_and_costs_no_other_its_flight() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40)), ("h2", (60, 90, 40))))
    seen = traffic(mission, NOW_S + 4)
    unsound = list(replace(seen, aircraft=Unsound(seen.aircraft)).moves())
    faulty = [each for each in unsound if isinstance(each, Faulty)]
    stopped = [each for each in unsound if isinstance(each, HostStopped)]
    assert {each.host for each in faulty} == {"h1"} == {each.host for each in stopped}
    assert stopped[0].gate == "fault"


def restarted(mission: MissionState, *hosts: str, autonomy: Autonomy = Autonomy.AUTO) -> MissionState:
    rules = replace(mission.rules, autonomy=autonomy)
    return apply(mission, MissionStarted(time_s=NOW_S + 1, rules=rules, hosts=hosts))


def test_after_a_restart_who_flew_is_stopped_and_sent_on_and_who_hovered_is_watched_again() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40)), ("h2", (60, 90, 40))))
    mission = spoke(spoke(mission, OrderAccepted), Arrived)
    assert statuses(mission) == {"h1": "arrived", "h2": "sent"}
    again = restarted(mission, "h1", "h2", "h3")
    assert statuses(again) == {"h1": "waiting", "h2": "waiting"}
    assert {host: pending.goal_m for host, pending in again.pending.items()} == {"h2": (60, 90, 40)}
    after, moves = moved(again, NOW_S + 4)
    assert [type(move) for move in moves] == [HostDeparted, HostDeparted]
    assert after.pending == {}
    assert all(progress.leg_id.endswith("/again1") for progress in after.progress.values())


def test_a_restart_without_a_host_forgets_it_and_its_plan_and_one_that_only_advises_flies_nothing() -> None:
    mission, _ = moved(flying(("h1", (0, 90, 40)), ("h2", (60, 90, 40))))
    without = restarted(mission, "h2", "h3")
    assert without.plans.flying is None
    assert statuses(without) == {"h2": "superseded"}
    assert set(without.pending) == {"h2"}
    advising = restarted(mission, "h1", "h2", "h3", autonomy=Autonomy.ADVISE)
    assert advising.plans.flying is None
    assert set(advising.pending) == {"h1", "h2"}
    for each in (without, advising):
        assert moved(each, NOW_S + 4)[1] == []


def test_a_new_plan_leaves_hosts_it_does_not_need_only_where_they_have_arrived() -> None:
    mission, _ = moved(flying(("h1", (0, 50, 40)), ("h2", (60, 50, 40))))
    mission = spoke(spoke(mission, OrderAccepted), Arrived)
    assert statuses(mission) == {"h1": "arrived", "h2": "sent"}
    plan = mission.plans.flying
    assert plan is not None
    again = DecisionMade(time_s=NOW_S, decision=plan.decision)
    asked = SolverAsked(time_s=NOW_S, trigger="", situation=situation(mission, (), NOW_S))
    for given in (asked, again, PlanFlew(time_s=NOW_S, plan_id="P2", departures=())):
        mission = apply(mission, given)
    assert statuses(mission) == {"h1": str(OrderStatus.ARRIVED)}
