"""Flights of real autopilots that our own link recorded, flown again: what they said makes the same flight.

Written by ``tests/system/record_flight.py`` with ArduCopter 4.7.0-dev and PX4 1.17.0-alpha1, each with a
gimbal, from power-up to the return.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import Arrived, Event, GimbalOnTarget, OnStation, OrderAccepted, OrderFailed, TookOff
from hsop_gcs.link.messages import CommandInt, CommandLong, Message
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.link.vehicle import Vehicle
from tests.system.record_flight import GROUND_STATION, STEPS

DATA = Path(__file__).parent.parent / "data"
ARDUCOPTER, PX4 = ("arducopter-4.7.0-dev-flight.tlog", 11), ("px4-1.17.0-alpha1-flight.tlog", 1)
BOTH = pytest.mark.parametrize(("name", "system"), [ARDUCOPTER, PX4])
ORDERS = {
    MavCmd.DO_SET_MODE,
    MavCmd.COMPONENT_ARM_DISARM,
    MavCmd.NAV_TAKEOFF,
    MavCmd.DO_REPOSITION,
    MavCmd.DO_CHANGE_SPEED,
    MavCmd.NAV_RETURN_TO_LAUNCH,
}


Order = tuple[int, tuple[float | None, ...]]
"""A command and what says where to or what."""


@dataclass
class Flight:
    """What was ordered and what happened, when the steps were flown by the recorded vehicle."""

    events: list[Event] = field(default_factory=list)
    recorded: list[Order] = field(default_factory=list)
    """The recording's own orders."""
    ordered: list[Order] = field(default_factory=list)
    """Ours."""


def fly_again(name: str, system: int) -> Flight:
    """Give each of the recorded flight's orders when it was given then, and hear what the vehicle said."""
    flight, vehicle, steps = Flight(), Vehicle(system), list(STEPS)
    with (DATA / name).open("rb") as file:
        for now, frame in read_tlog(file):
            vehicle.advance(now)
            if frame.system == GROUND_STATION:
                due = _begins_a_step(frame.message, flight)
                flight.recorded += _orders([frame.message])
            else:
                vehicle.receive(frame.message, now, component=frame.component)
                due = len(steps) == len(STEPS) and vehicle.state.link_up
            if due:
                steps.pop(0)[1](vehicle, now)
            flight.ordered += _orders(vehicle.take_outgoing())
            flight.events += vehicle.take_events()
    assert not steps
    return flight


def _begins_a_step(message: Message, flight: Flight) -> bool:
    """Whether the recording gives a new order: once it flies, each place and each mode is one."""
    (order,) = _orders([message]) or (None,)
    if order is None or order in flight.recorded or not any(isinstance(event, TookOff) for event in flight.events):
        return False
    return order[0] != MavCmd.DO_CHANGE_SPEED


def _orders(messages: list[Message]) -> list[Order]:
    found: list[Order] = []
    for message in messages:
        if isinstance(message, CommandInt) and message.command in ORDERS:
            what: tuple[float, ...] = (message.x, message.y, message.z, message.param4)
        elif isinstance(message, CommandLong) and message.command in ORDERS:
            what = (message.param1, message.param2, message.param3, message.param7)
        else:
            continue
        found.append((message.command, tuple(None if math.isnan(value) else round(value, 2) for value in what)))
    return found


@BOTH
def test_a_recorded_flight_flown_again_ends_every_order_as_it_did(name: str, system: int) -> None:
    flight = fly_again(name, system)
    kinds = (TookOff, OrderAccepted, Arrived, OnStation, OrderFailed)
    told = [(type(event), event.order_id) for event in flight.events if isinstance(event, kinds)]
    assert [each for each in told if each[0] is not OnStation] == [
        (TookOff, "take off"),
        (OrderAccepted, "a"),
        (Arrived, "a"),
        (OrderAccepted, "b"),
        (Arrived, "b"),
    ]
    assert [order_id for kind, order_id in told if kind is OnStation] == ["a", "b"]
    assert {event.order_id for event in flight.events if isinstance(event, GimbalOnTarget)} == {"a", "b"}


@BOTH
def test_a_recorded_flight_flown_again_puts_the_same_orders_on_the_wire(name: str, system: int) -> None:
    flight = fly_again(name, system)
    first_tries = [each for number, each in enumerate(flight.recorded) if each not in flight.recorded[:number]]
    again = [each for number, each in enumerate(flight.ordered) if each not in flight.ordered[:number]]
    assert again == first_tries
    assert {command for command, _ in again} >= {MavCmd.NAV_TAKEOFF, MavCmd.DO_REPOSITION, MavCmd.NAV_RETURN_TO_LAUNCH}


def test_a_fresh_arducopter_is_asked_to_arm_from_the_moment_it_has_a_home_until_it_does() -> None:
    flight = fly_again(*ARDUCOPTER)
    arming = [each for each in flight.recorded if each[0] == MavCmd.COMPONENT_ARM_DISARM]
    assert len(arming) > 3
    assert flight.ordered.count(arming[0]) == len(arming)
