"""The parameters that the operator's manual relies on: a host comes home when we fall silent or its battery is low.

Sources: ArduCopter events.cpp, Parameters.cpp, mode.h; PX4-Autopilot commander_params.c, failsafe.cpp.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from hsop_gcs.link.identity import GROUND_STATION

SHORTEST_SILENCE_S, LONGEST_SILENCE_S = 3.0, 30.0
"""How long an autopilot may wait for our heartbeat: a lossy radio alone must not send hosts home, and no dead service
keep them out for long."""
_ARDUPILOT_RETURNS = (2.0, 3.0, 6.0)
"""BATT_FS_LOW_ACT: RTL, and two that end in RTL."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Relied:
    """One parameter and what it must say for a failsafe to work."""

    names: tuple[str, ...]
    """What releases call it, newest first; a release has one of them."""
    fits: Callable[[float], bool]
    set_to: float
    """A value with which it works: what ``sitl_configs`` sets."""
    otherwise: str
    """What does not work if it does not fit, for a person."""


def _one_of(*values: float) -> Callable[[float], bool]:
    return lambda value: value in values


def _without_bit(bit: int) -> Callable[[float], bool]:
    return lambda value: 0.0 <= value < math.inf and not int(value) & bit


def _patient(value: float) -> bool:
    return SHORTEST_SILENCE_S <= value <= LONGEST_SILENCE_S


PX4_FAILSAFES = (
    Relied(
        names=("NAV_DLL_ACT",),
        fits=_one_of(2.0),
        set_to=2.0,
        otherwise="it does not return when the ground station falls silent",
    ),
    Relied(
        names=("COM_DL_LOSS_T",),
        fits=_patient,
        set_to=10.0,
        otherwise="it notices too early or too late that the ground station is silent (seconds)",
    ),
    Relied(
        names=("COM_DLL_EXCEPT",),
        fits=_without_bit(2),
        set_to=0.0,
        otherwise="in Hold, where hosts hover, it does not mind that the ground station is silent",
    ),
    Relied(
        names=("COM_FAIL_ACT_T",),
        fits=lambda value: 0.0 <= value <= LONGEST_SILENCE_S,
        set_to=5.0,
        otherwise="it holds too long before it returns (seconds)",
    ),
    Relied(
        names=("COM_LOW_BAT_ACT",),
        fits=_one_of(3.0),
        set_to=3.0,
        otherwise="it does not return when its battery is critical",
    ),
)

ARDUPILOT_FAILSAFES = (
    Relied(
        names=("FS_GCS_ENABLE",),
        fits=_one_of(1.0, 2.0, 3.0, 6.0),
        set_to=1.0,
        otherwise="it does not return when the ground station falls silent",
    ),
    Relied(
        names=("FS_GCS_TIMEOUT",),
        fits=_patient,
        set_to=10.0,
        otherwise="it notices too early or too late that the ground station is silent (seconds)",
    ),
    Relied(
        names=("FS_OPTIONS",),
        fits=_without_bit(16),
        set_to=8.0,
        otherwise="in Brake, where a held host hovers, it does not mind that the ground station is silent",
    ),
    Relied(
        names=("MAV_GCS_SYSID", "SYSID_MYGCS"),
        fits=_one_of(float(GROUND_STATION.system)),
        set_to=float(GROUND_STATION.system),
        otherwise="our heartbeat does not count as the ground station's",
    ),
    Relied(
        names=("BATT_FS_LOW_ACT",),
        fits=_one_of(*_ARDUPILOT_RETURNS),
        set_to=2.0,
        otherwise="it does not return when its battery is low",
    ),
    Relied(
        names=("BATT_FS_CRT_ACT",),
        fits=_one_of(1.0, 4.0, *_ARDUPILOT_RETURNS),
        set_to=1.0,
        otherwise="it flies on when its battery is critical",
    ),
)
