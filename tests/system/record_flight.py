"""Record a flight of a real autopilot with our own link: ``python -m tests.system.record_flight px4 OUT.tlog``.

Both directions of the link are written, from before power-up to the return. To keep the file small streams are thinned,
those that we asked for to five messages a second and the others to one; commands, answers, heartbeats and texts are all
there.
"""

import asyncio
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.codec import message_id
from hsop_gcs.link.events import CommandFinished, Event, OnStation, OrderFailed, TookOff
from hsop_gcs.link.messages import CommandAck, Heartbeat, StatusText
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.protocol.subscriptions import RATES_HZ
from hsop_gcs.link.pump import Link
from hsop_gcs.link.tlog import TlogWriter
from hsop_gcs.link.vehicle import Vehicle
from tests.system.autopilots import FRAME, real_vehicles

GROUND_STATION = 255
PAUSE_S = 3.0
"""Between the end of a step and the next one."""
_ASKED = {kind.ID for kind in RATES_HZ}
_PATIENCE_S = 240.0


def _hover(
    name: str, at_m: tuple[float, float, float], heading_deg: float, aim: Aim, speed_mps: float
) -> Callable[[Vehicle, float], None]:
    point = FRAME.to_geodetic(np.array(at_m))

    def order(vehicle: Vehicle, now: float) -> None:
        vehicle.hover(
            HoverOrder(
                order_id=name,
                point=point,
                heading_deg=heading_deg,
                aim=aim,
                deadline_s=now + 20.0,
                speed_mps=speed_mps,
            ),
            now,
        )

    return order


STEPS: tuple[tuple[type[Event], Callable[[Vehicle, float], None]], ...] = (
    (TookOff, lambda vehicle, now: vehicle.take_off(15.0, now)),
    (OnStation, _hover("a", (20.0, 15.0, 20.0), 45.0, Aim(pan_deg=100.0, tilt_deg=-20.0), 8.0)),
    (OnStation, _hover("b", (-10.0, 25.0, 25.0), 270.0, Aim(pan_deg=190.0, tilt_deg=-40.0), 5.0)),
    (CommandFinished, lambda vehicle, now: vehicle.hold(now)),
    (CommandFinished, lambda vehicle, now: vehicle.return_to_launch(now)),
)
"""Each step's order, and the event that ends it."""


class Thinned:
    """Writes frames, and of what is streamed only some."""

    def __init__(self, log: TlogWriter) -> None:
        self._log = log
        self._written_s: dict[tuple[int, int, int], float] = {}

    def write(self, raw: bytes) -> None:
        now_s = time.time()
        system, component, kind = raw[5], raw[6], message_id(raw)
        streamed = system != GROUND_STATION and kind not in (CommandAck.ID, Heartbeat.ID, StatusText.ID)
        least_s = 0.2 if kind in _ASKED else 1.0
        if streamed and now_s - self._written_s.get((system, component, kind), 0.0) < least_s:
            return
        self._written_s[system, component, kind] = now_s
        self._log.write(now_s, raw)


async def fly(port: int, system: int, log: Thinned) -> None:
    """Fly all steps. Raises AssertionError if one fails."""
    async with Link([f"udpin:127.0.0.1:{port}"], [system], on_frame=log.write) as link:
        vehicle = link.vehicles[system]
        while not vehicle.state.link_up:
            await asyncio.sleep(0.1)
        for ends_with, order in STEPS:
            order(vehicle, link.now())
            async with asyncio.timeout(_PATIENCE_S):
                while not isinstance(event := await link.events.get(), ends_with):
                    assert not isinstance(event, OrderFailed), event
            print(event)  # noqa: T201
            await asyncio.sleep(PAUSE_S)


def main(autopilot: str, path: Path) -> None:
    with (
        tempfile.TemporaryDirectory() as folder,
        path.open("wb") as file,
        TlogWriter(file) as log,
        real_vehicles(Path(folder), arducopters=autopilot == "ardupilot", px4s=autopilot == "px4") as (vehicle,),
    ):
        asyncio.run(fly(vehicle.port, vehicle.system_id, Thinned(log)))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
