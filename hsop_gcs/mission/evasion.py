"""Ways out: whether a threat comes too near to a host, and where to the host flies so that it does not.

Wherever a threat flies straight on to, its track leaves open a tube around it: twice the standard deviation that its
position will have by then, but no more than hover points keep on top of the safety distance. A host is to stay out of
the tubes by the safety distance.

    safe ──it would come too near──► waits ──waiting would cost distance──► gives way ──safe──► goes on

Whoever waits stays on station: most threats that come towards a host turn away or pass. A way out never leads towards
a threat that is near. Pure.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import repeat

import numpy as np
import numpy.typing as npt

from hsop_gcs.mission.planning import PlanningRules, Sigma, Situation, margin_m
from hsop_gcs.placement.problem import Point, Threat

FloatArray = npt.NDArray[np.float64]

LOOK_S = 6.0
"""How far ahead threats are watched: by then a circling one is anywhere, and a host of 8 m/s is 30 m away."""
REACTION_S = 1.0
"""From a threat's state to a vehicle that answers to it: half a tick, the link, the autopilot, its leaning over."""
ACCELERATION_MPS2 = 2.0
"""What vehicles are sure to reach, on any axis, and to brake with; autopilots allow 2.5 to 5 m/s²."""
_WAIT_S = 0.4
"""How much later a way out has to be as good for a host to wait: two looks."""
_STEP_S = 0.2
_HEADINGS = 16
_FULL_SPEED_S = (0.8, 1.5, 2.5, 4.0, 6.0)
"""How long ways out are flown before the host brakes: the shortest that does is taken."""
_GAIN_M = 0.5
"""A host moves only if it gains this, of what it lacks at worst and on average."""
_LENGTH_WEIGHT = 0.01
"""What a metre of way costs, beside a metre that is lacking: of ways that are about as good, the shorter."""
_TOWARDS_MPS = (0.0, 0.4)
"""How fast a way out may lead towards a near threat: for tracks are a little wrong, the first; the second where there
is no other way, as between two threats."""
_STANDS_MPS = 0.3
"""Slower than this a host does not move towards anything."""
_SURE = Sigma(position_m=0.0, velocity_mps=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tubes:
    """Where threats will be, (threats, 3, times) ENU metres, and how far around that, (threats, times) metres."""

    ids: tuple[str, ...]
    places_m: FloatArray
    radii_m: FloatArray
    safety_distance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A host as it moves: ENU metres and metres per second, and what it may fly at most."""

    position_m: Point
    velocity_mps: Point
    speed_mps: float
    climb_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """How near a threat is expected to come to a host within the look ahead."""

    threat: str
    distance_m: float
    lacks_m: float
    """What is lacking to the safety distance from the tubes, at worst and on average; 0: nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WayOut:
    """Where to a host gives way, and how it would fare: see ``Approach``."""

    goal_m: Point
    lacks_m: float


def tubes(known: Situation, rules: PlanningRules) -> Tubes:
    """Return where the situation's threats will be during the look ahead."""
    times = _times()
    starts = np.array([threat.position_m for threat in known.threats]).reshape(-1, 3, 1)
    velocities = np.array([threat.velocity_mps for threat in known.threats]).reshape(-1, 3, 1)
    radii = [
        [min(2 * sigma.after(after_s), margin_m(rules, (sigma,))) for after_s in times]
        for _, sigma in zip(known.threats, known.sigmas or repeat(_SURE), strict=False)
    ]
    return Tubes(
        ids=tuple(threat.id for threat in known.threats),
        places_m=starts + velocities * times,
        radii_m=np.array(radii).reshape(-1, len(times)),
        safety_distance_m=rules.safety_distance_m,
    )


def may_come_near(body: Body, threats: Iterable[Threat], rules: PlanningRules, sigmas: Iterable[Sigma]) -> bool:
    """Return whether anything can come too near to a host within the look ahead; quick, and rather yes than no."""
    reach_m = rules.safety_distance_m + margin_m(rules, sigmas) + math.hypot(*body.velocity_mps) * LOOK_S
    return any(
        math.dist(body.position_m, threat.position_m) < reach_m + math.hypot(*threat.velocity_mps) * LOOK_S
        for threat in threats
    )


def staying(body: Body, threats: Tubes) -> Approach:
    """Return how near threats come to a host that stays, or brakes."""
    return _approach(_flown(body, np.zeros((1, 3)), np.array([0.0]))[0], threats)


def flying_to(body: Body, route_m: tuple[Point, ...], threats: Tubes) -> Approach:
    """Return how near threats come to a host that flies on along its route and stops at each of its points."""
    return _approach(_going(body, route_m), threats)


def closes_in(
    body: Body, route_m: tuple[Point, ...], threats: Tubes, *, within_s: float, answers_s: float = 0.0
) -> Approach | None:
    """Return how near a host comes to a threat towards which its own flight takes it, within the safety distance and
    almost half of what the track leaves open; None if it does not within this time.

    Flights depart with half of it in hand. answers_s: when the host begins to fly this route; before, it flies on.
    """
    places = _going(body, route_m, answers_s)
    away = threats.places_m - places
    apart_m = np.linalg.norm(away, axis=1)
    steps = np.diff(places[0], axis=1, append=places[0][:, -1:])
    towards = np.einsum("txn,xn->tn", away, steps) / np.maximum(apart_m, 1e-9) > _STANDS_MPS * _STEP_S
    doubt_m = np.maximum(threats.radii_m / 2 - _GAIN_M, 0.0)
    too_near = apart_m < threats.safety_distance_m + doubt_m
    closing = too_near & towards & (_times() <= within_s)
    if not closing.any():
        return None
    worst = int(np.argmin(np.where(closing, apart_m, np.inf).min(axis=1)))
    distance_m = float(apart_m[worst][closing[worst]].min())
    return Approach(threat=threats.ids[worst], distance_m=distance_m, lacks_m=float(_lacks(places, threats)[0]))


def can_wait(body: Body, threats: Tubes, *, allowed: Callable[[Point], bool]) -> bool:
    """Return whether a host that waits two more looks has a way out by which it lacks nothing. See ``way_out``."""
    few, many = _level_ways(body), _ways(body)
    return any(_best(body, threats, 0.0, allowed, ways, late_s=_WAIT_S) is not None for ways in (few, many))


def way_out(body: Body, threats: Tubes, *, than_m: float, allowed: Callable[[Point], bool]) -> WayOut | None:
    """Return the way out by which a host lacks least, if that is less than ``than_m`` by what is worth a flight.

    allowed: whether a host may fly straight to a point; asked of the best first.
    """
    return _best(body, threats, than_m - _GAIN_M, allowed, _ways(body))


def _best(
    body: Body,
    threats: Tubes,
    most_m: float,
    allowed: Callable[[Point], bool],
    tried: tuple[FloatArray, FloatArray],
    *,
    late_s: float = 0.0,
) -> WayOut | None:
    """The way of those tried that lacks least, and at most so much, begun so late."""
    ways, seconds = tried
    places, ends = _flown(body, ways, seconds, late_s=late_s)
    lacks = _lacks(places, threats)
    towards = _towards_mps(places, _flown(body, np.zeros((1, 3)), np.array([0.0]))[0], threats)
    costs = lacks + _LENGTH_WEIGHT * np.linalg.norm(ends - np.array(body.position_m), axis=1)
    more_than_mps = -math.inf
    for most_mps in _TOWARDS_MPS:
        good = np.flatnonzero((lacks <= most_m) & (towards <= most_mps) & (towards > more_than_mps))
        for index in good[np.argsort(costs[good], kind="stable")]:
            east, north, up = ends[index].tolist()
            if allowed((east, north, up)):
                return WayOut(goal_m=(east, north, up), lacks_m=float(lacks[index]))
        more_than_mps = most_mps
    return None


def _times() -> FloatArray:
    return np.arange(0.0, LOOK_S + _STEP_S / 2, _STEP_S)


def _level_ways(body: Body) -> tuple[FloatArray, FloatArray]:
    """A few of ``_ways``: mostly one of them does, and it takes a tenth of the time to see that."""
    ways, seconds = _ways(body)
    few = (ways[:, 2] == 0.0) & np.isin(seconds, _FULL_SPEED_S[2::2])
    return ways[few], seconds[few]


def _ways(body: Body) -> tuple[FloatArray, FloatArray]:
    """Velocities of ways out, (ways, 3), and how long each is flown, (ways,) seconds."""
    angles = np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS)
    level = body.speed_mps * np.stack([np.sin(angles), np.cos(angles), np.zeros(_HEADINGS)], axis=1)
    up = np.array([0.0, 0.0, body.climb_mps])
    velocities = np.concatenate([level, level + up, level - up, [up, -up]])
    return np.repeat(velocities, len(_FULL_SPEED_S), axis=0), np.tile(np.array(_FULL_SPEED_S), len(velocities))


