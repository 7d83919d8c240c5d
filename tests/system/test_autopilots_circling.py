"""Real ArduCopter and PX4 vehicles under threats that fly circles; two are lost, and at last the service.

Skipped unless HSOP_ARDUCOPTER_BIN and HSOP_PX4_BIN name SITL binaries; see docs/autopilots.md.
"""

import math
import socket
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import httpx2
import numpy as np
import pytest

from hsop_gcs.link.adapters import adapter_for
from hsop_gcs.link.codec import Decoder
from hsop_gcs.link.messages import Heartbeat
from tests.service import report, wait_until
from tests.system.autopilots import ARDUCOPTER, FRAME, PX4, RealVehicle, real_vehicles
from tests.system.test_autopilots import LEAST_SEPARATION_M, READY_S, TAKE_OFF_M, Json, hosts_of, service_process

pytestmark = [
    pytest.mark.autopilot,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(
        not (ARDUCOPTER and PX4), reason="HSOP_ARDUCOPTER_BIN and HSOP_PX4_BIN are not both set: no fleet to fly"
    ),
]

SAFETY_M = 20.0
"""The service's default ``planning.safety_distance_m``."""
FLOWN_S, LOSSES_S, PLAN_WITHIN_S = 240.0, (60.0, 150.0), 10.0
OWN_CLOSING_MPS = 0.5
"""A host that flies faster than this towards a threat closes in by its own motion; slower is wander and noise."""
HELD_WITHIN_M, FAILSAFE_WITHIN_S = 3.0, 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """A threat on a level circle, clockwise as seen from above."""

    centre_m: tuple[float, float, float]
    radius_m: float
    speed_mps: float

    def at(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity, ENU."""
        angle = self.speed_mps / self.radius_m * time_s
        east, north = math.sin(angle), math.cos(angle)
        place = np.array(self.centre_m) + self.radius_m * np.array([east, north, 0.0])
        return place, self.speed_mps * np.array([north, -east, 0.0])


SLOW = {
    "t1": Circle(centre_m=(30.0, 60.0, 40.0), radius_m=30.0, speed_mps=3.0),
    "t2": Circle(centre_m=(-50.0, 10.0, 45.0), radius_m=20.0, speed_mps=1.5),
}
FAST = {
    "t1": Circle(centre_m=(20.0, 50.0, 40.0), radius_m=50.0, speed_mps=4.0),
    "t2": Circle(centre_m=(-50.0, 10.0, 45.0), radius_m=20.0, speed_mps=1.0),
}


class Watch(threading.Thread):
    """Reports the threats once a second, and holds what hosts do against where the threats are."""

    def __init__(self, client: httpx2.Client, circles: Mapping[str, Circle]) -> None:
        super().__init__(daemon=True)
        self._circles = circles
        self.nearest: dict[str, float] = {}
        """The least distance of each host in the air to a threat, metres."""
        self.closing: dict[str, float] = {}
        """The same, only while the host flew towards that threat itself."""
        self.least_apart_m = math.inf
        self.plans: list[tuple[float, str, tuple[str, ...]]] = []
        """Flying plans as they came: when, their ids, their hosts."""
        self._client, self._ended = client, threading.Event()
        self._before: dict[str, tuple[float, np.ndarray]] = {}

    def run(self) -> None:
        with httpx2.Client(base_url=self._client.base_url, timeout=20) as client:
            reported_s = 0.0
            while not self._ended.wait(0.2):
                if time.time() >= reported_s + 1.0:
                    reported_s = time.time()
                    client.post("/api/v1/reports", json=[sighting(*each, reported_s) for each in self._circles.items()])
                self._look(client)

    def stop(self) -> None:
        self._ended.set()
        self.join()

    def _look(self, client: httpx2.Client) -> None:
        hosts = client.get("/api/v1/hosts").json()
        now_s = time.time()
        aloft = {
            host["id"]: np.array(host["position_enu_m"])
            for host in hosts
            if host["in_air"] and host["link_up"] and host["position_enu_m"]
        }
        for one, other in combinations(aloft.values(), 2):
            self.least_apart_m = min(self.least_apart_m, float(np.linalg.norm(one - other)))
        for name, place in aloft.items():
            before_s, before = self._before.get(name, (now_s, place))
            velocity = (place - before) / max(now_s - before_s, 0.2)
            for circle in self._circles.values():
                there, _ = circle.at(now_s)
                distance_m = float(np.linalg.norm(there - place))
                self.nearest[name] = min(self.nearest.get(name, math.inf), distance_m)
                if float(velocity @ (there - place)) / distance_m > OWN_CLOSING_MPS:
                    self.closing[name] = min(self.closing.get(name, math.inf), distance_m)
            if now_s - before_s >= 0.8 or name not in self._before:
                self._before[name] = (now_s, place)
        plan = client.get("/api/v1/plan").json()["flying"]
        if plan is not None and (not self.plans or self.plans[-1][1] != plan["id"]):
            self.plans.append((time.monotonic(), plan["id"], tuple(order["host"] for order in plan["orders"])))


def sighting(name: str, circle: Circle, time_s: float) -> Json:
    place_m, (east, north, up) = circle.at(time_s)
    place = FRAME.to_geodetic(place_m)
    position = {
        "lat_deg": place.lat_deg,
        "lon_deg": place.lon_deg,
        "altitude_m": place.altitude_amsl_m,
        "altitude_datum": "amsl",
    }
    return report(name, position=position, velocity={"east_mps": east, "north_mps": north, "up_mps": up})


def mode_after_the_service(vehicle: RealVehicle, wanted: Callable[[str], bool], limit_s: float) -> tuple[str, float]:
    """Listen where the service did, saying nothing, until the mode is wanted; return it, and after how long."""
    started, mode = time.monotonic(), "not heard"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", vehicle.port))
        listener.settimeout(1.0)
        while time.monotonic() < started + limit_s:
            try:
                frames = Decoder().feed_datagram(listener.recv(4096))
            except TimeoutError:
                continue
            for frame in frames:
                if isinstance(frame.message, Heartbeat) and frame.component == 1:
                    adapter = adapter_for(frame.message.autopilot, frame.message.type)
                    mode = adapter.mode_name(frame.message.custom_mode) if adapter is not None else mode
            if wanted(mode):
                break
    return mode, time.monotonic() - started


@pytest.mark.parametrize("circles", [pytest.param(SLOW, id="slow"), pytest.param(FAST, id="fast")])
def test_real_autopilots_keep_clear_of_circling_threats_and_come_home_when_all_else_is_lost(
    tmp_path: Path, circles: Mapping[str, Circle]
) -> None:
    with (
        real_vehicles(tmp_path, arducopters=3, px4s=2) as vehicles,
        service_process(vehicles, tmp_path) as (client, process),
    ):
        by_id = {vehicle.id: vehicle for vehicle in vehicles}
        ready = {"the vehicle is not armed"}
        wait_until(lambda: {host["unavailable_reason"] for host in hosts_of(client).values()} == ready, limit_s=READY_S)
        print("\nfailsafes:", {name: host["failsafes"] for name, host in hosts_of(client).items()})  # noqa: T201
        client.post("/api/v1/hosts/take-off", json={"altitude_m": TAKE_OFF_M, "hosts": list(by_id)}).raise_for_status()
        try:
            wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == 5, limit_s=READY_S)
        except AssertionError:
            told = ("unavailable_reason", "take_off", "last_text")
            raise AssertionError(
                {name: [host[key] for key in told] for name, host in hosts_of(client).items()}
            ) from None
        watch = Watch(client, circles)
        watch.start()
        lost: list[str] = []
        waited_s: list[float] = []
        try:
            began_s = time.monotonic()
            wait_until(lambda: bool(watch.plans), limit_s=READY_S)
            print(f"the first plan flew after {time.monotonic() - began_s:.1f} s: {watch.plans[-1]}")  # noqa: T201
            began_s = time.monotonic()
            for at_s in LOSSES_S:
                time.sleep(max(0.0, began_s + at_s - time.monotonic()))
                victim = next(name for name in watch.plans[-1][2] if name not in lost)
                by_id[victim].kill()
                lost.append(victim)
                killed_s = time.monotonic()
                wait_until(
                    lambda killed_s=killed_s: any(  # type: ignore[misc]
                        at > killed_s and not set(lost) & set(names) for at, _, names in watch.plans
                    ),
                    limit_s=90.0,
                )
                waited_s.append(time.monotonic() - killed_s)
                print(f"{victim} killed at {at_s:g} s; plan without it after {waited_s[-1]:.1f} s")  # noqa: T201
            time.sleep(max(0.0, began_s + FLOWN_S - time.monotonic()))
        finally:
            watch.stop()
            print(f"plans: {len(watch.plans)}, hosts never nearer to each other than {watch.least_apart_m:.1f} m")  # noqa: T201
            print("nearest to a threat:", {name: round(each, 1) for name, each in watch.nearest.items()})  # noqa: T201
            print("by their own motion:", {name: round(each, 1) for name, each in watch.closing.items()})  # noqa: T201

        left = [name for name in by_id if name not in lost]
        at_m = {name: np.array(hosts_of(client)[name]["position_enu_m"]) for name in left}
        client.post("/api/v1/hosts/hold", json={}).raise_for_status()
        wait_until(lambda: all(hosts_of(client)[name]["mode"] in ("Brake", "Hold") for name in left))
        time.sleep(8.0)
        held_m = {name: np.array(hosts_of(client)[name]["position_enu_m"]) for name in left}
        stopped_in_m = {name: round(float(np.linalg.norm(held_m[name] - at_m[name])), 1) for name in left}
        print("stopped within, m:", stopped_in_m)  # noqa: T201
        time.sleep(8.0)
        for name in left:
            place = np.array(hosts_of(client)[name]["position_enu_m"])
            assert np.linalg.norm(place - held_m[name]) < HELD_WITHIN_M, name

        process.kill()
        process.wait()
        home = {
            name: mode_after_the_service(by_id[name], lambda mode: mode in ("RTL", "Return", "Land"), FAILSAFE_WITHIN_S)
            for name in left
        }
        print("after the service was killed:", home)  # noqa: T201
        assert all(mode in ("RTL", "Return", "Land") for mode, _ in home.values())
        assert watch.least_apart_m >= LEAST_SEPARATION_M
        assert all(each >= SAFETY_M - 1.0 for each in watch.closing.values()), watch.closing
        assert all(each <= PLAN_WITHIN_S for each in waited_s), waited_s
