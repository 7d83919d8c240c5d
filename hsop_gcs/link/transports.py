"""What carries bytes to and from vehicles: UDP here, TCP and serial lines in ``streams``."""

import asyncio
from collections.abc import Callable
from typing import Protocol

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.endpoint import Address, Endpoint
from hsop_gcs.link.streams import StreamTransport

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
    """One open UDP socket; what arrives is handed to ``on_bytes`` with its address."""

    def __init__(self, endpoint: Endpoint, on_bytes: OnBytes) -> None:
        self.endpoint = endpoint
        self.errors = 0
        """Datagrams the network refused, most often because nobody listens on the other side yet."""
        self._on_bytes = on_bytes
        self._transport: asyncio.DatagramTransport | None = None
        self._closed = asyncio.Event()

    async def open(self) -> None:
        """Open the socket. Raises Unavailable saying which endpoint and why."""
        loop = asyncio.get_running_loop()
        address = (self.endpoint.host, self.endpoint.port)
        try:
            if self.endpoint.kind == "udpin":
                self._transport, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=address)
            else:
                self._transport, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=address)
        except OSError as error:
            raise Unavailable(f"{self.endpoint} cannot be opened: {error.strerror or error}") from error

    @property
    def problem(self) -> str | None:
        """A socket that is open can carry."""
        return None

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
        if self._transport is None or self._transport.is_closing():
            self.errors += 1
        elif self.endpoint.kind == "udpout":
            self._transport.sendto(data)
        else:
            self._transport.sendto(data, to)

    async def close(self) -> None:
        """Close the socket; its port is free when this returns."""
        if self._transport is not None:
            self._transport.close()
            await self._closed.wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio."""
        del exc
        self._closed.set()

    def datagram_received(self, data: bytes, addr: tuple[str, int] | tuple[str, int, int, int]) -> None:
        """Called by asyncio."""
        self._on_bytes(data, (addr[0], addr[1]))

    def error_received(self, exc: Exception) -> None:
        """Called by asyncio, for instance when nobody listens on the other side."""
        del exc
        self.errors += 1

    def _address(self, name: str) -> Address:
        if self._transport is None:
            raise RuntimeError(f"{self.endpoint} is not open")
        host, port, *_ = self._transport.get_extra_info(name)
        return host, port
