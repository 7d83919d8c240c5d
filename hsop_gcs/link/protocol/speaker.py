"""Whose heartbeat it is: the autopilot's, or that of something else that speaks under its ids.

Companion computers, cameras, trackers and other ground stations send heartbeats, some of them as component 1 of the
vehicle that they ride on. What they say of modes and arming is not the autopilot's.
"""

from hsop_gcs.link.enums import MavAutopilot, MavComponent, MavType
from hsop_gcs.link.messages import Heartbeat, Message

VEHICLE_TYPES = frozenset(
    {
        MavType.GENERIC,
        MavType.FIXED_WING,
        MavType.QUADROTOR,
        MavType.COAXIAL,
        MavType.HELICOPTER,
        MavType.AIRSHIP,
        MavType.FREE_BALLOON,
        MavType.ROCKET,
        MavType.GROUND_ROVER,
        MavType.SURFACE_BOAT,
        MavType.SUBMARINE,
        MavType.HEXAROTOR,
        MavType.OCTOROTOR,
        MavType.TRICOPTER,
        MavType.FLAPPING_WING,
        MavType.KITE,
        MavType.VTOL_DUOROTOR,
        MavType.VTOL_QUADROTOR,
        MavType.VTOL_TILTROTOR,
        MavType.VTOL_FIXEDROTOR,
        MavType.VTOL_TAILSITTER,
        MavType.VTOL_TILTWING,
        MavType.VTOL_RESERVED5,
        MavType.PARAFOIL,
        MavType.DODECAROTOR,
        MavType.DECAROTOR,
        MavType.GENERIC_MULTIROTOR,
        MavType.SPACECRAFT_ORBITER,
        MavType.GROUND_QUADRUPED,
        MavType.VTOL_GYRODYNE,
    }
)
"""The kinds of MAV_TYPE that move by themselves; the others are parts of a vehicle, or stand beside it."""


def is_autopilots(message: Message) -> bool:
    """Whether a message is the heartbeat of an autopilot that flies, drives or sails something."""
    return (
        isinstance(message, Heartbeat) and message.autopilot != MavAutopilot.INVALID and message.type in VEHICLE_TYPES
    )


def begins_link(message: Message, component: int) -> bool:
    """Whether a message of a vehicle's ``component`` says that its autopilot is there."""
    return component == MavComponent.AUTOPILOT1 and is_autopilots(message)


def is_foreign(message: Message, component: int) -> bool:
    """Whether a message is a heartbeat under the autopilot's ids that is not the autopilot's."""
    return component == MavComponent.AUTOPILOT1 and isinstance(message, Heartbeat) and not is_autopilots(message)
