"""Where things are: WGS-84, the mission's local ENU frame, compass angles and the camera's aim.

The local frame is the plane tangent to the ellipsoid at the mission's origin: x east, y north, z up, metres.
Altitudes here are AMSL and stand in for heights above the ellipsoid: over a mission's few kilometres the separation of
the two surfaces is a constant that cancels (it scales distances by less than 2e-5).
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

_SEMI_MAJOR_AXIS_M = 6378137.0
_FLATTENING = 1 / 298.257223563
_ECCENTRICITY_SQUARED = _FLATTENING * (2 - _FLATTENING)


@dataclass(frozen=True, slots=True, kw_only=True)
class GeodeticPoint:
    """A place on WGS-84; the altitude is AMSL."""

    lat_deg: float
    lon_deg: float
    altitude_amsl_m: float


class LocalFrame:
    """East-north-up frame, metres, at a geodetic origin."""

    def __init__(self, origin: GeodeticPoint) -> None:
        self.origin = origin
        lat, lon = math.radians(origin.lat_deg), math.radians(origin.lon_deg)
        self._origin_ecef = _to_ecef(origin)
        self._ecef_to_enu = np.array(
            [
                [-math.sin(lon), math.cos(lon), 0.0],
                [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)],
                [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)],
            ]
        )

    def to_enu(self, point: GeodeticPoint) -> Vector:
        """Return (3,), metres."""
        return self._ecef_to_enu @ (_to_ecef(point) - self._origin_ecef)

    def to_geodetic(self, position_m: Vector) -> GeodeticPoint:
        """Return the place at ``position_m`` (3,), ENU metres. Good to a micrometre within 100 km of the origin."""
        return _from_ecef(self._origin_ecef + self._ecef_to_enu.T @ np.asarray(position_m, dtype=np.float64))


def _to_ecef(point: GeodeticPoint) -> Vector:
    lat, lon, height = math.radians(point.lat_deg), math.radians(point.lon_deg), point.altitude_amsl_m
    prime_vertical = _SEMI_MAJOR_AXIS_M / math.sqrt(1 - _ECCENTRICITY_SQUARED * math.sin(lat) ** 2)
    return np.array(
        [
            (prime_vertical + height) * math.cos(lat) * math.cos(lon),
            (prime_vertical + height) * math.cos(lat) * math.sin(lon),
            (prime_vertical * (1 - _ECCENTRICITY_SQUARED) + height) * math.sin(lat),
        ]
    )


def _from_ecef(ecef: Vector) -> GeodeticPoint:
    """Bowring's start, then fixed-point steps; three reach rounding at any height an aircraft flies."""
    x, y, z = (float(value) for value in ecef)
    ring = math.hypot(x, y)
    lat = math.atan2(z, ring * (1 - _ECCENTRICITY_SQUARED))
    for _ in range(4):
        prime_vertical = _SEMI_MAJOR_AXIS_M / math.sqrt(1 - _ECCENTRICITY_SQUARED * math.sin(lat) ** 2)
        lat = math.atan2(z + _ECCENTRICITY_SQUARED * prime_vertical * math.sin(lat), ring)
    prime_vertical = _SEMI_MAJOR_AXIS_M / math.sqrt(1 - _ECCENTRICITY_SQUARED * math.sin(lat) ** 2)
    height = (
        ring * math.cos(lat) + z * math.sin(lat) - prime_vertical * (1 - _ECCENTRICITY_SQUARED * math.sin(lat) ** 2)
    )
    return GeodeticPoint(lat_deg=math.degrees(lat), lon_deg=math.degrees(math.atan2(y, x)), altitude_amsl_m=height)


def wrap_rad(angle_rad: float) -> float:
    """Return the same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi


def wrap_deg(angle_deg: float) -> float:
    """Return the same angle in [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def compass_deg(east: float, north: float) -> float:
    """Return the compass course of a horizontal direction, degrees clockwise from north, [0, 360)."""
    return math.degrees(math.atan2(east, north)) % 360.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """Where a camera looks: compass pan in [0, 360), tilt up positive, degrees."""

    pan_deg: float
    tilt_deg: float


def aim_at(from_m: Vector, target_m: Vector) -> Aim:
    """Return the aim from one place to another, both (3,), ENU metres. Straight up or down has pan 0."""
    east, north, up = (float(value) for value in np.asarray(target_m) - np.asarray(from_m))
    return Aim(pan_deg=compass_deg(east, north), tilt_deg=math.degrees(math.atan2(up, math.hypot(east, north))))


def aim_between(from_m: Vector, targets_m: Vector) -> Aim:
    """Return the aim that has all targets, (targets, 3), as near to the middle of the picture as can be."""
    aims = [aim_at(from_m, target) for target in targets_m]
    offsets = [wrap_deg(aim.pan_deg - aims[0].pan_deg) for aim in aims]
    tilts = [aim.tilt_deg for aim in aims]
    pan_deg = (aims[0].pan_deg + (min(offsets) + max(offsets)) / 2) % 360.0
    return Aim(pan_deg=pan_deg, tilt_deg=(min(tilts) + max(tilts)) / 2)
