"""TCP and serial lines: byte streams that are connected again whenever they end.

waiting ──due──► connecting ──connected──► open ──ended, refused, silent──► waiting, twice as long as before
"""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable

import serial
import serial_asyncio_fast

from hsop_gcs.link.endpoint import Address, Endpoint
from hsop_gcs.link.faults import describe

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.25, 8.0
_CONNECT_WITHIN_S = 5.0
_UNACKNOWLEDGED_FOR_MS = 10_000
"""A TCP connection whose other side has vanished is given up after this, instead of the kernel's quarter of an hour."""
_READ_BYTES = 4096
MOST_UNSENT_BYTES = 4096
"""What a stalled line has not taken by then is dropped: an order that comes late is worse than none."""


class StreamTransport:
    """One TCP client or serial line; what arrives is handed to ``on_bytes``, and empty bytes when the stream ends."""

    def __init__(self, endpoint: Endpoint, on_bytes: Callable[[bytes, Address], None]) -> None:
        self.endpoint = endpoint
        self.errors = 0
        """Frames that found the line down or full."""
        self.problem: str | None = "not connected yet"
        self._on_bytes = on_bytes
        self._address = (endpoint.host, endpoint.port)
        self._writer: asyncio.StreamWriter | None = None
        self._keeper: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Begin to connect; an other side that is not there yet is waited for."""
        self._keeper = asyncio.create_task(self._keep_connected(), name=str(self.endpoint))

    @property
    def local(self) -> Address:
        """The endpoint itself: nobody can call us here."""
        return self._address

    @property
    def remote(self) -> Address | None:
        """The other side."""
        return self._address

    def send(self, data: bytes, to: Address) -> None:
        """Send one frame; a line that is down or full is counted, not raised."""
        del to
        writer = self._writer
        if writer is None or writer.is_closing() or writer.transport.get_write_buffer_size() > MOST_UNSENT_BYTES:
            self.errors += 1
        else:
            writer.write(data)

    async def close(self) -> None:
        """Give the line up."""
        keeper, self._keeper = self._keeper, None
        if keeper is not None:
            keeper.cancel()
            await asyncio.gather(keeper, return_exceptions=True)

    async def _keep_connected(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while True:
            try:
                async with asyncio.timeout(_CONNECT_WITHIN_S):
                    reader, writer = await self._connect()
            except (OSError, TimeoutError) as error:
                self.problem = f"cannot connect: {_why(error)}"
            except Exception as error:  # whatever it is, the line is tried again
                self.problem = f"cannot connect: {describe(error)}"
            else:
                heard, why = await self._read(reader, writer)
                self.problem = f"connection lost: {why}"
                if heard:
                    pause_s = _FIRST_PAUSE_S
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        host, port = self._address
        if self.endpoint.kind == "serial":
            return await serial_asyncio_fast.open_serial_connection(url=host, baudrate=port, exclusive=True)
        reader, writer = await asyncio.open_connection(host, port)
        connected = writer.get_extra_info("socket")
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNACKNOWLEDGED_FOR_MS)
        return reader, writer

    async def _read(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> tuple[bool, str]:
        """Read until the stream ends; return whether anything came, and why it ended."""
        self._writer, self.problem, heard, why = writer, None, False, "the other side closed it"
        try:
            while data := await reader.read(_READ_BYTES):
                heard = True
                self._on_bytes(data, self._address)
        except OSError as error:
            why = _why(error)
        except Exception as error:
            why = describe(error)
        finally:
            self._writer = None
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()
            self._on_bytes(b"", self._address)
        return heard, why


def _why(error: OSError | TimeoutError) -> str:
    if isinstance(error, serial.SerialException):
        return str(error)
    return os.strerror(error.errno) if error.errno is not None else str(error) or "no answer"
