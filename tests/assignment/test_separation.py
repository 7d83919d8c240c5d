"""Hosts keep apart whatever speeds they fly at: plans made by the planner, flown and measured here."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.assignment import (
    Departure,
    Flight,
    FlightRules,
    Mover,
    NoSafeFlight,
    arrange,
    in_the_way,
    safe_route,
)
from hsop_gcs.assignment.routes import Route
from hsop_gcs.assignment.separation import WANDER_M, gap_m
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point, Threat

MILLIMETRE = 0.001
SEPARATION_M = 10.0
RULES = FlightRules(
    horizon_s=10.0,
    safety_distance_m=20.0,
    separation_m=SEPARATION_M,
    airspace=Airspace(floor_m=10.0, ceiling_m=100.0),
)
TICK_S = 0.2


def mover(name: str, position_m: Point) -> Mover:
    return Mover(id=name, position_m=position_m, speed_mps=8.0)


def routes(goals_m: dict[str, Point], movers: tuple[Mover, ...], threats: tuple[Threat, ...] = ()) -> dict[str, Route]:
    by_id = {each.id: each for each in movers}
    found = {host: safe_route(by_id[host], goal_m, threats, RULES) for host, goal_m in goals_m.items()}
    return {host: route for host, route in found.items() if route is not None}


def arranged(goals_m: dict[str, Point], *at: Point, threats: tuple[Threat, ...] = ()) -> tuple[Departure, ...]:
    movers = tuple(mover(f"h{number}", place) for number, place in enumerate(at, start=1))
    departures = arrange(routes(goals_m, movers, threats), movers, threats, RULES)
    assert not isinstance(departures, NoSafeFlight), departures.reason
    return departures


class Sky:
    """Hosts that fly their routes at speeds nobody planned for, each as soon as nothing is in its way."""

    def __init__(self, departures: tuple[Departure, ...], at: dict[str, Point], rng: np.random.Generator) -> None:
        self.left = {each.host: [np.array(point) for point in each.route_m] for each in departures}
        self.at = {host: np.array(place) for host, place in at.items()}
        self.rank = {each.host: number for number, each in enumerate(departures)}
        self.flying: set[str] = set()
        self.rng = rng
        self.least_m = {pair: math.inf for pair in combinations(sorted(at), 2)}

    def flight(self, host: str, *, whole: bool = True) -> Flight:
        points = [self.at[host], *(self.left.get(host, []) if whole else [])]
        return Flight(host=host, points_m=tuple((float(e), float(n), float(u)) for e, n, u in points))

    def others(self, host: str) -> list[Flight]:
        ahead = {each for each in self.at if each in self.flying or self.rank.get(each, -1) < self.rank[host]}
        return [self.flight(each, whole=each in ahead) for each in self.at if each != host]

    def tick(self) -> None:
        for host in sorted(self.rank, key=self.rank.__getitem__):
            if host not in self.flying and in_the_way(self.flight(host), self.others(host), SEPARATION_M) is None:
                self.flying.add(host)
        for host in self.flying:
            self._advance(host, self.rng.uniform(1.0, 10.0) * TICK_S)
        for one, other in self.least_m:
            apart_m = float(np.linalg.norm(self.at[one] - self.at[other]))
            self.least_m[one, other] = min(self.least_m[one, other], apart_m)

    def _advance(self, host: str, step_m: float) -> None:
        while self.left[host] and step_m > 0:
            way = self.left[host][0] - self.at[host]
            length_m = float(np.linalg.norm(way))
            if length_m <= step_m:
                self.at[host] = self.left[host].pop(0)
                step_m -= length_m
            else:
                self.at[host] = self.at[host] + way * (step_m / length_m)
                step_m = 0.0

    def fly(self) -> None:
        for _ in range(20_000):
            self.tick()
            if not any(self.left.values()):
                return
        raise AssertionError(f"never arrived: {[host for host, left in self.left.items() if left]}")


def flown(departures: tuple[Departure, ...], at: dict[str, Point], seed: int = 0) -> Sky:
    sky = Sky(departures, at, np.random.default_rng(seed))
    sky.fly()
    return sky


def spread_out(points: list[Point]) -> bool:
    return all(math.dist(a, b) >= SEPARATION_M for a, b in combinations(points, 2))


places = st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(30, 60)), min_size=2, max_size=6).filter(
    spread_out
)


@given(places, places, st.integers(0, 2**32))
@settings(deadline=None, max_examples=40)
def test_whoever_flies_at_whatever_speed_nobody_comes_near_anybody(
    starts: list[Point], goals: list[Point], seed: int
) -> None:
    at = {f"h{number}": place for number, place in enumerate(starts)}
    goals_m = dict(zip(at, goals, strict=False))
    movers = tuple(mover(host, place) for host, place in at.items())
    departures = arrange(routes(goals_m, movers), movers, (), RULES)
    if isinstance(departures, NoSafeFlight):
        assert "cannot pass each other" in departures.reason
        return
    sky = flown(departures, at, seed)
    assert min(sky.least_m.values()) >= SEPARATION_M - WANDER_M - MILLIMETRE
    for host, goal in goals_m.items():
        assert sky.at[host] == pytest.approx(np.array(goal), abs=MILLIMETRE)


def test_nearly_every_wild_fleet_gets_where_it_should() -> None:
    rng, arrived = np.random.default_rng(7), 0
    for _ in range(40):
        points = [tuple(rng.uniform((-60, -60, 30), (60, 60, 60)).tolist()) for _ in range(12)]
        if not (spread_out(points[:6]) and spread_out(points[6:])):
            continue
        movers = tuple(mover(f"h{number}", point) for number, point in enumerate(points[:6]))
        goals_m = dict(zip((each.id for each in movers), points[6:], strict=True))
        assert not isinstance(arrange(routes(goals_m, movers), movers, (), RULES), NoSafeFlight)
        arrived += 1
    assert arrived >= 10


def test_flights_that_do_not_meet_depart_together() -> None:
    departures = arranged({"h1": (0, 50, 40), "h2": (30, 50, 40)}, (0, 0, 40), (30, 0, 40))
    assert [(each.route_m, each.wait_s) for each in departures] == [(((0, 50, 40),), 0), (((30, 50, 40),), 0)]


def test_of_two_that_cross_the_longer_flight_goes_first_and_the_other_waits() -> None:
    first, second = arranged({"h1": (0, 30, 40), "h2": (40, 0, 40)}, (0, -30, 40), (-40, 0, 40))
    assert first.host == "h2"
    assert [first.wait_s, second.wait_s] == pytest.approx([0.0, (40 + SEPARATION_M) / 8.0], abs=0.3)
    assert all(len(each.route_m) == 1 for each in (first, second))


def test_two_that_meet_head_on_pass_in_layers() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (60.0, 3.0, 40.0)}
    departures = arranged({"h1": (100.0, 0.0, 40.0), "h2": (-40.0, 3.0, 40.0)}, *at.values())
    high = next(each for each in departures if len(each.route_m) > 1)
    assert {point[2] for point in high.route_m[:-1]} == {52.0}
    assert min(flown(departures, at).least_m.values()) >= SEPARATION_M - WANDER_M


def test_two_that_change_places_do_not() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (60.0, 0.0, 40.0)}
    movers = tuple(mover(host, place) for host, place in at.items())
    refused = arrange(routes({"h1": at["h2"], "h2": at["h1"]}, movers), movers, (), RULES)
    assert isinstance(refused, NoSafeFlight)
    assert refused.reason == "hosts h1 and h2 cannot pass each other with 10 m between them"


def test_a_host_follows_into_a_place_only_when_it_is_left() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (30.0, 0.0, 40.0)}
    first, second = arranged({"h1": (30, 0, 40), "h2": (60, 0, 40)}, *at.values())
    assert (first.host, second.host) == ("h2", "h1")
    assert min(flown((first, second), at).least_m.values()) >= SEPARATION_M - WANDER_M


def test_an_idle_host_gives_way_and_one_that_cannot_be_sent_does_not() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (100.0, 3.0, 40.0)}
    departures = arranged({"h1": (100, 0, 40)}, *at.values())
    assert {each.host for each in departures} == {"h1", "h2"}
    assert min(flown(departures, at).least_m.values()) >= SEPARATION_M - WANDER_M
    standing = Flight(host="h2", points_m=((100.0, 3.0, 40.0),))
    movers = (mover("h1", at["h1"]),)
    refused = arrange(routes({"h1": (100, 0, 40)}, movers), movers, (), RULES, standing=(standing,))
    assert isinstance(refused, NoSafeFlight)
    assert refused.reason == "hosts h1 and h2 cannot pass each other with 10 m between them"


def test_a_layer_that_leads_past_a_threat_is_not_taken() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (60.0, 3.0, 40.0)}
    above = Threat(id="t1", position_m=(30.0, 0.0, 65.0))
    goals_m = {"h1": (100.0, 0.0, 40.0), "h2": (-40.0, 3.0, 40.0)}
    departures = arranged(goals_m, *at.values(), threats=(above,))
    assert {point[2] for each in departures for point in each.route_m[:-1]} == {28.0}


def test_hosts_that_are_too_near_already_may_part() -> None:
    at = {"h1": (0.0, 0.0, 40.0), "h2": (4.0, 0.0, 40.0)}
    departures = arranged({"h1": (-40, 0, 40), "h2": (44, 0, 40)}, *at.values())
    assert min(flown(departures, at).least_m.values()) >= 4.0 - MILLIMETRE


@given(st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=4, max_size=4))
@settings(deadline=None)
def test_the_gap_between_lines_is_the_least_distance_of_their_points(points: list[Point]) -> None:
    one, other = Flight(host="a", points_m=tuple(points[:2])), Flight(host="b", points_m=tuple(points[2:]))
    share = np.linspace(0, 1, 101)[:, None]
    a, b = (
        np.array(each.points_m[0]) + share * np.subtract(each.points_m[1], each.points_m[0]) for each in (one, other)
    )
    sampled_m = float(np.linalg.norm(a[:, None] - b[None], axis=2).min())
    step_m = max(math.dist(*each.points_m) for each in (one, other)) / 100
    assert sampled_m - step_m - MILLIMETRE <= gap_m(one, other) <= sampled_m + MILLIMETRE
