"""What ArduPilot reports: next to nothing unasked, and the groups in which streams are asked for.

Source: a recording of 4.7.0-dev.
"""

from dataclasses import replace
from functools import partial

from hsop_gcs.link.enums import MavSysStatusSensor
from hsop_gcs.link.messages import (
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    EkfStatusReport,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    LocalPositionNed,
    MissionCurrent,
    PositionTargetGlobalInt,
    RequestDataStream,
    SysStatus,
    SystemTime,
    Timesync,
    VfrHud,
)
from hsop_gcs.simulator.telemetry import global_position
from hsop_gcs.simulator.vehicle import Sampler, Vehicle

FRESH_LINK_HZ = {Heartbeat.ID: 1.0, Timesync.ID: 0.1}

_SATELLITES_AFTER = 0.2
_ALL_GROUPS = 0
_STREAM_GROUPS = {
    2: {SysStatus.ID, GpsRawInt.ID, MissionCurrent.ID, PositionTargetGlobalInt.ID},
    6: {GlobalPositionInt.ID, LocalPositionNed.ID},
    10: {Attitude.ID},
    11: {VfrHud.ID},
    12: {SystemTime.ID, EkfStatusReport.ID, BatteryStatus.ID, GimbalDeviceAttitudeStatus.ID, GimbalManagerStatus.ID},
}
"""MAV_DATA_STREAM -> messages."""


def streams_of(request: RequestDataStream) -> list[int]:
    """Return the ids of the messages that a REQUEST_DATA_STREAM is about."""
    if request.req_stream_id == _ALL_GROUPS:
        return sorted(set().union(*_STREAM_GROUPS.values()))
    return sorted(_STREAM_GROUPS.get(request.req_stream_id, set()))


def reports(vehicle: Vehicle) -> dict[int, Sampler]:
    """Return how an ArduPilot fills in what it does not share with other stacks."""
    return {
        Timesync.ID: lambda: Timesync(ts1=round(vehicle.since_boot_s * 1e9)),
        SysStatus.ID: partial(_sys_status, vehicle),
        EkfStatusReport.ID: partial(_ekf_status, vehicle),
        ExtendedSysState.ID: lambda: ExtendedSysState(vtol_state=3, landed_state=vehicle.landed),
        MissionCurrent.ID: MissionCurrent,
        GlobalPositionInt.ID: partial(_global_position, vehicle),
        AutopilotVersion.ID: partial(_autopilot_version, vehicle),
    }


def _global_position(vehicle: Vehicle) -> GlobalPositionInt:
    """At latitude and longitude 0 while it has no satellites, some 9 of the 41 seconds until it is ready."""
    message = global_position(vehicle.situation())
    if vehicle.ready or vehicle.since_boot_s >= _SATELLITES_AFTER * vehicle.config.ready_after_s:
        return message
    return replace(message, lat=0, lon=0, alt=0)


def _sys_status(vehicle: Vehicle) -> SysStatus:
    healthy = 1198652463
    return SysStatus(
        onboard_control_sensors_present=1399979055,
        onboard_control_sensors_enabled=1398930479,
        onboard_control_sensors_health=healthy | (MavSysStatusSensor.PREARM_CHECK if vehicle.ready else 0),
        voltage_battery=vehicle.battery.voltage_mv,
        battery_remaining=vehicle.battery_percent,
    )


def _ekf_status(vehicle: Vehicle) -> EkfStatusReport:
    return EkfStatusReport(
        flags=831 if vehicle.ready else 167, pos_horiz_variance=0.009, pos_vert_variance=5e-5, compass_variance=0.03
    )


def _autopilot_version(vehicle: Vehicle) -> AutopilotVersion:
    uid2 = (vehicle.config.system, *(0,) * 17)
    return AutopilotVersion(capabilities=64495, flight_sw_version=67567616, uid2=uid2)
