"""The HTTP server: accepts clients' connections within their bounds, and closes those that take too long."""

import asyncio
import ctypes
import logging
import resource
import socket
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from email.utils import formatdate

import uvicorn
from starlette.types import ASGIApp
from uvicorn.server import ServerState

from hsop_gcs.api.bounds import Account, Bounds, Excess
from hsop_gcs.api.connection import FULL, Connection

_LOOK_EVERY_S = 0.25
_PAUSE_S = 0.25
"""After the process has run out of file descriptors."""
_PATIENCE_S = 2.0
"""At the end, for requests that are being answered."""
_OTHER_FILES = 256
"""File descriptors that are none of a client's: links, journal, workers and libraries."""

_M_MMAP_THRESHOLD = -3
_LARGE_BYTES = 131_072

log = logging.getLogger(__name__)


@asynccontextmanager
async def serving(
    app: ASGIApp, listening: socket.socket, bounds: Bounds | None = None, account: Account | None = None
) -> AsyncIterator[None]:
    """Answer requests on a listening socket until the block ends; then wait a little for those being answered."""
    server = Server(app, listening, within_descriptors(bounds or Bounds()), account or Account())
    _give_memory_back()
    server.open()
    keeper = asyncio.create_task(server.keep())
    try:
        yield
    finally:
        keeper.cancel()
        await server.close()


class Server:
    """Accepts connections by itself: asyncio, out of descriptors, logs each try and stops for a second."""

    def __init__(self, app: ASGIApp, listening: socket.socket, bounds: Bounds, account: Account) -> None:
        self._config = uvicorn.Config(
            app,
            http="httptools",
            ws="none",
            lifespan="off",
            log_level="warning",
            access_log=False,
            proxy_headers=False,
            timeout_keep_alive=bounds.idle_s,
        )
        self._config.load()
        self._state = ServerState()
        self._listening, self._bounds, self._account = listening, bounds, account
        self._loop = asyncio.get_running_loop()
        self._connections: dict[Connection, None] = {}
        """Oldest first."""
        self._per_address: Counter[str] = Counter()
        self._arriving: dict[asyncio.Task[tuple[asyncio.Transport, Connection]], Connection] = {}
        self._open = False

    def open(self) -> None:
        """Begin to accept."""
        self._listening.setblocking(False)
        self._open = True
        self._date()
        self._loop.add_reader(self._listening, self._accept)

    async def keep(self) -> None:
        """Close what takes too long, until cancelled."""
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            self._date()
            now_s = self._loop.time()
            for connection in list(self._connections):
                connection.look(now_s)
            unread = sum([each.unread_bytes for each in self._connections])
            while unread > self._bounds.unread_bytes:
                largest = max(self._connections, key=lambda each: each.unread_bytes)
                unread -= largest.unread_bytes
                largest.drop(Excess.UNREAD)

    async def close(self) -> None:
        """Accept nothing more, and give what is being answered a moment."""
        if self._open:
            self._open = False
            self._loop.remove_reader(self._listening)
        for connection in list(self._connections):
            connection.shutdown()
        with suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                while self._connections or self._state.tasks:
                    await asyncio.sleep(0.01)
        for connection in list(self._connections):
            connection.transport.abort()
        left = [*self._state.tasks, *self._arriving]
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    def _accept(self) -> None:
        for _ in range(self._bounds.connections_at_once):
            try:
                client, peer = self._listening.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                # no descriptor or memory left: those that wait in line are taken as soon as there is
                self._account.tell(Excess.FILE_DESCRIPTORS, f"{error.strerror}")
                self._make_room(None)
                self._loop.remove_reader(self._listening)
                self._loop.call_later(_PAUSE_S, self._again)
                return
            client.setblocking(False)
            self._admit(client, peer[0])

    def _again(self) -> None:
        if self._open:
            self._loop.add_reader(self._listening, self._accept)

    def _admit(self, client: socket.socket, address: str) -> None:
        bounds = self._bounds
        full = self._account.connections >= bounds.connections
        if self._per_address[address] >= bounds.connections_per_address or full:
            crowd = address
            if full and self._per_address[address] < bounds.connections_per_address:
                crowd = self._per_address.most_common(1)[0][0]
            self._account.tell(Excess.CONNECTIONS, address)
            if not self._make_room(crowd):
                _turn_away(client)
                return
        self._per_address[address] += 1
        self._account.connections += 1

        connection = Connection(self._config, self._state, bounds, self._account, address, self._began, self._ended)
        task = self._loop.create_task(self._loop.connect_accepted_socket(lambda: connection, client))
        self._arriving[task] = connection
        task.add_done_callback(self._arrived)

    def _arrived(self, task: "asyncio.Task[tuple[asyncio.Transport, Connection]]") -> None:
        connection = self._arriving.pop(task)
        if (task.cancelled() or task.exception() is not None) and connection.transport is None:
            self._leave(connection.address)

    def _began(self, connection: Connection) -> None:
        self._connections[connection] = None

    def _make_room(self, address: str | None) -> bool:
        """Close the connection of an address, or of any, that has waited longest, useless ones first; False: none."""
        waiting = [
            each
            for each in self._connections
            if (address is None or each.address == address) and each.waits and not each.transport.is_closing()
        ]
        if not waiting:
            return False
        longest = min(waiting, key=lambda each: (each.answered, each.since_s))
        longest.transport.abort()
        self._ended(longest)
        return True

    def _ended(self, connection: Connection) -> None:
        if connection in self._connections:
            del self._connections[connection]
            self._leave(connection.address)

    def _leave(self, address: str) -> None:
        self._account.connections -= 1
        self._per_address[address] -= 1
        if not self._per_address[address]:
            del self._per_address[address]

    def _date(self) -> None:
        self._state.default_headers = [(b"date", formatdate(usegmt=True).encode()), *self._config.encoded_headers]


def _give_memory_back() -> None:
    """Have the C library return large pieces of memory at once: it keeps them once there were some."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)


def _turn_away(client: socket.socket) -> None:
    with client, suppress(OSError):
        client.send(FULL)
        client.shutdown(socket.SHUT_WR)
        # what lies unread when it closes would take the answer with it
        client.recv(65_536)


def within_descriptors(bounds: Bounds) -> Bounds:
    """Raise the process's limit of open files to what the bounds need; return bounds for what could be had."""
    needed = bounds.connections + _OTHER_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        wanted = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return bounds
    connections = max(16, soft - _OTHER_FILES)
    log.warning("%d connections at most, not %d: this process may open %d files", connections, bounds.connections, soft)
    return replace(bounds, connections=min(bounds.connections, connections))
