"""What differs between autopilots, as values."""

from collections.abc import Callable
from dataclasses import dataclass

from hsop_gcs.link.adapters.failsafes import Relied
from hsop_gcs.link.enums import GimbalFlags
from hsop_gcs.link.messages import GimbalManagerInformation


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A flight mode: the number in HEARTBEAT.custom_mode and what DO_SET_MODE wants in its params 2 and 3."""

    custom_mode: int
    main: int
    sub: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalLimits:
    """How far a gimbal turns, degrees: tilt from the horizon, up positive; pan from the vehicle's nose, clockwise."""

    tilt_min_deg: float
    tilt_max_deg: float
    pan_min_deg: float
    pan_max_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Adapter:
    """How one autopilot wants to be spoken to."""

    name: str
    mode_name: Callable[[int], str]
    """From HEARTBEAT.custom_mode to the name that its pilots know."""
    hover_mode: Mode
    """The mode in which it flies to a hover point and stays there."""
    hold_mode: Mode
    """The mode that stops it where it is."""
    hold_is_reposition: bool
    """It flies to hover points inside its hold mode: only a reposition to where it is stops it."""
    take_off_mode: Mode
    """The mode it must be in before arming for a take-off."""
    climb_mode: Mode
    """The mode in which it climbs when it takes off; it leaves one that is not the hover mode by itself."""
    return_modes: tuple[Mode, ...]
    """The modes in which it flies home and lands."""
    take_off_altitude_is_amsl: bool
    """Else it is above home."""
    heading_needs_follow_up: bool
    """DO_REPOSITION's yaw is ignored: the heading goes separately, in SET_POSITION_TARGET_GLOBAL_INT."""
    speed_needs_own_command: bool
    """DO_REPOSITION's speed is ignored: DO_CHANGE_SPEED goes first."""
    gimbal_flags: GimbalFlags
    gimbal_yaw_from_nose: bool
    """PITCHYAW's yaw counts from the vehicle's nose, else from north."""
    gimbal_limits: Callable[[GimbalManagerInformation], GimbalLimits]
    failsafes: tuple[Relied, ...]
    """The parameters by which it comes home by itself."""
    integers_bytewise: bool
    """PARAM_VALUE holds the bits of an integer parameter, else its number."""