def _flown(body: Body, ways: FloatArray, seconds: FloatArray, *, late_s: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Where a host is that answers after its reaction time, flies each way so long and brakes: places, (ways, 3,
    times), and where it comes to rest, (ways, 3).
    """
    times = _times()
    place = np.tile(np.array(body.position_m), (len(ways), 1))
    velocity = np.tile(np.array(body.velocity_mps), (len(ways), 1))
    begins_s = REACTION_S + late_s
    places = np.empty((len(ways), 3, len(times)))
    for number, time_s in enumerate(times):
        places[:, :, number] = place
        if time_s >= begins_s:
            wanted = np.where((time_s < begins_s + seconds - 1e-9)[:, None], ways, 0.0)
            velocity = velocity + _limited(wanted - velocity, ACCELERATION_MPS2 * _STEP_S)
        place = place + velocity * _STEP_S
    left_s = np.maximum(begins_s + seconds - times[-1], 0.0)
    brakes_s = np.linalg.norm(velocity, axis=1) / ACCELERATION_MPS2
    return places, place + velocity * (left_s + brakes_s / 2)[:, None]


def _going(body: Body, route_m: tuple[Point, ...], answers_s: float = 0.0) -> FloatArray:
    """Where a host is that flies its route, (1, 3, times), from when it answers on."""
    times = _times()
    place, velocity, ahead = np.array(body.position_m), np.array(body.velocity_mps), [np.array(at) for at in route_m]
    places = np.empty((1, 3, len(times)))
    for number, time_s in enumerate(times):
        places[0, :, number] = place
        if time_s < answers_s:
            place = place + velocity * _STEP_S
            continue
        way = ahead[0] - place
        away_m = float(np.linalg.norm(way))
        if away_m < 1.0 and len(ahead) > 1:
            ahead.pop(0)
        speed_mps = min(body.speed_mps, math.sqrt(1.5 * ACCELERATION_MPS2 * away_m), away_m / _STEP_S)
        wanted = way / max(away_m, 1e-9) * speed_mps
        velocity = velocity + _limited((wanted - velocity)[None], ACCELERATION_MPS2 * _STEP_S)[0]
        place = place + velocity * _STEP_S
    return places


def _limited(changes: FloatArray, most: float) -> FloatArray:
    sizes = np.linalg.norm(changes, axis=1)
    return np.asarray(changes * np.minimum(1.0, most / np.maximum(sizes, 1e-9))[:, None])


def _apart_m(places: FloatArray, threats: Tubes) -> FloatArray:
    """(ways, threats, times) metres between places, (ways, 3, times), and threats."""
    return np.asarray(np.linalg.norm(places[:, None] - threats.places_m[None], axis=2))


def _lacks(places: FloatArray, threats: Tubes) -> FloatArray:
    """What is lacking to the safety distance from all tubes, (ways,) metres: at worst, and on average on top."""
    clear_m = (_apart_m(places, threats) - threats.radii_m).min(axis=1)
    lacking = np.maximum(threats.safety_distance_m - clear_m, 0.0)
    return np.asarray(lacking.max(axis=1) + lacking.mean(axis=1))


def _towards_mps(places: FloatArray, braking: FloatArray, threats: Tubes) -> FloatArray:
    """The greatest speed at which each way leads towards a threat while the host is within the safety distance of its
    tube, (ways,), beyond what is left of its present speed if it brakes; 0 if it never is.
    """
    away = threats.places_m[None] - places[:, None]
    apart_m = np.linalg.norm(away, axis=2)
    steps, braking_steps = (np.diff(each, axis=2, append=each[:, :, -1:]) for each in (places, braking))
    changed = np.einsum("wtxn,wxn->wtn", away, steps - braking_steps) / np.maximum(apart_m, 1e-9) / _STEP_S
    near = apart_m < threats.safety_distance_m + threats.radii_m
    return np.asarray(np.where(near, changed, 0.0).max(axis=(1, 2)))


def _approach(places: FloatArray, threats: Tubes) -> Approach:
    apart_m = _apart_m(places, threats)[0]
    worst = int(np.argmin((apart_m - threats.radii_m).min(axis=1)))
    return Approach(
        threat=threats.ids[worst], distance_m=float(apart_m[worst].min()), lacks_m=float(_lacks(places, threats)[0])
    )
