"""What carries bytes to and from vehicles: UDP here, TCP and serial lines in ``streams``."""

import asyncio
import socket
from collections.abc import Callable
from typing import Protocol

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.endpoint import Address, Endpoint
from hsop_gcs.link.streams import MOST_UNSENT_BYTES, StreamTransport

_OPENED_AGAIN_S = 0.5
_RECEIVE_BYTES = 4_000_000
"""What the system keeps for us while we do not read, as far as it allows: some seconds of twenty vehicles. Of a buffer
that is full it drops the newest."""

OnBytes = Callable[[bytes, Address], None]
"""Given what arrived and from where; empty bytes say that a stream has ended."""


class Transport(Protocol):
    """One open endpoint."""

    endpoint: Endpoint
    errors: int
    """What the network or the device refused to carry."""

    @property
    def problem(self) -> str | None:
        """Why nothing can be carried now, for a person; None if it can."""

    @property
    def local(self) -> Address:
        """Our own address."""

    @property
    def remote(self) -> Address | None:
        """The only other side there is; None if there may be many."""

    async def open(self) -> None:
        """Begin to carry. Raises Unavailable for what can never work as configured."""

    def send(self, data: bytes, to: Address) -> None:
        """Send one frame; what cannot be sent is counted, not raised."""

    async def close(self) -> None:
        """Stop carrying."""


def transport_for(endpoint: Endpoint, on_bytes: OnBytes) -> Transport:
    """Return what carries bytes over this endpoint."""
    return StreamTransport(endpoint, on_bytes) if endpoint.is_stream else UdpTransport(endpoint, on_bytes)


class UdpTransport(asyncio.DatagramProtocol):
    """One open UDP socket; what arrives is handed to ``on_bytes`` with its address. One that dies is opened again."""

    def __init__(self, endpoint: Endpoint, on_bytes: OnBytes) -> None:
        self.endpoint = endpoint
        self.errors = 0
        """Datagrams the network refused, most often because nobody listens on the other side yet."""
        self.problem: str | None = None
        self._on_bytes = on_bytes
        self._transport: asyncio.DatagramTransport | None = None
        self._addresses: dict[str, Address] = {}
        self._closed = asyncio.Event()
        self._keeper: asyncio.Task[None] | None = None
        self._wanted = False

    async def open(self) -> None:
        """Open the socket. Raises Unavailable saying which endpoint and why."""
        await self._open((self.endpoint.host, self.endpoint.port))
        self._wanted = True

    @property
    def local(self) -> Address:
        """Our own address."""
        return self._address("sockname")

    @property
    def remote(self) -> Address | None:
        """The other side of a udpout; None for a udpin."""
        return self._address("peername") if self.endpoint.kind == "udpout" else None

    def send(self, data: bytes, to: Address) -> None:
        """Send one datagram; a full or refusing network is counted, not raised."""
        transport = self._transport
        # asyncio keeps what the network does not take for ever: an order that comes late is worse than none
        if transport is None or transport.is_closing() or _unsent_bytes(transport) > MOST_UNSENT_BYTES:
            self.errors += 1
        elif self.endpoint.kind == "udpout":
            transport.sendto(data)
        else:
            transport.sendto(data, to)

    async def close(self) -> None:
        """Close the socket; its port is free when this returns."""
        self._wanted = False
        keeper, self._keeper = self._keeper, None
        if keeper is not None:
            keeper.cancel()
            await asyncio.gather(keeper, return_exceptions=True)
        if self._transport is not None:
            self._transport.close()
            await self._closed.wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio: we closed it, or a fault of the system did."""
        self._closed.set()
        if self._wanted:
            self.problem = f"its socket has died: {exc or 'nobody knows why'}"
            self._keeper = asyncio.get_running_loop().create_task(self._open_again(), name=str(self.endpoint))

    def datagram_received(self, data: bytes, addr: tuple[str, int] | tuple[str, int, int, int]) -> None:
        """Called by asyncio."""
        self._on_bytes(data, (addr[0], addr[1]))

    def error_received(self, exc: Exception) -> None:
        """Called by asyncio, for instance when nobody listens on the other side."""
        del exc
        self.errors += 1

    async def _open(self, address: Address) -> None:
        loop = asyncio.get_running_loop()
        try:
            if self.endpoint.kind == "udpin":
                transport, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=address)
            else:
                transport, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=address)
        except OSError as error:
            raise Unavailable(f"{self.endpoint} cannot be opened: {error.strerror or error}") from error
        # an event loop without sockets, such as one of virtual time, has none
        if (own := transport.get_extra_info("socket")) is not None:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)
        self._closed.clear()
        self._transport, self.problem = transport, None
        for name in ("sockname", "peername"):
            host, port, *_ = transport.get_extra_info(name) or ("", 0)
            self._addresses[name] = (host, port)

    async def _open_again(self) -> None:
        """Where vehicles know us: a port that the system chose stays."""
        address = self._addresses["sockname" if self.endpoint.kind == "udpin" else "peername"]
        while self.problem is not None:
            await asyncio.sleep(_OPENED_AGAIN_S)
            try:
                await self._open(address)
            except Unavailable as error:
                self.problem = str(error)

    def _address(self, name: str) -> Address:
        if name not in self._addresses:
            raise RuntimeError(f"{self.endpoint} is not open")
        return self._addresses[name]


def _unsent_bytes(transport: asyncio.DatagramTransport) -> int:
    unsent: int = transport.get_write_buffer_size()  # type: ignore[attr-defined]  # not in typeshed
    return unsent
