"""How a simulated quadrotor moves: towards a goal, within its limits, and never past it.

A point with velocity and heading. It brakes along the curve on which a constant deceleration ends at the goal, eases
into the last metre linearly, and tilts as its acceleration demands. Local ENU of the vehicle's home, metres, seconds,
radians; the ground is the plane z = 0. Stepping is a function of values: the same goal and steps give the same flight.
"""

import math
from dataclasses import dataclass, replace

from hsop_gcs.geometry.frames import wrap_rad

Point = tuple[float, float, float]

STEP_S = 0.02
_GRAVITY_MPS2 = 9.80665
_APPROACH_PER_S = 1.2
_BRAKING_SHARE = 0.7
"""Share of the acceleration limit that braking plans with; the rest turns the velocity."""
_GUST_SHARE = 0.1
"""Of a gust's speed, what a vehicle drifts before its controller has answered."""
_LEAN_PER_S = 0.24
"""Acceleration against a wind per metre and second of it: some 20 degrees of tilt in 15 m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """What the airframe can do."""

    cruise_mps: float = 8.0
    max_speed_mps: float = 15.0
    acceleration_mps2: float = 3.0
    climb_mps: float = 3.0
    descent_mps: float = 2.0
    vertical_acceleration_mps2: float = 2.0
    yaw_rate_rad_s: float = math.radians(60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightGoal:
    """Where to be. ``heading_rad`` is clockwise from north; None keeps the present one."""

    position_m: Point
    heading_rad: float | None = None
    cruise_mps: float | None = None
    """Horizontal speed of this leg; None is the airframe's own."""
    climb_mps: float | None = None
    """Vertical speeds of this leg; None are the airframe's own."""
    descent_mps: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightState:
    """Where the vehicle is. ``heading_rad`` is clockwise from north, [-pi, pi); roll right and nose up are positive."""

    position_m: Point
    velocity_mps: Point = (0.0, 0.0, 0.0)
    heading_rad: float = 0.0
    heading_rate_rad_s: float = 0.0
    push_mps: tuple[float, float] = (0.0, 0.0)
    """East and north, on top of the velocity that is controlled: what a gust does before the controller notices."""
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    @property
    def ground_speed_mps(self) -> float:
        return math.hypot(self.velocity_mps[0], self.velocity_mps[1])

    @property
    def on_ground(self) -> bool:
        return self.position_m[2] <= 0.0

    def halted(self) -> "FlightState":
        """Return the same place at rest and level, as a landed vehicle stands."""
        at_rest = replace(self, velocity_mps=(0.0, 0.0, 0.0), heading_rate_rad_s=0.0, push_mps=(0.0, 0.0))
        return replace(at_rest, roll_rad=0.0, pitch_rad=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """How the air moves, east and north: its mean, which a controller learns, and the gusts, which it does not."""

    mean_mps: tuple[float, float]
    gust_mps: tuple[float, float]


CALM = Air(mean_mps=(0.0, 0.0), gust_mps=(0.0, 0.0))


def step(
    state: FlightState, goal: FlightGoal, limits: FlightLimits, dt_s: float = STEP_S, air: Air = CALM
) -> FlightState:
    """Return the state ``dt_s`` later on the way to ``goal``. Touching the ground takes the downward speed away.

    The airframe's greatest speed is one through the air: a stronger wind carries it away.
    """
    east, north, up = (target - present for target, present in zip(goal.position_m, state.position_m, strict=True))
    cruise_mps = limits.cruise_mps if goal.cruise_mps is None else goal.cruise_mps
    cruise_mps = min(limits.max_speed_mps, max(0.0, cruise_mps))
    distance_m = math.hypot(east, north)
    speed_mps = min(cruise_mps, _approach_speed(distance_m, limits.acceleration_mps2))
    per_metre = speed_mps / distance_m if distance_m > 0.0 else 0.0
    ve, vn, vu = state.velocity_mps
    wind_e, wind_n = air.mean_mps
    through_e, through_n = _limited(east * per_metre - wind_e, north * per_metre - wind_n, limits.max_speed_mps)
    wanted_e, wanted_n = wind_e + through_e, wind_n + through_n
    ae, an = _limited((wanted_e - ve) / dt_s, (wanted_n - vn) / dt_s, limits.acceleration_mps2)

    vertical_mps = math.copysign(_approach_speed(abs(up), limits.vertical_acceleration_mps2), up)
    descent_mps = limits.descent_mps if goal.descent_mps is None else goal.descent_mps
    climb_mps = limits.climb_mps if goal.climb_mps is None else goal.climb_mps
    vertical_mps = min(climb_mps, max(-descent_mps, vertical_mps))
    au_limit = limits.vertical_acceleration_mps2
    au = min(au_limit, max(-au_limit, (vertical_mps - vu) / dt_s))

    ve, vn, vu = ve + ae * dt_s, vn + an * dt_s, vu + au * dt_s
    x, y, z = state.position_m
    z += vu * dt_s
    if z <= 0.0:
        z, vu = 0.0, max(0.0, vu)

    heading_rad, heading_rate_rad_s = _turned(state.heading_rad, goal.heading_rad, limits.yaw_rate_rad_s, dt_s)
    tilt_e, tilt_n = ae - _LEAN_PER_S * wind_e, an - _LEAN_PER_S * wind_n
    forward = tilt_n * math.cos(heading_rad) + tilt_e * math.sin(heading_rad)
    right = tilt_e * math.cos(heading_rad) - tilt_n * math.sin(heading_rad)
    push_e, push_n = (_GUST_SHARE * gust_mps for gust_mps in air.gust_mps)
    return FlightState(
        position_m=(x + (ve + push_e) * dt_s, y + (vn + push_n) * dt_s, z),
        velocity_mps=(ve, vn, vu),
        heading_rad=heading_rad,
        heading_rate_rad_s=heading_rate_rad_s,
        push_mps=(push_e, push_n),
        roll_rad=math.atan2(right, _GRAVITY_MPS2),
        pitch_rad=-math.atan2(forward, _GRAVITY_MPS2),
    )


def _approach_speed(distance_m: float, acceleration_mps2: float) -> float:
    """Return the speed at which one may still be ``distance_m`` before the goal: linear near it, a square root beyond.

    Both pieces meet with equal slope where the linear one would brake at the limit.
    """
    braking_mps2 = _BRAKING_SHARE * acceleration_mps2
    linear_until_m = braking_mps2 / _APPROACH_PER_S**2
    if distance_m <= linear_until_m:
        return _APPROACH_PER_S * distance_m
    return math.sqrt(2.0 * braking_mps2 * (distance_m - 0.5 * linear_until_m))


def _limited(east: float, north: float, limit: float) -> tuple[float, float]:
    size = math.hypot(east, north)
    share = limit / size if size > limit else 1.0
    return east * share, north * share


def _turned(heading_rad: float, goal_rad: float | None, rate_rad_s: float, dt_s: float) -> tuple[float, float]:
    if goal_rad is None:
        return heading_rad, 0.0
    turn = wrap_rad(goal_rad - heading_rad)
    turn = min(rate_rad_s * dt_s, max(-rate_rad_s * dt_s, turn))
    return wrap_rad(heading_rad + turn), turn / dt_s
