import asyncio
import itertools
import math
import socket
import time
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import MavCmd, MavResult
from hsop_gcs.link.messages import Attitude, CommandAck, CommandLong, GlobalPositionInt, Heartbeat, ParamSet
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.simulator.faults import parse_fault
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid, places

ORIGIN = GeodeticPoint(lat_deg=47.4, lon_deg=8.5, altitude_amsl_m=430.0)
PATIENCE_S = 20.0
METRE = 1.0


class Listener:
    """A UDP socket that hears vehicles."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._decoder = Decoder()

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def close(self) -> None:
        self._socket.close()

    def send(self, message: Any, to: tuple[str, int]) -> None:
        self._socket.sendto(Encoder(system=255, component=190).encode(message), to)

    async def hear(self, wanted: Callable[[Frame], bool]) -> Frame:
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(PATIENCE_S):
            while True:
                for frame in self._decoder.feed_datagram(await loop.sock_recv(self._socket, 65536)):
                    if wanted(frame):
                        return frame


@pytest.fixture
def listener() -> Iterator[Listener]:
    listener = Listener()
    yield listener
    listener.close()


def with_fleet(config: FleetConfig, body: Callable[[SimulatedFleet], Awaitable[None]]) -> None:
    async def run() -> None:
        fleet = SimulatedFleet(config, clock=time.monotonic)
        await fleet.start()
        try:
            await body(fleet)
        finally:
            await fleet.close()

    asyncio.run(run())


def fleet_of(count: int, target_port: int, **options: Any) -> FleetConfig:
    chosen: dict[str, Any] = {"autopilot": Autopilot.PX4, "shared_port": True, "local_port": 0, "speed": 4.0}
    return FleetConfig(homes=grid(ORIGIN, count, 15.0), target=("127.0.0.1", target_port), **(chosen | options))


def test_every_vehicle_speaks_from_a_port_of_its_own_under_its_own_system_id(listener: Listener) -> None:
    async def body(fleet: SimulatedFleet) -> None:
        heard: set[int] = set()
        while heard != {1, 2, 3}:
            heard.add((await listener.hear(lambda frame: isinstance(frame.message, Heartbeat))).system)
        assert len({port for _, port in fleet.local_addresses}) == 3

    with_fleet(fleet_of(3, listener.port), body)


def test_positions_over_the_wire_are_the_homes_in_amsl_and_above_home(listener: Listener) -> None:
    local = LocalFrame(ORIGIN)

    async def body(_: SimulatedFleet) -> None:
        for number in range(2):
            frame = await listener.hear(
                lambda frame, number=number: isinstance(frame.message, GlobalPositionInt) and frame.system == number + 1  # type: ignore[misc]
            )
            position = frame.message
            assert isinstance(position, GlobalPositionInt)
            place = GeodeticPoint(
                lat_deg=position.lat * 1e-7, lon_deg=position.lon * 1e-7, altitude_amsl_m=position.alt * 1e-3
            )
            assert local.to_enu(place) == pytest.approx((15.0 * number, 0.0, 25.0), abs=0.2 * METRE)
            assert position.relative_alt * 1e-3 == pytest.approx(25.0, abs=0.2 * METRE)

    with_fleet(fleet_of(2, listener.port, airborne_m=25.0), body)


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_stranger_who_calls_a_vehicle_is_answered(listener: Listener, autopilot: Autopilot) -> None:
    caller = Listener()
    request = CommandLong(target_system=1, target_component=1, command=MavCmd.REQUEST_MESSAGE, param1=148.0)

    async def body(fleet: SimulatedFleet) -> None:
        caller.send(request, fleet.local_addresses[0])
        ack = (await caller.hear(lambda frame: isinstance(frame.message, CommandAck))).message
        assert isinstance(ack, CommandAck)
        assert (ack.result, ack.target_system, ack.target_component) == (MavResult.ACCEPTED, 255, 190)

    try:
        with_fleet(fleet_of(1, listener.port, autopilot=autopilot), body)
    finally:
        caller.close()


def test_rubbish_on_the_port_disturbs_nothing(listener: Listener) -> None:
    async def body(fleet: SimulatedFleet) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as caller:
            for rubbish in (b"", b"\xfd", b"\xfd" * 300, bytes(range(256)), b"GET / HTTP/1.1\r\n"):
                caller.sendto(rubbish, fleet.local_addresses[0])
        for _ in range(3):
            await listener.hear(lambda frame: isinstance(frame.message, Heartbeat))

    with_fleet(fleet_of(1, listener.port), body)


def test_targets_count_up_from_the_first_unless_they_share_a_port() -> None:
    assert [port for _, port in SimulatedFleet(fleet_of(3, 20000), clock=lambda: 0.0).targets] == [20000] * 3
    counted = SimulatedFleet(fleet_of(3, 20000, shared_port=False), clock=lambda: 0.0)
    assert [port for _, port in counted.targets] == [20000, 20001, 20002]


def test_a_port_that_is_taken_is_named(listener: Listener) -> None:
    async def body(fleet: SimulatedFleet) -> None:
        raise AssertionError(f"{fleet} started on a port that is in use")

    with pytest.raises(Unavailable, match=str(listener.port)):
        with_fleet(fleet_of(1, 20000, local_port=listener.port), body)


def test_a_fleet_of_none_is_bad_input() -> None:
    with pytest.raises(BadInput, match="vehicles: 0"):
        SimulatedFleet(FleetConfig(autopilot=Autopilot.PX4, homes=[]), clock=lambda: 0.0)


def test_a_process_that_was_stopped_does_not_race_to_catch_up() -> None:
    ticks = itertools.chain([0.0, 0.0], itertools.repeat(3600.0))
    fleet = SimulatedFleet(fleet_of(1, 20000, speed=1.0), clock=lambda: next(ticks))
    member = fleet.members[0]
    member.datagram_received(b"", ("127.0.0.1", 9))
    assert fleet.vehicles[0].since_boot_s <= 0.25


def test_homes_stand_apart_by_the_spacing_at_the_origins_altitude() -> None:
    local = LocalFrame(ORIGIN)
    homes = grid(ORIGIN, 5, 12.0)
    pairs = [math.dist(local.to_enu(a), local.to_enu(b)) for a, b in itertools.combinations(homes, 2)]
    assert min(pairs) == pytest.approx(12.0, abs=1e-3 * METRE)
    assert {home.altitude_amsl_m for home in homes} == {430.0}
    assert local.to_enu(places(ORIGIN, [(-30.0, 7.0)])[0])[:2] == pytest.approx((-30.0, 7.0), abs=1e-3 * METRE)


def test_a_cut_link_carries_nothing_either_way_for_as_long_as_it_is_cut(listener: Listener) -> None:
    # A busy machine may be a second of the simulation late, never early.
    cut_s, late_s = (4.0, 8.0), 1.1
    fault = parse_fault("h1:link-cut@4+4", 2)
    name = "MPC_XY_CRUISE"

    async def body(fleet: SimulatedFleet) -> None:
        cut, whole = fleet.vehicles
        heard: dict[int, list[float]] = {1: [], 2: []}
        while not heard[1] or heard[1][-1] < cut_s[1] + late_s:
            frame = await listener.hear(lambda frame: isinstance(frame.message, Attitude))
            assert isinstance(frame.message, Attitude)
            heard[frame.system].append(frame.message.time_boot_ms / 1000)
            if cut_s[0] + 0.1 < cut.since_boot_s < cut_s[1] - late_s:
                for number, to in enumerate(fleet.local_addresses, start=1):
                    order = ParamSet(
                        target_system=number, target_component=1, param_id=name, param_value=3.0, param_type=9
                    )
                    listener.send(order, to)
        assert [at_s for at_s in heard[1] if cut_s[0] < at_s < cut_s[1] - late_s] == []
        assert min(heard[1]) < cut_s[0]
        assert len([at_s for at_s in heard[2] if cut_s[0] < at_s < cut_s[1]]) > 50
        assert (cut.parameters[name], whole.parameters[name]) == (whole.config.flight.cruise_mps, 3.0)
        assert fleet.lost > 0

    with_fleet(fleet_of(2, listener.port, faults=[fault]), body)


def test_a_fleet_with_a_key_signs_and_obeys_only_what_is_signed_with_it(listener: Listener) -> None:
    name, key, wall = "MPC_XY_CRUISE", bytes(range(32)), SigningClock(time.time)

    def speed(value: float, sign: Callable[[bytes], bytes] | None) -> bytes:
        order = ParamSet(target_system=1, target_component=1, param_id=name, param_value=value, param_type=9)
        return Encoder(system=255, component=190, sign=sign).encode(order)

    async def body(fleet: SimulatedFleet) -> None:
        (vehicle,) = fleet.vehicles
        frame = await listener.hear(lambda frame: isinstance(frame.message, Heartbeat))
        assert Signing(key, clock=wall).judge(frame.raw).accepted
        before = vehicle.parameters[name]
        genuine = speed(4.0, Signing(key, clock=wall).sign)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as caller:
            for raw in (speed(2.0, None), speed(3.0, Signing(bytes(32), clock=wall).sign)):
                caller.sendto(raw, fleet.local_addresses[0])
            async with asyncio.timeout(PATIENCE_S):
                while fleet.refused.total() < 2:
                    await asyncio.sleep(0.01)
            assert vehicle.parameters[name] == before
            for raw in (genuine, genuine):
                caller.sendto(raw, fleet.local_addresses[0])
            async with asyncio.timeout(PATIENCE_S):
                while fleet.refused.total() < 3:
                    await asyncio.sleep(0.01)
        assert vehicle.parameters[name] == 4.0
        assert fleet.refused == {"unsigned": 1, "forged": 1, "replayed": 1}

    with_fleet(fleet_of(1, listener.port, signing_key=key), body)
