"""The MAVLink messages this system speaks, as plain values.

Names, order, integer scaling and units are those of the MAVLink definition, so that a reader can hold a class against
the specification; everything that is not plain SI says so beside the field. Conversions to SI happen one level up
(``link.protocol``, the adapters, the simulator). Fields default to zero, MAVLink's own value for a field not sent.

Source: mavlink/mavlink message_definitions/v1.0 (common, standard, ardupilotmega), as carried by pymavlink 2.4.50.
"""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """Base of all messages; ``NAME`` and ``ID`` are MAVLink's."""

    NAME: ClassVar[str]
    ID: ClassVar[int]


# Presence and identity


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat(Message):
    NAME = "HEARTBEAT"
    ID = 0

    type: int = 0
    autopilot: int = 0
    base_mode: int = 0
    custom_mode: int = 0
    system_status: int = 0
    mavlink_version: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotVersion(Message):
    NAME = "AUTOPILOT_VERSION"
    ID = 148

    capabilities: int = 0
    flight_sw_version: int = 0
    middleware_sw_version: int = 0
    os_sw_version: int = 0
    board_version: int = 0
    flight_custom_version: tuple[int, ...] = (0,) * 8
    middleware_custom_version: tuple[int, ...] = (0,) * 8
    os_custom_version: tuple[int, ...] = (0,) * 8
    vendor_id: int = 0
    product_id: int = 0
    uid: int = 0
    uid2: tuple[int, ...] = (0,) * 18


@dataclass(frozen=True, slots=True, kw_only=True)
class SysStatus(Message):
    NAME = "SYS_STATUS"
    ID = 1

    onboard_control_sensors_present: int = 0
    onboard_control_sensors_enabled: int = 0
    onboard_control_sensors_health: int = 0
    load: int = 0  # d%
    voltage_battery: int = 0  # mV
    current_battery: int = 0  # cA
    battery_remaining: int = 0  # %
    drop_rate_comm: int = 0  # c%
    errors_comm: int = 0
    errors_count1: int = 0
    errors_count2: int = 0
    errors_count3: int = 0
    errors_count4: int = 0
    onboard_control_sensors_present_extended: int = 0
    onboard_control_sensors_enabled_extended: int = 0
    onboard_control_sensors_health_extended: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryStatus(Message):
    NAME = "BATTERY_STATUS"
    ID = 147

    id: int = 0
    battery_function: int = 0
    type: int = 0
    temperature: int = 0  # cdegC
    voltages: tuple[int, ...] = (0,) * 10  # mV
    current_battery: int = 0  # cA
    current_consumed: int = 0  # mAh
    energy_consumed: int = 0  # hJ
    battery_remaining: int = 0  # %
    time_remaining: int = 0  # s
    charge_state: int = 0
    voltages_ext: tuple[int, ...] = (0,) * 4  # mV
    mode: int = 0
    fault_bitmask: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtendedSysState(Message):
    NAME = "EXTENDED_SYS_STATE"
    ID = 245

    vtol_state: int = 0
    landed_state: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusText(Message):
    NAME = "STATUSTEXT"
    ID = 253

    severity: int = 0
    text: str = ""
    id: int = 0
    chunk_seq: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Timesync(Message):
    NAME = "TIMESYNC"
    ID = 111

    tc1: int = 0  # ns
    ts1: int = 0  # ns


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping(Message):
    NAME = "PING"
    ID = 4

    time_usec: int = 0  # us
    seq: int = 0
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemTime(Message):
    NAME = "SYSTEM_TIME"
    ID = 2

    time_unix_usec: int = 0  # us
    time_boot_ms: int = 0  # ms


