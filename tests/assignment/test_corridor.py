"""Straight flights inside the fence and outside keep-outs, against sampled points; and the ways around."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.assignment import Flight, FlightRules, Mover, clear_of, safe_route, why_outside
from hsop_gcs.assignment.separation import WANDER_M, gap_m
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Point

DECIMETRE = 0.1
FENCE = ((-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (0.0, 60.0), (0.0, 0.0), (-60.0, 0.0))
"""An L: its corner at the origin points inwards."""
TOWER = KeepOut(polygon=((20.0, -40.0), (40.0, -40.0), (40.0, -20.0), (20.0, -20.0)), floor_m=0.0, ceiling_m=30.0)
AIRSPACE = Airspace(inside=(FENCE,), keep_outs=(TOWER,))
RULES = FlightRules(horizon_s=10.0, safety_distance_m=20.0, separation_m=10.0, airspace=AIRSPACE)

places = st.tuples(st.floats(-70, 70), st.floats(-70, 70), st.floats(5, 60))


def along(way: tuple[Point, ...], steps: int = 120) -> list[Point]:
    share = np.linspace(0, 1, steps)[:, None]
    legs = [np.array(a) + share * np.subtract(b, a) for a, b in pairwise(way)]
    return [(float(e), float(n), float(u)) for leg in legs for e, n, u in leg]


def room_m(way: tuple[Point, ...]) -> float:
    return min(min(AIRSPACE.fence_room_m(point), AIRSPACE.keep_out_room_m(point)) for point in along(way))


@given(places, places)
@settings(deadline=None, max_examples=60)
def test_a_straight_flight_is_judged_like_its_points(start: Point, goal: Point) -> None:
    room = room_m((start, goal))
    problem = why_outside(AIRSPACE, (start, goal))
    if room > 0:
        assert problem is None
    elif room < -5 * DECIMETRE and AIRSPACE.room_m(start) >= 0:
        assert problem in ("leaves the fence", "leads through a keep-out area")


@given(places, places)
@settings(deadline=None, max_examples=60)
def test_a_flight_that_begins_outside_comes_steadily_nearer_to_the_inside_and_stays_there(
    start: Point, goal: Point
) -> None:
    rooms = [AIRSPACE.room_m(point) for point in along((start, goal))]
    if rooms[0] < -DECIMETRE and why_outside(AIRSPACE, (start, goal)) is None:
        entry = next(index for index, room in enumerate(rooms) if room >= -DECIMETRE)
        assert all(after > before - 2 * DECIMETRE for before, after in pairwise(rooms[:entry]))
        assert min(rooms[entry:]) >= -5 * DECIMETRE


OUT, IN = (-20.0, 5.0, 20.0), (-20.0, -30.0, 20.0)
AT_THE_TOWER = (30.0, -22.0, 20.0)


@pytest.mark.parametrize(
    ("way", "problem"),
    [
        ((OUT, IN), None),
        ((OUT, IN, OUT), "leaves the fence"),
        ((OUT, (-20.0, 2.0, 20.0)), "leaves the fence"),
        ((OUT, (-20.0, 50.0, 20.0), (30.0, 50.0, 20.0)), "leaves the fence"),
        ((AT_THE_TOWER, (30.0, 10.0, 20.0)), None),
        ((AT_THE_TOWER, (30.0, -22.0, 50.0)), "leads through a keep-out area"),
        ((AT_THE_TOWER, (30.0, -60.0, 20.0)), "leads through a keep-out area"),
    ],
    ids=["back in", "and out again", "not far enough", "farther out first", "out of the tower", "up", "through it"],
)
def test_who_is_outside_may_fly_straight_back_in(way: tuple[Point, ...], problem: str | None) -> None:
    assert why_outside(AIRSPACE, way) == problem


@pytest.mark.parametrize(
    ("goal", "problem"),
    [
        ((-50.0, -20.0, 20.0), None),
        ((30.0, 50.0, 20.0), "leads through a keep-out area"),
        ((30.0, 50.0, 50.0), None),
        ((30.0, -50.0, 80.0), None),
        ((70.0, -50.0, 20.0), "leaves the fence"),
    ],
)
def test_a_keep_out_has_a_top_and_a_fence_has_none(goal: Point, problem: str | None) -> None:
    assert why_outside(AIRSPACE, ((30.0, -50.0, goal[2]), goal)) == problem


def test_descending_into_a_keep_out_is_seen_too() -> None:
    over, inside = (30.0, -30.0, 50.0), (30.0, -30.0, 10.0)
    assert why_outside(AIRSPACE, (over, inside)) == "leads through a keep-out area"
    assert why_outside(AIRSPACE, ((30.0, -50.0, 10.0), (30.0, -10.0, 55.0))) == "leads through a keep-out area"


@pytest.mark.parametrize(
    ("start", "goal"),
    [((-50.0, -20.0, 20.0), (20.0, 50.0, 20.0)), ((30.0, -50.0, 20.0), (30.0, 0.0, 20.0))],
    ids=["around the corner of the fence", "around the tower"],
)
def test_a_route_leads_around(start: Point, goal: Point) -> None:
    assert why_outside(AIRSPACE, (start, goal)) is not None
    route = safe_route(Mover(id="h1", position_m=start, speed_mps=8.0), goal, (), RULES)
    assert route is not None
    assert room_m((start, *route.points_m)) >= 0
    assert route.length_m < 1.6 * math.dist(start, goal)


def test_there_is_no_route_out_of_the_fence() -> None:
    start = Mover(id="h1", position_m=(30.0, 30.0, 20.0), speed_mps=8.0)
    assert safe_route(start, (100.0, 0.0, 20.0), (), RULES) is None


def test_what_there_is_no_way_around_is_flown_over_or_under() -> None:
    def shut_in_below(ceiling_m: float) -> Airspace:
        ring = [(-60.0, 60.0), (-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)]
        walls = [Flight(host="h9", points_m=((*a, 40.0), (*b, 40.0))) for a, b in pairwise(ring)]
        return replace(clear_of(Airspace(), walls, 10.0), floor_m=5.0, ceiling_m=ceiling_m)

    mover, goal = Mover(id="h1", position_m=(-100.0, 0.0, 40.0), speed_mps=8.0), (0.0, 0.0, 40.0)
    over = safe_route(mover, goal, (), replace(RULES, airspace=shut_in_below(60.0)))
    assert over is not None
    assert over.points_m == ((-100.0, 0.0, 52.0), (0.0, 0.0, 52.0), goal)
    under = safe_route(mover, goal, (), replace(RULES, airspace=shut_in_below(50.0)))
    assert under is not None
    assert under.points_m == ((-100.0, 0.0, 28.0), (0.0, 0.0, 28.0), goal)
    low = replace(shut_in_below(50.0), floor_m=30.0)
    assert safe_route(mover, goal, (), replace(RULES, airspace=low)) is None


@given(places, places, places, places)
@settings(deadline=None, max_examples=60)
def test_ways_that_keep_clear_of_an_aircraft_are_never_nearer_than_the_separation_less_what_hosts_wander(
    start: Point, goal: Point, at: Point, to: Point
) -> None:
    other, way = Flight(host="h9", points_m=(at, to)), Flight(host="h1", points_m=(start, goal))
    airspace = clear_of(Airspace(), [other], 10.0)
    if airspace.room_m(start) >= 0 and why_outside(airspace, way.points_m) is None:
        assert gap_m(way, other) >= 10.0 - WANDER_M
    if gap_m(way.start, other) < 10.0 - WANDER_M:
        assert why_outside(airspace, (start, start)) == "comes too near to h9"
