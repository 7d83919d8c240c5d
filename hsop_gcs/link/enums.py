"""MAVLink's enumerations, as far as this system uses them.  Source: mavlink/mavlink common.xml and minimal.xml."""

from enum import IntEnum, IntFlag


class MavType(IntEnum):
    GENERIC = 0
    FIXED_WING = 1
    QUADROTOR = 2
    COAXIAL = 3
    HELICOPTER = 4
    ANTENNA_TRACKER = 5
    GCS = 6
    AIRSHIP = 7
    FREE_BALLOON = 8
    ROCKET = 9
    GROUND_ROVER = 10
    SURFACE_BOAT = 11
    SUBMARINE = 12
    HEXAROTOR = 13
    OCTOROTOR = 14
    TRICOPTER = 15
    FLAPPING_WING = 16
    KITE = 17
    ONBOARD_CONTROLLER = 18
    VTOL_DUOROTOR = 19
    VTOL_QUADROTOR = 20
    VTOL_TILTROTOR = 21
    VTOL_FIXEDROTOR = 22
    VTOL_TAILSITTER = 23
    VTOL_TILTWING = 24
    VTOL_RESERVED5 = 25
    GIMBAL = 26
    ADSB = 27
    PARAFOIL = 28
    DODECAROTOR = 29
    CAMERA = 30
    DECAROTOR = 35
    GENERIC_MULTIROTOR = 43
    SPACECRAFT_ORBITER = 45
    GROUND_QUADRUPED = 46
    VTOL_GYRODYNE = 47


class MavAutopilot(IntEnum):
    GENERIC = 0
    ARDUPILOTMEGA = 3
    INVALID = 8
    PX4 = 12


class MavState(IntEnum):
    UNINIT = 0
    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6
    POWEROFF = 7
    FLIGHT_TERMINATION = 8


class MavModeFlag(IntFlag):
    CUSTOM_MODE_ENABLED = 1
    TEST_ENABLED = 2
    AUTO_ENABLED = 4
    GUIDED_ENABLED = 8
    STABILIZE_ENABLED = 16
    HIL_ENABLED = 32
    MANUAL_INPUT_ENABLED = 64
    SAFETY_ARMED = 128


class MavComponent(IntEnum):
    ALL = 0
    AUTOPILOT1 = 1
    GIMBAL = 154
    GIMBAL2 = 171
    GIMBAL3 = 172
    GIMBAL4 = 173
    GIMBAL5 = 174
    GIMBAL6 = 175
    BATTERY = 180
    BATTERY2 = 181
    MISSIONPLANNER = 190


class MavResult(IntEnum):
    """Result of a command. Receivers treat a number that is not listed here as a failure."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6
    COMMAND_LONG_ONLY = 7
    COMMAND_INT_ONLY = 8
    UNSUPPORTED_MAV_FRAME = 9
    NOT_IN_CONTROL = 10


class MavCmd(IntEnum):
    NAV_LOITER_UNLIM = 17
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    COMPONENT_ARM_DISARM = 400
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    REQUEST_CAMERA_INFORMATION = 521
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002
    NAV_FENCE_CIRCLE_INCLUSION = 5003
    NAV_FENCE_CIRCLE_EXCLUSION = 5004


class MavMissionType(IntEnum):
    FENCE = 1
    ALL = 255


class MavMissionResult(IntEnum):
    ACCEPTED = 0
    NO_SPACE = 4
    INVALID = 5


class MavFrame(IntEnum):
    GLOBAL = 0
    LOCAL_NED = 1
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    LOCAL_OFFSET_NED = 7
    BODY_NED = 8
    BODY_OFFSET_NED = 9
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


class MavLandedState(IntEnum):
    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class MavBatteryChargeState(IntEnum):
    UNDEFINED = 0
    OK = 1
    LOW = 2
    CRITICAL = 3
    EMERGENCY = 4


class MavVtolState(IntEnum):
    UNDEFINED = 0
    TRANSITION_TO_FW = 1
    TRANSITION_TO_MC = 2
    MC = 3
    FW = 4


class MavBatteryFunction(IntEnum):
    UNKNOWN = 0
    ALL = 1
    PROPULSION = 2
    AVIONICS = 3
    PAYLOAD = 4


class MavSeverity(IntEnum):
    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7


class DoRepositionFlags(IntFlag):
    CHANGE_MODE = 1
    RELATIVE_YAW = 2


class PositionTargetTypemask(IntFlag):
    X_IGNORE = 1
    Y_IGNORE = 2
    Z_IGNORE = 4
    VX_IGNORE = 8
    VY_IGNORE = 16
    VZ_IGNORE = 32
    AX_IGNORE = 64
    AY_IGNORE = 128
    AZ_IGNORE = 256
    FORCE_SET = 512
    YAW_IGNORE = 1024
    YAW_RATE_IGNORE = 2048


class GimbalFlags(IntFlag):
    """GIMBAL_MANAGER_FLAGS and GIMBAL_DEVICE_FLAGS: the bits both share."""

    RETRACT = 1
    NEUTRAL = 2
    ROLL_LOCK = 4
    PITCH_LOCK = 8
    YAW_LOCK = 16
    YAW_IN_VEHICLE_FRAME = 32
    YAW_IN_EARTH_FRAME = 64


class MavSysStatusSensor(IntFlag):
    """What SYS_STATUS tells is there, enabled and healthy."""

    GYRO_3D = 1
    ACCEL_3D = 2
    MAG_3D = 4
    ABSOLUTE_PRESSURE = 8
    GPS = 32
    AHRS = 0x200000
    BATTERY = 0x2000000
    PREARM_CHECK = 0x10000000


class EstimatorFlags(IntFlag):
    """What PX4's ESTIMATOR_STATUS and ArduPilot's EKF_STATUS_REPORT say in the same bits."""

    POS_HORIZ_ABS = 16
    POS_VERT_ABS = 32
    CONST_POS_MODE = 128
