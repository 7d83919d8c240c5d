"""ArduPilot Copter (4.3 and later).

A hover point is flown in GUIDED; DO_REPOSITION's yaw and speed are ignored. Hold is BRAKE, not DO_PAUSE_CONTINUE: a
paused GUIDED accepts the next DO_REPOSITION and does not move until it is continued or left.
The gimbal manager obeys anybody, and its yaw lock is the only flag that counts.
"""

import math

from hsop_gcs.link.adapters.adapter import Adapter, GimbalLimits, Mode
from hsop_gcs.link.enums import GimbalFlags
from hsop_gcs.link.messages import GimbalManagerInformation

_NAMES = {
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
    15: "Autotune",
    16: "Position hold",
    17: "Brake",
    18: "Throw",
    19: "Avoid",
    20: "Guided without GPS",
    21: "Smart RTL",
    23: "Follow",
    27: "Auto RTL",
}


def _mode(number: int) -> Mode:
    return Mode(custom_mode=number, main=number)


def _mode_name(custom_mode: int) -> str:
    return _NAMES.get(custom_mode, f"mode {custom_mode}")


def _gimbal_limits(information: GimbalManagerInformation) -> GimbalLimits:
    return GimbalLimits(
        tilt_min_deg=math.degrees(information.pitch_min),
        tilt_max_deg=math.degrees(information.pitch_max),
        pan_min_deg=math.degrees(information.yaw_min),
        pan_max_deg=math.degrees(information.yaw_max),
    )


ARDUPILOT = Adapter(
    name="ardupilot",
    mode_name=_mode_name,
    hover_mode=_mode(4),
    hold_mode=_mode(17),
    hold_is_reposition=False,
    take_off_mode=_mode(4),
    take_off_altitude_is_amsl=False,
    heading_needs_follow_up=True,
    speed_needs_own_command=True,
    gimbal_flags=GimbalFlags.YAW_LOCK,
    gimbal_yaw_from_nose=False,
    gimbal_limits=_gimbal_limits,
)
