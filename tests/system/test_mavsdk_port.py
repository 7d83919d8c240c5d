"""MAVSDK over our own signed link: what it is for works, and it cannot fly."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.param import ParamAsync

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link import mavsdk_port
from hsop_gcs.link.codec import Decoder, Frame, is_signed
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.mavsdk_port import MavsdkPort
from hsop_gcs.link.messages import Heartbeat, ParamSet
from hsop_gcs.link.pump import Link
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid

KEY = bytes(range(32))
ORIGIN = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
SPEEDS = {Autopilot.PX4: ("MPC_XY_CRUISE", 4.5), Autopilot.ARDUPILOT: ("WPNAV_SPEED", 450.0)}


@asynccontextmanager
async def signed_pair(autopilot: Autopilot) -> AsyncIterator[tuple[Link, SimulatedFleet, list[Frame]]]:
    """Two simulated vehicles that sign, our link to them, and every frame that goes over it."""
    recorded: list[Frame] = []
    config = FleetConfig(
        autopilot=autopilot, homes=grid(ORIGIN, 2, 20.0), target=("127.0.0.1", 9), local_port=0, signing_key=KEY
    )
    fleet = SimulatedFleet(config, clock=asyncio.get_running_loop().time)
    await fleet.start()
    try:
        endpoints = [f"udpout:{host}:{port}" for host, port in fleet.local_addresses]
        signing = {text: Signing(KEY, clock=SigningClock(time.time)) for text in endpoints}
        record = lambda raw: recorded.extend(Decoder().feed_datagram(raw))  # noqa: E731
        async with Link(endpoints, [1, 2], signing=signing, on_frame=record) as link:
            yield link, fleet, recorded
    finally:
        await fleet.close()


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_parameters_are_read_and_set_over_our_signed_and_recorded_link(autopilot: Autopilot) -> None:
    name, value = SPEEDS[autopilot]

    async def scenario() -> None:
        async with signed_pair(autopilot) as (link, fleet, recorded), MavsdkPort(link, 2) as port:
            parameters = port.plugin(ParamAsync)
            before = fleet.vehicles[1].parameters[name]
            assert await parameters.get_param_float(name) == pytest.approx(before)
            await parameters.set_param_float(name, value)
            assert [vehicle.parameters[name] for vehicle in fleet.vehicles] == pytest.approx([before, value])
            told = [frame for frame in recorded if isinstance(frame.message, ParamSet)]
            assert told
            assert all(is_signed(frame.raw) and frame.component == 191 for frame in told)
            # Its heartbeat is withheld: it would hide from the vehicle that ours has stopped.
            while link.vehicle_link(2).withheld.get("message 0", 0) == 0:
                await asyncio.sleep(0.01)
            assert not any(frame.component == 191 and isinstance(frame.message, Heartbeat) for frame in recorded)

    asyncio.run(scenario())


def test_mavsdk_cannot_arm_through_the_port() -> None:
    async def scenario() -> None:
        async with signed_pair(Autopilot.PX4) as (link, fleet, recorded), MavsdkPort(link, 1) as port:
            with pytest.raises(ActionError):
                await port.plugin(ActionAsync).arm()
            assert link.vehicle_link(1).withheld[f"command {int(MavCmd.COMPONENT_ARM_DISARM)}"] > 0
            assert not fleet.vehicles[0].armed
            assert {frame.system for frame in recorded} == {1, 2, 255}

    asyncio.run(scenario())


def test_a_vehicle_that_is_not_there_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mavsdk_port, "_PATIENCE_S", 0.5)

    async def scenario() -> None:
        async with Link(["udpin:127.0.0.1:0"], [1]) as link:
            with pytest.raises(Unavailable, match=r"MAVSDK: system 1 was not heard within 0\.5 s"):
                await MavsdkPort(link, 1).__aenter__()
            with pytest.raises(BadInput, match="system: 2 is not in the fleet"):
                await MavsdkPort(link, 2).__aenter__()

    asyncio.run(scenario())
