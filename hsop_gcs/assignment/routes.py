"""Routes: how a host gets to its hover point without coming near a threat or leaving the airspace: straight, past what
is in the way by a point or two, or over or under it."""

import math
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import numpy.typing as npt

from hsop_gcs.assignment.corridor import corners_beside, why_outside
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point, Threat

FloatArray = npt.NDArray[np.float64]

_STEP_S = 0.2
_LATE_S = 2.0
"""How late a host may be on a whole flight: it speeds up, and slows down at each point of its route."""
_MARGINS_M = (4.0, 14.0)
"""How much farther than the safety distance detours lead past a threat: chords between them stay outside, from the
nearer ones to each other, from the farther ones also to a host close to the threat."""
_AROUND = 12
"""Detour points around each place of a threat."""
_ALONG = 3
"""Places of a threat's predicted path that detours are laid around."""
_GLANCES = 24
"""Moments of a way that are looked at before the whole of it."""
_OVER_M = 2.0
"""How far over or under keep-out areas ways lead that lead past none."""
_PASSED = 8
"""Threats, nearest to the straight line first, that detours are laid around."""
_NEAREST = 24
"""Detour points tried in pairs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A host that can be sent: where it is, ENU metres, and how fast it flies."""

    id: str
    position_m: Point
    speed_mps: float
    rig: CameraRig | None = None
    """None: the one that hosts have in common."""
    climb_mps: float = 1.5
    """Up and down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRules:
    """What every straight flight keeps to."""

    horizon_s: float
    """Threats fly straight on for so long; beyond it, they are taken to stay where that has brought them."""
    safety_distance_m: float
    separation_m: float
    airspace: Airspace = field(default_factory=Airspace)
    """The fence and the keep-out areas, and the limits of layers: floor and ceiling."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """The points a host flies to one after the other; the last is its hover point."""

    points_m: tuple[Point, ...]
    length_m: float


def straight(mover: Mover, goal_m: Point) -> Route:
    """Return the direct way."""
    return Route(points_m=(goal_m,), length_m=math.dist(mover.position_m, goal_m))


def safe_route(mover: Mover, goal_m: Point, threats: tuple[Threat, ...], rules: FlightRules) -> Route | None:
    """Return the shortest route found that is safe, or None. See ``why_unsafe``."""

    def shortest(ways: FloatArray, shorter_than: Route | None = None) -> Route | None:
        ways = ways[_may_be_safe(ways, mover, threats, rules)]
        lengths = np.linalg.norm(np.diff(ways, axis=1), axis=2).sum(axis=1)
        for index in np.argsort(lengths, kind="stable"):
            if shorter_than is not None and lengths[index] >= shorter_than.length_m:
                break
            points = tuple((east, north, up) for east, north, up in ways[index, 1:].tolist())
            if why_unsafe(mover, points, threats, rules) is None:
                return Route(points_m=points, length_m=float(lengths[index]))
        return shorter_than

    if _ends_too_near(mover, goal_m, threats, rules):
        return None
    start, goal = np.array(mover.position_m), np.array(goal_m)
    threats = _near_first(threats, start, goal, rules.horizon_s)
    direct = shortest(np.stack([start, goal])[None])
    corners = corners_beside(rules.airspace)
    if direct is not None or not (threats or corners):
        return direct
    beside = np.array([(east, north, 0.0) for east, north in corners]).reshape(-1, 3)
    if threats:
        rings = (
            _beside(threats[:_PASSED], rules.horizon_s, rules.safety_distance_m + margin_m) for margin_m in _MARGINS_M
        )
        beside = np.concatenate([beside, *rings])
    beside[:, 2] = goal[2]
    by_one = shortest(_ways(start, beside[:, None], goal))
    if by_one is not None and not corners:
        return by_one
    near = np.linalg.norm(beside - start, axis=1) + np.linalg.norm(beside - goal, axis=1)
    kept = beside[np.argsort(near, kind="stable")[:_NEAREST]]
    pairs = np.array([pair for pair in product(kept, kept) if pair[0] is not pair[1]])
    around = shortest(_ways(start, pairs, goal), by_one)
    return around or shortest(_ways(start, _over(start, goal, rules.airspace), goal))


def why_unsafe(
    mover: Mover,
    route_m: tuple[Point, ...],
    threats: tuple[Threat, ...],
    rules: FlightRules,
    *,
    within_s: float = math.inf,
    stays_s: float = 0.0,
) -> str | None:
    """Return what is wrong with flying a route from now on, for a person; None if it is safe.

    It keeps the safety distance from all threats flying straight on, inside the fence and outside keep-out areas; and
    a host that is already nearer to a threat than that may not come nearer still. within_s: how much of the flight is
    looked at; the whole of it may also begin late. stays_s: how long the host stays at its end.
    """
    way = np.array([mover.position_m, *route_m])
    places, times = _flown(way, mover, within_s, stays_s)
    for late_s in (0.0, _LATE_S) if math.isinf(within_s) else (0.0,):
        distances = _distances(places, times + late_s, threats, rules.horizon_s)
        near = _comes_near(distances, rules.safety_distance_m)
        if near.any():
            worst = int(np.argmin(np.where(near, distances.min(axis=1), np.inf)))
            return f"comes to {distances[worst].min():.0f} m from threat {threats[worst].id}"
    outside = why_outside(rules.airspace, (mover.position_m, *route_m))
    if outside is None or math.isinf(within_s):
        return outside
    return why_outside(rules.airspace, _stretch_m(mover, route_m, within_s))


def _stretch_m(mover: Mover, route_m: tuple[Point, ...], within_s: float) -> tuple[Point, ...]:
    """Return the points of the way that is flown within a time from now on, from where the host is."""
    way = np.array([mover.position_m, *route_m])
    reached_s = reached_times_s(way, mover)
    if within_s >= reached_s[-1]:
        return (mover.position_m, *route_m)
    east, north, up = (float(np.interp(within_s, reached_s, way[:, axis])) for axis in range(3))
    passed = int(np.searchsorted(reached_s, within_s, side="right"))
    return (*(mover.position_m, *route_m)[:passed], (east, north, up))


def _may_be_safe(
    ways: FloatArray, mover: Mover, threats: tuple[Threat, ...], rules: FlightRules
) -> npt.NDArray[np.bool_]:
    """Which of many ways, (ways, points, 3), keep their distance at a few moments each: for the others ``why_unsafe``
    need not be asked.
    """
    legs, lasting_s = np.diff(ways, axis=1), leg_times_s(ways, mover)
    begun_s = np.cumsum(lasting_s, axis=1) - lasting_s
    times = lasting_s.sum(axis=1)[:, None] * np.linspace(0.0, 1.0, _GLANCES)
    shares = np.clip((times[:, None] - begun_s[:, :, None]) / np.maximum(lasting_s, 1e-9)[:, :, None], 0.0, 1.0)
    places = ways[:, 0, :, None] + np.einsum("wlk,wlx->wxk", shares, legs)
    left = np.arange(len(ways))
    low, high = (places.min(axis=(0, 2), initial=np.inf), places.max(axis=(0, 2), initial=-np.inf))
    for threat in threats:
        ends = np.array([threat.position_m, threat.predicted_m(rules.horizon_s)])
        away_m = np.maximum(low - ends.max(axis=0), ends.min(axis=0) - high)
        if away_m.max() > rules.safety_distance_m:
            continue
        start, velocity = np.array(threat.position_m)[:, None], np.array(threat.velocity_mps)[:, None]
        at = start + velocity * np.minimum(times[left], rules.horizon_s)[:, None]
        apart_m = np.linalg.norm(places[left] - at, axis=1)
        left = left[~_comes_near(apart_m, rules.safety_distance_m)]
    safe = np.zeros(len(ways), dtype=bool)
    safe[left] = True
    return safe


def _comes_near(distances: FloatArray, safety_distance_m: float) -> npt.NDArray[np.bool_]:
    """Whether distances over time, (n, times) metres, fall below the safety distance, or once they are below it, at
    all.
    """
    reached = np.maximum.accumulate(distances, axis=1)
    return np.asarray(np.min(distances - np.minimum(safety_distance_m, reached), axis=1) < -1e-9)


def clearance_m(mover: Mover, route_m: tuple[Point, ...], threats: tuple[Threat, ...], *, horizon_s: float) -> float:
    """Return the least distance to any threat along a route flown from now on, metres; infinity without threats."""
    places, times = _flown(np.array([mover.position_m, *route_m]), mover, math.inf)
    return float(_distances(places, times, threats, horizon_s).min(initial=np.inf))


def gains_by_staying(
    mover: Mover, route_m: tuple[Point, ...], threats: tuple[Threat, ...], *, horizon_s: float, within_s: float
) -> bool:
    """Return whether a host that stays is farther from all threats, at the worst moment, than one that flies on."""
    way = np.array([mover.position_m, *route_m])
    places, times = _flown(way, mover, within_s)
    flying, staying = (_distances(at, times, threats, horizon_s) for at in (places, way[0, :, None]))
    return bool(flying.min(initial=np.inf) < staying.min(initial=np.inf))


def _ends_too_near(mover: Mover, goal_m: Point, threats: tuple[Threat, ...], rules: FlightRules) -> bool:
    """Whether no way is safe, for where it ends."""
    if math.dist(mover.position_m, goal_m) < mover.speed_mps * rules.horizon_s:
        return False  # it may be there before the threat is where its prediction ends
    return any(
        math.dist(goal_m, threat.predicted_m(rules.horizon_s))
        < min(rules.safety_distance_m, math.dist(mover.position_m, threat.position_m)) - 1e-9
        for threat in threats
    )


def _flown(way: FloatArray, mover: Mover, within_s: float, stays_s: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Where a host is that flies the way, (points, 3), at constant speed, and stays so long at its end: (3, times) ENU
    metres, and those times.
    """
    reached_s = reached_times_s(way, mover)
    times = np.arange(0.0, min(float(reached_s[-1]) + stays_s, within_s) + _STEP_S, _STEP_S)
    return np.stack([np.interp(times, reached_s, way[:, axis]) for axis in range(3)]), times


