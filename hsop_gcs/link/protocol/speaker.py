"""Whose heartbeat it is: the autopilot's, or that of something else that speaks under its ids.

Companion computers, cameras, trackers and other ground stations send heartbeats, some of them as component 1 of the
vehicle that they ride on. What they say of modes and arming is not the autopilot's.
"""

from hsop_gcs.link.enums import MavAutopilot, MavComponent, MavType
from hsop_gcs.link.messages import (
    BatteryStatus,
    CommandAck,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerStatus,
    Heartbeat,
    Message,
)
from hsop_gcs.link.protocol.batteries import BATTERIES
from hsop_gcs.link.protocol.gimbal_device import is_gimbals

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


_OF_ANY = (CommandAck, GimbalDeviceAttitudeStatus, GimbalManagerInformation, GimbalManagerStatus)
_SILENT_AFTER_S = 10.0
_MOST_OTHERS = 8
_KINDS = {
    "autopilot's component": range(1, 2),
    "camera": range(100, 106),
    "gimbal": (154, *range(171, 176)),
    "battery": range(180, 182),
    "ground station": range(190, 191),
    "companion computer": range(191, 200),
}
"""Component ids of MAVLink's common names.  Source: MAV_COMPONENT in mavlink/mavlink minimal.xml."""


_NEVER = ("camera", "gimbal", "battery", "ground station")
"""Kinds of components that are no autopilot, whatever their heartbeats say."""


def is_autopilots(message: Message) -> bool:
    """Whether a message is the heartbeat of an autopilot that flies, drives or sails something."""
    return (
        isinstance(message, Heartbeat) and message.autopilot != MavAutopilot.INVALID and message.type in VEHICLE_TYPES
    )


def begins_link(message: Message, component: int) -> bool:
    """Whether a message of a vehicle's ``component`` says that its autopilot is there.

    PX4's MAV_COMP_ID gives it any id. As another component than 1 only what we could fly counts: cameras and ADS-B
    receivers send heartbeats in which everything is zero, which is a generic autopilot's on a generic vehicle.
    """
    if not isinstance(message, Heartbeat) or not is_autopilots(message) or what_speaks(component) in _NEVER:
        return False
    return component == MavComponent.AUTOPILOT1 or _is_spoken_to(message)


def is_foreign(message: Message, component: int, *, autopilot: int = MavComponent.AUTOPILOT1) -> bool:
    """Whether a message is a heartbeat under the ids of the ``autopilot`` component that is not the autopilot's."""
    return isinstance(message, Heartbeat) and component == autopilot and not begins_link(message, component)


def is_taken(message: Message, component: int, *, autopilot: int) -> bool:
    """Whether a message of a vehicle's component is listened to: all of the autopilot's, of others what is theirs."""
    if component == autopilot or isinstance(message, _OF_ANY):
        return True
    if isinstance(message, BatteryStatus):
        return component in BATTERIES
    return is_gimbals(message, component)


class Speaker:
    """Which of a vehicle's components is its autopilot.

    unknown ──an autopilot's heartbeat──► component c ──c silent for 10 s, then another's heartbeat──► component d
                                              └── c is no autopilot that we speak to, and d is ──► component d
    """

    def __init__(self, component: int = MavComponent.AUTOPILOT1) -> None:
        self.component = component
        self.others: dict[int, float] = {}
        """Components that send an autopilot's heartbeat and are not listened to, and when each was heard last."""
        self._heard_s: float | None = None
        self._spoken_to = False

    def receive(self, message: Message, now: float, *, component: int) -> bool:
        """Take a message of any component; return whether another component is the autopilot from now on."""
        if not isinstance(message, Heartbeat) or not begins_link(message, component):
            return False
        spoken_to = _is_spoken_to(message)
        changes = component != self.component
        silent = self._heard_s is None or now - self._heard_s > _SILENT_AFTER_S
        if changes and not silent and (self._spoken_to or not spoken_to):
            if component in self.others or len(self.others) < _MOST_OTHERS:
                self.others[component] = now
            return False
        self.component, self._heard_s, self._spoken_to = component, now, spoken_to
        self.others.pop(component, None)
        return changes

    def others_lately(self, now: float) -> tuple[int, ...]:
        """Return the components that spoke as a second autopilot within the last seconds."""
        return tuple(component for component, at in self.others.items() if now - at <= _SILENT_AFTER_S)


def what_speaks(component: int) -> str:
    """Return the kind of a component by its id, one of a few: frames that are not taken are counted by it."""
    return next((kind for kind, ids in _KINDS.items() if component in ids), "other component")


def _is_spoken_to(message: Heartbeat) -> bool:
    return message.autopilot in (MavAutopilot.PX4, MavAutopilot.ARDUPILOTMEGA) and message.type != MavType.GENERIC
