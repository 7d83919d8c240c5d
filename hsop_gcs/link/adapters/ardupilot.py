"""ArduPilot Copter (4.3 and later).

A hover point is flown in GUIDED; DO_REPOSITION's yaw and speed are ignored. Hold is BRAKE, not DO_PAUSE_CONTINUE: a
paused GUIDED accepts the next DO_REPOSITION and does not move until it is continued or left.
The gimbal manager obeys anybody, and its yaw lock is the only flag that counts.

ArduPilot's other vehicles are only read, never ordered: their mode numbers mean other modes (Copter's Guided, 4, is
Plane's Acro).  Source: ArduPilot, mode.h of ArduCopter, ArduPlane, Rover, ArduSub and Blimp.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from hsop_gcs.link.adapters.adapter import Adapter, GimbalLimits, Mode
from hsop_gcs.link.adapters.failsafes import ARDUPILOT_FAILSAFES
from hsop_gcs.link.enums import GimbalFlags, MavType
from hsop_gcs.link.kinds import VTOLS
from hsop_gcs.link.messages import GimbalManagerInformation

_COPTER = {
    0: "Stabilize",
    1: "Acro",
    2: "Altitude hold",
    3: "Auto",
    4: "Guided",
    5: "Loiter",
    6: "RTL",
    7: "Circle",
    9: "Land",
    11: "Drift",
    13: "Sport",
    14: "Flip",
    15: "Autotune",
    16: "Position hold",
    17: "Brake",
    18: "Throw",
    19: "Avoid",
    20: "Guided without GPS",
    21: "Smart RTL",
    22: "Flow hold",
    23: "Follow",
    24: "Zigzag",
    25: "System identification",
    26: "Autorotate",
    27: "Auto RTL",
    28: "Turtle",
}
_PLANE = {
    0: "Manual",
    1: "Circle",
    2: "Stabilize",
    3: "Training",
    4: "Acro",
    5: "Fly by wire A",
    6: "Fly by wire B",
    7: "Cruise",
    8: "Autotune",
    10: "Auto",
    11: "RTL",
    12: "Loiter",
    13: "Takeoff",
    14: "Avoid",
    15: "Guided",
    16: "Initialising",
    17: "QStabilize",
    18: "QHover",
    19: "QLoiter",
    20: "QLand",
    21: "QRTL",
    22: "QAutotune",
    23: "QAcro",
    24: "Thermal",
    25: "Loiter to QLand",
    26: "Autoland",
}
_ROVER = {
    0: "Manual",
    1: "Acro",
    3: "Steering",
    4: "Hold",
    5: "Loiter",
    6: "Follow",
    7: "Simple",
    8: "Dock",
    9: "Circle",
    10: "Auto",
    11: "RTL",
    12: "Smart RTL",
    15: "Guided",
    16: "Initialising",
}
_SUB = {
    0: "Stabilize",
    1: "Acro",
    2: "Depth hold",
    3: "Auto",
    4: "Guided",
    7: "Circle",
    9: "Surface",
    16: "Position hold",
    19: "Manual",
    20: "Motor detection",
    21: "Surface tracking",
}
_BLIMP = {0: "Land", 1: "Manual", 2: "Velocity", 3: "Loiter", 4: "RTL"}


def _mode(number: int) -> Mode:
    return Mode(custom_mode=number, main=number)


def _names_in(modes: dict[int, str]) -> Callable[[int], str]:
    return lambda custom_mode: modes.get(custom_mode, f"mode {custom_mode}")


def _gimbal_limits(information: GimbalManagerInformation) -> GimbalLimits:
    return GimbalLimits(
        tilt_min_deg=math.degrees(information.pitch_min),
        tilt_max_deg=math.degrees(information.pitch_max),
        pan_min_deg=math.degrees(information.yaw_min),
        pan_max_deg=math.degrees(information.yaw_max),
    )


ARDUPILOT = Adapter(
    name="ardupilot",
    mode_name=_names_in(_COPTER),
    hover_mode=_mode(4),
    hold_mode=_mode(17),
    hold_is_reposition=False,
    take_off_mode=_mode(4),
    climb_mode=_mode(4),
    return_modes=(_mode(6), _mode(9)),
    take_off_altitude_is_amsl=False,
    heading_needs_follow_up=True,
    speed_needs_own_command=True,
    gimbal_flags=GimbalFlags.YAW_LOCK,
    gimbal_yaw_from_nose=False,
    gimbal_limits=_gimbal_limits,
    failsafes=ARDUPILOT_FAILSAFES,
    integers_bytewise=False,
)

_PLANES = replace(ARDUPILOT, mode_name=_names_in(_PLANE))
_ROVERS = replace(ARDUPILOT, mode_name=_names_in(_ROVER))
_OTHERS = {
    MavType.FIXED_WING: _PLANES,
    **dict.fromkeys(VTOLS, _PLANES),
    MavType.GROUND_ROVER: _ROVERS,
    MavType.SURFACE_BOAT: _ROVERS,
    MavType.SUBMARINE: replace(ARDUPILOT, mode_name=_names_in(_SUB)),
    MavType.AIRSHIP: replace(ARDUPILOT, mode_name=_names_in(_BLIMP)),
}


def ardupilot_of(vehicle_type: int) -> Adapter:
    """Return the adapter by which an ArduPilot on this MAV_TYPE is read; orders are given to Copters only."""
    return next((adapter for known, adapter in _OTHERS.items() if known == vehicle_type), ARDUPILOT)
