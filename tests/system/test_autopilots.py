"""Real ArduCopter and PX4 vehicles, flown by the service as its users run it.

Skipped unless HSOP_ARDUCOPTER_BIN or HSOP_PX4_BIN names a SITL binary; see docs/autopilots.md.
"""

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from tests.service import report, wait_until
from tests.system.autopilots import ARDUCOPTER, FRAME, ORIGIN, PX4, RealVehicle, real_vehicles

pytestmark = [
    pytest.mark.autopilot,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(
        not (ARDUCOPTER or PX4), reason="HSOP_ARDUCOPTER_BIN and HSOP_PX4_BIN are not set: no autopilot to fly"
    ),
]

Json = dict[str, Any]
HOVER_M, HEADING_DEG, GIMBAL_DEG = 0.5, 2.0, 1.0
SETTLED_FOR_S = 5.0
LEAST_SEPARATION_M = 8.0
"""Of two hosts in the air: the plan's 10 m, less what each may be off its way."""
READY_S, FLIGHT_S = 180.0, 180.0
TAKE_OFF_M = 20.0


@contextmanager
def serving(vehicles: Iterable[RealVehicle], folder: Path) -> Iterator[httpx2.Client]:
    """Run ``hsop-gcs serve`` for these vehicles and yield a client of it; it must end well."""
    with service_process(vehicles, folder) as (client, process):
        yield client
    assert process.returncode == 0, (folder / "service.txt").read_text()[-2000:]


@contextmanager
def service_process(
    vehicles: Iterable[RealVehicle], folder: Path
) -> Iterator[tuple[httpx2.Client, subprocess.Popen[bytes]]]:
    """Run ``hsop-gcs serve`` for these vehicles and yield a client of it and its process, which the block may kill."""
    config, log = folder / "FLEET.toml", folder / "service.txt"
    lines = [
        "[site]",
        f"origin = {{ lat_deg = {ORIGIN.lat_deg}, lon_deg = {ORIGIN.lon_deg}, "
        f"altitude_amsl_m = {ORIGIN.altitude_amsl_m} }}",
        '[service]\nport = 0\nautonomy = "auto"',
        '[planning]\nhosts = "all"\nhorizon_s = 20.0',
        "[limits]\nfloor_m = 10.0\nceiling_m = 100.0",
    ]
    for vehicle in vehicles:
        lines.append(f'[[hosts]]\nid = "{vehicle.id}"\nsystem_id = {vehicle.system_id}')
        lines.append(f'connection = "udpin:127.0.0.1:{vehicle.port}"')
    config.write_text("\n".join(lines))
    with log.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "hsop_gcs", "serve", "--config", str(config)], stdout=file, stderr=file
        )
    try:
        said = wait_until(
            lambda: [line for line in log.read_text().splitlines() if " at http://" in line], limit_s=READY_S
        )
        address = said[0].split(" at ")[1].split()[0]
        with httpx2.Client(base_url=address, timeout=20) as client:
            yield client, process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Radar(threading.Thread):
    """Reports its threats once a second, at rest where they are put."""

    def __init__(self, client: httpx2.Client) -> None:
        super().__init__(daemon=True)
        self.threats_m: dict[str, tuple[float, float, float]] = {}
        self._url = f"{client.base_url}/api/v1/reports"
        self._ended = threading.Event()

    def run(self) -> None:
        with httpx2.Client(timeout=20) as client:
            while not self._ended.wait(1.0):
                reports = [self._report(name, at_m) for name, at_m in list(self.threats_m.items())]
                if reports:
                    client.post(self._url, json=reports)

    def stop(self) -> None:
        self._ended.set()
        self.join()

    @staticmethod
    def _report(name: str, at_m: tuple[float, float, float]) -> Json:
        place = FRAME.to_geodetic(np.array(at_m))
        position = {
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "altitude_m": place.altitude_amsl_m,
            "altitude_datum": "amsl",
        }
        return report(name, position=position, velocity={"east_mps": 0.0, "north_mps": 0.0, "up_mps": 0.0})


class Separation(threading.Thread):
    """Watches how near any two hosts in the air come to each other."""

    def __init__(self, client: httpx2.Client) -> None:
        super().__init__(daemon=True)
        self.least_m = math.inf
        self.between: tuple[str, str] | None = None
        self._url = f"{client.base_url}/api/v1/hosts"
        self._ended = threading.Event()

    def run(self) -> None:
        with httpx2.Client(timeout=20) as client:
            while not self._ended.wait(0.5):
                aloft = [host for host in client.get(self._url).json() if host["in_air"] and host["link_up"]]
                for one, other in combinations(aloft, 2):
                    apart_m = math.dist(one["position_enu_m"], other["position_enu_m"])
                    if apart_m < self.least_m:
                        self.least_m, self.between = apart_m, (one["id"], other["id"])

    def stop(self) -> None:
        self._ended.set()
        self.join()


def hosts_of(client: httpx2.Client) -> dict[str, Json]:
    return {host["id"]: host for host in client.get("/api/v1/hosts").raise_for_status().json()}


def next_plan(client: httpx2.Client, after: str | None) -> Json:
    """Wait for a plan that flies and is not the given one."""

    def look() -> Json | None:
        plan: Json | None = client.get("/api/v1/plan").raise_for_status().json()["flying"]
        return plan if plan is not None and plan["id"] != after else None

    return wait_until(look, limit_s=FLIGHT_S)


