"""Separation: hosts keep their distance along their straight flights, whatever the speed they fly at.

A flight's place in the sky is the line it flies, not a line in time: wind, gusts and climbing make every timetable
wrong. So two hosts whose lines come near each other never fly them at once. One goes first; the other waits until what
is left of the first one's line is clear of its own. Where no order of departure does that (two hosts that change
places), one of them flies a layer higher or lower, or a host that no order needs gives way.

    A first, if A's line is clear of B where it waits, and of A where it will stand when B flies:
    gap(line A, start B) and gap(goal A, line B) at least the separation.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

from hsop_gcs.placement.problem import Point

WANDER_M = 0.5
"""How far two hosts that hover at the separation may wander towards each other."""
_RESOLUTION_M = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A host and the straight lines it flies, ENU metres: from where it is to where it stays. One point: it stays."""

    host: str
    points_m: tuple[Point, ...]

    @property
    def lines(self) -> tuple[tuple[Point, Point], ...]:
        return tuple(pairwise(self.points_m)) or ((self.points_m[0], self.points_m[0]),)

    @property
    def length_m(self) -> float:
        return sum(math.dist(a, b) for a, b in self.lines)

    @property
    def start(self) -> "Flight":
        return Flight(host=self.host, points_m=self.points_m[:1])

    @property
    def goal(self) -> "Flight":
        return Flight(host=self.host, points_m=self.points_m[-1:])


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflict:
    """Hosts that cannot all get where they should and keep the separation."""

    hosts: tuple[str, ...]


def gap_m(one: Flight, other: Flight) -> float:
    """Return the least distance between two lines, metres, each at any time."""
    return min(_segment_gap_m(a, b, c, d) for a, b in one.lines for c, d in other.lines)


def required_m(one: Flight, other: Flight, separation_m: float) -> float:
    """Return how near two lines may come: the separation, or for hosts that are nearer now, no nearer than that."""
    return min(separation_m, math.dist(one.points_m[0], other.points_m[0])) - WANDER_M


def in_the_way(flight: Flight, others: Iterable[Flight], separation_m: float) -> str | None:
    """Return the first host whose line, or place, comes nearer to the flight's line than it may; None: go."""
    for other in others:
        if other.host != flight.host and gap_m(flight, other) < required_m(flight, other, separation_m):
            return other.host
    return None


def departures(
    flights: tuple[Flight, ...],
    alternatives: Callable[[Flight], Iterable[Flight]],
    *,
    separation_m: float,
    late: Callable[[], bool] = lambda: False,
) -> tuple[Flight, ...] | Conflict:
    """Return the flights in an order of departure that keeps the separation, or the hosts that are in each other's way.

    Where no order does, flights are exchanged for their alternatives, as few as possible: always the one that frees the
    most hosts; when it is late, no more are looked for. Flights that come first depart first where it does not matter.
    """
    known: dict[str, tuple[Flight, ...]] = {}
    before = {flight.host: _before(flight, flights, separation_m) for flight in flights}
    while True:
        order, stuck = _sorted(flights, before)
        if not stuck:
            return order
        best, least = None, len(stuck)
        for flight in stuck:
            if late():
                break
            if flight.host not in known:
                known[flight.host] = tuple(alternatives(flight))
            for other in known[flight.host]:
                if late():
                    break
                tried = tuple(other if each.host == flight.host else each for each in flights)
                changed = _exchanged(before, other, tried, separation_m)
                left = len(_sorted(tried, changed)[1])
                if left < least:
                    best, least = (tried, changed), left
        if best is None:
            return Conflict(hosts=tuple(flight.host for flight in stuck))
        flights, before = best


def clear_after_m(first: Flight, second: Flight, separation_m: float) -> float:
    """Return how far the first has to fly until what is left of its line is clear of the second's, metres."""
    required = required_m(first, second, separation_m)

    def clear(flown_m: float) -> bool:
        return gap_m(_rest(first, flown_m), second) >= required

    if clear(0.0):
        return 0.0
    low, high = 0.0, first.length_m
    while high - low > _RESOLUTION_M:
        middle = (low + high) / 2
        low, high = (low, middle) if clear(middle) else (middle, high)
    return high


