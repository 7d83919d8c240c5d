"""MAVSDK for one vehicle over our link, in this process: parameters, fences, camera settings and files.

It has no socket (its ``raw://`` connection), so it needs neither a second radio nor the key, and it cannot fly: see
``passing``. Needs the extra ``mavsdk``. Programs outside of this process have ``GuestPort``.
"""

import asyncio
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, TypeVar

from mavsdk.asyncio.system import System
from mavsdk.mavsdk import Configuration, Mavsdk

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.identity import GROUND_STATION
from hsop_gcs.link.pump import Link

_COMPONENT = 191
"""Beside the ground station itself, 190, in the same system: answers find the one who asked."""
_PATIENCE_S = 15.0

Plugin = TypeVar("Plugin")


class MavsdkPort:
    """Open with ``async with``, then ``port.plugin(ParamAsync)``: any of MAVSDK's asynchronous plugins."""

    def __init__(self, link: Link, system_id: int) -> None:
        self._link = link
        self._system_id = system_id
        self._system: System | None = None
        self._plugins: list[Any] = []

    async def __aenter__(self) -> Self:
        """Raises Unavailable if MAVSDK does not find the vehicle, BadInput for one that is not in the fleet."""
        loop = asyncio.get_running_loop()
        self._mavsdk = Mavsdk(Configuration.create_manual(GROUND_STATION.system, _COMPONENT, True))
        try:
            self._mavsdk.add_any_connection("raw://")
            self._mavsdk.subscribe_raw_bytes_to_be_sent(
                lambda data: loop.call_soon_threadsafe(self._link.forward, self._system_id, data)
            )
            self._link.listen(self._system_id, self._mavsdk.pass_received_raw_bytes)
            self._system = await self._find()
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._close()

    def plugin(self, kind: Callable[[Any], Plugin]) -> Plugin:
        """Return a plugin of the vehicle; it ends with the port."""
        plugin = kind(self._system)
        self._plugins.append(plugin)
        return plugin

    async def _find(self) -> System:
        loop = asyncio.get_running_loop()
        found: asyncio.Future[Any] = loop.create_future()

        def answer(system: object) -> None:
            if not found.done():
                found.set_result(system)

        waiting = self._mavsdk.first_autopilot_async(
            _PATIENCE_S, lambda system: loop.call_soon_threadsafe(answer, system)
        )
        try:
            system = await found
        finally:
            self._mavsdk.cancel_first_autopilot(waiting)
        if system is None:
            raise Unavailable(f"MAVSDK: system {self._system_id} was not heard within {_PATIENCE_S:g} s")
        return System(system)

    async def _close(self) -> None:
        """End the plugins before what they stand on: MAVSDK aborts the process if they are ended at once or after."""

        def end() -> None:
            for plugin in self._plugins:
                plugin.destroy()
            self._mavsdk.destroy()

        try:
            self._link.unlisten(self._system_id, self._mavsdk.pass_received_raw_bytes)
        finally:
            await asyncio.get_running_loop().run_in_executor(None, end)
