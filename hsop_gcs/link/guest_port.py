"""A UDP port of ours through which MAVSDK, or any MAVLink program, reaches one vehicle over our link.

    program ──► port ──what may pass──► our link: signature, recording ──► vehicle
       ▲──────── what our link believes of this vehicle ◄────────────────────┘

On this machine only: what comes through is signed with our key, whoever sent it.
"""

from types import TracebackType
from typing import Self

from hsop_gcs.link.endpoint import Address, Endpoint
from hsop_gcs.link.pump import Link
from hsop_gcs.link.transports import UdpTransport

_MOST_GUESTS = 8
_FORGOTTEN_AFTER_S = 10.0


class GuestPort:
    """Open with ``async with`` while the link is. Programs that fall silent are forgotten."""

    def __init__(self, link: Link, system: int, port: int) -> None:
        self._link = link
        self._system = system
        self._transport = UdpTransport(Endpoint("udpin", "127.0.0.1", port), self._hear)
        self._heard_s: dict[Address, float] = {}

    async def __aenter__(self) -> Self:
        """Raises Unavailable if the port is taken."""
        await self._transport.open()
        self._link.listen(self._system, self._show)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._link.unlisten(self._system, self._show)
        await self._transport.close()

    def _hear(self, data: bytes, address: Address) -> None:
        if address in self._heard_s or len(self._heard_s) < _MOST_GUESTS:
            self._heard_s[address] = self._link.now()
        self._link.forward(self._system, data)

    def _show(self, raw: bytes) -> None:
        now = self._link.now()
        self._heard_s = {guest: at for guest, at in self._heard_s.items() if now - at < _FORGOTTEN_AFTER_S}
        for guest in self._heard_s:
            self._transport.send(raw, guest)
