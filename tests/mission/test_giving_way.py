"""Giving way, look by look: who flies out of a threat's way, whereto, who stays, and what people are told."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hsop_gcs.assignment import Mover, inner
from hsop_gcs.link.events import Arrived, LinkLost, LinkUp, OnStation, OrderAccepted
from hsop_gcs.mission.core import MissionState, Wish, apply
from hsop_gcs.mission.gates import Aircraft
from hsop_gcs.mission.inputs import (
    HostDeparted,
    HostGaveWay,
    HostsHeld,
    HostSpoke,
    HostsRecalled,
    HostsReleased,
    HostThreatened,
    Input,
    ReportsArrived,
    WishLapsed,
)
from hsop_gcs.mission.state import replan_reason
from hsop_gcs.mission.threatened import Threatened
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Point
from hsop_gcs.reports import Report
from tests.mission.test_traffic import NOW_S, aircraft, blocked, flying, moved, spoke, statuses

AT_HOVER: Point = (0.0, 0.0, 40.0)
HERE: dict[str, Any] = {"h2": (300.0, 0.0, 40.0)}
FENCE = Airspace(inside=(((-100.0, -100.0), (2.5, -100.0), (2.5, 2.5), (-100.0, 2.5)),))


def on_station(airspace: Airspace | None = None) -> MissionState:
    """A mission whose h1 is on station where it stands."""
    mission, _ = moved(flying(("h1", AT_HOVER), airspace=airspace), **HERE)
    for kind in (OrderAccepted, Arrived, OnStation):
        mission = spoke(mission, kind)
    return mission


def coming(mission: MissionState, position_m: Point, velocity_mps: Point, threat: str = "t2") -> MissionState:
    report = Report(
        source="radar",
        threat_id=threat,
        time_s=NOW_S + 1,
        position_m=position_m,
        velocity_mps=velocity_mps,
        sigma_m=0.3,
        velocity_sigma_mps=0.2,
    )
    return apply(mission, ReportsArrived(time_s=NOW_S + 1, measurements=(report,)))


def given(mission: MissionState, *others: Aircraft, **at: Any) -> tuple[MissionState, list[Input]]:
    return moved(mission, NOW_S + 1, *others, **{**HERE, **at})


def way_of(moves: list[Input]) -> HostGaveWay:
    (move,) = moves
    assert isinstance(move, HostGaveWay)
    return move


def test_a_host_on_station_waits_until_waiting_would_cost_distance_and_then_flees() -> None:
    far = coming(on_station(), (0.0, 60.0, 40.0), (0.0, -4.0, 0.0))
    assert given(far)[1] == []
    mission, moves = given(coming(on_station(), (0.0, 29.0, 40.0), (0.0, -4.0, 0.0)))
    way = way_of(moves)
    assert way.threat == "t2"
    assert way.goal_m[1] < -8.0
    assert statuses(mission) == {"h1": "waiting"}
    assert mission.progress["h1"].note == "gives way to threat t2"
    assert mission.flies_to_m("h1") == (way.goal_m,)
    assert blocked(mission, "h1", NOW_S + 4, **HERE) is not None, "it does not go back into the threat's way"
    flying_plan = mission.plans.flying
    assert flying_plan is not None
    plans = replace(mission.plans, flying=replace(flying_plan, made_at_s=NOW_S - 9))
    mover = Mover(id="h1", position_m=AT_HOVER, speed_mps=8.0)
    tracks, rules = (mission.picture.tracks["t1"],), mission.rules
    asked = replan_reason(
        plans, tracks, (mover,), NOW_S + 3, rules.replanning, rules.planning, (), (), mission.ways_given
    )
    assert asked == "host h1 gave way to threat t2"


def test_a_threat_that_passes_beside_a_host_moves_nobody() -> None:
    assert given(coming(on_station(), (24.5, -15.0, 40.0), (0.0, 4.0, 0.0)))[1] == []


@pytest.mark.parametrize(
    ("position_m", "velocity_mps"),
    [
        ((0.0, 15.0, 40.0), (0.0, 0.0, 0.0)),
        ((0.0, 10.0, 52.0), (0.0, -2.0, -3.0)),
        ((14.0, 5.0, 40.0), (-1.0, 2.0, 0.0)),
    ],
    ids=["appears 15 m beside it", "dives from above", "passes within the safety distance"],
)
def test_inside_the_safety_distance_a_host_moves_away_and_never_nearer(position_m: Point, velocity_mps: Point) -> None:
    goal_m = way_of(given(coming(on_station(), position_m, velocity_mps))[1]).goal_m
    before_m = math.dist(AT_HOVER, position_m)
    for share in (k / 20 for k in range(1, 21)):
        at = [share * (goal - here) + here for goal, here in zip(goal_m, AT_HOVER, strict=True)]
        apart_m = math.dist(at, position_m)
        assert apart_m >= before_m - 0.05
        before_m = apart_m


@pytest.mark.parametrize("from_inside", [True, False])
def test_at_the_fences_corner_a_host_leaves_along_the_fence_and_stays_inside(from_inside: bool) -> None:
    side = (-29.0, 0.0, 40.0) if from_inside else (-20.5, -20.5, 40.0)
    speed = (3.5, 0.0, 0.0) if from_inside else (2.5, 2.5, 0.0)
    _, moves = given(coming(on_station(FENCE), side, speed))
    for move in moves:
        if isinstance(move, HostGaveWay):
            assert FENCE.fence_room_m(move.goal_m) >= 0
    if from_inside:
        assert way_of(moves).goal_m[1] < -5.0


def test_a_way_out_keeps_clear_of_other_hosts_and_two_that_give_way_of_each_other() -> None:
    threatened = coming(on_station(), (0.0, 29.0, 40.0), (0.0, -4.0, 0.0))
    behind = aircraft("h2", (0.0, -15.0, 40.0))
    way = way_of([each for each in given(threatened, behind)[1] if getattr(each, "host", "") == "h1"])
    ways = [move for move in given(threatened, behind)[1] if isinstance(move, HostGaveWay)]
    for one, other in ((way.goal_m, behind.position_m), *((a.goal_m, b.goal_m) for a in ways for b in ways if a != b)):
        assert other is not None
        assert math.dist(one, other) >= 9.5


def test_hosts_without_an_order_or_on_their_climb_give_way_too() -> None:
    mission = coming(on_station(), (300.0, 27.0, 40.0), (0.0, -4.0, 0.0))
    assert way_of(given(mission)[1]).host == "h2"
    low = coming(on_station(), (300.0, 25.0, 4.0), (0.0, -4.0, 0.0))
    climbing = replace(aircraft("h2", (300.0, 0.0, 3.0), velocity_enu_mps=(0.0, 0.0, 1.5)), takes_off=True)
    way = way_of(given(low, climbing)[1])
    assert way.goal_m[2] >= 3.0
    on_the_ground = aircraft("h2", (300.0, 0.0, 0.0), in_air=False)
    assert given(low, on_the_ground)[1] == []


@pytest.mark.parametrize(
    ("stop", "other", "reason"),
    [
        (HostsHeld(time_s=NOW_S, hosts=("h1",)), {}, "an operator holds it"),
        (HostsRecalled(time_s=NOW_S, hosts=("h1",)), {}, "recalled by the operator"),
        (None, {"obeys": False, "mode": "Loiter"}, "somebody else flies it (mode Loiter)"),
    ],
    ids=["held", "recalled", "flown by somebody else"],
)
def test_a_host_that_is_not_ours_to_move_stays_and_people_are_told(
    stop: Input | None, other: dict[str, Any], reason: str
) -> None:
    mission = on_station() if stop is None else apply(on_station(), stop)
    mission = coming(mission, (0.0, 32.0, 40.0), (0.0, -4.0, 0.0))
    (told,) = [
        each for each in given(mission, aircraft("h1", AT_HOVER, **other))[1] if isinstance(each, HostThreatened)
    ]
    assert (told.host, told.threat, told.reason) == ("h1", "t2", reason)
    news = Threatened()
    assert news.is_news(told)
    assert not news.is_news(replace(told, time_s=told.time_s + 0.2))
    assert news.problems(NOW_S + 2) == [
        f"host h1: threat t2 comes within {told.distance_m:.0f} m of it, and it stays: {reason}"
    ]
    assert news.problems(NOW_S + 9) == []


def test_a_released_host_gives_way_again() -> None:
    held = apply(on_station(), HostsHeld(time_s=NOW_S, hosts=("h1",)))
    released = apply(held, HostsReleased(time_s=NOW_S, hosts=("h1",), everyone=True))
    assert way_of(given(coming(released, (0.0, 29.0, 40.0), (0.0, -4.0, 0.0)))[1]).host == "h1"


def test_a_host_that_waits_for_another_to_pass_gives_way_and_departs_when_it_is_safe() -> None:
    waiting = flying(("h1", (100, 0, 40)), ("h2", (60, 50, 40)))
    threatened = coming(waiting, (60.0, -79.0, 40.0), (0.0, 4.0, 0.0))
    mission, moves = moved(threatened, NOW_S + 1, h2=(60.0, -50.0, 40.0))
    ways = [move for move in moves if isinstance(move, HostGaveWay)]
    assert [way.host for way in ways] == ["h2"]
    assert statuses(mission)["h2"] == "waiting"
    mission = replace(mission, picture=mission.picture._replace(tracks={}))
    _, moves = moved(mission, NOW_S + 4, h1=(110.0, 0.0, 40.0), h2=ways[0].goal_m)
    assert "h2" in [move.host for move in moves if isinstance(move, HostDeparted)]


def test_a_host_that_is_not_heard_is_not_on_station() -> None:
    mission = on_station()
    lost = apply(mission, HostSpoke(time_s=NOW_S, host="h1", event=LinkLost(system=1, silent_s=3.5)))
    assert statuses(lost) == {"h1": "not heard"}
    heard = apply(lost, HostSpoke(time_s=NOW_S, host="h1", event=LinkUp(system=1)))
    assert statuses(heard) == {"h1": "arrived"}
    assert statuses(spoke(heard, OnStation)) == {"h1": "on station"}


@pytest.mark.parametrize(
    ("wish", "seen", "reason"),
    [
        (Wish.HOLD, {"holds": True, "velocity_enu_mps": (0.1, 0.0, 0.0)}, "it stands still (mode Guided)"),
        (Wish.HOLD, {"holds": True, "velocity_enu_mps": (6.0, 0.0, 0.0)}, None),
        (Wish.HOLD, {"velocity_enu_mps": (0.1, 0.0, 0.0)}, None),
        (Wish.RECALL, {"returns": True}, "it returns (mode Guided)"),
        (Wish.RECALL, {"in_air": False}, "the vehicle is on the ground"),
        (Wish.RECALL, {"velocity_enu_mps": (0.0, 0.0, 0.0)}, None),
    ],
)
def test_a_wish_that_telemetry_shows_fulfilled_is_not_pending_though_its_answer_was_lost(
    wish: Wish, seen: dict[str, Any], reason: str | None
) -> None:
    stop = HostsHeld if wish is Wish.HOLD else HostsRecalled
    mission = apply(on_station(), stop(time_s=NOW_S, hosts=("h1",)))
    flags = {name: seen.pop(name) for name in ("holds", "returns") if name in seen}
    h1 = replace(aircraft("h1", AT_HOVER, **seen), **flags)
    assert moved(mission, NOW_S + 1, h1, **HERE)[1] == [], "it has to settle first"
    lapsed = [each.reason for each in moved(mission, NOW_S + 6, h1, **HERE)[1] if isinstance(each, WishLapsed)]
    assert lapsed == ([] if reason is None else [reason])


def test_hover_points_lie_inside_the_fence_and_outside_keep_outs_by_a_margin() -> None:
    square = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
    beside = ((100.0, 0.0), (200.0, 0.0), (200.0, 100.0), (100.0, 100.0))
    tower = KeepOut(polygon=((40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0)))
    within = inner(Airspace(inside=(square, beside), keep_outs=(tower,)), 2.0)
    assert within.fence_room_m((1.9, 50.0, 30.0)) < 0 <= within.fence_room_m((2.1, 50.0, 30.0))
    assert within.fence_room_m((100.0, 50.0, 30.0)) > 0, "where two fences meet is no edge"
    assert within.keep_out_room_m((61.9, 50.0, 30.0)) < 0 <= within.keep_out_room_m((62.1, 50.0, 30.0))
    narrow = Airspace(inside=(((0.0, 0.0), (3.0, 0.0), (3.0, 100.0), (0.0, 100.0)),))
    assert inner(narrow, 2.0).inside == narrow.inside
    side = ((0.0, 0.0), (30.0, 0.0), (30.0, 100.0), (0.0, 100.0))
    rail = ((0.0, 0.0), (100.0, 0.0), (100.0, 30.0), (0.0, 30.0))
    around = (side, tuple((x + 70, y) for x, y in side), rail, tuple((x, y + 70) for x, y in rail))
    courtyard = inner(Airspace(inside=around), 2.0)
    assert courtyard.fence_room_m((50.0, 50.0, 30.0)) < 0, "a hole stays one"
    assert courtyard.fence_room_m((15.0, 50.0, 30.0)) > 0
