"""What a vehicle's link tells the layers above: facts and outcomes, as values."""

from dataclasses import dataclass
from typing import Literal

from hsop_gcs.geometry.frames import Aim


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Base of all events; ``system`` is the MAVLink system id of the vehicle."""

    system: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkUp(Event):
    """The vehicle is heard: for the first time, or again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLost(Event):
    """Nothing was heard for longer than allowed. The vehicle keeps flying what it was ordered."""

    silent_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AddressRefused(Event):
    """Somebody speaks under the vehicle's id from another address, and is not listened to until it is registered.

    Told once per address. registered: the vehicle's own; None: it was not heard at its endpoint yet.
    """

    address: str
    registered: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AddressRegistered(Event):
    """The vehicle has another address from now on.

    by: an operator said so, its signature did, or it fell silent and speaks from another port of the same host: it was
    started again.
    """

    address: str
    before: str | None
    by: Literal["operator", "signature", "same host"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotRestarted(Event):
    """The autopilot's clock went back and stayed there: what it was ordered and asked is forgotten, and asked again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoAircraftHeard(Event):
    """What comes under the vehicle's id cannot come from one aircraft; nothing is ordered while that is so."""

    problem: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamRateFell(Event):
    """Messages come far less often than they were asked for, and are asked for again.

    rates: each message with the rate at which it came and the rate asked for.
    """

    rates: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamRateNotKept(Event):
    """Messages that were asked for again in vain: a link too slow for them, or another station that asks for less.

    They are asked for again less and less often. rates: as in ``StreamRateFell``.
    """

    rates: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleFault(Event):
    """The service failed at something the vehicle sent, or that was due for it: a fault of ours.

    Whatever the vehicle was ordered is given up, and it is given nothing until a frame of its goes through without a
    fault. where: the part that failed. frame: the frame at which it did, in hexadecimal; None: it was at no frame.
    """

    where: str
    problem: str
    frame: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusTextReceived(Event):
    """A line the autopilot wrote for a person; parts sent in several messages are joined."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FailsafeNotSet(Event):
    """A parameter of the vehicle is not as a failsafe needs it, or is not told: what that means, for a person."""

    problem: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeChanged(Event):
    """The flight mode is another one than before, for whatever reason."""

    before: str
    after: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandFinished(Event):
    """An operator's hold or return was answered, or was not.

    command: "hold" or "return to launch". problem: None if the autopilot accepted, else why not, for a person.
    """

    command: str
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderEvent(Event):
    """Base of the events that belong to one order."""

    order_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderAccepted(OrderEvent):
    """The autopilot accepted the order; that it also flies there, only ``Arrived`` says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrived(OrderEvent):
    """Telemetry shows the vehicle resting at the hover point with the ordered heading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drifted(OrderEvent):
    """After arrival the vehicle left its hover point or its heading; ``Arrived`` follows if it comes back."""

    problem: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalOnTarget(OrderEvent):
    """The gimbal reports that it looks where the order says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalOffTarget(OrderEvent):
    """The gimbal was on target and is not any more; ``GimbalOnTarget`` follows if it comes back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalControlLost(OrderEvent):
    """Somebody else holds the primary control of the gimbal; it is being taken back. Ids 0: nobody said who."""

    owner_system: int
    owner_component: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AimClipped(OrderEvent):
    """The gimbal cannot look where the order says; it looks as near as its limits allow."""

    wanted: Aim
    given: Aim


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalFailed(OrderEvent):
    """The gimbal does not follow; the hover point is kept."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OnStation(OrderEvent):
    """Arrived, and the gimbal (if the order aims one) on target: this host sees what it was sent to see."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TookOff(OrderEvent):
    """In the air and at the ordered altitude."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderFailed(OrderEvent):
    """The order ended without success; the reason is a sentence for a person."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderSuperseded(OrderEvent):
    """A newer order took the place of this one."""
