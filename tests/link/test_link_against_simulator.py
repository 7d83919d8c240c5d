"""The link and the simulated fleet on real sockets, with a clock that runs fast."""

import asyncio
import time
from collections.abc import Callable

import numpy as np
import pytest

from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame
from hsop_gcs.link.events import Event, OnStation, OrderEvent, OrderFailed, TookOff
from hsop_gcs.link.identity import Identity
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.pump import Link
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.simulator.channel import Impairment
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid

ORIGIN = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
LOCAL = LocalFrame(ORIGIN)
SYSTEMS = [1, 2, 3]
KEY = bytes(range(32))
SPEED = 2.0
METRE = 1.0


def simulated(
    autopilot: Autopilot, target: tuple[str, int], loop: asyncio.AbstractEventLoop, *, key: bytes | None = None
) -> SimulatedFleet:
    config = FleetConfig(
        autopilot=autopilot,
        homes=grid(ORIGIN, len(SYSTEMS), 20.0),
        target=target,
        shared_port=True,
        local_port=0,
        impairment=Impairment(loss=0.02, delay_s=0.02, jitter_s=0.02),
        signing_key=key,
        seed=5,
        speed=SPEED,
    )
    return SimulatedFleet(config, clock=loop.time)


async def fly(link: Link, fleet: SimulatedFleet, events: list[Event]) -> None:
    """Take off, order one hover point each, and see everybody on station."""

    async def until(condition: Callable[[], bool], *, within_s: float) -> None:
        end = link.now() + within_s
        while not condition():
            assert link.now() < end, events[-6:]
            assert link.running
            await asyncio.sleep(0.02)

    def done(kind: type[OrderEvent]) -> bool:
        assert [event for event in events if isinstance(event, OrderFailed)] == []
        return {event.system for event in events if isinstance(event, kind)} == set(SYSTEMS)

    vehicles = link.vehicles.values()
    await until(lambda: all(v.state.home is not None and v.state.in_air is False for v in vehicles), within_s=60.0)
    for system in SYSTEMS:
        link.take_off(system, 20.0)
    await until(lambda: done(TookOff), within_s=120.0)
    await until(lambda: all(v.why_not_ready(link.now()) is None for v in vehicles), within_s=30.0)
    for system in SYSTEMS:
        order = HoverOrder(
            order_id=f"order {system}",
            point=LOCAL.to_geodetic(np.array([25.0, 15.0 * system, 22.0])),
            heading_deg=120.0,
            aim=Aim(pan_deg=45.0, tilt_deg=-8.0),
            deadline_s=link.now() + 20.0,
        )
        link.hover(system, order)
    await until(lambda: done(OnStation), within_s=120.0)
    for vehicle, flown in zip(vehicles, fleet.vehicles, strict=True):
        progress = vehicle.progress
        assert progress is not None
        really_m = LOCAL.to_enu(flown.config.home) + np.array(flown.state.position_m)
        assert np.linalg.norm(really_m - LOCAL.to_enu(progress.order.point)) < 1.0 * METRE
    assert link.strangers == ()
    shares = [link.vehicle_link(system) for system in link.vehicles]
    assert all(each.round_trip_s is not None and each.rate_hz > 5 for each in shares)


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_fleet_that_calls_us_takes_off_and_comes_on_station(autopilot: Autopilot) -> None:
    async def scenario() -> None:
        loop = asyncio.get_running_loop()
        events: list[Event] = []
        clock = lambda: loop.time() * SPEED  # noqa: E731
        async with Link(["udpin:127.0.0.1:0"], SYSTEMS, clock=clock, on_event=events.append) as link:
            fleet = simulated(autopilot, link.addresses[0], loop)
            await fleet.start()
            try:
                await fly(link, fleet, events)
            finally:
                await fleet.close()

    asyncio.run(scenario())


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_fleet_that_we_call_takes_off_and_comes_on_station(autopilot: Autopilot) -> None:
    async def scenario() -> None:
        loop = asyncio.get_running_loop()
        events: list[Event] = []
        clock = lambda: loop.time() * SPEED  # noqa: E731
        nowhere = ("127.0.0.1", 9)
        fleet = simulated(autopilot, nowhere, loop)
        await fleet.start()
        try:
            endpoints = [f"udpout:{host}:{port}" for host, port in fleet.local_addresses]
            async with Link(endpoints, SYSTEMS, clock=clock, on_event=events.append) as link:
                await fly(link, fleet, events)
        finally:
            await fleet.close()

    asyncio.run(scenario())


def test_a_signed_fleet_takes_off_and_comes_on_station_and_hears_nobody_else() -> None:
    async def scenario() -> None:
        loop = asyncio.get_running_loop()
        events: list[Event] = []
        clock = lambda: loop.time() * SPEED  # noqa: E731
        fleet = simulated(Autopilot.PX4, ("127.0.0.1", 9), loop, key=KEY)
        await fleet.start()
        try:
            endpoints = [f"udpout:{host}:{port}" for host, port in fleet.local_addresses]
            ours = {text: Signing(KEY, clock=SigningClock(time.time)) for text in endpoints}
            theirs = {text: Signing(bytes(32), clock=SigningClock(time.time)) for text in endpoints}
            stranger = Identity(system=254)
            async with (
                Link(endpoints, SYSTEMS, clock=clock, on_event=events.append, signing=ours) as link,
                Link(endpoints, SYSTEMS, own=stranger) as unsigned,
                Link(endpoints, SYSTEMS, own=stranger, signing=theirs) as forger,
            ):
                await fly(link, fleet, events)
                assert link.counters.refused == 0
                assert set(link.counters.signature_refused) <= {"replayed"}
                assert unsigned.counters.received == forger.counters.received == 0
                assert all(member.refused["unsigned"] > 0 for member in fleet.members)
                assert all(member.refused["forged"] > 0 for member in fleet.members)
        finally:
            await fleet.close()

    asyncio.run(scenario())
