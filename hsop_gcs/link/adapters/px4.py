"""PX4 (1.14 and later).

DO_REPOSITION is flown inside Hold, its altitude is AMSL whatever the frame says, yaw and speed are honoured. The
gimbal manager obeys only its primary controller and looks only at the lock bits; some simulated gimbals ignore the yaw
lock, so the yaw is given from the nose and renewed as the heading changes.
"""

import math

from hsop_gcs.link.adapters.adapter import Adapter, GimbalLimits, Mode
from hsop_gcs.link.enums import GimbalFlags
from hsop_gcs.link.messages import GimbalManagerInformation

_AUTO = 4
_MAIN_NAMES = {1: "Manual", 2: "Altitude", 3: "Position", 5: "Acro", 6: "Offboard", 7: "Stabilized"}
_AUTO_NAMES = {
    1: "Ready",
    2: "Takeoff",
    3: "Hold",
    4: "Mission",
    5: "Return",
    6: "Land",
    8: "Follow",
    9: "Precision land",
}


def _auto(sub: int) -> Mode:
    return Mode(custom_mode=sub << 24 | _AUTO << 16, main=_AUTO, sub=sub)


def _mode_name(custom_mode: int) -> str:
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    names, number = (_AUTO_NAMES, sub) if main == _AUTO else (_MAIN_NAMES, main)
    return names.get(number, f"mode {main}.{sub}")


def _gimbal_limits(information: GimbalManagerInformation) -> GimbalLimits:
    """PX4 1.16 sends degrees where the message means radians; a size that no radian limit has gives it away."""
    limits = (information.pitch_min, information.pitch_max, information.yaw_min, information.yaw_max)
    in_degrees = max(abs(limit) for limit in limits) > 2 * math.pi + 1e-3
    tilt_min, tilt_max, pan_min, pan_max = (limit if in_degrees else math.degrees(limit) for limit in limits)
    return GimbalLimits(tilt_min_deg=tilt_min, tilt_max_deg=tilt_max, pan_min_deg=pan_min, pan_max_deg=pan_max)


PX4 = Adapter(
    name="px4",
    mode_name=_mode_name,
    hover_mode=_auto(3),
    hold_mode=_auto(3),
    take_off_mode=None,
    take_off_altitude_is_amsl=True,
    heading_needs_follow_up=False,
    speed_needs_own_command=False,
    gimbal_flags=GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME,
    gimbal_yaw_from_nose=True,
    gimbal_limits=_gimbal_limits,
)