# Where the vehicle is


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalPositionInt(Message):
    NAME = "GLOBAL_POSITION_INT"
    ID = 33

    time_boot_ms: int = 0  # ms
    lat: int = 0  # degE7
    lon: int = 0  # degE7
    alt: int = 0  # mm
    relative_alt: int = 0  # mm
    vx: int = 0  # cm/s
    vy: int = 0  # cm/s
    vz: int = 0  # cm/s
    hdg: int = 0  # cdeg


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPositionNed(Message):
    NAME = "LOCAL_POSITION_NED"
    ID = 32

    time_boot_ms: int = 0  # ms
    x: float = 0.0  # m
    y: float = 0.0  # m
    z: float = 0.0  # m
    vx: float = 0.0  # m/s
    vy: float = 0.0  # m/s
    vz: float = 0.0  # m/s


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsRawInt(Message):
    NAME = "GPS_RAW_INT"
    ID = 24

    time_usec: int = 0  # us
    fix_type: int = 0
    lat: int = 0  # degE7
    lon: int = 0  # degE7
    alt: int = 0  # mm
    eph: int = 0
    epv: int = 0
    vel: int = 0  # cm/s
    cog: int = 0  # cdeg
    satellites_visible: int = 0
    alt_ellipsoid: int = 0  # mm
    h_acc: int = 0  # mm
    v_acc: int = 0  # mm
    vel_acc: int = 0  # mm/s
    hdg_acc: int = 0  # degE5
    yaw: int = 0  # cdeg


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsGlobalOrigin(Message):
    NAME = "GPS_GLOBAL_ORIGIN"
    ID = 49

    latitude: int = 0  # degE7
    longitude: int = 0  # degE7
    altitude: int = 0  # mm
    time_usec: int = 0  # us


@dataclass(frozen=True, slots=True, kw_only=True)
class HomePosition(Message):
    NAME = "HOME_POSITION"
    ID = 242

    latitude: int = 0  # degE7
    longitude: int = 0  # degE7
    altitude: int = 0  # mm
    x: float = 0.0  # m
    y: float = 0.0  # m
    z: float = 0.0  # m
    q: tuple[float, ...] = (0.0,) * 4
    approach_x: float = 0.0  # m
    approach_y: float = 0.0  # m
    approach_z: float = 0.0  # m
    time_usec: int = 0  # us


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude(Message):
    NAME = "ATTITUDE"
    ID = 30

    time_boot_ms: int = 0  # ms
    roll: float = 0.0  # rad
    pitch: float = 0.0  # rad
    yaw: float = 0.0  # rad
    rollspeed: float = 0.0  # rad/s
    pitchspeed: float = 0.0  # rad/s
    yawspeed: float = 0.0  # rad/s


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeQuaternion(Message):
    NAME = "ATTITUDE_QUATERNION"
    ID = 31

    time_boot_ms: int = 0  # ms
    q1: float = 0.0
    q2: float = 0.0
    q3: float = 0.0
    q4: float = 0.0
    rollspeed: float = 0.0  # rad/s
    pitchspeed: float = 0.0  # rad/s
    yawspeed: float = 0.0  # rad/s
    repr_offset_q: tuple[float, ...] = (0.0,) * 4


@dataclass(frozen=True, slots=True, kw_only=True)
class VfrHud(Message):
    NAME = "VFR_HUD"
    ID = 74

    airspeed: float = 0.0  # m/s
    groundspeed: float = 0.0  # m/s
    heading: int = 0  # deg
    throttle: int = 0  # %
    alt: float = 0.0  # m
    climb: float = 0.0  # m/s


