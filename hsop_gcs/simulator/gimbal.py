"""A simulated pan-tilt gimbal with its manager: who may steer it, where it is told to look, where it looks.

Angles are radians: pitch up positive against the horizon (the gimbal is stabilized), yaw clockwise, either against the
vehicle's nose (follow) or against north (lock). How a stack words orders and reports stays with its personality.
"""

import math
from dataclasses import dataclass

from hsop_gcs.geometry.frames import wrap_rad

Quaternion = tuple[float, float, float, float]
Identity = tuple[int, int]
"""System and component id of a MAVLink sender."""

NOBODY: Identity = (0, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalLimits:
    """Where a gimbal can look against its vehicle, and how fast it turns. A full circle of yaw has no end stop."""

    pitch_min_rad: float = math.radians(-90.0)
    pitch_max_rad: float = math.radians(90.0)
    yaw_min_rad: float = math.radians(-180.0)
    yaw_max_rad: float = math.radians(180.0)
    slew_rad_s: float = math.radians(120.0)
    """``math.inf`` for a gimbal that reports what it was told, as simulated ones without a model do."""

    @property
    def full_circle(self) -> bool:
        return self.yaw_max_rad - self.yaw_min_rad >= 2 * math.pi

    def clip_pitch(self, pitch_rad: float) -> float:
        return min(self.pitch_max_rad, max(self.pitch_min_rad, pitch_rad))

    def clip_yaw(self, yaw_rad: float) -> float:
        """Return the nearest reachable vehicle-frame yaw, in [-pi, pi)."""
        yaw_rad = wrap_rad(yaw_rad)
        return yaw_rad if self.full_circle else min(self.yaw_max_rad, max(self.yaw_min_rad, yaw_rad))


class Gimbal:
    """One gimbal: an order (angles or rates), the present aim, the primary and secondary controller."""

    def __init__(self, limits: GimbalLimits, *, pitch_rad: float = 0.0) -> None:
        self.limits = limits
        self.pitch_rad = limits.clip_pitch(pitch_rad)
        self.yaw_rad = 0.0
        """Present yaw in the vehicle frame."""
        self.primary: Identity = NOBODY
        self.secondary: Identity = NOBODY
        self.locked = False
        """True: the yaw order is against north and holds while the vehicle turns."""
        self._order_pitch_rad = self.pitch_rad
        self._order_yaw_rad = 0.0
        self._rate_rad_s = (0.0, 0.0)
        self._vehicle_heading_rad = 0.0

    @property
    def earth_yaw_rad(self) -> float:
        """Present yaw against north, [-pi, pi)."""
        return wrap_rad(self.yaw_rad + self._vehicle_heading_rad)

    def point(self, *, pitch_rad: float | None = None, yaw_rad: float | None = None, locked: bool) -> None:
        """Aim at angles; None keeps where the gimbal looks. ``locked``: yaw is against north, else against the nose."""
        self._rate_rad_s = (0.0, 0.0)
        self._order_pitch_rad = self.pitch_rad if pitch_rad is None else self.limits.clip_pitch(pitch_rad)
        present = self.earth_yaw_rad if locked else self.yaw_rad
        self._order_yaw_rad = present if yaw_rad is None else wrap_rad(yaw_rad)
        self.locked = locked

    def turn(self, *, pitch_rad_s: float, yaw_rad_s: float, locked: bool) -> None:
        """Turn at rates until the next order."""
        self.point(locked=locked)
        self._rate_rad_s = (pitch_rad_s, yaw_rad_s)

    def step(self, dt_s: float, vehicle_heading_rad: float, *, stuck: bool = False) -> None:
        """Move for ``dt_s`` seconds under a vehicle with this heading; ``stuck``: turn with it and not by itself."""
        self._vehicle_heading_rad = vehicle_heading_rad
        if stuck:
            return
        pitch_rate, yaw_rate = self._rate_rad_s
        self._order_pitch_rad = self.limits.clip_pitch(self._order_pitch_rad + pitch_rate * dt_s)
        self._order_yaw_rad = wrap_rad(self._order_yaw_rad + yaw_rate * dt_s)
        wanted_yaw = self._order_yaw_rad - vehicle_heading_rad if self.locked else self._order_yaw_rad
        reach = self.limits.slew_rad_s * dt_s
        self.pitch_rad += _within(self._order_pitch_rad - self.pitch_rad, reach)
        way = self.limits.clip_yaw(wanted_yaw) - self.yaw_rad
        # With an end stop the gimbal unwinds through the front; without, it takes the shorter side.
        self.yaw_rad = wrap_rad(self.yaw_rad + _within(wrap_rad(way) if self.limits.full_circle else way, reach))

    def configure(
        self, primary: tuple[float, float], secondary: tuple[float, float], *, sender: Identity, me: Identity
    ) -> None:
        """Hand over control as DO_GIMBAL_MANAGER_CONFIGURE words it; -2 ("me") means ``me``, -3 releases one's own."""
        self.primary = _controller(self.primary, primary, sender, me)
        self.secondary = _controller(self.secondary, secondary, sender, me)


def quaternion(*, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return (w, x, y, z) of a turn by yaw, then pitch, without roll (MAVLink's order, z down)."""
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return (cp * cy, -sp * sy, sp * cy, cp * sy)


def pitch_yaw(q: tuple[float, ...]) -> tuple[float, float]:
    """Return (pitch, yaw) of a quaternion (w, x, y, z), radians; NaN, MAVLink's "unused", if it is none."""
    w, x, y, z = q
    if not all(map(math.isfinite, q)):
        return math.nan, math.nan
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _within(way: float, reach: float) -> float:
    return min(reach, max(-reach, way))


def _controller(present: Identity, wanted: tuple[float, float], sender: Identity, me: Identity) -> Identity:
    match wanted[0]:
        case -1:
            return present
        case -2:
            return me
        case -3:
            return NOBODY if present == sender else present
        case system if 0 <= system <= 255 and 0 <= wanted[1] <= 255:
            return round(system), round(wanted[1])
        case _:
            return present
