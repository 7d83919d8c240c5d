"""MAVSDK for one vehicle over our link: parameters, fences, camera settings and files, signed and recorded like ours.

    MAVSDK ──frames──► only what is listed here ──► our link: signature, recording ──► vehicle
       ▲───────────────────── what our link believes of this vehicle ◄────────────────────┘

MAVSDK has no socket (its ``raw://`` connection), so it needs neither a second radio nor the key, and it cannot fly:
orders, modes, streams and heartbeats stay with the service. Needs the extra ``mavsdk``.
"""

import asyncio
from collections import Counter
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, TypeVar

from mavsdk.asyncio.system import System
from mavsdk.mavsdk import Configuration, Mavsdk

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.codec import Decoder, Frame, message_id, message_ids
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.identity import GROUND_STATION
from hsop_gcs.link.messages import CommandInt, CommandLong
from hsop_gcs.link.pump import Link

_COMPONENT = 191
"""Beside the ground station itself, 190, in the same system: answers find the one who asked."""
_PATIENCE_S = 15.0
_MESSAGES = message_ids(
    (
        *("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"),
        *("PARAM_EXT_REQUEST_LIST", "PARAM_EXT_REQUEST_READ", "PARAM_EXT_SET"),
        *("MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"),
        *("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_CLEAR_ALL"),
        *("FILE_TRANSFER_PROTOCOL", "LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END"),
        *("PING", "TIMESYNC"),
    )
)
_COMMANDS = {
    MavCmd.GET_HOME_POSITION,
    MavCmd.GET_MESSAGE_INTERVAL,
    MavCmd.REQUEST_MESSAGE,
    MavCmd.REQUEST_PROTOCOL_VERSION,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES,
    *range(521, 535),  # camera and storage: information, mode, zoom, focus
    *(2000, 2001),  # images
    *range(2500, 2506),  # video
}


Plugin = TypeVar("Plugin")


class MavsdkPort:
    """Open with ``async with``, then ``port.plugin(ParamAsync)``: any of MAVSDK's asynchronous plugins."""

    def __init__(self, link: Link, system_id: int) -> None:
        self.withheld: Counter[str] = Counter()
        """What MAVSDK wanted to send and may not, by message or command."""
        self._link = link
        self._system_id = system_id
        self._decoder = Decoder()
        self._system: System | None = None
        self._plugins: list[Any] = []

    async def __aenter__(self) -> Self:
        """Raises Unavailable if MAVSDK does not find the vehicle, BadInput for one that is not in the fleet."""
        loop = asyncio.get_running_loop()
        self._mavsdk = Mavsdk(Configuration.create_manual(GROUND_STATION.system, _COMPONENT, True))
        try:
            self._mavsdk.add_any_connection("raw://")
            self._mavsdk.subscribe_raw_bytes_to_be_sent(lambda data: loop.call_soon_threadsafe(self._send, data))
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
            self._link.listen(self._system_id, None)
        finally:
            await asyncio.get_running_loop().run_in_executor(None, end)

    def _send(self, data: bytes) -> None:
        for frame in self._decoder.feed_datagram(data):
            what = _withheld(frame)
            if what is None:
                self._link.forward(self._system_id, frame)
            else:
                self.withheld[what] += 1


def _withheld(frame: Frame) -> str | None:
    """Return the name of what may not pass; None for what may."""
    match frame.message:
        case CommandLong(command=command) | CommandInt(command=command):
            return None if command in _COMMANDS else f"command {command}"
    number = message_id(frame.raw)
    return None if number in _MESSAGES and frame.verified else f"message {number}"
