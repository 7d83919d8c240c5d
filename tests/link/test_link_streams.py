"""TCP and serial lines, on loopback and on a pair of pseudo-terminals."""

import asyncio
import os
import pty
import tty
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.endpoint import Endpoint
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import Event, LinkLost, LinkUp
from hsop_gcs.link.messages import Attitude, Heartbeat, Message
from hsop_gcs.link.pump import Link
from hsop_gcs.link.streams import StreamTransport
from hsop_gcs.link.vehicle import VehicleLimits
from tests.link.test_link_udp import until

BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)


class Line:
    """The vehicle's end of a stream."""

    def __init__(
        self, reader: asyncio.StreamReader, write: Callable[[bytes], object], hang_up: Callable[[], None]
    ) -> None:
        self.heard: list[Frame] = []
        self._reader, self._write, self._hang_up = reader, write, hang_up
        self._encoder, self._decoder = Encoder(system=1, component=1), Decoder()
        self._listening = asyncio.create_task(self._listen())

    def say(self, message: Message, *, only: int | None = None) -> None:
        """Send a message, or only its first bytes."""
        self._write(self._encoder.encode(message)[:only])

    async def close(self) -> None:
        self._hang_up()
        self._listening.cancel()
        await asyncio.gather(self._listening, return_exceptions=True)

    async def _listen(self) -> None:
        while data := await self._reader.read(1000):
            self.heard += self._decoder.feed_stream(data)


@asynccontextmanager
async def tcp_vehicle(port: int = 0) -> AsyncIterator[tuple[int, list[Line]]]:
    """A vehicle that waits to be called, as ArduPilot's simulator does; yields its port and its connections."""
    lines: list[Line] = []
    server = await asyncio.start_server(lambda r, w: lines.append(Line(r, w.write, w.close)), "127.0.0.1", port)
    try:
        yield server.sockets[0].getsockname()[1], lines
    finally:
        server.close()
        for line in lines:
            await line.close()
        await server.wait_closed()


def hears_us(line: Line) -> Callable[[], bool]:
    return lambda: any(isinstance(frame.message, Heartbeat) and frame.system == 255 for frame in line.heard)


def test_a_tcp_link_speaks_first_hears_and_is_connected_again_when_it_ends() -> None:
    async def scenario() -> None:
        async with tcp_vehicle() as (port, lines), Link([f"tcp:127.0.0.1:{port}"], [1]) as link:
            await until(lambda: len(lines) == 1)
            await until(hears_us(lines[0]))
            assert link.problems == ()
            lines[0].say(BEAT)
            await until(lambda: link.vehicles[1].state.link_up)
            for _ in range(100):
                lines[0].say(Attitude(yaw=1.0))
            await until(lambda: link.counters.received == 101)
            # The connection ends in the middle of a frame; the rest of it never comes.
            lines[0].say(Attitude(yaw=1.0), only=7)
            await lines[0].close()
            await until(lambda: len(lines) == 2)
            lines[1].say(Attitude(yaw=2.0))
            await until(lambda: link.counters.received == 102)
            assert link.vehicles[1].state.heading_deg == pytest.approx(114.6, abs=0.1)
            assert link.counters.bad_frames == 0
            assert link.counters.refused == 0
            assert link.counters.lost == 0, "a vehicle that starts again begins to count again"
            await until(hears_us(lines[1]))

    asyncio.run(scenario())


def test_a_tcp_vehicle_that_is_not_there_yet_is_waited_for_and_named() -> None:
    async def scenario() -> None:
        async with tcp_vehicle() as (port, _):
            pass
        async with Link([f"tcp:127.0.0.1:{port}"], [1]) as link:
            await until(lambda: link.problems == (f"tcp:127.0.0.1:{port}: cannot connect: Connection refused",))
            await until(lambda: link.send_errors > 0)
            async with tcp_vehicle(port) as (_, lines):
                await until(lambda: len(lines) == 1)
                lines[0].say(BEAT)
                assert await link.events.get() == LinkUp(system=1)
                assert link.problems == ()
            assert link.running

    asyncio.run(scenario())


def test_a_line_that_stays_down_is_tried_less_and_less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses_s: list[float] = []
    sleep = asyncio.sleep

    async def at_once(seconds: float) -> None:
        if seconds >= 0.25:
            pauses_s.append(seconds)
        await sleep(0)

    async def scenario() -> None:
        async with tcp_vehicle() as (port, _):
            pass
        transport = StreamTransport(Endpoint("tcp", "127.0.0.1", port), lambda *_: None)
        monkeypatch.setattr("hsop_gcs.link.streams.asyncio.sleep", at_once)
        await transport.open()
        await until(lambda: len(pauses_s) >= 8)
        await transport.close()

    asyncio.run(scenario())
    assert pauses_s[:8] == [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0]


def test_a_tcp_vehicle_that_stops_reading_costs_frames_and_no_memory() -> None:
    async def scenario() -> None:
        waiting = asyncio.Event()

        async def deaf(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            del reader
            await waiting.wait()
            writer.close()

        server = await asyncio.start_server(deaf, "127.0.0.1", 0, limit=1)
        port = server.sockets[0].getsockname()[1]
        transport = StreamTransport(Endpoint("tcp", "127.0.0.1", port), lambda *_: None)
        await transport.open()
        await until(lambda: transport.problem is None)
        frame, sent = Encoder(system=255, component=190).encode(Attitude()), 0
        while transport.errors == 0:
            transport.send(frame, ("", 0))
            sent += 1
            assert sent < 10_000_000 // len(frame), "10 MB were taken by nobody"
        await transport.close()
        waiting.set()
        server.close()
        await server.wait_closed()

    asyncio.run(scenario())


def test_a_serial_line_carries_a_vehicle_and_is_opened_again_when_it_comes_back(tmp_path: Path) -> None:
    async def plug_in(device: Path) -> Line:
        """A radio at the end of a cable; ``device`` is its name on our side."""
        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(theirs))
        reader = asyncio.StreamReader()
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(ours, "rb", buffering=0)
        )

        def hang_up() -> None:
            transport.close()
            os.close(theirs)

        return Line(reader, lambda data: os.write(ours, data), hang_up)

    async def scenario() -> None:
        device, events = tmp_path / "ttyRADIO", list[Event]()
        limits = VehicleLimits(lost_after_s=0.5)
        async with Link([f"serial:{device}:57600"], [1], limits=limits, on_event=events.append) as link:
            await until(lambda: "cannot connect" in link.problems[0])
            line = await plug_in(device)
            await until(hears_us(line))
            line.say(BEAT)
            await until(lambda: events == [LinkUp(system=1)])
            device.unlink()
            await line.close()
            await until(lambda: isinstance(events[-1], LinkLost) and link.problems != ())
            line = await plug_in(device)
            await until(hears_us(line))
            line.say(BEAT)
            await until(lambda: events[-1] == LinkUp(system=1))
            await line.close()

    asyncio.run(scenario())
