"""Programs beside us at a vehicle: who is shown what, and for how long."""

import asyncio
import socket
from dataclasses import dataclass

import pytest

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.codec import Decoder, Encoder
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.guest_port import GuestPort
from hsop_gcs.link.messages import CommandLong, Heartbeat, Message, ParamSet
from hsop_gcs.link.pump import Link
from tests.link.test_link_udp import Radio, until
from tests.service import free_udp_port


@dataclass
class Clock:
    now_s: float = 0.0

    def __call__(self) -> float:
        return self.now_s


class Guest:
    """A program on a socket of its own."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.connect(("127.0.0.1", port))

    def say(self, message: Message | None = None) -> None:
        self._socket.send(Encoder(system=245, component=190).encode(message or Heartbeat()))

    def shown(self) -> set[int]:
        """The systems whose frames have come since the last look."""
        systems = set()
        try:
            while True:
                systems |= {frame.system for frame in Decoder().feed_datagram(self._socket.recv(1000))}
        except BlockingIOError:
            return systems

    def close(self) -> None:
        self._socket.close()


def test_guests_are_shown_their_vehicle_alone_and_are_few_and_forgotten_when_silent() -> None:
    async def scenario() -> None:
        port, clock = free_udp_port(), Clock()
        one, two = Radio(1), Radio(2)
        guests = [Guest(port) for _ in range(9)]
        async with Link(["udpin:127.0.0.1:0"], [1, 2], clock=clock) as link, GuestPort(link, 1, port):
            for radio in (one, two):
                await radio.open()

            def withheld() -> int:
                return sum(link.vehicle_link(1).withheld.values())

            async def vehicles_speak() -> None:
                before = link.counters.received
                for radio in (two, one):
                    radio.beat(link.addresses[0])
                await until(lambda: link.counters.received == before + 2)

            for number, guest in enumerate(guests, start=1):
                guest.say()
                await until(lambda number=number: withheld() == number)  # type: ignore[misc]
            await vehicles_speak()
            assert [guest.shown() for guest in guests] == [{1}] * 8 + [set()]

            clock.now_s = 9.0
            guests[0].say()
            await until(lambda: withheld() == 10)
            clock.now_s = 11.0
            await vehicles_speak()
            assert [guest.shown() for guest in guests] == [{1}] + [set()] * 8, "the others have been silent for 11 s"
            guests[8].say(ParamSet(target_system=1, param_id="A"))
            await until(lambda: any(isinstance(frame.message, ParamSet) for frame in one.heard))
            assert not any(isinstance(frame.message, ParamSet) for frame in two.heard)
            await vehicles_speak()
            assert guests[8].shown() == {1}, "there is room for it now"
            guests[8].say(CommandLong(target_system=1, command=MavCmd.COMPONENT_ARM_DISARM, param1=1.0))
            await until(lambda: link.vehicle_link(1).withheld.get("command 400") == 1)
            assert guests[8].shown() == {1}, "denied in the vehicle's name"
        for radio in (one, two):
            radio.close()
        for guest in guests:
            guest.close()

    asyncio.run(scenario())


def test_a_port_that_is_taken_is_named_and_a_closed_one_given_back() -> None:
    async def scenario() -> None:
        port = free_udp_port()
        async with Link(["udpin:127.0.0.1:0"], [1]) as link:
            async with GuestPort(link, 1, port):
                with pytest.raises(Unavailable, match=f"udpin:127.0.0.1:{port} cannot be opened"):
                    await GuestPort(link, 1, port).__aenter__()
            async with GuestPort(link, 1, port):
                pass

    asyncio.run(scenario())
