"""Sockets, on loopback."""

import asyncio
import socket
from collections.abc import Callable

import pytest

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import MavAutopilot, MavComponent, MavType
from hsop_gcs.link.events import Event, LinkUp
from hsop_gcs.link.messages import CommandLong, Heartbeat
from hsop_gcs.link.pump import Link

BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)


class Radio(asyncio.DatagramProtocol):
    """The vehicle's end of a socket."""

    def __init__(self, system: int) -> None:
        self.heard: list[Frame] = []
        self._encoder = Encoder(system=system, component=1)
        self._decoder = Decoder()
        self._socket: asyncio.DatagramTransport | None = None

    async def open(self) -> tuple[str, int]:
        self._socket, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: self, local_addr=("127.0.0.1", 0)
        )
        host, port = self._socket.get_extra_info("sockname")[:2]
        return host, port

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def datagram_received(self, data: bytes, addr: object) -> None:
        del addr
        self.heard += self._decoder.feed_datagram(data)

    def beat(self, to: tuple[str, int]) -> None:
        assert self._socket is not None
        self._socket.sendto(self._encoder.encode(BEAT), to)


async def until(condition: Callable[[], bool]) -> None:
    """Wait until something is so; the test's own time limit ends a vain wait."""
    while not condition():
        await asyncio.sleep(0.005)


@pytest.mark.parametrize("systems", [[0], [256], [255], [1, 2, 1]])
def test_ids_that_no_fleet_has_are_refused(systems: list[int]) -> None:
    with pytest.raises(BadInput) as caught:
        Link([], systems)
    assert caught.value.field == "system"


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]

        async def scenario() -> None:
            with pytest.raises(Unavailable, match=f"udpin:127.0.0.1:{port}"):
                await Link(["udpin:127.0.0.1:0", f"udpin:127.0.0.1:{port}"], [1]).open()

        asyncio.run(scenario())


def test_a_closed_link_has_given_its_port_back() -> None:
    async def scenario() -> None:
        async with Link(["udpin:127.0.0.1:0"], [1]) as link:
            _, port = link.addresses[0]
        async with Link([f"udpin:127.0.0.1:{port}"], [1]) as link:
            assert link.addresses[0][1] == port

    asyncio.run(scenario())


def test_a_listening_link_answers_where_it_was_spoken_to_from() -> None:
    async def scenario() -> None:
        events: list[Event] = []
        radios = [Radio(system) for system in (1, 2)]
        async with Link(["udpin:127.0.0.1:0"], [1, 2], on_event=events.append) as link:
            for radio in radios:
                await radio.open()
                radio.beat(link.addresses[0])
            await until(lambda: all(any(isinstance(f.message, Heartbeat) for f in radio.heard) for radio in radios))
            await until(lambda: all(any(isinstance(f.message, CommandLong) for f in radio.heard) for radio in radios))
            for system, radio in enumerate(radios, start=1):
                commands = [frame.message for frame in radio.heard if isinstance(frame.message, CommandLong)]
                assert {command.target_system for command in commands} == {system}
                assert {(frame.system, frame.component) for frame in radio.heard} == {
                    (255, MavComponent.MISSIONPLANNER)
                }
            assert {event.system for event in events if isinstance(event, LinkUp)} == {1, 2}
            assert link.running
        for radio in radios:
            radio.close()
        assert not link.running

    asyncio.run(scenario())


def test_a_calling_link_speaks_first() -> None:
    async def scenario() -> None:
        radio = Radio(1)
        host, port = await radio.open()
        async with Link([f"udpout:{host}:{port}"], [1]) as link:
            await until(lambda: len(radio.heard) > 0)
            assert isinstance(radio.heard[0].message, Heartbeat)
            radio.beat(link.addresses[0])
            assert await link.events.get() == LinkUp(system=1)
        radio.close()

    asyncio.run(scenario())


def test_nobody_listening_on_the_other_side_is_counted_and_not_raised() -> None:
    async def scenario() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vacant:
            vacant.bind(("127.0.0.1", 0))
            port = vacant.getsockname()[1]
        async with Link([f"udpout:127.0.0.1:{port}"], [1]) as link:
            await until(lambda: link.send_errors > 0)
            assert link.running

    asyncio.run(scenario())


def test_one_endpoint_per_vehicle_works_like_a_shared_one() -> None:
    async def scenario() -> None:
        radios = [Radio(system) for system in (1, 2)]
        async with Link(["udpin:127.0.0.1:0", "udpin:127.0.0.1:0"], [1, 2]) as link:
            for radio, address in zip(radios, link.addresses, strict=True):
                await radio.open()
                radio.beat(address)
            await until(lambda: all(vehicle.state.link_up for vehicle in link.vehicles.values()))
            peers = [link.vehicle_link(system).peer for system in link.vehicles]
            assert [peer.transport for peer in peers if peer is not None] == [0, 1]
        for radio in radios:
            radio.close()

    asyncio.run(scenario())


def test_every_frame_received_and_sent_is_shown_to_the_recorder() -> None:
    async def scenario() -> None:
        raws: list[bytes] = []
        radio = Radio(1)
        async with Link(["udpin:127.0.0.1:0"], [1], on_frame=raws.append) as link:
            await radio.open()
            radio.beat(link.addresses[0])
            await until(lambda: len(radio.heard) > 2)
            systems = {frame.system for raw in raws for frame in Decoder().feed_datagram(raw)}
            assert systems == {1, 255}
            assert link.counters.received == 1
            assert link.counters.sent == len(raws) - 1
        radio.close()

    asyncio.run(scenario())


def test_an_order_for_a_vehicle_outside_the_fleet_is_refused() -> None:
    async def scenario() -> None:
        async with Link(["udpin:127.0.0.1:0"], [1]) as link:
            with pytest.raises(BadInput) as caught:
                link.hold(2)
            assert caught.value.field == "system"

    asyncio.run(scenario())