def settled(client: httpx2.Client, what: str) -> tuple[str, set[str]]:
    """Wait until every host of the flying plan has been on its order for a while; return the plan's id and the hosts.

    On it means: within the hover, heading and gimbal tolerances, by what the vehicles themselves report. The worst seen
    in that time is printed.
    """
    started = time.monotonic()
    since: float | None = None
    worst: dict[str, list[float]] = {}
    plan_id = ""

    def look() -> bool:
        nonlocal since, plan_id
        flying = client.get("/api/v1/plan").json()["flying"]
        if flying is None:
            return False
        hosts = hosts_of(client)
        errors = {order["host"]: _errors(hosts[order["host"]], flying["id"]) for order in flying["orders"]}
        now = time.monotonic()
        if not all(_inside(each) for each in errors.values()) or flying["id"] != plan_id:
            since, plan_id = None, flying["id"]
            worst.clear()
            return False
        since = now if since is None else since
        for name, each in errors.items():
            assert each is not None
            seen = worst.setdefault(name, [0.0, 0.0, 0.0])
            worst[name] = [max(one, abs(other)) for one, other in zip(seen, each, strict=True)]
        return now - since >= SETTLED_FOR_S

    try:
        wait_until(look, limit_s=FLIGHT_S)
    except AssertionError:
        shown = {name: (host["mode"], host["order"], host["last_text"]) for name, host in hosts_of(client).items()}
        failed = client.get("/api/v1/plan").json()["failed"]
        why = f"no newer plan: {failed['reason']}; " if failed else ""
        raise AssertionError(f"{what}: not settled: {why}{shown}") from None
    print(f"\n{what}: {plan_id} settled after {time.monotonic() - started - SETTLED_FOR_S:.0f} s")  # noqa: T201
    for name, (hover_m, heading_deg, gimbal_deg) in sorted(worst.items()):
        print(f"  {name}: hover {hover_m:.2f} m, heading {heading_deg:.2f}°, gimbal {gimbal_deg:.2f}°")  # noqa: T201
    return plan_id, set(worst)


Errors = tuple[float, float, float]


def _errors(host: Json, plan_id: str) -> Errors | None:
    """Hover (m), heading and gimbal (degrees) of a host on station; 0 for a gimbal that is to look at nothing."""
    order = host["order"]
    if order is None or order["plan_id"] != plan_id or order["status"] != "on station":
        return None
    gimbal_deg = 0.0 if order["aim"] is None else order["gimbal_error_deg"]
    errors = (order["hover_error_m"], order["heading_error_deg"], gimbal_deg)
    return None if None in errors else errors


def _inside(errors: Errors | None) -> bool:
    if errors is None:
        return False
    hover_m, heading_deg, gimbal_deg = errors
    return hover_m <= HOVER_M and abs(heading_deg) <= HEADING_DEG and gimbal_deg <= GIMBAL_DEG


def test_real_autopilots_take_off_hover_where_planned_are_replanned_and_lose_one(tmp_path: Path) -> None:
    arducopters = 3 if ARDUCOPTER else 0
    px4s = 0 if not PX4 else 2 if ARDUCOPTER else 3
    with (
        real_vehicles(tmp_path, arducopters=arducopters, px4s=px4s) as vehicles,
        serving(vehicles, tmp_path) as client,
    ):
        everybody = {vehicle.id for vehicle in vehicles}
        ready = {"the vehicle is not armed"}
        wait_until(lambda: {host["unavailable_reason"] for host in hosts_of(client).values()} == ready, limit_s=READY_S)
        client.post("/api/v1/hosts/take-off", json={"altitude_m": TAKE_OFF_M, "hosts": "all"}).raise_for_status()

        def up() -> bool:
            events = client.get("/api/v1/events").json()
            failed = [event for event in events if event["kind"] == "OrderFailed"]
            assert not failed, failed
            return {event["host"] for event in events if event["kind"] == "TookOff"} == everybody

        wait_until(up, limit_s=READY_S)
        wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == len(vehicles))

        radar, separation = Radar(client), Separation(client)
        radar.start()
        separation.start()
        try:
            radar.threats_m |= {"t1": (20.0, 90.0, 45.0), "t2": (-70.0, 20.0, 50.0)}
            next_plan(client, None)
            plan_id, been_on_station = settled(client, "two threats")

            radar.threats_m["t3"] = (40.0, -80.0, 40.0)
            next_plan(client, plan_id)
            plan_id, hosts = settled(client, "a third one")
            been_on_station |= hosts

            radar.threats_m["t1"] = (70.0, 60.0, 45.0)
            next_plan(client, plan_id)
            plan_id, hosts = settled(client, "the first one elsewhere")
            been_on_station |= hosts
            assert been_on_station == everybody

            radar.threats_m["t2"] = (-80.0, -30.0, 50.0)
            plan = next_plan(client, plan_id)
            lost = next(vehicle for vehicle in vehicles if vehicle.id == plan["orders"][0]["host"])
            wait_until(lambda: hosts_of(client)[lost.id]["order"]["status"] == "accepted")
            lost.kill()
            next_plan(client, plan["id"])
            _, hosts = settled(client, f"the second one elsewhere, and {lost.id} killed on the way there")
            assert hosts <= everybody - {lost.id}
            assert not hosts_of(client)[lost.id]["available"]
        finally:
            radar.stop()
            separation.stop()

        print(f"\nnever nearer to each other than {separation.least_m:.1f} m, {separation.between}")  # noqa: T201
        assert separation.least_m >= LEAST_SEPARATION_M

        client.post("/api/v1/hosts/hold", json={}).raise_for_status()
        left = everybody - {lost.id}
        wait_until(lambda: all(hosts_of(client)[name]["mode"] in ("Brake", "Hold") for name in left))
