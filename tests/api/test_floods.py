"""What one client can send too much of: answered with the bound or closed, while the others are served."""

import asyncio
import json
import resource
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from hsop_gcs.api.bounds import Account, Bounds, Excess
from hsop_gcs.api.gate import Gate
from hsop_gcs.api.server import serving, within_descriptors

ONE, OTHER = "127.0.0.1", "127.0.0.2"
GET = b"GET / HTTP/1.1\r\nhost: x\r\n\r\n"
LAST_GET = b"GET / HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n"
SMALL = Bounds(head_bytes=4096, headers=20, url_bytes=500, body_bytes=10_000, command_bytes=1_000, refusal_delay_s=0.01)


class Site:
    """A server behind the gate whose application answers how much it was sent; ``/busy`` answers when it is told to."""

    def __init__(self, bounds: Bounds) -> None:
        self.account = Account()
        self.go_on = asyncio.Event()
        self.busy = 0
        self.answer = b""
        self.gate = Gate(self._app, bounds, self.account)
        self.port = 0

    async def _app(self, scope: Scope, receive: Receive, send: Send) -> None:
        body = (await receive())["body"]
        if scope["path"] == "/busy":
            self.busy += 1
            await self.go_on.wait()
        content = self.answer or f"{len(body)} bytes".encode()
        await send(
            {
                "type": "http.response.start",
                "status": 200,
                "headers": [(b"content-length", str(len(content)).encode())],
            }
        )
        await send({"type": "http.response.body", "body": content})

    async def connect(self, address: str = ONE) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection("127.0.0.1", self.port, local_addr=(address, 0))

    async def ask(self, *parts: bytes, address: str = ONE) -> bytes:
        """Everything that is answered until the server closes."""
        reader, writer = await self.connect(address)
        try:
            for part in parts:
                writer.write(part)
            return await reader.read()
        finally:
            writer.close()


def under(bounds: Bounds, test: Callable[[Site], Awaitable[None]]) -> None:
    async def run() -> None:
        async with asyncio.timeout(30), site_of(bounds) as site:
            await test(site)

    asyncio.run(run())


@asynccontextmanager
async def site_of(bounds: Bounds) -> AsyncIterator[Site]:
    site = Site(bounds)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        site.port = listening.getsockname()[1]
        async with serving(site.gate, listening, bounds, site.account):
            yield site
            site.go_on.set()


def problem_of(answer: bytes, status: int) -> dict[str, Any]:
    """The problem that is the newest answer on a connection."""
    head, _, body = answer[answer.rfind(b"HTTP/1.1 ") :].partition(b"\r\n\r\n")
    assert head.split()[1] == str(status).encode(), answer[:300]
    assert b"application/problem+json" in head
    told: dict[str, Any] = json.loads(body)
    assert told["status"] == status
    return told


async def answered(reader: asyncio.StreamReader) -> bytes:
    """One answer that is not the last on its connection."""
    head = await reader.readuntil(b"\r\n\r\n")
    length = int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
    return head + await reader.readexactly(length)


