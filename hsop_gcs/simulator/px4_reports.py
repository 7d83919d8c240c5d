"""What PX4 reports, and how often without being asked.  Source: a recording of v1.16.0."""

import math
from functools import partial
from itertools import count

import numpy as np

from hsop_gcs.link.enums import MavSysStatusSensor
from hsop_gcs.link.messages import (
    Altitude,
    Attitude,
    AttitudeQuaternion,
    AutopilotVersion,
    BatteryStatus,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    MissionCurrent,
    Ping,
    PositionTargetGlobalInt,
    SysStatus,
    VfrHud,
)
from hsop_gcs.simulator.telemetry import e7
from hsop_gcs.simulator.vehicle import Sampler, Vehicle

FRESH_LINK_HZ = {
    Heartbeat.ID: 1.0,
    Attitude.ID: 50.0,
    AttitudeQuaternion.ID: 50.0,
    GlobalPositionInt.ID: 50.0,
    LocalPositionNed.ID: 50.0,
    GpsRawInt.ID: 5.0,
    VfrHud.ID: 4.0,
    Altitude.ID: 1.0,
    ExtendedSysState.ID: 1.0,
    GimbalDeviceAttitudeStatus.ID: 1.0,
    SysStatus.ID: 1.0,
    PositionTargetGlobalInt.ID: 1.0,
    MissionCurrent.ID: 1.0,
    HomePosition.ID: 0.5,
    BatteryStatus.ID: 0.5,
    EstimatorStatus.ID: 0.5,
    GimbalManagerStatus.ID: 0.5,
    Ping.ID: 0.1,
}


def reports(vehicle: Vehicle) -> dict[int, Sampler]:
    """Return how a PX4 fills in what it does not share with other stacks."""
    return {
        SysStatus.ID: partial(_sys_status, vehicle),
        EstimatorStatus.ID: partial(_estimator_status, vehicle),
        PositionTargetGlobalInt.ID: partial(_position_target, vehicle),
        MissionCurrent.ID: lambda: MissionCurrent(seq=0, total=65535),
        Ping.ID: partial(_ping, vehicle, count()),
        AutopilotVersion.ID: partial(_autopilot_version, vehicle),
    }


def _sys_status(vehicle: Vehicle) -> SysStatus:
    return SysStatus(
        onboard_control_sensors_present=50348079,
        onboard_control_sensors_enabled=50413615,
        onboard_control_sensors_health=52480063 | (MavSysStatusSensor.PREARM_CHECK if vehicle.ready else 0),
        load=200,
        voltage_battery=vehicle.battery.voltage_mv,
        current_battery=-100,
        battery_remaining=vehicle.battery_percent,
    )


def _estimator_status(vehicle: Vehicle) -> EstimatorStatus:
    flags = 895 if vehicle.in_air else 1023
    return EstimatorStatus(
        time_usec=round(vehicle.since_boot_s * 1e6),
        flags=flags if vehicle.ready else 0x0A7,
        vel_ratio=0.05,
        pos_horiz_ratio=0.05,
        pos_vert_ratio=0.02,
        mag_ratio=0.07,
        tas_ratio=math.nan,
        pos_horiz_accuracy=0.3,
        pos_vert_accuracy=0.3,
    )


def _position_target(vehicle: Vehicle) -> PositionTargetGlobalInt | None:
    goal = vehicle.goal
    if goal is None or not vehicle.armed:
        return None
    place = vehicle.local.to_geodetic(np.array(goal.position_m))
    return PositionTargetGlobalInt(
        time_boot_ms=vehicle.boot_ms,
        coordinate_frame=5,
        lat_int=e7(place.lat_deg),
        lon_int=e7(place.lon_deg),
        alt=place.altitude_amsl_m,
        vx=math.nan,
        vy=math.nan,
        vz=math.nan,
        yaw=vehicle.state.heading_rad if goal.heading_rad is None else goal.heading_rad,
    )


def _ping(vehicle: Vehicle, numbers: "count[int]") -> Ping:
    return Ping(time_usec=round(vehicle.since_boot_s * 1e6), seq=next(numbers))


def _autopilot_version(vehicle: Vehicle) -> AutopilotVersion:
    system = vehicle.config.system
    return AutopilotVersion(
        capabilities=321791,
        flight_sw_version=17826047,
        middleware_sw_version=17826047,
        board_version=1,
        uid=system,
        uid2=(system, *(0,) * 17),
    )
