"""Our heartbeat is a safety signal: it stops when the mission's loop does, seen from a vehicle's socket."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

from hsop_gcs.app import running_mission
from hsop_gcs.link.codec import Decoder
from hsop_gcs.link.messages import Heartbeat
from hsop_gcs.mission.controller import Mission
from hsop_gcs.settings import Settings
from tests.service import ORIGIN, wait_until

SILENCE_S = 4.0
"""Longer than any pause between heartbeats of a living ground station."""


@dataclass
class Running:
    mission: Mission
    loop: asyncio.AbstractEventLoop


class Vehicle:
    """The socket a vehicle would have."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]

    def heartbeat_within(self, seconds: float) -> bool:
        """Wait for the next heartbeat; False if nothing comes for so long."""
        self._socket.settimeout(seconds)
        while True:
            try:
                data = self._socket.recv(1000)
            except TimeoutError:
                return False
            if any(isinstance(frame.message, Heartbeat) for frame in Decoder().feed_datagram(data)):
                return True

    def close(self) -> None:
        self._socket.close()


@contextmanager
def running(port: int) -> Iterator[Running]:
    """A mission whose one host is called at this port, in a thread of its own."""
    settings = Settings.model_validate(
        {
            "site": {"origin": ORIGIN},
            "hosts": [{"id": "h1", "system_id": 1, "connection": f"udpout:127.0.0.1:{port}"}],
        }
    )
    ready, stop = threading.Event(), asyncio.Event()
    found: list[Running] = []

    async def run() -> None:
        async with running_mission(settings) as mission:
            found.append(Running(mission, asyncio.get_running_loop()))
            ready.set()
            await stop.wait()

    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(asyncio.run, run())
        assert ready.wait(60)
        try:
            yield found[0]
        finally:
            found[0].loop.call_soon_threadsafe(stop.set)
            future.result(60)


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    vehicle = Vehicle()
    yield vehicle
    vehicle.close()


def test_a_blocked_loop_stops_the_heartbeat_and_a_freed_one_resumes_it(vehicle: Vehicle) -> None:
    with running(vehicle.port) as service:
        assert vehicle.heartbeat_within(20.0)
        freed = threading.Event()
        service.loop.call_soon_threadsafe(freed.wait)
        try:
            wait_until(lambda: not vehicle.heartbeat_within(SILENCE_S))
        finally:
            freed.set()
        assert vehicle.heartbeat_within(20.0)


def test_a_mission_that_moves_no_more_stops_the_heartbeat_though_the_link_runs(vehicle: Vehicle) -> None:
    with running(vehicle.port) as service:
        assert vehicle.heartbeat_within(20.0)

        def end_the_mission() -> None:
            (runner,) = (task for task in asyncio.all_tasks() if "Mission.run" in str(task.get_coro()))
            runner.cancel()

        service.loop.call_soon_threadsafe(end_the_mission)
        wait_until(lambda: not vehicle.heartbeat_within(SILENCE_S))
        assert service.mission.link.running
        assert "heartbeat withheld: the mission does not move" in service.mission.link.problems
