"""PX4 (1.14 and later).

A take-off begins in Hold: in Return, where a recall or a failsafe left it, arming is denied.
DO_REPOSITION is flown inside Hold, its altitude is AMSL whatever the frame says, yaw and speed are honoured. The
gimbal manager obeys only its primary controller and looks only at the lock bits; some simulated gimbals ignore the yaw
lock, so the yaw is given from the nose and renewed as the heading changes.
"""

import math

from hsop_gcs.link.adapters.adapter import Adapter, GimbalLimits, Mode
from hsop_gcs.link.adapters.failsafes import PX4_FAILSAFES
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
    """A gimbal on PX4's own outputs is told in degrees where the message means radians, and twice as far as it turns.

    It tells MNT_RANGE_PITCH and MNT_RANGE_YAW to either side and stops at half of them. A size that no limit in radians
    has gives it away; a pitch with two different limits is no such range.
    """
    tilt = (information.pitch_min, information.pitch_max)
    pan = (information.yaw_min, information.yaw_max)
    in_degrees = max(abs(limit) for limit in tilt + pan) > 2 * math.pi + 1e-3
    tilt_scale = pan_scale = math.degrees(1.0)
    if in_degrees:
        tilt_scale, pan_scale = 0.5 if tilt[0] == -tilt[1] else 1.0, 0.5
    return GimbalLimits(
        tilt_min_deg=tilt_scale * tilt[0],
        tilt_max_deg=tilt_scale * tilt[1],
        pan_min_deg=pan_scale * pan[0],
        pan_max_deg=pan_scale * pan[1],
    )


PX4 = Adapter(
    name="px4",
    mode_name=_mode_name,
    hover_mode=_auto(3),
    hold_mode=_auto(3),
    hold_is_reposition=True,
    take_off_mode=_auto(3),
    climb_mode=_auto(2),
    return_modes=(_auto(5), _auto(6)),
    take_off_altitude_is_amsl=True,
    heading_needs_follow_up=False,
    speed_needs_own_command=False,
    gimbal_flags=GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME,
    gimbal_yaw_from_nose=True,
    gimbal_limits=_gimbal_limits,
    failsafes=PX4_FAILSAFES,
    integers_bytewise=True,
)