async def until(true: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not true():
            await asyncio.sleep(0.005)


def test_idle_connections_give_way_to_new_ones_the_useless_first() -> None:
    async def flood(site: Site) -> None:
        reader, writer = await site.connect()
        writer.write(GET)
        assert b"200 OK" in await answered(reader)
        idle = [await site.connect() for _ in range(20)]
        assert b"200 OK" in await site.ask(LAST_GET)
        writer.write(GET)
        assert b"200 OK" in await answered(reader)
        await until(lambda: site.account.connections <= 4)
        assert site.account.excesses[Excess.CONNECTIONS] >= 17
        for _, each in [*idle, (reader, writer)]:
            each.close()

    under(Bounds(connections=8, connections_per_address=4), flood)


def test_a_crowd_of_one_address_costs_no_connection_of_another() -> None:
    async def flood(site: Site) -> None:
        reader, writer = await site.connect(OTHER)
        crowd = [await site.connect() for _ in range(20)]
        writer.write(GET)
        assert b"200 OK" in await answered(reader)
        assert site.account.connections <= 6
        for _, each in [*crowd, (reader, writer)]:
            each.close()

    under(Bounds(connections=6, connections_per_address=100), flood)


def test_with_all_connections_at_work_a_new_one_is_told_to_come_again() -> None:
    async def flood(site: Site) -> None:
        busy = [asyncio.create_task(site.ask(LAST_GET.replace(b"/", b"/busy", 1))) for _ in range(3)]
        await until(lambda: site.busy == 3)
        assert "connections" in problem_of(await site.ask(), 503)["detail"]
        site.go_on.set()
        assert all([b"200 OK" in await each for each in busy])

    under(Bounds(connections=3, working_per_address=8), flood)


@pytest.mark.parametrize(
    ("request_", "status", "word", "kind"),
    [
        (b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 1_000_000, 431, "4096 bytes", Excess.HEAD),
        (b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 21 + b"\r\n", 431, "more than 20", Excess.HEAD),
        (b"GET / HTTP/1.1\r\n" + b"x" * 200_000, 431, "4096 bytes", Excess.HEAD),
        (b"GET / HTTP/1.1\r\nx: " + b"y" * 200_000, 431, "4096 bytes", Excess.HEAD),
        (b"GET / HTTP/1.1\r\nx: " + b"y" * 5000 + b"\r\n\r\n", 431, "4096 bytes", Excess.HEAD),
        (b"GET /" + b"x" * 200_000, 414, "500 bytes", Excess.URL),
        (b"\x16\x03\x01\x02\x00\x01\x00" * 100, 400, "not HTTP", Excess.NOT_HTTP),
        (b"CONNECT x:80 HTTP/1.1\r\n\r\n", 400, "not HTTP", Excess.NOT_HTTP),
    ],
    ids=["6 MB of headers", "21 headers", "a name", "a value", "one header", "a path", "TLS", "CONNECT"],
)
def test_what_is_too_long_or_no_request_is_refused_by_its_bound(
    request_: bytes, status: int, word: str, kind: Excess
) -> None:
    async def flood(site: Site) -> None:
        assert word in problem_of(await site.ask(request_), status)["detail"]
        assert site.account.excesses == {kind: 1}
        await until(lambda: site.account.connections == 0)

    under(SMALL, flood)


@pytest.mark.parametrize(
    "endless",
    [
        b"1;" + b"x" * 300_000,
        b"1\r\nx\r\n" * 30_000,
        b"1\r\nx\r\n0\r\n" + b"x: y\r\n" * 50,
        b"0\r\nx: " + b"y" * 300_000,
    ],
    ids=["chunk extension", "chunks of a byte", "trailers", "a trailer"],
)
def test_what_stands_around_a_chunked_body_is_bounded_like_headers(endless: bytes) -> None:
    async def flood(site: Site) -> None:
        head = b"POST /api/v1/reports HTTP/1.1\r\ntransfer-encoding: chunked\r\n\r\n"
        assert "headers" in problem_of(await site.ask(head, endless), 431)["detail"]

    under(SMALL, flood)


def test_a_chunked_body_without_end_is_refused_and_its_connection_closed_in_time() -> None:
    async def flood(site: Site) -> None:
        reader, writer = await site.connect()
        writer.write(b"POST /api/v1/reports HTTP/1.1\r\ntransfer-encoding: chunked\r\n\r\n")

        async def pour() -> None:
            while not reader.at_eof():
                writer.write(b"1000\r\n" + b"x" * 4096 + b"\r\n")
                await writer.drain()

        pouring = asyncio.create_task(pour())
        assert b"413" in await answered(reader)
        await until(lambda: site.account.connections == 0)
        await asyncio.gather(pouring, return_exceptions=True)

    under(Bounds(body_bytes=10_000, body_s=0.3, linger_s=0.1), flood)


@pytest.mark.parametrize(
    ("parts", "word"),
    [
        ([b"GET / HTTP/1.1\r\nhost: "], "headers: not complete after 0.2 s"),
        ([GET, b"GET"], "headers: not complete after 0.2 s"),
        ([b"POST / HTTP/1.1\r\ncontent-length: 100\r\n\r\n", b"x"], "body: not complete after 0.3 s"),
        ([b"POST / HTTP/1.1\r\ncontent-length: 9\r\nexpect: 100-continue\r\n\r\n"], "body: not complete after 0.3 s"),
    ],
    ids=["headers", "second request", "body", "expected to continue"],
)
def test_who_takes_too_long_is_told_and_closed(parts: list[bytes], word: str) -> None:
    async def flood(site: Site) -> None:
        assert word in problem_of(await site.ask(*parts), 408)["detail"]
        await until(lambda: site.account.connections == 0)

    under(Bounds(head_s=0.2, body_s=0.3, linger_s=0.1), flood)


def test_empty_lines_keep_no_connection_open() -> None:
    async def flood(site: Site) -> None:
        reader, writer = await site.connect()
        writer.write(GET)
        assert b"200 OK" in await answered(reader)
        writer.write(b"\r\n")
        assert "not complete after 0.2 s" in problem_of(await reader.read(), 408)["detail"]
        writer.close()

    under(Bounds(head_s=0.2, linger_s=0.1), flood)


def test_who_never_says_a_word_is_closed() -> None:
    async def flood(site: Site) -> None:
        assert await site.ask() == b""
        assert site.account.excesses == {Excess.HEAD_TIME: 1}

    under(Bounds(head_s=0.1), flood)


def test_slow_bodies_hold_up_nobody() -> None:
    async def flood(site: Site) -> None:
        slow = [await site.connect() for _ in range(20)]
        for _, writer in slow:
            writer.write(b"POST / HTTP/1.1\r\ncontent-length: 100\r\n\r\nx")
        assert b"200 OK" in await site.ask(LAST_GET)
        for _, writer in slow:
            writer.close()

    under(Bounds(working_per_address=2), flood)


def test_of_too_many_requests_in_line_the_first_are_answered_and_the_connection_closed() -> None:
    async def flood(site: Site) -> None:
        answers = await site.ask(GET * 5000)
        assert answers.count(b"HTTP/1.1 200 OK") == 5
        assert answers.count(b"connection: close") == 1
        assert site.account.excesses == {Excess.PIPELINED: 1}

    under(Bounds(pipelined=4), flood)


@pytest.mark.parametrize("to", [b"websocket", b"h2c"])
def test_who_would_speak_something_else_is_answered_in_http(to: bytes) -> None:
    async def flood(site: Site) -> None:
        upgrade = b"POST / HTTP/1.1\r\nconnection: upgrade\r\nupgrade: " + to + b"\r\ncontent-length: 3\r\n\r\nabc"
        answers = await site.ask(upgrade, upgrade + LAST_GET)
        assert answers.count(b"HTTP/1.1 200 OK") == 3
        assert answers.count(b"3 bytes") == 2

    under(SMALL, flood)


@pytest.mark.parametrize(
    ("path", "header", "status", "word"),
    [
        (b"/api/v1/reports", b"content-length: 60000000", 413, "60000000"),
        (b"/api/v1/reports", b"content-length: 60000000\r\nexpect: 100-continue", 413, "10000"),
        (b"/api/v1/hosts/hold", b"content-length: 888901", 422, "1000"),
        (b"/api/v1/reports", b"content-encoding: gzip\r\ncontent-length: 2", 415, "gzip"),
        (b"/api/v1/reports", b"content-length: 99999999999999999999999999", 400, "not HTTP"),
    ],
)
def test_a_body_that_will_not_be_taken_is_refused_by_its_headers(
    path: bytes, header: bytes, status: int, word: str
) -> None:
    async def flood(site: Site) -> None:
        answer = await site.ask(b"POST " + path + b" HTTP/1.1\r\nconnection: close\r\n" + header + b"\r\n\r\n")
        assert answer.startswith(b"HTTP/1.1 " + str(status).encode())
        assert word in problem_of(answer, status)["detail"]

    under(SMALL, flood)


def test_a_flood_of_requests_is_slowed_and_costs_no_other_client_and_no_stop() -> None:
    async def flood(site: Site) -> None:
        answers = [await site.ask(LAST_GET) for _ in range(8)]
        assert [b"200 OK" in each for each in answers[:5]] == [True] * 5
        assert "10 a second" in problem_of(answers[-1], 429)["detail"]
        assert b"retry-after: 1\r\n" in answers[-1]
        assert b"200 OK" in await site.ask(LAST_GET, address=OTHER)
        hold = b"POST /api/v1/hosts/hold HTTP/1.1\r\ncontent-length: 2\r\nconnection: close\r\n\r\n{}"
        assert b"200 OK" in await site.ask(hold)

    under(Bounds(requests_per_s=10, burst_s=0.5, refusal_delay_s=0.01), flood)


def test_who_does_not_read_his_answers_is_closed() -> None:
    async def flood(site: Site) -> None:
        site.answer = b"x" * 8_000_000
        _, writer = await site.connect()
        writer.write(GET * 3)
        await until(lambda: site.account.excesses == {Excess.UNREAD: 1})
        await until(lambda: site.account.connections == 0)
        writer.close()

    under(Bounds(read_s=0.1), flood)


def test_answers_that_nobody_reads_are_bounded_in_all() -> None:
    async def flood(site: Site) -> None:
        site.answer = b"x" * 8_000_000
        writers = [(await site.connect())[1] for _ in range(4)]
        for writer in writers:
            writer.write(GET)
        await until(lambda: site.account.excesses[Excess.UNREAD] >= 2)
        assert site.account.connections >= 1
        for writer in writers:
            writer.close()

    under(Bounds(unread_bytes=12_000_000), flood)


def test_bodies_that_wait_for_their_turn_are_bounded_for_each_client() -> None:
    async def flood(site: Site) -> None:
        body = b"POST /busy HTTP/1.1\r\nconnection: close\r\ncontent-length: 900\r\n\r\n" + b"x" * 900
        waiting = [asyncio.create_task(site.ask(body)) for _ in range(3)]
        answers = asyncio.gather(*waiting)
        await until(lambda: any(each.done() for each in waiting))
        told = next(each.result() for each in waiting if each.done())
        assert "2000" in problem_of(told, 503)["detail"]
        assert b"200 OK" in await site.ask(LAST_GET, address=OTHER)
        site.go_on.set()
        assert [b"200 OK" in each for each in await answers].count(True) == 2

    under(Bounds(body_bytes=1000, held_bodies=2), flood)


def test_without_file_descriptors_connections_wait_until_there_are_some() -> None:
    async def flood(site: Site) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        client = socket.socket()
        client.setblocking(False)
        free = socket.socket()
        resource.setrlimit(resource.RLIMIT_NOFILE, (free.fileno(), hard))
        try:
            await asyncio.get_running_loop().sock_connect(client, ("127.0.0.1", site.port))
            await until(lambda: site.account.excesses[Excess.FILE_DESCRIPTORS] > 0)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
            free.close()
        reader, writer = await asyncio.open_connection(sock=client)
        writer.write(LAST_GET)
        assert b"200 OK" in await reader.read()
        writer.close()

    under(Bounds(), flood)


def test_bounds_keep_to_the_files_that_the_process_may_open() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY:
        assert within_descriptors(Bounds(connections=hard)).connections == hard - 256
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert within_descriptors(Bounds(connections=100)).connections == 100
