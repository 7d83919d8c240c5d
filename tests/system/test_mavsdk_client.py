"""MAVSDK, which shares no code with this project, finds a simulated vehicle, flies it and points its gimbal."""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from typing import Any

import pytest
from mavsdk.asyncio import Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.gimbal import ControlMode, GimbalAsync, GimbalError, GimbalMode, SendMode
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync
from mavsdk.mavsdk import Configuration

from tests.system.simulator_process import simulator

pytestmark = pytest.mark.timeout(60)

OWN_SYSTEM, OWN_COMPONENT = 245, 190
PATIENCE_S = 20.0
METRE = 1.0
DEGREE = 1.0
METRES_PER_DEGREE = 111_000.0
TAKE_OFF_M, NORTH_M, CLIMB_M = 8.0, 20.0, 4.0
ORDERED_YAW_DEG = 90.0


async def first(values: AsyncIterator[Any], wanted: Callable[[Any], bool]) -> Any:
    """Return the first value that is wanted; a value that never comes is a timeout."""
    async with asyncio.timeout(PATIENCE_S), aclosing(values) as stream:  # type: ignore[type-var]
        async for value in stream:
            if wanted(value):
                return value
    raise AssertionError("the stream ended")


async def stream(system: Any, message_id: int, rate_hz: float) -> None:
    """Ask for a message that MAVSDK itself does not ask ArduPilot for."""
    fields = {
        "target_system": 1,
        "target_component": 1,
        "command": 511,
        "confirmation": 0,
        "param1": float(message_id),
        "param2": 1e6 / rate_hz,
        **{f"param{number}": 0.0 for number in range(3, 8)},
    }
    order = MavlinkMessage("COMMAND_LONG", OWN_SYSTEM, OWN_COMPONENT, 1, 1, json.dumps(fields))
    await MavlinkDirectAsync(system).send_message(order)


async def fly(port: int, autopilot: str) -> None:
    configuration = Configuration.create_manual(OWN_SYSTEM, OWN_COMPONENT, True)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
        assert system is not None
        assert await system.get_system_id() == 1
        telemetry, action, gimbal = TelemetryAsync(system), ActionAsync(system), GimbalAsync(system)
        for set_rate in (telemetry.set_rate_health, telemetry.set_rate_position, telemetry.set_rate_attitude_euler):
            await set_rate(10.0)
        for message_id in (281, 285):
            await stream(system, message_id, 10.0)

        await first(telemetry.subscribe_health(), lambda health: health.is_armable and health.is_global_position_ok)
        ground = await first(telemetry.subscribe_position(), lambda _: True)
        assert ground.absolute_altitude_m == pytest.approx(584.0, abs=0.2 * METRE)
        assert ground.relative_altitude_m == pytest.approx(0.0, abs=0.2 * METRE)

        await action.arm()
        await first(telemetry.subscribe_armed(), bool)
        await action.set_takeoff_altitude(TAKE_OFF_M)
        await action.takeoff()
        await first(telemetry.subscribe_position(), lambda p: abs(p.relative_altitude_m - TAKE_OFF_M) < 0.4 * METRE)
        await first(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)

        lat_deg = ground.latitude_deg + NORTH_M / METRES_PER_DEGREE
        altitude_m = ground.absolute_altitude_m + TAKE_OFF_M + CLIMB_M
        await action.goto_location(lat_deg, ground.longitude_deg, altitude_m, ORDERED_YAW_DEG)
        await first(
            telemetry.subscribe_position(),
            lambda p: (
                abs(p.latitude_deg - lat_deg) * METRES_PER_DEGREE < 0.5 * METRE
                and abs(p.longitude_deg - ground.longitude_deg) * METRES_PER_DEGREE < 0.5 * METRE
                and abs(p.absolute_altitude_m - altitude_m) < 0.5 * METRE
            ),
        )
        # ArduPilot leaves the yaw of the order alone and keeps its nose on the course, which was north.
        yaw_deg = ORDERED_YAW_DEG if autopilot == "px4" else 0.0
        await first(telemetry.subscribe_attitude_euler(), lambda e: abs(e.yaw_deg - yaw_deg) < 2 * DEGREE)
        if autopilot == "px4":
            await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)

        await point(gimbal, autopilot, yaw_deg)

        await action.return_to_launch()
        await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.RETURN_TO_LAUNCH)
        await first(telemetry.subscribe_armed(), lambda armed: not armed)
        await first(telemetry.subscribe_landed_state(), lambda state: state == LandedState.ON_GROUND)
        home = await first(telemetry.subscribe_position(), lambda _: True)
        assert math.dist((home.latitude_deg, home.longitude_deg), (ground.latitude_deg, ground.longitude_deg)) < 1e-5


async def point(gimbal: Any, autopilot: str, vehicle_yaw_deg: float) -> None:
    """Point the gimbal against the nose and against north, and read both back as MAVSDK understands them."""
    gimbals = await first(gimbal.subscribe_gimbal_list(), lambda found: len(found.gimbals) > 0)
    gimbal_id = gimbals.gimbals[0].gimbal_id

    follow = (gimbal_id, 0.0, -30.0, 45.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    if autopilot == "px4":
        with pytest.raises(GimbalError):
            await gimbal.set_angles(*follow)
    await gimbal.take_control(gimbal_id, ControlMode.PRIMARY)
    status = await first(gimbal.subscribe_control_status(), lambda s: s.control_mode == ControlMode.PRIMARY)
    assert (status.sysid_primary_control, status.compid_primary_control) == (OWN_SYSTEM, OWN_COMPONENT)

    def looks(pitch_deg: float, yaw_deg: float, *, north: bool) -> Callable[[Any], bool]:
        def check(attitude: Any) -> bool:
            euler = attitude.euler_angle_north if north else attitude.euler_angle_forward
            return bool(abs(euler.pitch_deg - pitch_deg) < DEGREE and abs(euler.yaw_deg - yaw_deg) < DEGREE)

        return check

    await gimbal.set_angles(*follow)
    await first(gimbal.subscribe_attitude(), looks(-30.0, 45.0, north=False))
    await first(gimbal.subscribe_attitude(), looks(-30.0, 45.0 + vehicle_yaw_deg, north=True))
    await gimbal.set_angles(gimbal_id, 0.0, -20.0, 10.0, GimbalMode.YAW_LOCK, SendMode.ONCE)
    await first(gimbal.subscribe_attitude(), looks(-20.0, 10.0, north=True))
    await first(gimbal.subscribe_attitude(), looks(-20.0, 10.0 - vehicle_yaw_deg, north=False))


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_mavsdk_arms_takes_off_flies_to_a_point_points_the_gimbal_and_returns(autopilot: str) -> None:
    with simulator("--autopilot", autopilot, "--speed", "4") as running:
        asyncio.run(fly(running.ports[1], autopilot))


def test_mavsdk_tells_three_vehicles_of_one_process_apart() -> None:
    async def count(ports: list[int]) -> set[int]:
        async with Mavsdk(Configuration.create_manual(OWN_SYSTEM, OWN_COMPONENT, True)) as mavsdk:
            for port in ports:
                await mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
            async with asyncio.timeout(PATIENCE_S):
                while await mavsdk.system_count() < len(ports):
                    await asyncio.sleep(0.05)
            return {await system.get_system_id() for system in await mavsdk.get_systems()}

    with simulator("--autopilot", "px4", vehicles=3) as running:
        assert asyncio.run(count(list(running.ports.values()))) == {1, 2, 3}
