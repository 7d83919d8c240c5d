"""Three simulated hosts on their way, our link to them, and what is heard of our heartbeat: all in virtual time.

They are asked for a fifth of the usual telemetry: a flight takes a fifth of the processor's time.
"""

import asyncio
from collections.abc import Awaitable, Callable
from types import MethodType

import numpy as np
import pytest

from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame
from hsop_gcs.link.adapters import ARDUPILOT
from hsop_gcs.link.codec import Frame
from hsop_gcs.link.events import CommandFinished, Event, LinkLost, OrderFailed, VehicleFault
from hsop_gcs.link.messages import Heartbeat
from hsop_gcs.link.protocol import subscriptions
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.pump import Link
from hsop_gcs.link.vehicle import Vehicle
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid
from tests.virtual import run

HOME = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
LOCAL = LocalFrame(HOME)
PORT = 14550
FAULTY = 2
LONGEST_GAP_S = 1.5
SYSTEMS = (1, 2, 3)


class Hosts:
    """What a test sees and does. ``sleep`` and everything else goes by the loop's clock."""

    def __init__(self, link: Link, fleet: SimulatedFleet) -> None:
        self.link = link
        self.fleet = fleet
        self.events: list[tuple[float, Event]] = []
        self.beats_s: dict[int, list[float]] = {system: [] for system in SYSTEMS}
        for system, vehicle in zip(SYSTEMS, fleet.vehicles, strict=True):
            self._count_heartbeats(system, vehicle)

    def _count_heartbeats(self, system: int, vehicle: object) -> None:
        inner = vehicle.receive  # type: ignore[attr-defined]

        def receive(_: object, frame: Frame, now: float) -> None:
            if isinstance(frame.message, Heartbeat):
                self.beats_s[system].append(self.link.now())
            inner(frame, now)

        vehicle.receive = MethodType(receive, vehicle)  # type: ignore[attr-defined]

    @property
    def faulty(self) -> Vehicle:
        return self.link.vehicles[FAULTY]

    def note(self, event: Event) -> None:
        self.events.append((self.link.now(), event))

    def of(self, kind: type[Event], system: int | None = None) -> list[Event]:
        return [event for _, event in self.events if isinstance(event, kind) and system in (None, event.system)]

    async def ready(self) -> None:
        while any(self.link.vehicles[system].why_not_ready(self.link.now()) for system in SYSTEMS):
            await asyncio.sleep(0.1)

    def depart(self) -> None:
        """Send all hosts far away, side by side, their cameras to the horizon."""
        for system in SYSTEMS:
            point = LOCAL.to_geodetic(np.array([20.0 * system, 400.0, 30.0]))
            aim = Aim(pan_deg=20.0, tilt_deg=-10.0)
            order = HoverOrder(
                order_id=f"o{system}", point=point, heading_deg=0.0, aim=aim, deadline_s=self.link.now() + 60.0
            )
            self.link.hover(system, order)

    def longest_gap_s(self) -> float:
        """The longest time in which a host heard no heartbeat of ours, since it heard the first."""
        now = self.link.now()
        return max(
            later - earlier
            for beats_s in self.beats_s.values()
            for earlier, later in zip(beats_s, [*beats_s[1:], now], strict=True)
        )

    def mode(self, system: int) -> str:
        """The mode that a host really is in."""
        return ARDUPILOT.mode_name(self.fleet.vehicles[system - 1].custom_mode())

    def unharmed(self) -> bool:
        """Whether nothing has happened to the hosts that are not faulty."""
        return not any(
            event.system != FAULTY and isinstance(event, LinkLost | OrderFailed | VehicleFault)
            for _, event in self.events
        )

    def obeyed(self, command: str) -> list[int]:
        """The hosts whose answer to a command we know, and that took it."""
        return [
            event.system
            for _, event in self.events
            if isinstance(event, CommandFinished) and event.command == command and event.problem is None
        ]


def fly(
    story: Callable[[Hosts], Awaitable[None]],
    *,
    on_frame: Callable[[bytes], None] | None = None,
) -> Hosts:
    """Tell a story of three hosts that have departed; returns them as they are at its end."""

    async def scenario() -> Hosts:
        loop = asyncio.get_running_loop()
        fleet = SimulatedFleet(
            FleetConfig(
                autopilot=Autopilot.ARDUPILOT,
                homes=grid(HOME, len(SYSTEMS), 20.0),
                target=("127.0.0.1", PORT),
                shared_port=True,
                local_port=0,
                airborne_m=30.0,
                seed=1,
            ),
            clock=loop.time,
        )
        told: list[Callable[[Event], None]] = []
        link = Link([f"udpin:127.0.0.1:{PORT}"], SYSTEMS, on_event=lambda event: told[0](event), on_frame=on_frame)
        async with link:
            hosts = Hosts(link, fleet)
            told.append(hosts.note)
            await fleet.start()
            await hosts.ready()
            hosts.depart()
            await asyncio.sleep(2.0)
            await story(hosts)
            await fleet.close()
        return hosts

    with pytest.MonkeyPatch.context() as patch:
        for kind, rate_hz in subscriptions.RATES_HZ.items():
            patch.setitem(subscriptions.RATES_HZ, kind, min(rate_hz, 4.0))
        return run(scenario())
