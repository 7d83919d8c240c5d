"""Whatever a vehicle says, its machine goes on and what it believes stays sane."""

import math
import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from random import Random

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hsop_gcs.geometry.frames import Aim, GeodeticPoint
from hsop_gcs.link.codec import Decoder, Encoder
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavLandedState, MavModeFlag, MavResult, MavType
from hsop_gcs.link.events import Arrived, OrderEvent, OrderFailed, OrderSuperseded
from hsop_gcs.link.messages import (
    Attitude,
    CommandAck,
    ExtendedSysState,
    GimbalManagerInformation,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    Message,
)
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.vehicle import Vehicle
from tests.link.noise import noise, pieces
from tests.link.strategies import spoken

ROOT = Path(__file__).parents[2]
POINT = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=525.0)
ORDINARY: list[Message] = [
    *(
        Heartbeat(type=MavType.QUADROTOR, autopilot=autopilot, custom_mode=mode, base_mode=MavModeFlag.SAFETY_ARMED)
        for autopilot, mode in (
            (MavAutopilot.PX4, 50593792),
            (MavAutopilot.ARDUPILOTMEGA, 4),
            (MavAutopilot.GENERIC, 0),
        )
    ),
    ExtendedSysState(landed_state=MavLandedState.IN_AIR),
    HomePosition(latitude=470000000, longitude=80000000, altitude=500000),
    GlobalPositionInt(lat=470000000, lon=80000000, alt=525000, relative_alt=25000),
    Attitude(yaw=1.0),
    GimbalManagerInformation(gimbal_device_id=1, pitch_min=-1.0, pitch_max=1.0, yaw_min=-3.0, yaw_max=3.0),
    *(
        CommandAck(command=command, result=result)
        for command in (MavCmd.DO_REPOSITION, MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, MavCmd.COMPONENT_ARM_DISARM)
        for result in (MavResult.ACCEPTED, MavResult.DENIED)
    ),
]
HEARD = st.tuples(
    st.one_of(st.sampled_from(ORDINARY), spoken()), st.floats(0.0, 3.0), st.sampled_from([1, 154]), st.integers(0, 9)
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(st.lists(HEARD, max_size=60))
def test_no_message_stops_a_vehicle_and_every_order_ends_at_most_once(
    heard: list[tuple[Message, float, int, int]],
) -> None:
    vehicle, encoder, now = Vehicle(1), Encoder(system=255, component=190), 0.0
    orders = 0
    ended: list[str] = []
    for message in ORDINARY[:1] + ORDINARY[3:7]:
        vehicle.receive(message, now)
    for message, pause_s, component, chance in heard:
        now += pause_s
        vehicle.receive(message, now, component=component)
        if chance == 0:
            orders += 1
            order = HoverOrder(
                order_id=f"{orders}",
                point=POINT,
                heading_deg=57.0,
                aim=Aim(pan_deg=10.0, tilt_deg=5.0),
                deadline_s=now + 5.0,
            )
            vehicle.hover(order, now)
        elif chance == 1:
            vehicle.take_off(20.0, now, order_id="up")
        elif chance == 2:
            vehicle.hold(now)
        vehicle.advance(now)
        for sent in vehicle.take_outgoing():
            encoder.encode(sent)
        events = vehicle.take_events()
        ended += [
            event.order_id
            for event in events
            if isinstance(event, OrderFailed | OrderSuperseded) and event.order_id != "up"
        ]
        assert all(event.order_id for event in events if isinstance(event, OrderEvent | Arrived))
        state = vehicle.state
        numbers = [value for field in fields(state) if isinstance(value := getattr(state, field.name), float)]
        assert all(math.isfinite(number) for number in numbers)
        wake_at = vehicle.wake_at
        assert wake_at is None or now < wake_at < math.inf, "a machine that is due after its work would spin"
    assert len(ended) == len(set(ended))
    assert orders - len(ended) in (0, 1)


def test_of_thousands_of_spoiled_frames_none_is_fatal_and_every_good_one_between_is_understood() -> None:
    """As datagrams, as a stream and over a signed link, without growth of memory. The bench sends a million."""
    command = [sys.executable, "-m", "tests.bench.bench_noise", "20000", "6"]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=150, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_good_frame_of_a_spoiled_stream_is_understood_wherever_it_is_cut() -> None:
    rng, decoder = Random(7), Decoder()
    made = list(noise(rng, 4000))
    found: list[bytes] = []
    for piece in pieces(rng, b"".join(raw for raw, _ in made) + bytes(600)):
        found += [frame.raw for frame in decoder.feed_stream(piece) if frame.verified]
        assert decoder.pending_bytes < 280
    assert [raw for raw, is_good in made if is_good and raw not in found] == []
