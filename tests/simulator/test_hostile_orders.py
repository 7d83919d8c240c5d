"""Whatever arrives in a good frame, a vehicle neither fails nor loses its place."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.link import messages
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.messages import CommandInt, CommandLong, Message
from tests.simulator.station import CONFIG, Station, ardupilot, px4

VEHICLES = [pytest.param(px4, id="px4"), pytest.param(ardupilot, id="ardupilot")]
HOVERING = replace(CONFIG, airborne_m=30.0, ready_after_s=0.0)

SPECIAL = [0.0, 1.0, -1.0, -2.0, -3.0, 4.0, math.nan, math.inf, 2.0**31 - 1]
PARAMETERS = ["WPNAV_SPEED", "MPC_XY_CRUISE", "RTL_ALT", "MAV_SYS_ID", "NONE", ""]
numbers = st.one_of(st.floats(width=32), st.sampled_from(SPECIAL))
CLASSES = [kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Message)]
KINDS: list[type[Message]] = [kind for kind in CLASSES if kind not in (Message, messages.Unknown)]
e7 = st.one_of(st.integers(-(2**31), 2**31 - 1), st.sampled_from([2**31 - 1, -353632610, 1491652300, 0, 28]))
byte = st.integers(0, 255)


@st.composite
def orders(draw: st.DrawFn) -> Message:
    command = draw(st.sampled_from(list(MavCmd)))
    four = {f"param{number}": draw(numbers) for number in range(1, 5)}
    if draw(st.booleans()):
        rest = {f"param{number}": draw(numbers) for number in range(5, 8)}
        values: dict[str, Any] = {**four, **rest}
        return CommandLong(target_system=1, target_component=1, command=command, **values)
    values = {**four, "x": draw(e7), "y": draw(e7), "z": draw(numbers), "frame": draw(byte)}
    return CommandInt(target_system=1, target_component=1, command=command, **values)


@st.composite
def other_messages(draw: st.DrawFn) -> Message:
    """Any message of any kind for this vehicle, with numbers of any sort where numbers go."""
    kind = draw(st.sampled_from(KINDS))
    values: dict[str, Any] = {}
    for field in fields(kind):
        if field.name == "target_system":
            values[field.name] = draw(st.sampled_from([0, 1]))
        elif field.name == "target_component":
            values[field.name] = 1
        elif field.type is float:
            values[field.name] = draw(numbers)
        elif field.name in ("lat_int", "lon_int"):
            values[field.name] = draw(e7)
        elif field.name in ("type_mask", "custom_mode", "flags", "coordinate_frame", "req_stream_id", "start_stop"):
            values[field.name] = draw(byte)
        elif field.name in ("req_message_rate",):
            values[field.name] = draw(st.integers(0, 65535))
        elif field.name == "q":
            values[field.name] = tuple(draw(numbers) for _ in range(4))
        elif field.name == "param_id":
            values[field.name] = draw(st.sampled_from(PARAMETERS))
    return kind(**values)


@pytest.mark.parametrize("vehicle", VEHICLES)
@given(hostile=st.lists(st.one_of(orders(), other_messages()), min_size=1, max_size=12))
@settings(max_examples=80, deadline=None)
def test_no_well_formed_message_breaks_a_vehicle(vehicle: Callable[..., Station], hostile: list[Message]) -> None:
    station = vehicle(HOVERING)
    for message in hostile:
        station.send(message)
        station.wait(0.4)
    state = station.vehicle.state
    assert all(map(math.isfinite, (*state.position_m, *state.velocity_mps, state.heading_rad)))
    assert all(map(math.isfinite, (station.vehicle.gimbal.pitch_rad, station.vehicle.gimbal.yaw_rad)))
    assert state.position_m[2] >= 0.0
    assert math.hypot(*state.velocity_mps) < 30.0
