"""A running service for tests: real HTTP, real UDP, in a thread of its own."""

import asyncio
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from typing import Any, TypeVar

import httpx2

from hsop_gcs import loopback
from hsop_gcs.app import running_service
from hsop_gcs.settings import Settings

T = TypeVar("T")

ORIGIN = asdict(loopback.ORIGIN)


def settings(count: int = 2, udp_port: int = 0, autonomy: str = "confirm", **planning: Any) -> Settings:
    """A fleet that listens on one UDP port; 0 is any free one, where nobody will ever call."""
    return Settings.model_validate(
        {
            "site": {"origin": ORIGIN},
            "service": {"port": 0, "autonomy": autonomy},
            "planning": planning,
            "hosts": [
                {"id": f"h{n}", "system_id": n, "connection": f"udpin:127.0.0.1:{udp_port}"}
                for n in range(1, count + 1)
            ],
        }
    )


@contextmanager
def service(wanted: Settings) -> Iterator[httpx2.Client]:
    """Run the service and yield a client of it."""
    ready: Future[tuple[str, Callable[[], object]]] = Future()

    async def run() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        async with running_service(wanted) as address:
            ready.set_result((address, lambda: loop.call_soon_threadsafe(stop.set)))
            await stop.wait()

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(asyncio.run, run())
        either: list[Future[Any]] = [ready, running]
        wait(either, return_when=FIRST_COMPLETED)
        if running.done():
            running.result()
        address, stop = ready.result()
        try:
            with httpx2.Client(base_url=address, timeout=10) as client:
                yield client
        finally:
            if not running.done():
                stop()
            running.result()


@contextmanager
def simulated_fleet(udp_port: int, vehicles: int = 4, *options: str) -> Iterator[None]:
    """Run ``hsop-gcs simulate`` as a process: airborne hosts at the origin that talk to one UDP port of ours."""
    origin = ",".join(str(value) for value in ORIGIN.values())
    command = [sys.executable, "-m", "hsop_gcs", "simulate", "--vehicles", str(vehicles), f"--origin={origin}"]
    command += ["--target", f"127.0.0.1:{udp_port}", "--shared-port", "--local-port", "0", "--exit-with-stdin"]
    process = subprocess.Popen(
        [*command, "--airborne", "40", *options], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
    )
    try:
        yield
    finally:
        process.communicate(timeout=10)


def free_udp_port() -> int:
    (port,) = loopback.free_udp_ports(1)
    return port


def wait_until(look: Callable[[], T | None], *, limit_s: float = 30.0) -> T:
    """Look until there is something to see, and return it."""
    give_up_at = time.monotonic() + limit_s
    while True:
        seen = look()
        if seen:
            return seen
        assert time.monotonic() < give_up_at, f"waited {limit_s:g} s in vain"
        time.sleep(0.1)


def report(threat_id: str = "t1", *, late_s: float = 0.0, **changes: Any) -> dict[str, Any]:
    """A good report of a threat 100 m north of the origin, with top-level fields replaced."""
    good = {
        "source": "radar",
        "threat_id": threat_id,
        "time": (datetime.now(UTC) - timedelta(seconds=late_s)).isoformat(),
        "position": {
            "lat_deg": ORIGIN["lat_deg"] + 0.0009,
            "lon_deg": ORIGIN["lon_deg"],
            "altitude_m": 528.0,
            "altitude_datum": "amsl",
        },
        "velocity": {"east_mps": 0.5, "north_mps": -0.5, "up_mps": 0.0},
    }
    return good | changes


def position(**changes: Any) -> dict[str, Any]:
    """The good report's position with fields replaced."""
    changed: dict[str, Any] = report()["position"] | changes
    return {name: value for name, value in changed.items() if value is not None}
