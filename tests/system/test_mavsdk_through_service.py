"""MAVSDK beside the running service: over its signed, recorded link, and as a witness of what it flies."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx2
import pytest
from mavsdk.asyncio import Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.ftp import FtpAsync
from mavsdk.asyncio.plugins.geofence import FenceType, GeofenceAsync, GeofenceData, Point, Polygon
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync
from mavsdk.mavsdk import Configuration

from hsop_gcs.link.codec import is_signed
from hsop_gcs.link.messages import FileTransferProtocol, MissionItemInt, ParamSet
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.settings import Settings
from tests.service import ORIGIN, free_udp_port, report, service, settings, simulated_fleet, wait_until
from tests.system.test_mavsdk_client import METRES_PER_DEGREE, PATIENCE_S, first

OWN_SYSTEM, OWN_COMPONENT = 245, 190
METRE = 1.0
SPEEDS = {"px4": ("MPC_XY_CRUISE", 4.5), "ardupilot": ("WPNAV_SPEED", 450.0)}


def with_mavsdk(wanted: Settings, ports: list[int], **more: Any) -> Settings:
    """The settings with a port for MAVSDK at each host."""
    changed = wanted.model_dump(mode="json", exclude_unset=True) | more
    changed["hosts"] = [host | {"mavsdk_port": port} for host, port in zip(changed["hosts"], ports, strict=True)]
    return Settings.model_validate(changed)


@asynccontextmanager
async def mavsdk_at(port: int) -> AsyncIterator[Any]:
    async with Mavsdk(Configuration.create_manual(OWN_SYSTEM, OWN_COMPONENT, True)) as mavsdk:
        await mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
        assert system is not None
        yield system


def square(half_deg: float) -> GeofenceData:
    lat, lon = ORIGIN["lat_deg"], ORIGIN["lon_deg"]
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    points = [Point(lat + north * half_deg, lon + east * half_deg) for north, east in corners]
    return GeofenceData(polygons=[Polygon(points, FenceType.INCLUSION)], circles=[])


def withheld(client: httpx2.Client, host: int) -> dict[str, int]:
    found: dict[str, int] = client.get("/api/v1/hosts").json()[host]["link"]["withheld"]
    return found


@pytest.mark.parametrize("autopilot", list(SPEEDS))
def test_parameters_fences_and_files_go_through_the_running_service_signed_and_recorded(
    autopilot: str, tmp_path: Path
) -> None:
    name, value = SPEEDS[autopilot]
    key = tmp_path / "fleet.key"
    key.write_text("ab" * 32)
    key.chmod(0o600)
    port, ports = free_udp_port(), [free_udp_port(), free_udp_port()]
    logs = {"port": 0, "tlog": str(tmp_path / "tlogs")}
    wanted = with_mavsdk(settings(2, port), ports, signing={"key_file": str(key)}, service=logs)

    async def use(client: httpx2.Client) -> None:
        async with mavsdk_at(ports[1]) as system:
            assert await system.get_system_id() == 2
            parameters = ParamAsync(system)
            before = await parameters.get_param_float(name)
            await parameters.set_param_float(name, value)
            assert value != before
            assert await parameters.get_param_float(name) == pytest.approx(value)
            fence = GeofenceAsync(system)
            await fence.upload_geofence(square(0.001))
            (kept,) = (await fence.download_geofence()).polygons
            for point, sent in zip(kept.points, square(0.001).polygons[0].points, strict=True):
                assert point.latitude_deg == pytest.approx(sent.latitude_deg, abs=1e-7)
                assert point.longitude_deg == pytest.approx(sent.longitude_deg, abs=1e-7)
            files = FtpAsync(system)
            (listed,) = (await files.list_directory("/")).entries
            assert listed.name == "parameters.txt"
            async for _ in files.download("parameters.txt", str(tmp_path), False):
                pass
            read = (tmp_path / "parameters.txt").read_text()
            assert f"{name} {value:g}\n" in read
            with pytest.raises(ActionError):
                await ActionAsync(system).land()
            wait_until(lambda: withheld(client, 1).get("message 0"))
            assert any(what.startswith("command ") for what in withheld(client, 1))
            assert withheld(client, 0) == {}

    with simulated_fleet(port, 2, "--autopilot", autopilot, "--signing-key", str(key)), service(wanted) as client:
        wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == 2)
        asyncio.run(use(client))
        assert all(host["in_air"] for host in client.get("/api/v1/hosts").json())
    (log,) = (tmp_path / "tlogs").iterdir()
    with log.open("rb") as file:
        told = [frame for _, frame in read_tlog(file) if frame.system == OWN_SYSTEM]
    kinds = {type(frame.message) for frame in told}
    assert {ParamSet, MissionItemInt, FileTransferProtocol} <= kinds
    assert all(is_signed(frame.raw) for frame in told)


@pytest.mark.parametrize("autopilot", list(SPEEDS))
def test_what_the_service_flies_is_what_mavsdk_sees_at_its_port_and_at_the_vehicle(autopilot: str) -> None:
    port, ports, vehicles = free_udp_port(), [free_udp_port(), free_udp_port()], free_udp_port()
    wanted = with_mavsdk(settings(2, port, autonomy="auto"), ports)
    still = {"east_mps": 0.0, "north_mps": 0.0}

    def on_station(client: httpx2.Client) -> dict[str, Any] | None:
        """Keep the threat reported; return the first host once all are on station."""
        client.post("/api/v1/reports", json=report("t1", velocity=still)).raise_for_status()
        hosts: list[dict[str, Any]] = client.get("/api/v1/hosts").json()
        return hosts[0] if all((host["order"] or {}).get("status") == "on station" for host in hosts) else None

    async def witness(client: httpx2.Client) -> None:
        async with (
            mavsdk_at(ports[0]) as through_the_service,
            mavsdk_at(vehicles) as at_the_vehicle,
            asyncio.timeout(120),
        ):
            for system in (through_the_service, at_the_vehicle):
                await sees_what_was_ordered(system, client)

    async def sees_what_was_ordered(system: Any, client: httpx2.Client) -> None:
        assert await system.get_system_id() == 1
        telemetry = TelemetryAsync(system)
        await first(telemetry.subscribe_armed(), bool)
        await first(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)
        while True:
            seen = await first(telemetry.subscribe_position(), lambda _: True)
            nose = await first(telemetry.subscribe_heading(), lambda _: True)
            host = await asyncio.to_thread(on_station, client)
            if host is not None and all(near(place)(seen) for place in (host["order"]["position"], host["position"])):
                off_deg = abs((nose.heading_deg - host["order"]["heading_deg"] + 180) % 360 - 180)
                if off_deg < 3:
                    return
            await asyncio.sleep(0.2)

    with service(wanted) as client, simulated_fleet(port, 2, "--autopilot", autopilot, "--local-port", str(vehicles)):
        asyncio.run(witness(client))


def near(place: dict[str, float]) -> Callable[[Any], bool]:
    def check(seen: Any) -> bool:
        return bool(
            abs(seen.latitude_deg - place["lat_deg"]) * METRES_PER_DEGREE < METRE
            and abs(seen.longitude_deg - place["lon_deg"]) * METRES_PER_DEGREE < METRE
            and abs(seen.absolute_altitude_m - place["altitude_amsl_m"]) < METRE
        )

    return check