@dataclass(frozen=True, slots=True, kw_only=True)
class EkfStatusReport(Message):
    NAME = "EKF_STATUS_REPORT"
    ID = 193

    flags: int = 0
    velocity_variance: float = 0.0
    pos_horiz_variance: float = 0.0
    pos_vert_variance: float = 0.0
    compass_variance: float = 0.0
    terrain_alt_variance: float = 0.0
    airspeed_variance: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorStatus(Message):
    NAME = "ESTIMATOR_STATUS"
    ID = 230

    time_usec: int = 0  # us
    flags: int = 0
    vel_ratio: float = 0.0
    pos_horiz_ratio: float = 0.0
    pos_vert_ratio: float = 0.0
    mag_ratio: float = 0.0
    hagl_ratio: float = 0.0
    tas_ratio: float = 0.0
    pos_horiz_accuracy: float = 0.0  # m
    pos_vert_accuracy: float = 0.0  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class Altitude(Message):
    NAME = "ALTITUDE"
    ID = 141

    time_usec: int = 0  # us
    altitude_monotonic: float = 0.0  # m
    altitude_amsl: float = 0.0  # m
    altitude_local: float = 0.0  # m
    altitude_relative: float = 0.0  # m
    altitude_terrain: float = 0.0  # m
    bottom_clearance: float = 0.0  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionTargetGlobalInt(Message):
    NAME = "POSITION_TARGET_GLOBAL_INT"
    ID = 87

    time_boot_ms: int = 0  # ms
    coordinate_frame: int = 0
    type_mask: int = 0
    lat_int: int = 0  # degE7
    lon_int: int = 0  # degE7
    alt: float = 0.0  # m
    vx: float = 0.0  # m/s
    vy: float = 0.0  # m/s
    vz: float = 0.0  # m/s
    afx: float = 0.0  # m/s/s
    afy: float = 0.0  # m/s/s
    afz: float = 0.0  # m/s/s
    yaw: float = 0.0  # rad
    yaw_rate: float = 0.0  # rad/s


# Orders


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandLong(Message):
    NAME = "COMMAND_LONG"
    ID = 76

    target_system: int = 0
    target_component: int = 0
    command: int = 0
    confirmation: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandInt(Message):
    NAME = "COMMAND_INT"
    ID = 75

    target_system: int = 0
    target_component: int = 0
    frame: int = 0
    command: int = 0
    current: int = 0
    autocontinue: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandAck(Message):
    NAME = "COMMAND_ACK"
    ID = 77

    command: int = 0
    result: int = 0
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMode(Message):
    NAME = "SET_MODE"
    ID = 11

    target_system: int = 0
    base_mode: int = 0
    custom_mode: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPositionTargetGlobalInt(Message):
    NAME = "SET_POSITION_TARGET_GLOBAL_INT"
    ID = 86

    time_boot_ms: int = 0  # ms
    target_system: int = 0
    target_component: int = 0
    coordinate_frame: int = 0
    type_mask: int = 0
    lat_int: int = 0  # degE7
    lon_int: int = 0  # degE7
    alt: float = 0.0  # m
    vx: float = 0.0  # m/s
    vy: float = 0.0  # m/s
    vz: float = 0.0  # m/s
    afx: float = 0.0  # m/s/s
    afy: float = 0.0  # m/s/s
    afz: float = 0.0  # m/s/s
    yaw: float = 0.0  # rad
    yaw_rate: float = 0.0  # rad/s


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestDataStream(Message):
    NAME = "REQUEST_DATA_STREAM"
    ID = 66

    target_system: int = 0
    target_component: int = 0
    req_stream_id: int = 0
    req_message_rate: int = 0  # Hz
    start_stop: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageInterval(Message):
    NAME = "MESSAGE_INTERVAL"
    ID = 244

    message_id: int = 0
    interval_us: int = 0  # us


