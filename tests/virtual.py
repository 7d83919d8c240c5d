"""An event loop without wall-clock time: when nothing is left to do, the clock jumps to the next thing that is due.

Datagrams go through memory, to whoever is bound to their address, and arrive ``LATENCY_S`` later. Everything above the
sockets runs unchanged, as fast as the machine can, and the same way each time.
"""

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")
Address = tuple[str, int]

LATENCY_S = 0.002
_FIRST_FREE_PORT = 49152


class _Jump(selectors.SelectSelector):
    """Waits for nothing: the time that would be waited passes at once."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            raise RuntimeError("the loop waits for something that will never come")
        self.now_s += max(timeout, 0.0)
        return super().select(0)


class VirtualLoop(asyncio.SelectorEventLoop):
    """Its ``time`` starts at 0."""

    def __init__(self) -> None:
        self._jump = _Jump()
        super().__init__(self._jump)
        self._bound: dict[Address, _Socket] = {}

    def time(self) -> float:
        return self._jump.now_s

    async def create_datagram_endpoint(  # type: ignore[override]
        self,
        protocol_factory: Callable[[], asyncio.DatagramProtocol],
        local_addr: Address | None = None,
        remote_addr: Address | None = None,
    ) -> tuple["_Socket", asyncio.DatagramProtocol]:
        host, port = local_addr or ("127.0.0.1", 0)
        if port == 0:
            port = max([_FIRST_FREE_PORT, *(each[1] + 1 for each in self._bound)])
        if (host, port) in self._bound:
            raise OSError(98, "Address already in use")
        protocol = protocol_factory()
        bound = _Socket(self, protocol, (host, port), remote_addr)
        self._bound[host, port] = bound
        protocol.connection_made(bound)
        return bound, protocol

    def carry(self, data: bytes, sender: Address, receiver: Address) -> None:
        def arrive() -> None:
            to = self._bound.get(receiver)
            if to is not None:
                to.protocol.datagram_received(data, sender)

        self.call_later(LATENCY_S, arrive)

    def unbind(self, address: Address) -> None:
        self._bound.pop(address, None)


class _Socket(asyncio.DatagramTransport):
    def __init__(
        self, loop: VirtualLoop, protocol: asyncio.DatagramProtocol, local: Address, remote: Address | None
    ) -> None:
        super().__init__({"sockname": local, "peername": remote})
        self.protocol = protocol
        self._loop = loop
        self._local, self._remote = local, remote
        self._closing = False

    def sendto(self, data: Any, addr: Any = None) -> None:
        to = addr or self._remote
        assert to is not None, "a socket without a peer is told whom to send to"
        self._loop.carry(bytes(data), self._local, (to[0], to[1]))

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return self._closing

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            self._loop.unbind(self._local)
            self._loop.call_soon(self.protocol.connection_lost, None)


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run to the end in virtual time."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(main)


async def sleep_until(time_s: float) -> None:
    """Sleep until the loop's clock shows ``time_s``."""
    await asyncio.sleep(max(0.0, time_s - asyncio.get_running_loop().time()))
