"""Flights of several hosts at once: each a safe route, in an order of departure that keeps them apart."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hsop_gcs.assignment.routes import FlightRules, Mover, Route, reached_times_s, why_unsafe
from hsop_gcs.assignment.separation import Conflict, Flight, clear_after_m, departures
from hsop_gcs.placement.problem import Point, Threat

_LAYERS = 2
"""Layers above and below that are tried."""
_LAYER_MARGIN_M = 2.0
_ACCELERATION_MPS2 = 2.0
"""Of a flight as a whole, its slow approach included; autopilots allow 3 to 5 m/s² at the most."""
_ASIDE = 8
"""Directions in which a host that is in the way may give way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """A host's flight: the points it flies to one after the other, and about how long it waits for others before."""

    host: str
    route_m: tuple[Point, ...]
    wait_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSafeFlight:
    """There is no safe way for every host."""

    reason: str
    hosts: tuple[str, ...] = ()
    """Hosts of the placement that cannot get to their hover points, or not past each other."""


def arrange(
    routes: Mapping[str, Route],
    movers: tuple[Mover, ...],
    threats: tuple[Threat, ...],
    rules: FlightRules,
    *,
    standing: Iterable[Flight] = (),
    late: Callable[[], bool] = lambda: False,
) -> tuple[Departure, ...] | NoSafeFlight:
    """Return a departure for every route, in order; hosts without one that have to give way are among them.

    movers: the hosts that can be sent, those with routes and idle ones. standing: what hovers there and does not give
    way. late: from then on no way past each other is looked for any more.
    """
    by_id = {mover.id: mover for mover in movers}
    flights = [Flight(host=host, points_m=(by_id[host].position_m, *route.points_m)) for host, route in routes.items()]
    flights.sort(key=lambda flight: (-flight.length_m, flight.host))
    idle = [Flight(host=mover.id, points_m=(mover.position_m,)) for mover in movers if mover.id not in routes]

    def alternatives(flight: Flight) -> Iterator[Flight]:
        mover = by_id.get(flight.host)
        if mover is not None:
            for points in _layers(flight, rules) if len(flight.points_m) > 1 else _asides(flight, rules):
                if why_unsafe(mover, points, threats, rules) is None:
                    yield replace(flight, points_m=(mover.position_m, *points))

    order = departures((*flights, *idle, *standing), alternatives, separation_m=rules.separation_m, late=late)
    if isinstance(order, Conflict):
        hosts = " and ".join(order.hosts)
        return NoSafeFlight(
            reason=f"hosts {hosts} cannot pass each other with {rules.separation_m:g} m between them", hosts=order.hosts
        )
    flown = [flight for flight in order if len(flight.points_m) > 1]
    return tuple(_timed(flown, by_id, rules.separation_m))


def flight_s(mover: Mover, route_m: tuple[Point, ...]) -> float:
    """Return how long a route takes, seconds: from rest, and to rest at each of its points."""
    legs = np.diff([mover.position_m, *route_m], axis=0)
    away_m, climbs_m = np.linalg.norm(legs, axis=1), np.abs(legs[:, 2])
    to_speed_m = mover.speed_mps**2 / _ACCELERATION_MPS2
    short_s = 2 * np.sqrt(away_m / _ACCELERATION_MPS2)
    long_s = (away_m + to_speed_m) / mover.speed_mps
    level_s = np.where(away_m < to_speed_m, short_s, long_s)
    return float(np.maximum(level_s, climbs_m / mover.climb_mps).sum())


def _timed(flown: list[Flight], movers: Mapping[str, Mover], separation_m: float) -> Iterator[Departure]:
    """About when each can depart: when those before it have passed."""
    leaves_s: dict[str, float] = {}
    for number, flight in enumerate(flown):
        leaves_s[flight.host] = max(
            (
                leaves_s[first.host] + _after_s(first, movers[first.host], near_m)
                for first in flown[:number]
                if (near_m := clear_after_m(first, flight, separation_m)) > 0
            ),
            default=0.0,
        )
        yield Departure(host=flight.host, route_m=flight.points_m[1:], wait_s=leaves_s[flight.host])


def _after_s(flight: Flight, mover: Mover, flown_m: float) -> float:
    way = np.array(flight.points_m)
    reached_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    reached_s = reached_times_s(way, mover)
    return float(np.interp(flown_m, reached_m, reached_s))


def _layers(flight: Flight, rules: FlightRules) -> Iterator[tuple[Point, ...]]:
    """The flight, climbed to a layer over or under it where it starts, and left where it ends."""
    ups = [point[2] for point in flight.points_m]
    for up_m in _heights(max(ups), min(ups), rules):
        yield (*((east, north, up_m) for east, north, _ in flight.points_m), flight.points_m[-1])


def _asides(flight: Flight, rules: FlightRules) -> Iterator[tuple[Point, ...]]:
    """Places over, under and beside where an idle host hovers."""
    ((east, north, up_m),) = flight.points_m
    for other_m in _heights(up_m, up_m, rules):
        yield ((east, north, other_m),)
    for number in range(1, _LAYERS + 1):
        away_m = number * (rules.separation_m + _LAYER_MARGIN_M)
        for angle in (2 * math.pi * k / _ASIDE for k in range(_ASIDE)):
            yield ((east + away_m * math.sin(angle), north + away_m * math.cos(angle), up_m),)


def _heights(highest_m: float, lowest_m: float, rules: FlightRules) -> Iterator[float]:
    for number in range(1, _LAYERS + 1):
        for up_m in (
            highest_m + number * (rules.separation_m + _LAYER_MARGIN_M),
            lowest_m - number * (rules.separation_m + _LAYER_MARGIN_M),
        ):
            if rules.airspace.altitude_room_m(up_m) >= 0:
                yield up_m