# Gimbal protocol v2


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalManagerInformation(Message):
    NAME = "GIMBAL_MANAGER_INFORMATION"
    ID = 280

    time_boot_ms: int = 0  # ms
    cap_flags: int = 0
    gimbal_device_id: int = 0
    roll_min: float = 0.0  # rad
    roll_max: float = 0.0  # rad
    pitch_min: float = 0.0  # rad
    pitch_max: float = 0.0  # rad
    yaw_min: float = 0.0  # rad
    yaw_max: float = 0.0  # rad


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalManagerStatus(Message):
    NAME = "GIMBAL_MANAGER_STATUS"
    ID = 281

    time_boot_ms: int = 0  # ms
    flags: int = 0
    gimbal_device_id: int = 0
    primary_control_sysid: int = 0
    primary_control_compid: int = 0
    secondary_control_sysid: int = 0
    secondary_control_compid: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalManagerSetAttitude(Message):
    NAME = "GIMBAL_MANAGER_SET_ATTITUDE"
    ID = 282

    target_system: int = 0
    target_component: int = 0
    flags: int = 0
    gimbal_device_id: int = 0
    q: tuple[float, ...] = (0.0,) * 4
    angular_velocity_x: float = 0.0  # rad/s
    angular_velocity_y: float = 0.0  # rad/s
    angular_velocity_z: float = 0.0  # rad/s


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalManagerSetPitchyaw(Message):
    NAME = "GIMBAL_MANAGER_SET_PITCHYAW"
    ID = 287

    target_system: int = 0
    target_component: int = 0
    flags: int = 0
    gimbal_device_id: int = 0
    pitch: float = 0.0  # rad
    yaw: float = 0.0  # rad
    pitch_rate: float = 0.0  # rad/s
    yaw_rate: float = 0.0  # rad/s


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalDeviceAttitudeStatus(Message):
    NAME = "GIMBAL_DEVICE_ATTITUDE_STATUS"
    ID = 285

    target_system: int = 0
    target_component: int = 0
    time_boot_ms: int = 0  # ms
    flags: int = 0
    q: tuple[float, ...] = (0.0,) * 4
    angular_velocity_x: float = 0.0  # rad/s
    angular_velocity_y: float = 0.0  # rad/s
    angular_velocity_z: float = 0.0  # rad/s
    failure_flags: int = 0
    delta_yaw: float = 0.0  # rad
    delta_yaw_velocity: float = 0.0  # rad/s
    gimbal_device_id: int = 0


# Parameters, missions and files: what every ground station asks for


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamRequestList(Message):
    NAME = "PARAM_REQUEST_LIST"
    ID = 21

    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamRequestRead(Message):
    NAME = "PARAM_REQUEST_READ"
    ID = 20

    target_system: int = 0
    target_component: int = 0
    param_id: str = ""
    param_index: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamValue(Message):
    NAME = "PARAM_VALUE"
    ID = 22

    param_id: str = ""
    param_value: float = 0.0
    param_type: int = 0
    param_count: int = 0
    param_index: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSet(Message):
    NAME = "PARAM_SET"
    ID = 23

    target_system: int = 0
    target_component: int = 0
    param_id: str = ""
    param_value: float = 0.0
    param_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionRequestList(Message):
    NAME = "MISSION_REQUEST_LIST"
    ID = 43

    target_system: int = 0
    target_component: int = 0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionCount(Message):
    NAME = "MISSION_COUNT"
    ID = 44

    target_system: int = 0
    target_component: int = 0
    count: int = 0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionRequestInt(Message):
    NAME = "MISSION_REQUEST_INT"
    ID = 51

    target_system: int = 0
    target_component: int = 0
    seq: int = 0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionItemInt(Message):
    NAME = "MISSION_ITEM_INT"
    ID = 73

    target_system: int = 0
    target_component: int = 0
    seq: int = 0
    frame: int = 0
    command: int = 0
    current: int = 0
    autocontinue: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0  # degE7
    y: int = 0  # degE7
    z: float = 0.0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionAck(Message):
    NAME = "MISSION_ACK"
    ID = 47

    target_system: int = 0
    target_component: int = 0
    type: int = 0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionClearAll(Message):
    NAME = "MISSION_CLEAR_ALL"
    ID = 45

    target_system: int = 0
    target_component: int = 0
    mission_type: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FileTransferProtocol(Message):
    NAME = "FILE_TRANSFER_PROTOCOL"
    ID = 110

    target_network: int = 0
    target_system: int = 0
    target_component: int = 0
    payload: tuple[int, ...] = (0,) * 251


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionCurrent(Message):
    NAME = "MISSION_CURRENT"
    ID = 42

    seq: int = 0
    total: int = 0
    mission_state: int = 0
    mission_mode: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown(Message):
    """A frame whose id this system does not speak: counted, never acted on. Its checksum could not be verified."""

    NAME = "UNKNOWN"
    ID = -1

    message_id: int = 0
