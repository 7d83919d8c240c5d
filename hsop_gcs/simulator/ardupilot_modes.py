"""Copter's flight modes, those that are simulated, and what is allowed in them."""

from enum import IntEnum

from hsop_gcs.link.enums import MavModeFlag


class Mode(IntEnum):
    """HEARTBEAT.custom_mode."""

    STABILIZE = 0
    ALT_HOLD = 2
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    POSHOLD = 16
    BRAKE = 17


ARMABLE = {Mode.STABILIZE, Mode.ALT_HOLD, Mode.GUIDED, Mode.LOITER, Mode.POSHOLD}
POSITION_FREE = {Mode.STABILIZE, Mode.ALT_HOLD, Mode.LAND}
"""Those that need no position."""
_STEERED_BY_ITSELF = {Mode.GUIDED, Mode.LOITER, Mode.RTL, Mode.POSHOLD, Mode.BRAKE}


def base_mode(mode: Mode, *, armed: bool) -> int:
    """Return HEARTBEAT.base_mode."""
    flags = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.STABILIZE_ENABLED | MavModeFlag.MANUAL_INPUT_ENABLED
    if mode in _STEERED_BY_ITSELF:
        flags |= MavModeFlag.GUIDED_ENABLED
    return flags | MavModeFlag.SAFETY_ARMED if armed else flags