def _rest(flight: Flight, flown_m: float) -> Flight:
    """What is left of a flight."""
    points = list(flight.points_m)
    while len(points) > 1 and (length_m := math.dist(points[0], points[1])) <= flown_m:
        flown_m -= length_m
        points.pop(0)
    if len(points) > 1:
        (x, y, z), (u, v, w), share = points[0], points[1], flown_m / length_m
        points[0] = (x + share * (u - x), y + share * (v - y), z + share * (w - z))
    return Flight(host=flight.host, points_m=tuple(points))


def _before(flight: Flight, flights: tuple[Flight, ...], separation_m: float) -> set[str]:
    """The hosts that have to depart before this one."""
    return {other.host for other in flights if other.host != flight.host and _first(other, flight, separation_m)}


def _exchanged(
    before: dict[str, set[str]], new: Flight, flights: tuple[Flight, ...], separation_m: float
) -> dict[str, set[str]]:
    """Who has to depart before whom when one host flies another way."""
    changed = {
        flight.host: before[flight.host] - {new.host} | ({new.host} if _first(new, flight, separation_m) else set())
        for flight in flights
        if flight.host != new.host
    }
    return {**changed, new.host: _before(new, flights, separation_m)}


def _sorted(flights: tuple[Flight, ...], before: dict[str, set[str]]) -> tuple[tuple[Flight, ...], tuple[Flight, ...]]:
    """The flights in an order of departure, and those for which there is none."""
    order: list[Flight] = []
    waiting = list(flights)
    while waiting:
        hosts = {flight.host for flight in waiting}
        ready = next((flight for flight in waiting if not before[flight.host] & hosts), None)
        if ready is None:
            break
        waiting.remove(ready)
        order.append(ready)
    return tuple(order), tuple(waiting)


def _first(one: Flight, other: Flight, separation_m: float) -> bool:
    """Whether ``one`` has to depart before ``other``: it is in its way now, or the other would be in its way later."""
    if len(one.points_m) == len(other.points_m) == 1:
        return False
    required = required_m(one, other, separation_m)
    if _boxes_gap_m(one, other) >= required:
        return False
    return gap_m(one.start, other) < required or gap_m(one, other.goal) < required


def _boxes_gap_m(one: Flight, other: Flight) -> float:
    """How far the lines are apart at least, along one of the axes."""
    gaps_m = []
    for axis in range(3):
        here, there = [point[axis] for point in one.points_m], [point[axis] for point in other.points_m]
        gaps_m.append(max(min(here) - max(there), min(there) - max(here)))
    return max(gaps_m)


def _segment_gap_m(a: Point, b: Point, c: Point, d: Point) -> float:
    """The distance between segments ab and cd: between their lines if they are nearest inside, else from an end."""
    ends = min(_point_gap_m(a, c, d), _point_gap_m(b, c, d), _point_gap_m(c, a, b), _point_gap_m(d, a, b))
    u, v, w = _minus(b, a), _minus(d, c), _minus(a, c)
    uu, vv, uv, uw, vw = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, w), _dot(v, w)
    crossed = uu * vv - uv * uv
    if crossed <= 1e-9 * uu * vv:
        return ends
    s, t = (uv * vw - vv * uw) / crossed, (uu * vw - uv * uw) / crossed
    if not (0 <= s <= 1 and 0 <= t <= 1):
        return ends
    return min(ends, math.hypot(*(w[k] + s * u[k] - t * v[k] for k in range(3))))


def _point_gap_m(point: Point, a: Point, b: Point) -> float:
    along, here = _minus(b, a), _minus(point, a)
    length = _dot(along, along)
    share = min(max(_dot(here, along) / length, 0.0), 1.0) if length > 0 else 0.0
    return math.hypot(*(here[k] - share * along[k] for k in range(3)))


def _minus(a: Point, b: Point) -> Point:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
