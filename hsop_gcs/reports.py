"""Threat reports: what radars and consoles tell us, brought into the mission's local frame.

A report is accepted whole or refused with a reason that names the field; nothing is repaired in silence. Altitudes
come with their datum: a radar's height above the ellipsoid and an autopilot's AMSL differ by tens of metres.
"""

from dataclasses import dataclass
from enum import StrEnum

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame

Vector3 = tuple[float, float, float]
"""East, north, up."""
Matrix3 = tuple[Vector3, Vector3, Vector3]

_NO_FIX_DEG = 1e-6
"""Receivers without a fix say 0/0, some after rounding."""


class AltitudeDatum(StrEnum):
    AMSL = "amsl"
    """Above mean sea level."""
    HAE = "hae"
    """Above the WGS-84 ellipsoid."""
    AGL = "agl"
    """Above the ground at the mission's origin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """One sighting: time in seconds since the Unix epoch, ENU metres and metres per second."""

    source: str
    threat_id: str | None
    """The source's own name for the threat."""
    time_s: float
    position_m: Vector3
    velocity_mps: Vector3 | None = None
    size_m: float | None = None
    sigma_m: float | None = None
    """Standard deviation of the position, each axis."""
    velocity_sigma_mps: float | None = None
    """Standard deviation of the velocity, each axis."""
    covariance_m2: Matrix3 | None = None
    """Of the position, where the source knows all of it (cameras do); stands in for ``sigma_m``."""
    common_m2: Matrix3 | None = None
    """The part of ``covariance_m2`` that the next reports have in common with this one: they do not better it."""
    track_id: str | None = None
    """Our own name for the threat, from a source that knows it (our cameras do)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """One direction in which a camera saw something: time in seconds since the Unix epoch, ENU metres."""

    source: str
    """Each camera of each host is a source of its own."""
    time_s: float
    origin_m: Vector3
    direction: Vector3
    """ENU, of any length but zero."""
    sigma_rad: float
    """Standard deviation of the direction, across the ray, each of the two axes."""
    threat_id: str | None = None
    track_id: str | None = None


Measurement = Report | Bearing
"""What a track can be updated with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """Where the mission takes place: the local frame, and what converts altitudes to AMSL."""

    frame: LocalFrame
    geoid_separation_m: float | None = None
    """Ellipsoid height minus AMSL; None: unknown, and reports above the ellipsoid are refused."""

    def altitude_amsl_m(self, altitude_m: float, datum: AltitudeDatum) -> float:
        """Return the altitude AMSL. Raises BadInput if the datum cannot be converted at this site."""
        match datum:
            case AltitudeDatum.AMSL:
                return altitude_m
            case AltitudeDatum.AGL:
                return altitude_m + self.frame.origin.altitude_amsl_m
            case AltitudeDatum.HAE:
                if self.geoid_separation_m is None:
                    raise BadInput("position.altitude_datum", "'hae' needs site.geoid_separation_m, which is not set")
                return altitude_m - self.geoid_separation_m


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportRules:
    """What a report must keep to be believed."""

    max_range_m: float = 20_000.0
    """Farther from the mission's origin than this is a mistake (or another mission)."""
    max_future_s: float = 2.0
    """How far a source's clock may run ahead of ours."""
    max_age_s: float = 30.0


def check_time(time_s: float, now_s: float, rules: ReportRules) -> None:
    """Raise BadInput for a time too far ahead of ``now_s`` or too old, all seconds since the Unix epoch."""
    if time_s > now_s + rules.max_future_s:
        raise BadInput("time", f"{time_s - now_s:.1f} s in the future; the limit is {rules.max_future_s:g} s")
    if time_s < now_s - rules.max_age_s:
        raise BadInput("time", f"{now_s - time_s:.1f} s old; the limit is {rules.max_age_s:g} s")


def locate(
    lat_deg: float, lon_deg: float, altitude_m: float, datum: AltitudeDatum, site: Site, rules: ReportRules
) -> Vector3:
    """Return the ENU position, metres. Raises BadInput for 0/0 (a receiver without a fix), a far place or a datum."""
    if abs(lat_deg) < _NO_FIX_DEG and abs(lon_deg) < _NO_FIX_DEG:
        raise BadInput("position", "latitude 0 and longitude 0 mean that the source has no fix")
    altitude_amsl_m = site.altitude_amsl_m(altitude_m, datum)
    point = GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=altitude_amsl_m)
    east, north, up = (float(value) for value in site.frame.to_enu(point))
    distance_m = (east**2 + north**2 + up**2) ** 0.5
    if distance_m > rules.max_range_m:
        raise BadInput(
            "position",
            f"{distance_m / 1000:.1f} km from the mission's origin; the limit is {rules.max_range_m / 1000:g} km",
        )
    return (east, north, up)