def _distances(places: FloatArray, times: FloatArray, threats: tuple[Threat, ...], horizon_s: float) -> FloatArray:
    """(threats, times) metres from places, (3, times), at times from now on.

    Beyond the horizon threats stay where their prediction ends: a longer way round does not make a goal safe.
    """
    start = np.array([threat.position_m for threat in threats]).reshape(-1, 3, 1)
    velocity = np.array([threat.velocity_mps for threat in threats]).reshape(-1, 3, 1)
    return np.asarray(np.linalg.norm(start + velocity * np.minimum(times, horizon_s) - places, axis=1))


def leg_times_s(way: FloatArray, mover: Mover) -> FloatArray:
    """Return how long each leg of ways, (..., points, 3), takes, (..., points - 1) seconds: its climb at least."""
    legs = np.diff(way, axis=-2)
    level_s, climb_s = np.linalg.norm(legs, axis=-1) / mover.speed_mps, np.abs(legs[..., 2]) / mover.climb_mps
    return np.asarray(np.maximum(level_s, climb_s))


def reached_times_s(way: FloatArray, mover: Mover) -> FloatArray:
    """Return when each point of a way, (points, 3), is reached, (points,) seconds from its start."""
    return np.concatenate([[0.0], np.cumsum(leg_times_s(way, mover))])


