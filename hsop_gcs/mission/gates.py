"""Gates: what a host has to pass before it is given an order, and as long as it has one.

The link asks for what no order can do without (``link.protocol.ready``); here come the fleet's own reserves and the
airspace. Every gate is a small question with an answer for a person; a host that fails one is not available, and the
mission plans without it.
"""

from dataclasses import dataclass

from hsop_gcs.assignment import why_outside
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.link.protocol import ready
from hsop_gcs.link.protocol.telemetry import VehicleState
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Aircraft:
    """A host as the gates and the traffic rules see it."""

    id: str
    state: VehicleState
    now_s: float
    """The link's time."""
    position_m: Point | None
    loss: float | None = None
    """Share of its frames lost of late."""
    obeys: bool = True
    """Whether it is in one of the modes in which we fly it or hold it, or takes off as it was ordered."""
    takes_off: bool = False
    """Whether it takes off as it was ordered."""
    holds: bool = False
    """Whether it is in the mode that a hold puts it in."""
    returns: bool = False
    """Whether it is in a mode in which it flies home and lands."""
    reached: str | None = None
    """The leg of its route whose end it has come near."""

    @property
    def flies_for_us(self) -> bool:
        """Whether it hears us, is in the air, and nobody else flies it."""
        return self.state.link_up and self.state.in_air is True and self.obeys

    @property
    def taken_over(self) -> bool:
        """Whether somebody else flies it now: a pilot, another ground station, the autopilot's own failsafe."""
        return self.state.link_up and not self.obeys


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """A gate that a host does not pass, and why, for a person."""

    gate: str
    reason: str


ON_THE_GROUND = frozenset({"armed", "in air", "mode"})
"""Gates that a host passes by taking off. They are asked last: who stands at one of them could take off."""

UNHEARD = frozenset({"link", "autopilot", "position", "home", "battery"})
"""Gates that are closed until a host's telemetry has come."""


def mode(aircraft: Aircraft) -> str | None:
    if aircraft.takes_off and aircraft.state.in_air:
        return "it takes off, as it was ordered"
    return None if aircraft.obeys else f"somebody else flies it (mode {aircraft.state.mode}); hold it to take it over"


def battery(aircraft: Aircraft, limits: FlightLimits) -> str | None:
    left, reserve = aircraft.state.battery_percent, limits.battery_reserve_percent
    if reserve <= 0:
        return None
    if left is None:
        return "the vehicle's battery is not known"
    return None if left >= reserve else f"the battery has {left:.0f} % left, less than the reserve of {reserve:g} %"


def link_reserve(aircraft: Aircraft, limits: FlightLimits) -> str | None:
    loss, most = aircraft.loss, limits.link_loss_max
    if loss is None or loss <= most:
        return None
    return f"the link loses {loss:.0%} of the vehicle's messages, more than {most:.0%}"


def fence(aircraft: Aircraft, airspace: Airspace, ahead_m: tuple[Point, ...]) -> str | None:
    if aircraft.position_m is None or (room_m := airspace.fence_room_m(aircraft.position_m)) >= 0:
        return None
    if _leads_in(aircraft.position_m, airspace, ahead_m):
        return None
    return f"the vehicle is {-room_m:.0f} m outside the fence"


def keep_out(aircraft: Aircraft, airspace: Airspace, ahead_m: tuple[Point, ...]) -> str | None:
    if aircraft.position_m is None or airspace.keep_out_room_m(aircraft.position_m) >= 0:
        return None
    return None if _leads_in(aircraft.position_m, airspace, ahead_m) else "the vehicle is inside a keep-out area"


def _leads_in(position_m: Point, airspace: Airspace, ahead_m: tuple[Point, ...]) -> bool:
    """Whether a host outside the airspace is on its way straight back in: to stop it would keep it outside."""
    return bool(ahead_m) and why_outside(airspace, (position_m, *ahead_m)) is None


def closed(
    aircraft: Aircraft, limits: FlightLimits, airspace: Airspace, ahead_m: tuple[Point, ...] = ()
) -> Closed | None:
    """Return the first gate that the host does not pass; None: it can be sent. ahead_m: what it has still to fly."""
    reasons = {name: gate(aircraft.state, aircraft.now_s) for name, gate in ready.GATES.items()} | {
        "battery": battery(aircraft, limits),
        "link reserve": link_reserve(aircraft, limits),
        "fence": fence(aircraft, airspace, ahead_m),
        "keep-out": keep_out(aircraft, airspace, ahead_m),
        "mode": mode(aircraft),
    }
    asked = sorted(reasons.items(), key=lambda gate: gate[0] in ON_THE_GROUND)
    return next((Closed(gate=name, reason=reason) for name, reason in asked if reason is not None), None)
