"""Floods against a real service while another client goes on: how long that one waits, and what memory is left of it.

python -m tests.bench.bench_floods [ADDRESS [FLOOD ...]]

ADDRESS: where the floods come from, 127.0.0.2 by default; the other client is at 127.0.0.1.
"""

import asyncio
import http.client
import json
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event as SyncEvent
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from hsop_gcs.bench.process import Service, running
from hsop_gcs.loopback import ORIGIN
from tests.service import report

POLL_S = 0.02
SETTLE_S = 4.0
LIMIT_S, LIMIT_MIB = 0.25, 10.0
HEAD = b"POST /api/v1/%s HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\n"


@dataclass(frozen=True)
class Flood:
    """A crowd of one address."""

    address: str
    port: int

    async def say(self, *parts: bytes, pause_s: float = 0.0, wait_s: float = 30.0) -> bytes:
        """Send parts, and return what is answered until the connection closes or it has taken too long."""
        answer = b""
        with suppress(OSError, TimeoutError):
            async with asyncio.timeout(wait_s):
                reader, writer = await asyncio.open_connection("127.0.0.1", self.port, local_addr=(self.address, 0))
                try:
                    for part in parts:
                        writer.write(part)
                        await writer.drain()
                        await asyncio.sleep(pause_s)
                except OSError:
                    pass
                finally:
                    answer = await reader.read(65_536)
                    writer.close()
        return answer

    async def post(self, path: bytes, body: bytes, *, more: bytes = b"", wait_s: float = 30.0) -> bytes:
        head = HEAD % path + more + b"content-length: %d\r\nconnection: close\r\n\r\n" % len(body)
        return await self.say(head + body, wait_s=wait_s)

    async def nothing(self) -> None:
        await asyncio.sleep(3)

    async def names(self) -> None:
        body = json.dumps({"hosts": [f"host-{number}" for number in range(100_000)]}).encode()
        answers = await asyncio.gather(*[self.post(b"hosts/hold", body) for _ in range(20)])
        assert all(b" 422 " in each[:20] for each in answers if each), answers[0][:200]

    async def headers(self) -> None:
        many = b"x-%d: y\r\n" * 1000 % tuple(range(1000))
        await asyncio.gather(*[self.say(b"GET / HTTP/1.1\r\n", *[many] * 6000) for _ in range(2)])

    async def header_names(self) -> None:
        await asyncio.gather(*[self.say(b"GET / HTTP/1.1\r\n", b"x" * 64_000, wait_s=3) for _ in range(200)])

    async def idle(self) -> None:
        await asyncio.gather(*[self.say(wait_s=8) for _ in range(1100)])

    async def slow(self) -> None:
        drip = [b"GET / HTTP/1.1\r\n", *[b"x: y\r\n"] * 20]
        await asyncio.gather(*[self.say(*drip, pause_s=0.5, wait_s=15) for _ in range(200)])

    async def slow_bodies(self) -> None:
        parts = [HEAD % b"reports" + b"content-length: 900000\r\n\r\n", *[b" " * 20_000] * 20]
        await asyncio.gather(*[self.say(*parts, pause_s=0.3, wait_s=10) for _ in range(200)])

    async def pipelined(self) -> None:
        await asyncio.gather(*[self.say(b"GET /api/v1/hosts HTTP/1.1\r\n\r\n" * 5000, wait_s=8) for _ in range(100)])

    async def not_found(self) -> None:
        async def many(first: int) -> None:
            for number in range(50):
                await self.say(b"GET /p%d HTTP/1.1\r\nconnection: close\r\n\r\n" % (first + number), wait_s=5)

        await asyncio.gather(*[many(50 * number) for number in range(100)])

    async def batches(self) -> None:
        def body() -> bytes:
            return json.dumps([report(f"flood-{number}", source="flood") for number in range(1000)]).encode()

        for _ in range(3):
            await asyncio.gather(*[self.post(b"reports", body(), wait_s=5) for _ in range(20)])

    async def json_of_all_kinds(self) -> None:
        bodies = [b"[" + b"{}," * 330_000 + b"{}]", b"[" + b"[[]]," * 190_000 + b"1]", b"[" * 900_000]
        bodies += [b'{"a": [' + b"1.5," * 240_000 + b"0]}", b"[" + b'{"a":{}},' * 990 + b"{}]"]
        await asyncio.gather(*[self.post(b"reports", body) for body in bodies * 10])

    async def questions(self) -> None:
        threats = [{"id": f"t{k}", "position_m": [60 * k, 0], "velocity_mps": [1, 1]} for k in range(40)]
        body = json.dumps({"scenario": {"threats": threats}, "time_limit_s": 10}).encode()
        await asyncio.gather(*[self.post(b"placements", body, wait_s=4) for _ in range(50)])

    async def endless(self) -> None:
        chunk = b"8000\r\n" + b" " * 32_768 + b"\r\n"
        head = HEAD % b"reports" + b"transfer-encoding: chunked\r\n\r\n"
        await asyncio.gather(*[self.say(head, *[chunk] * 1000, wait_s=8) for _ in range(20)])


