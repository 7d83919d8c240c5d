"""What both stacks report in the same words: one situation in, one MAVLink message out.

Altitudes are AMSL and, where a field says so, relative to home; NED velocities; everything scaled as MAVLink has it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.messages import (
    Altitude,
    Attitude,
    AttitudeQuaternion,
    GlobalPositionInt,
    GpsGlobalOrigin,
    GpsRawInt,
    LocalPositionNed,
    Message,
    SystemTime,
    VfrHud,
)
from hsop_gcs.simulator.flight import FlightState

_UNIX_AT_BOOT_S = 1_790_000_000
_FIX_3D = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """A vehicle at one moment, as its estimator sees it."""

    since_boot_s: float
    flight: FlightState
    place: GeodeticPoint
    home: GeodeticPoint
    origin: GeodeticPoint
    gps_fix: int

    @property
    def boot_ms(self) -> int:
        return round(self.since_boot_s * 1e3)

    @property
    def boot_us(self) -> int:
        return round(self.since_boot_s * 1e6)

    @property
    def relative_altitude_m(self) -> float:
        return self.place.altitude_amsl_m - self.home.altitude_amsl_m

    @property
    def heading_cdeg(self) -> int:
        return round(math.degrees(self.flight.heading_rad) * 100) % 36000

    @property
    def velocity_ned_mps(self) -> tuple[float, float, float]:
        east, north, up = self.flight.velocity_mps
        return north, east, -up


def e7(angle_deg: float) -> int:
    """Return degrees as MAVLink's 1e7 integer."""
    return round(angle_deg * 1e7)


def mm(length_m: float) -> int:
    return round(length_m * 1e3)


def _attitude(s: Situation) -> Attitude:
    f = s.flight
    return Attitude(
        time_boot_ms=s.boot_ms, roll=f.roll_rad, pitch=f.pitch_rad, yaw=f.heading_rad, yawspeed=f.heading_rate_rad_s
    )


def _attitude_quaternion(s: Situation) -> AttitudeQuaternion:
    f = s.flight
    cr, sr = math.cos(f.roll_rad / 2), math.sin(f.roll_rad / 2)
    cp, sp = math.cos(f.pitch_rad / 2), math.sin(f.pitch_rad / 2)
    cy, sy = math.cos(f.heading_rad / 2), math.sin(f.heading_rad / 2)
    return AttitudeQuaternion(
        time_boot_ms=s.boot_ms,
        q1=cr * cp * cy + sr * sp * sy,
        q2=sr * cp * cy - cr * sp * sy,
        q3=cr * sp * cy + sr * cp * sy,
        q4=cr * cp * sy - sr * sp * cy,
        yawspeed=f.heading_rate_rad_s,
    )


def global_position(s: Situation) -> GlobalPositionInt:
    """Return where the vehicle believes it is."""
    north, east, down = s.velocity_ned_mps
    return GlobalPositionInt(
        time_boot_ms=s.boot_ms,
        lat=e7(s.place.lat_deg),
        lon=e7(s.place.lon_deg),
        alt=mm(s.place.altitude_amsl_m),
        relative_alt=mm(s.relative_altitude_m),
        vx=round(north * 100),
        vy=round(east * 100),
        vz=round(down * 100),
        hdg=s.heading_cdeg,
    )


def _local_position(s: Situation) -> LocalPositionNed:
    east, north, up = s.flight.position_m
    vn, ve, vd = s.velocity_ned_mps
    return LocalPositionNed(time_boot_ms=s.boot_ms, x=north, y=east, z=-up, vx=vn, vy=ve, vz=vd)


def _gps_raw(s: Situation) -> GpsRawInt:
    east, north, _ = s.flight.velocity_mps
    return GpsRawInt(
        time_usec=s.boot_us,
        fix_type=s.gps_fix,
        lat=e7(s.place.lat_deg),
        lon=e7(s.place.lon_deg),
        alt=mm(s.place.altitude_amsl_m),
        eph=70,
        epv=110,
        vel=round(s.flight.ground_speed_mps * 100),
        cog=round(math.degrees(math.atan2(east, north)) * 100) % 36000,
        satellites_visible=10 if s.gps_fix >= _FIX_3D else 0,
        alt_ellipsoid=mm(s.place.altitude_amsl_m),
        h_acc=300,
        v_acc=300,
    )


def _vfr_hud(s: Situation) -> VfrHud:
    return VfrHud(
        groundspeed=s.flight.ground_speed_mps,
        heading=s.heading_cdeg // 100,
        throttle=0 if s.flight.on_ground else 40,
        alt=s.place.altitude_amsl_m,
        climb=s.flight.velocity_mps[2],
    )


def _altitude(s: Situation) -> Altitude:
    up = s.flight.position_m[2]
    return Altitude(
        time_usec=s.boot_us,
        altitude_monotonic=s.place.altitude_amsl_m,
        altitude_amsl=s.place.altitude_amsl_m,
        altitude_local=up,
        altitude_relative=s.relative_altitude_m,
        altitude_terrain=up,
        bottom_clearance=up,
    )


def _system_time(s: Situation) -> SystemTime:
    return SystemTime(time_unix_usec=_UNIX_AT_BOOT_S * 10**6 + s.boot_us, time_boot_ms=s.boot_ms)


def _gps_global_origin(s: Situation) -> GpsGlobalOrigin:
    return GpsGlobalOrigin(
        latitude=e7(s.origin.lat_deg),
        longitude=e7(s.origin.lon_deg),
        altitude=mm(s.origin.altitude_amsl_m),
        time_usec=s.boot_us,
    )


SAMPLERS: dict[int, Callable[[Situation], Message]] = {
    Attitude.ID: _attitude,
    AttitudeQuaternion.ID: _attitude_quaternion,
    GlobalPositionInt.ID: global_position,
    LocalPositionNed.ID: _local_position,
    GpsRawInt.ID: _gps_raw,
    VfrHud.ID: _vfr_hud,
    Altitude.ID: _altitude,
    SystemTime.ID: _system_time,
    GpsGlobalOrigin.ID: _gps_global_origin,
}
"""Message id -> its sampler, for every message that both stacks fill in alike."""
