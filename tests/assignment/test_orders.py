"""Orders: safe flights, and cameras aimed in three dimensions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.assignment import FlightRules, HostOrder, Mover, NoSafeFlight, assign, clearance_m, orders_for, safe_route
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.placement.problem import Formulation, Objective, Point, Threat
from hsop_gcs.placement.solution import HoverPose, Placement, Status, ThreatPair, View

CENTIMETRE = 0.01
RULES = FlightRules(horizon_s=10.0, safety_distance_m=20.0, separation_m=10.0)
RING = [(math.cos(k * math.pi / 6), math.sin(k * math.pi / 6)) for k in range(12)]


def mover(name: str, *position_m: float) -> Mover:
    east, north, up = position_m
    return Mover(id=name, position_m=(east, north, up), speed_mps=10.0)


def placement(*poses: HoverPose, camera: CameraKind = CameraKind.CENTRAL) -> Placement:
    views = (View(host=poses[0].host, camera=camera), View(host=poses[1].host, camera=camera))
    return Placement(
        status=Status.FEASIBLE,
        formulation=Formulation.OPERATIONAL,
        objective=Objective.LETTER,
        hosts=poses,
        pairs=(ThreatPair(threat="t1", views=views, cost=1.0),),
    )


def pose(name: str, position_m: Point, pan_deg: float | None) -> HoverPose:
    return HoverPose(host=name, position_m=position_m, heading_deg=10.0, pan_deg=pan_deg)


THREAT = Threat(id="t1", position_m=(0.0, 0.0, 50.0))
PLACEMENT = placement(pose("a", (0.0, -30.0, 20.0), 0.0), pose("b", (-40.0, 0.0, 50.0), 90.0))


def ordered(
    movers: tuple[Mover, ...], threat: Threat = THREAT, placed: Placement = PLACEMENT
) -> tuple[HostOrder, ...] | NoSafeFlight:
    return orders_for(placed, movers, threats_now=(threat,), threats_then=(threat,), rules=RULES)


def test_each_hover_point_goes_to_the_host_that_is_near() -> None:
    orders = ordered((mover("h1", -60, 0, 50), mover("h2", 0, -60, 20)))
    assert not isinstance(orders, NoSafeFlight)
    assert {order.host: order.position_m for order in orders} == {"h2": (0, -30, 20), "h1": (-40, 0, 50)}


def test_the_letters_plane_has_no_tilts_and_a_host_below_its_threat_tilts_its_camera_up() -> None:
    in_a_plane = replace(PLACEMENT, formulation=Formulation.LETTER)
    orders = ordered((mover("h1", -60, 0, 50), mover("h2", 0, -60, 20)), placed=in_a_plane)
    assert not isinstance(orders, NoSafeFlight)
    aims = {order.host: order.aim for order in orders}
    assert aims["h2"] is not None
    assert (aims["h2"].pan_deg, aims["h2"].tilt_deg) == pytest.approx((0.0, 45.0))
    assert aims["h1"] is not None
    assert aims["h1"].tilt_deg == pytest.approx(0.0)


def test_a_placement_in_space_is_aimed_as_it_says() -> None:
    tilted = replace(PLACEMENT, hosts=tuple(replace(each, tilt_deg=-12.0) for each in PLACEMENT.hosts))
    orders = ordered((mover("h1", -60, 0, 50), mover("h2", 0, -60, 20)), placed=tilted)
    assert not isinstance(orders, NoSafeFlight)
    assert [(order.aim.pan_deg, order.aim.tilt_deg) for order in orders if order.aim] == [(0.0, -12.0), (90.0, -12.0)]


def test_an_order_says_what_is_seen_beyond_the_pairs() -> None:
    more = View(host="b", camera=CameraKind.PERIPHERAL)
    fused = replace(PLACEMENT, pairs=tuple(replace(pair, more_views=(more,)) for pair in PLACEMENT.pairs))
    orders = ordered((mover("h1", -60, 0, 50), mover("h2", 0, -60, 20)), placed=fused)
    assert not isinstance(orders, NoSafeFlight)
    assert {order.host: order.more_views for order in orders} == {
        "h2": (),
        "h1": (("t1", CameraKind.PERIPHERAL),),
    }


def test_a_plan_that_uses_no_central_camera_aims_none() -> None:
    peripheral = placement(*PLACEMENT.hosts, camera=CameraKind.PERIPHERAL)
    orders = orders_for(
        peripheral,
        (mover("h1", -60, 0, 50), mover("h2", 0, -60, 20)),
        threats_now=(THREAT,),
        threats_then=(THREAT,),
        rules=RULES,
    )
    assert not isinstance(orders, NoSafeFlight)
    assert [order.aim for order in orders] == [None, None]


def test_a_host_is_not_sent_past_a_threat() -> None:
    orders = ordered((mover("h1", 60, 0, 50), mover("h2", 60, -5, 50), mover("h3", -10, -70, 30)))
    assert not isinstance(orders, NoSafeFlight)
    assert next(order.host for order in orders if order.position_m == (-40.0, 0.0, 50.0)) == "h3"


def test_a_host_flies_around_a_threat_that_is_in_its_way() -> None:
    movers = (mover("h1", 60, 0, 50), mover("h2", 60, -5, 50))
    orders = ordered(movers)
    assert not isinstance(orders, NoSafeFlight)
    west = next(order for order in orders if order.position_m == (-40.0, 0.0, 50.0))
    assert west.via_m
    flown = next(each for each in movers if each.id == west.host)
    way = (*west.via_m, west.position_m)
    assert clearance_m(flown, (west.position_m,), (THREAT,), horizon_s=10.0) < 20
    assert clearance_m(flown, way, (THREAT,), horizon_s=10.0) >= 20


def test_no_orders_when_every_way_leads_past_a_threat() -> None:
    fence = tuple(Threat(id=f"f{k}", position_m=(60.0 + 40 * c, 40 * s, 50.0)) for k, (c, s) in enumerate(RING))
    refused = orders_for(
        PLACEMENT,
        (mover("h1", 60, 0, 50), mover("h2", 60, -5, 50)),
        threats_now=fence,
        threats_then=(THREAT,),
        rules=RULES,
    )
    assert isinstance(refused, NoSafeFlight)
    assert "20 m from all threats" in refused.reason


def test_too_few_hosts_is_said_so() -> None:
    refused = ordered((mover("h1", -60, 0, 50),))
    assert isinstance(refused, NoSafeFlight)
    assert "needs 2 hosts; 1 can be sent" in refused.reason


def test_clearance_counts_where_the_threat_is_at_that_moment() -> None:
    flying, way = mover("h1", -100, 0, 50), ((100.0, 0.0, 50.0),)
    crossing = Threat(id="t1", position_m=(0.0, -100.0, 50.0), velocity_mps=(0.0, 10.0, 0.0))
    assert clearance_m(flying, way, (crossing,), horizon_s=20.0) == pytest.approx(0, abs=1 * CENTIMETRE)
    late = Threat(id="t1", position_m=(0.0, -100.0, 50.0), velocity_mps=(0.0, 1.0, 0.0))
    assert clearance_m(flying, way, (late,), horizon_s=20.0) > 80


def test_a_host_caught_inside_the_safety_distance_flies_out_and_never_nearer() -> None:
    caught = mover("h1", -5, 0, 50)
    for goal in ((-40.0, 0.0, 50.0), (40.0, 0.0, 50.0)):
        route = safe_route(caught, goal, (THREAT,), RULES)
        assert route is not None
        assert route.points_m[-1] == goal
        assert clearance_m(caught, route.points_m, (THREAT,), horizon_s=10.0) >= 5 - 1 * CENTIMETRE


places = st.tuples(st.floats(-80, 80), st.floats(-80, 80), st.floats(30, 50))


@given(places, places, st.lists(st.tuples(places, st.floats(-5, 5), st.floats(-5, 5)), max_size=3))
@settings(deadline=None, max_examples=60)
def test_no_route_comes_nearer_than_it_may(start: Point, goal: Point, moving: list[tuple[Point, float, float]]) -> None:
    threats = tuple(
        Threat(id=str(k), position_m=at, velocity_mps=(east, north, 0.0)) for k, (at, east, north) in enumerate(moving)
    )
    flying = Mover(id="h", position_m=start, speed_mps=10.0)
    route = safe_route(flying, goal, threats, RULES)
    if route is None:
        return
    for threat in threats:
        allowed = min(20.0, math.dist(start, threat.position_m))
        assert clearance_m(flying, route.points_m, (threat,), horizon_s=10.0) >= allowed - 1 * CENTIMETRE


def test_a_hover_point_is_given_only_to_a_host_with_the_rig_that_it_was_found_for() -> None:
    sharp = CameraRig(central=PinholeCamera(resolution_px=1920))
    near, far = mover("near", 0, -60, 20), replace(mover("a", -90, 0, 50), rig=sharp)
    others = (near, far, mover("b", -60, 0, 50))
    orders = ordered(others)
    assert not isinstance(orders, NoSafeFlight)
    assert {order.host: order.position_m for order in orders} == {"a": (0, -30, 20), "b": (-40, 0, 50)}
    alike = ordered(tuple(replace(each, rig=None) for each in others))
    assert not isinstance(alike, NoSafeFlight)
    assert {order.host for order in alike} == {"near", "b"}


corner = st.tuples(st.floats(-80, 80), st.floats(-80, 80))


@given(st.lists(corner, min_size=4, max_size=4), st.lists(corner, min_size=3, max_size=3), st.lists(corner, max_size=2))
@settings(deadline=None, max_examples=25)
def test_hosts_share_the_points_out_as_if_every_route_were_known(
    homes: list[tuple[float, float]], goals: list[tuple[float, float]], beside: list[tuple[float, float]]
) -> None:
    """Fewer routes are looked for; none shorter is missed."""
    movers = tuple(mover(f"h{number}", east, north, 50) for number, (east, north) in enumerate(homes))
    poses = [pose(name, (east, north, 50.0), None) for name, (east, north) in zip("abc", goals, strict=True)]
    threats = tuple(Threat(id=f"t{n}", position_m=(east, north, 50.0)) for n, (east, north) in enumerate(beside))
    loose = replace(RULES, separation_m=0.0)
    routes = [[safe_route(each, goal.position_m, threats, loose) for goal in poses] for each in movers]
    lengths_m = [[math.inf if route is None else route.length_m for route in row] for row in routes]
    best = assign(np.array(lengths_m))
    orders = orders_for(placement(*poses), movers, threats_now=threats, threats_then=threats, rules=loose)
    if best is None:
        assert isinstance(orders, NoSafeFlight)
        return
    assert not isinstance(orders, NoSafeFlight)
    flown_m = [
        sum(map(math.dist, way, way[1:]))
        for order in orders
        for each in movers
        if each.id == order.host and (way := [each.position_m, *order.via_m, order.position_m])
    ]
    best_m = [lengths_m[host][point] for point, host in enumerate(best)]
    assert max(flown_m) == pytest.approx(max(best_m), abs=CENTIMETRE)
    assert sum(flown_m) == pytest.approx(sum(best_m), abs=CENTIMETRE)