FLOODS: list[Callable[[Flood], Awaitable[None]]] = [
    Flood.nothing,
    Flood.names,
    Flood.headers,
    Flood.header_names,
    Flood.idle,
    Flood.slow,
    Flood.slow_bodies,
    Flood.pipelined,
    Flood.not_found,
    Flood.json_of_all_kinds,
    Flood.endless,
    Flood.batches,
    Flood.questions,
]


def go_on(port: int, begun: SyncEvent, over: SyncEvent, told: Connection) -> None:
    """Another client, in a process of its own: it reports, looks and holds, each on a new connection."""
    waits_s: list[float] = []
    failed: list[str] = []
    begun.set()
    while not over.is_set():
        began = time.perf_counter()
        try:
            match len(waits_s) % 3:
                case 0:
                    ask(port, "POST", "/api/v1/hosts/hold", {"hosts": ["h1"]})
                case 1:
                    ask(port, "POST", "/api/v1/reports", report("mine", source="other"))
                case _:
                    ask(port, "GET", "/api/v1/hosts", None)
        except (OSError, http.client.HTTPException) as error:
            failed.append(repr(error))
        waits_s.append(time.perf_counter() - began)
        time.sleep(POLL_S)
    told.send((waits_s, failed))


def ask(port: int, method: str, path: str, body: object) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(method, path, None if body is None else json.dumps(body), {"content-type": "application/json"})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    if answer.status >= 500:
        raise OSError(f"{path}: {answer.status}")


def measured(
    service: Service, flood: Callable[[Flood], Awaitable[None]], address: str
) -> tuple[float, float, float, int]:
    """p99 and longest wait of the other client, seconds; memory that is left, MiB; and how often it failed."""
    port = urlsplit(service.address).port
    assert port is not None
    before = service.usage().resident_mib
    processes = get_context("spawn")
    begun, over, (ours, theirs) = processes.Event(), processes.Event(), processes.Pipe()
    other = processes.Process(target=go_on, args=(port, begun, over, theirs), daemon=True)
    other.start()
    begun.wait()
    asyncio.run(flood_of(flood, Flood(address, port)))
    time.sleep(0.5)
    over.set()
    waits_s, failed = ours.recv()
    other.join()
    time.sleep(SETTLE_S)
    left = service.usage().resident_mib - before
    return float(np.quantile(waits_s, 0.99)), max(waits_s), left, len(failed)


async def flood_of(flood: Callable[[Flood], Awaitable[None]], crowd: Flood) -> None:
    await flood(crowd)


def main() -> None:
    address = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.2"
    chosen = [getattr(Flood, name) for name in sys.argv[2:]] or FLOODS
    with tempfile.TemporaryDirectory(prefix="hsop-gcs-floods-") as folder:
        config = Path(folder, "fleet.toml")
        config.write_text(
            f"[site]\norigin = {{ lat_deg = {ORIGIN.lat_deg}, lon_deg = {ORIGIN.lon_deg},"
            f" altitude_amsl_m = {ORIGIN.altitude_amsl_m} }}\n"
            '[[hosts]]\nid = "h1"\nsystem_id = 1\nconnection = "udpin:127.0.0.1:0"\n'
        )
        with running(config, Path(folder, "service.log")) as service:
            for flood in [Flood.names, *chosen]:  # the first time is for what every process comes to hold once
                p99_s, longest_s, left_mib, failed = measured(service, flood, address)
                kept = p99_s < LIMIT_S and left_mib < LIMIT_MIB and not failed
                sys.stdout.write(
                    f"| {flood.__name__} | p99 {1000 * p99_s:.0f} ms | longest {1000 * longest_s:.0f} ms |"
                    f" {left_mib:+.1f} MiB | {failed} failed | {'kept' if kept else 'NOT KEPT'} |\n"
                )
                sys.stdout.flush()
            health = http.client.HTTPConnection(urlsplit(service.address).netloc)
            health.request("GET", "/api/v1/health")
            sys.stdout.write(json.dumps(json.loads(health.getresponse().read())["clients"]) + "\n")


if __name__ == "__main__":
    main()
