"""Looking and posting: latency, retries, and a service that does not answer."""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.detections import Detection, Pixel
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid
from hsop_gcs.simulator.lookout import PATH, Lookout, LookoutConfig, Outbox, pose_of
from hsop_gcs.simulator.truth import truth_from_json

ORIGIN = GeodeticPoint(lat_deg=47.4, lon_deg=8.5, altitude_amsl_m=430.0)
TRUTH = truth_from_json({"threats": [{"id": "t1", "position_m": [5.0, 30.0, 40.0]}]}, ORIGIN)
PATIENCE_S = 30.0


def seen_at(time_s: float) -> Detection:
    return Detection(host="h1", camera=CameraKind.CENTRAL, time_s=time_s, seen=Pixel(u_px=1.0, v_px=2.0, sigma_px=3.0))


def test_a_detection_is_due_one_latency_after_its_exposure() -> None:
    outbox = Outbox(latency_s=0.1, give_up_s=2.0)
    outbox.put([seen_at(10.0), seen_at(10.2)])
    assert outbox.take_due(10.05) == []
    assert outbox.next_due_s == pytest.approx(10.1, abs=1e-9)
    assert outbox.take_due(10.15) == [seen_at(10.0)]
    assert outbox.take_due(11.0) == [seen_at(10.2)]


def test_what_could_not_be_posted_comes_first_again_until_it_is_too_old() -> None:
    outbox = Outbox(latency_s=0.0, give_up_s=2.0)
    outbox.put([seen_at(10.0), seen_at(11.0)])
    taken = outbox.take_due(11.0)
    outbox.put([seen_at(11.5)])
    outbox.put_back(taken)
    assert outbox.drop_old(12.5) == 1
    assert outbox.take_due(12.5) == [seen_at(11.0), seen_at(11.5)]


@dataclass
class Service:
    """A small HTTP server: keeps what is posted, and answers with each of ``statuses``, the last one for ever."""

    statuses: list[int] = field(default_factory=lambda: [200])
    posts: list[tuple[float, list[dict[str, Any]]]] = field(default_factory=list)
    paths: set[str] = field(default_factory=set)
    address: str = ""

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while head := await reader.readuntil(b"\r\n\r\n"):
                lines = head.decode().lower().split("\r\n")
                length = next(int(line.split(":")[1]) for line in lines if line.startswith("content-length:"))
                detections = json.loads(await reader.readexactly(length))
                self.paths.add(lines[0].split()[1])
                self.posts.append((time.time(), detections))
                status = self.statuses.pop(0) if len(self.statuses) > 1 else self.statuses[0]
                answer = {"accepted": len(detections), "rejected": 0} if status == 200 else {"detail": "not now"}
                body = json.dumps(answer).encode()
                writer.write(f"HTTP/1.1 {status} X\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body)
                await writer.drain()
        except asyncio.IncompleteReadError:
            pass
        finally:
            writer.close()


@asynccontextmanager
async def running(service: Service) -> AsyncIterator[Service]:
    server = await asyncio.start_server(service.serve, "127.0.0.1", 0)
    service.address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    try:
        yield service
    finally:
        server.close()


@asynccontextmanager
async def looking(address: str, **options: Any) -> AsyncIterator[Lookout]:
    config = FleetConfig(
        autopilot=Autopilot.PX4, homes=grid(ORIGIN, 2, 15.0), shared_port=True, local_port=0, airborne_m=40.0
    )
    fleet = SimulatedFleet(config, clock=time.monotonic)
    await fleet.start()
    lookout_config = LookoutConfig(**{"service": address, "host_ids": ["h1", "h2"], "rate_hz": 20.0, **options})
    lookout = Lookout(fleet, TRUTH, LocalFrame(ORIGIN), lookout_config, clock=time.time)
    task = asyncio.create_task(lookout.run())
    try:
        yield lookout
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await fleet.close()


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await asyncio.sleep(0.01)


def run(body: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(body(), PATIENCE_S))


def test_what_hosts_see_arrives_with_the_time_of_its_exposure_and_not_before_its_latency() -> None:
    async def body() -> None:
        async with running(Service()) as service, looking(service.address, latency_s=0.15) as lookout:
            await until(lambda: lookout.tally.accepted >= 10)
            assert service.paths == {PATH}
            for arrived_s, detections in service.posts:
                for each in detections:
                    exposed_s = (
                        np.datetime64(each["time"].replace("+00:00", "")).astype("datetime64[us]").astype(int) / 1e6
                    )
                    assert arrived_s - exposed_s >= 0.15 - 1e-3
            assert {each["host"] for _, detections in service.posts for each in detections} == {"h1", "h2"}
            assert (lookout.tally.refused, lookout.tally.failed_posts, lookout.tally.too_old) == (0, 0, 0)

    run(body)


def test_a_service_that_stumbles_gets_the_same_detections_again() -> None:
    async def body() -> None:
        async with (
            running(Service(statuses=[503, 503, 200])) as service,
            looking(service.address, latency_s=0.0, give_up_s=60.0) as lookout,
        ):
            await until(lambda: lookout.tally.accepted > 0)
            (_, first), (_, second), (_, third) = service.posts[:3]
            assert second[: len(first)] == first
            assert third[: len(second)] == second
            assert lookout.tally.failed_posts == 2
            assert lookout.tally.last_problem == "HTTP 503"

    run(body)


def test_detections_that_are_refused_are_counted_and_not_sent_again() -> None:
    async def body() -> None:
        async with running(Service(statuses=[422])) as service, looking(service.address, latency_s=0.0) as lookout:
            await until(lambda: len(service.posts) >= 4)
            times = [each["time"] for _, detections in service.posts for each in detections if each["host"] == "h1"]
            assert times == sorted(times)
            assert lookout.tally.accepted == 0
            assert lookout.tally.refused > 0
            assert lookout.tally.last_problem == "not now"

    run(body)


def test_without_a_service_the_fleet_flies_on_and_what_it_saw_grows_too_old() -> None:
    async def body() -> None:
        async with running(Service()) as service:
            nobody = service.address
        async with looking(nobody, latency_s=0.0, give_up_s=0.1) as lookout:
            await until(lambda: lookout.tally.too_old >= 3)
            assert lookout.tally.failed_posts > 0
            assert lookout.tally.accepted == 0
            assert "ConnectError" in str(lookout.tally)

    run(body)


def test_the_pose_is_the_true_one_in_the_frame_of_the_origin() -> None:
    config = FleetConfig(autopilot=Autopilot.PX4, homes=grid(ORIGIN, 2, 15.0), airborne_m=40.0)
    fleet = SimulatedFleet(config, clock=lambda: 0.0)
    body = fleet.vehicles[1]
    body.gimbal.point(pitch_rad=0.2, yaw_rad=-0.5, locked=True)
    for _ in range(100):
        body.gimbal.step(0.02, 0.3)
    pose = pose_of(body, LocalFrame(ORIGIN))
    assert pose.position_m == pytest.approx((15.0, 0.0, 40.0), abs=1e-3)
    assert pose.aim is not None
    assert np.radians(pose.aim.pan_deg) == pytest.approx(2 * np.pi - 0.5, abs=1e-9)
    assert np.radians(pose.aim.tilt_deg) == pytest.approx(0.2, abs=1e-9)
