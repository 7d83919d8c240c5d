"""UDP: the only transport there is, in two directions of speaking first.

``udpin:HOST:PORT`` listens and answers where it is spoken to from; ``udpout:HOST:PORT`` speaks first.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from hsop_gcs.errors import BadInput, Unavailable

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One end of a UDP link, as written in a configuration."""

    kind: Literal["udpin", "udpout"]
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def parse_endpoint(text: str) -> Endpoint:
    """Read ``udpin:HOST:PORT`` or ``udpout:HOST:PORT``; port 0 of a udpin is any free one. Raises BadInput."""
    kind, _, rest = text.partition(":")
    host, _, port_text = rest.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if kind not in ("udpin", "udpout") or not host:
        raise BadInput("link", f"{text!r} is neither udpin:HOST:PORT nor udpout:HOST:PORT")
    lowest = 0 if kind == "udpin" else 1
    if not port_text.isascii() or not port_text.isdigit() or not lowest <= int(port_text) <= 65535:
        raise BadInput("link", f"{port_text!r} in {text!r} is not a port")
    return Endpoint("udpin" if kind == "udpin" else "udpout", host, int(port_text))


class UdpTransport(asyncio.DatagramProtocol):
    """One open UDP socket; what arrives is handed to ``on_datagram`` with its address."""

    def __init__(self, endpoint: Endpoint, on_datagram: Callable[[bytes, Address], None]) -> None:
        self.endpoint = endpoint
        self.errors = 0
        """Datagrams the network refused, most often because nobody listens on the other side yet."""
        self._on_datagram = on_datagram
        self._transport: asyncio.DatagramTransport | None = None

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

    def close(self) -> None:
        """Close the socket."""
        if self._transport is not None:
            self._transport.close()

    def datagram_received(self, data: bytes, addr: tuple[str, int] | tuple[str, int, int, int]) -> None:
        """Called by asyncio."""
        self._on_datagram(data, (addr[0], addr[1]))

    def error_received(self, exc: Exception) -> None:
        """Called by asyncio, for instance when nobody listens on the other side."""
        del exc
        self.errors += 1

    def _address(self, name: str) -> Address:
        if self._transport is None:
            raise RuntimeError(f"{self.endpoint} is not open")
        host, port, *_ = self._transport.get_extra_info(name)
        return host, port
