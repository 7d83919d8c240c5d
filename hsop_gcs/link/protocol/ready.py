"""Whether a vehicle can take a hover order: small questions to its telemetry, each with an answer for a person."""

from collections.abc import Callable

from hsop_gcs.link.enums import MavVtolState
from hsop_gcs.link.kinds import MULTICOPTERS, VTOLS
from hsop_gcs.link.protocol.telemetry import VehicleState

Gate = Callable[[VehicleState, float], str | None]
"""Given the state and the link's time: why the vehicle cannot be sent, or None."""

POSITION_AGE_S = 2.0
"""A position older than this is not known any more."""


def heard(state: VehicleState, _now: float) -> str | None:
    return None if state.link_up else "no link to the vehicle"


def alone(state: VehicleState, _now: float) -> str | None:
    return state.conflict


def handled(state: VehicleState, _now: float) -> str | None:
    return state.fault


def spoken_to(state: VehicleState, _now: float) -> str | None:
    if state.autopilot in ("px4", "ardupilot"):
        return None
    return f"no orders are given to an autopilot of kind {state.autopilot}"


def never_flown(state: VehicleState, _now: float) -> str | None:
    """A kind of vehicle that is heard and never ordered, not even to hold: what an order means to it is not known."""
    if state.type is None:
        return "the vehicle has not said what it is"
    if state.type in MULTICOPTERS or (state.type in VTOLS and state.autopilot == "px4"):
        return None
    if state.type in VTOLS:
        return f"an ArduPilot {state.vehicle_type} is not flown: it flies to a hover point as a plane"
    return f"only multicopters are flown, and the vehicle is a {state.vehicle_type}"


def hovers(state: VehicleState, _now: float) -> str | None:
    """A kind of vehicle that hovers in one of its states only, and is not in it."""
    if state.type not in VTOLS or state.vtol_state == MavVtolState.MC:
        return None
    doing = {
        MavVtolState.FW: "it flies as a plane",
        MavVtolState.TRANSITION_TO_FW: "it is changing to a plane",
        MavVtolState.TRANSITION_TO_MC: "it is changing from a plane",
    }
    how = next((how for known, how in doing.items() if known == state.vtol_state), "it does not say whether it hovers")
    return f"a {state.vehicle_type} is flown only while it hovers as a multicopter: {how}"


def armed(state: VehicleState, _now: float) -> str | None:
    return None if state.armed else "the vehicle is not armed"


def in_air(state: VehicleState, _now: float) -> str | None:
    if state.in_air is None:
        return "the vehicle is not known to be in the air"
    return None if state.in_air else "the vehicle is on the ground"


def position_known(state: VehicleState, now: float) -> str | None:
    if state.position is None or not position_fresh(state, now):
        return "the vehicle's position is not known"
    return "the vehicle's heading is not known" if state.heading_deg is None else None


def position_healthy(state: VehicleState, _now: float) -> str | None:
    if state.gps_fix is not None and state.gps_fix < 3:
        return f"the vehicle's satellite receiver has no position in three dimensions (fix type {state.gps_fix})"
    if state.estimator_healthy is False:
        return "the vehicle's estimator does not trust its position"
    return None


def home_known(state: VehicleState, _now: float) -> str | None:
    return None if state.home is not None else "the vehicle's home is not known"


GATES: dict[str, Gate] = {
    "link": heard,
    "one aircraft": alone,
    "fault": handled,
    "autopilot": spoken_to,
    "vehicle type": never_flown,
    "hovers": hovers,
    "armed": armed,
    "in air": in_air,
    "position": position_known,
    "position health": position_healthy,
    "home": home_known,
}
"""In the order in which they are asked; the first that says no is told."""


_OF_ITS_KIND = ("autopilot", "vehicle type", "hovers")


def why_not_flown(state: VehicleState, now: float) -> str | None:
    """Return why nothing of this kind is given an order that flies it, for a person; None if it is."""
    return next((reason for name in _OF_ITS_KIND if (reason := GATES[name](state, now)) is not None), None)


def why_not_stopped(state: VehicleState, now: float) -> str | None:
    """Return why nothing of this kind is told to hold or to return, for a person; None if it is.

    A VTOL that has begun to fly as a plane is still stopped: it was flown by us before.
    """
    return spoken_to(state, now) or never_flown(state, now)


def why_not_ready(state: VehicleState, now: float) -> str | None:
    """Return why this vehicle cannot take a hover order now, for a person; None if it can."""
    return next((reason for gate in GATES.values() if (reason := gate(state, now)) is not None), None)


def position_fresh(state: VehicleState, now: float) -> bool:
    """Whether the position is that of a moment ago."""
    return state.position_heard_s is not None and now - state.position_heard_s <= POSITION_AGE_S