def _beside(threats: tuple[Threat, ...], horizon_s: float, radius_m: float) -> FloatArray:
    """Points around the threats' paths, (points, 3); their heights mean nothing."""
    angles = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    ring = radius_m * np.stack([np.cos(angles), np.sin(angles), np.zeros(_AROUND)], axis=1)
    places = [threat.predicted_m(after_s) for threat in threats for after_s in np.linspace(0.0, horizon_s, _ALONG)]
    # a threat at rest has one place, not several
    return np.unique(np.concatenate([np.round(place, 3) + ring for place in places]), axis=0)


def _near_first(
    threats: tuple[Threat, ...], start: FloatArray, goal: FloatArray, horizon_s: float
) -> tuple[Threat, ...]:
    """The threats, those first whose ways come nearest to the straight line."""
    if len(threats) <= _PASSED:
        return threats
    along = goal - start
    places = np.array([[t.predicted_m(after_s) for after_s in np.linspace(0.0, horizon_s, _ALONG)] for t in threats])
    shares = np.clip((places - start) @ along / max(float(along @ along), 1e-9), 0.0, 1.0)
    away_m = np.linalg.norm(places - start - shares[..., None] * along, axis=2).min(axis=1)
    return tuple(threats[n] for n in np.argsort(away_m, kind="stable"))


def _over(start: FloatArray, goal: FloatArray, airspace: Airspace) -> FloatArray:
    """(ways, 2, 3): straight up or down, and level as far as the goal, over or under the keep-out areas."""
    levels = {up for area in airspace.keep_outs for up in (area.ceiling_m + _OVER_M, area.floor_m - _OVER_M)}
    free = [up for up in sorted(levels, reverse=True) if math.isfinite(up) and airspace.altitude_room_m(up) >= 0]
    return np.array([[(*start[:2], up), (*goal[:2], up)] for up in free]).reshape(-1, 2, 3)


def _ways(start: FloatArray, via: FloatArray, goal: FloatArray) -> FloatArray:
    """(ways, points, 3): from the start by ``via``, (ways, points, 3), to the goal."""
    ends = np.ones((len(via), 1, 1))
    return np.concatenate([ends * start, via, ends * goal], axis=1)
