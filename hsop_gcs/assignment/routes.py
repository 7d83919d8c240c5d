"""Routes: how a host gets to its hover point without coming near a threat: straight, or past it by a point or two."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.placement.problem import Point, Threat

FloatArray = npt.NDArray[np.float64]

_STEP_S = 0.2
_MARGIN_M = 4.0
"""How much farther than the safety distance detours lead past a threat: a chord between two of them stays outside."""
_AROUND = 12
"""Detour points around each place of a threat."""
_ALONG = 3
"""Places of a threat's predicted path that detours are laid around."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """The points a host flies to one after the other; the last is its hover point."""

    points_m: tuple[Point, ...]
    length_m: float


def safe_route(
    mover: Mover, goal_m: Point, threats: tuple[Threat, ...], *, horizon_s: float, safety_distance_m: float
) -> Route | None:
    """Return the shortest route found that keeps the safety distance from all threats flying straight on, or None.

    Threats are looked at for ``horizon_s``: beyond it their prediction means nothing. A host that is already nearer to
    a threat than the safety distance may not come nearer still.
    """

    def shortest(ways: FloatArray) -> Route | None:
        lengths = np.linalg.norm(np.diff(ways, axis=1), axis=2).sum(axis=1)
        for index in np.argsort(lengths, kind="stable"):
            if _clear(ways[index], mover, threats, horizon_s, safety_distance_m):
                points = tuple((east, north, up) for east, north, up in ways[index, 1:].tolist())
                return Route(points_m=points, length_m=float(lengths[index]))
        return None

    start, goal = np.array(mover.position_m), np.array(goal_m)
    direct = shortest(np.stack([start, goal])[None])
    if direct is not None or not threats:
        return direct
    beside = _beside(threats, horizon_s, safety_distance_m + _MARGIN_M)
    beside[:, 2] = goal[2]
    by_one = shortest(_ways(start, beside[:, None], goal))
    if by_one is not None:
        return by_one
    near = np.linalg.norm(beside - start, axis=1) + np.linalg.norm(beside - goal, axis=1)
    kept = beside[np.argsort(near, kind="stable")[:_NEAREST]]
    return shortest(_ways(start, np.array([pair for pair in product(kept, kept) if pair[0] is not pair[1]]), goal))


def clearance_m(mover: Mover, route_m: tuple[Point, ...], threats: tuple[Threat, ...], *, horizon_s: float) -> float:
    """Return the least distance to any threat along a route flown from now on, metres; infinity without threats."""
    way = np.array([mover.position_m, *route_m])
    return float(_distances(way, mover, threats, horizon_s).min(initial=np.inf))


def _clear(
    way: FloatArray, mover: Mover, threats: tuple[Threat, ...], horizon_s: float, safety_distance_m: float
) -> bool:
    distances = _distances(way, mover, threats, horizon_s)
    return bool(np.all(distances >= np.minimum(safety_distance_m, distances[:, :1]) - 1e-9))


def _distances(way: FloatArray, mover: Mover, threats: tuple[Threat, ...], horizon_s: float) -> FloatArray:
    """(threats, times) metres, for a host that flies the way, (points, 3), at constant speed from now on."""
    legs = np.linalg.norm(np.diff(way, axis=0), axis=1)
    reached_s = np.concatenate([[0.0], np.cumsum(legs)]) / mover.speed_mps
    times = np.arange(0.0, min(float(reached_s[-1]), horizon_s) + _STEP_S, _STEP_S)
    host = np.stack([np.interp(times, reached_s, way[:, axis]) for axis in range(3)])
    start = np.array([threat.position_m for threat in threats]).reshape(-1, 3, 1)
    velocity = np.array([threat.velocity_mps for threat in threats]).reshape(-1, 3, 1)
    return np.asarray(np.linalg.norm(start + velocity * times - host, axis=1))


def _beside(threats: tuple[Threat, ...], horizon_s: float, radius_m: float) -> FloatArray:
    """Points around the threats' paths, (points, 3); their heights mean nothing."""
    angles = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    ring = radius_m * np.stack([np.cos(angles), np.sin(angles), np.zeros(_AROUND)], axis=1)
    places = [threat.predicted_m(after_s) for threat in threats for after_s in np.linspace(0.0, horizon_s, _ALONG)]
    return np.concatenate([np.array(place) + ring for place in places])


def _ways(start: FloatArray, via: FloatArray, goal: FloatArray) -> FloatArray:
    """(ways, points, 3): from the start by ``via``, (ways, points, 3), to the goal."""
    ends = np.ones((len(via), 1, 1))
    return np.concatenate([ends * start, via, ends * goal], axis=1)
