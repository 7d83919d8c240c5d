"""What ``hsop-gcs bench link`` measures, with a real service, real sockets and a fleet in a process of its own.

Load: a hundred vehicles at full telemetry. A plan flies, cameras follow threats, and an operator holds other hosts: how
much processor time and memory the service takes, how late commands are answered, how evenly aims and heartbeats come.

Reports: from the first HTTP request that reports two threats (they are reported twice a second) to the datagram that
orders the first waypoint, in autonomy ``auto``, with everything in between.
"""

import math
import multiprocessing
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx2
import numpy as np

from hsop_gcs.bench.console import HEIGHT_M, REPORT_EVERY_S, Console, Listener, post, random_threat
from hsop_gcs.bench.process import Service, running
from hsop_gcs.bench.traffic import Heard, run
from hsop_gcs.errors import Unavailable
from hsop_gcs.geometry.frames import LocalFrame
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.protocol.gimbal import GimbalTolerances
from hsop_gcs.link.protocol.heartbeat import HEARTBEAT_PERIOD_S
from hsop_gcs.loopback import ORIGIN, free_udp_ports

SPACING_M = 15.0
PLANNED = 4
"""Hosts that plans may use; the others are there to be heard and held."""
_READY_S = 180.0
_LONGEST_WAIT_S = 10.0

Step = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Of a measured quantity, seconds."""

    count: int
    p50_s: float
    p99_s: float
    worst_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What a fleet at full telemetry takes."""

    vehicles: int
    messages_per_s: float
    """Frames that the service received, a second."""
    duration_s: float
    service_cores: float
    """Processor seconds of the service's process per second."""
    planner_cores: float
    resident_mib: tuple[float, ...]
    """At each tenth of the duration, from its beginning to its end."""
    dropped: int
    """Datagrams that came faster than they could be taken."""
    command_to_ack: Spread
    """From the operator's HTTP request to the service knowing the vehicle's acknowledgement."""
    aim_jitter: Spread
    """How far the time between two aims of one camera is from a multiple of their period."""
    heartbeat_jitter: Spread
    """How far the time between two heartbeats to one vehicle is from their period."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What is asked of a figure; one that was not measured does not hold."""

    what: str
    measured: float
    at_most: float
    unit: str

    @property
    def holds(self) -> bool:
        return self.measured <= self.at_most


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What was measured; None for a part that was not asked for."""

    load: Load | None
    report_to_waypoint: Spread | None
    """Two threats, four hosts: from the first HTTP request to the first datagram that orders a hover point."""
    missed: int
    """Reports after which no waypoint came within ten seconds."""
    velocity: bool
    """Whether the reports carried one."""

    def limits(self) -> list[Limit]:
        """What is asked of 100 vehicles at full telemetry for ten minutes, and of a report in ``auto``."""
        limits = []
        if (load := self.load) is not None:
            growth_mib = load.resident_mib[-1] - load.resident_mib[1]
            limits += [
                Limit(what="service", measured=load.service_cores, at_most=1.0, unit="cores"),
                Limit(what="its memory grown since the first tenth", measured=growth_mib, at_most=5.0, unit="MiB"),
                _limit("command to acknowledgement, p99", load.command_to_ack.p99_s, 0.2),
                _limit("camera aims beside their beat, p99", load.aim_jitter.p99_s, 0.05),
                _limit("heartbeats beside theirs, p99", load.heartbeat_jitter.p99_s, 0.05),
            ]
        if (latency := self.report_to_waypoint) is not None:
            limits += [
                _limit("report to first waypoint, p50", latency.p50_s, 0.3),
                _limit("report to first waypoint, p99", latency.p99_s, 1.0),
                Limit(what="reports without a waypoint", measured=self.missed, at_most=0, unit=""),
            ]
        return limits

    def to_json(self) -> dict[str, Any]:
        return asdict(self) | {"limits": [asdict(each) | {"holds": each.holds} for each in self.limits()]}


def _limit(what: str, measured_s: float, at_most_s: float) -> Limit:
    return Limit(what=what, measured=1e3 * measured_s, at_most=1e3 * at_most_s, unit="ms")


def measure(*, vehicles: int, duration_s: float, reports: int, velocity: bool, seed: int, step: Step) -> Result:
    """Run both measurements; 0 vehicles or 0 reports leaves one out. Raises Unavailable if the service fails."""
    load, latency, missed = None, None, 0
    if vehicles:
        load = _load(vehicles, duration_s, seed, step)
    if reports:
        latency, missed = _report_to_waypoint(reports, velocity, seed, step)
    return Result(load=load, report_to_waypoint=latency, missed=missed, velocity=velocity)


def spread(seconds: Sequence[float]) -> Spread:
    """Return the quantiles of what was measured; not a number where nothing was."""
    if not seconds:
        return Spread(count=0, p50_s=math.nan, p99_s=math.nan, worst_s=math.nan)
    p50_s, p99_s = np.quantile(seconds, (0.5, 0.99), method="higher")
    return Spread(count=len(seconds), p50_s=float(p50_s), p99_s=float(p99_s), worst_s=max(seconds))


def off_the_grid(times_s: Sequence[float], period_s: float) -> list[float]:
    """Return how far each interval is from the nearest whole number (at least one) of periods."""
    intervals = [later - earlier for earlier, later in pairwise(times_s)]
    return [abs(each - max(1, round(each / period_s)) * period_s) for each in intervals]


def _load(vehicles: int, duration_s: float, seed: int, step: Step) -> Load:
    rng = np.random.default_rng(seed)
    with _setup(vehicles, "confirm", step) as (service, client, heard):
        console = Console(client, rng, [f"h{number}" for number in range(PLANNED + 1, vehicles + 1)])
        step("warming up")
        console.work(min(10.0, duration_s / 4), heard)
        console.latencies_s.clear()
        heard.take()
        step(f"{vehicles} vehicles for {duration_s:g} s")
        usages, frames, dropped = [service.usage()], console.frames(), console.dropped()
        for _ in range(10):
            console.work(duration_s / 10, heard)
            usages.append(service.usage())
        received, lost = console.frames() - frames, console.dropped() - dropped
    took_s = usages[-1].time_s - usages[0].time_s
    return Load(
        vehicles=vehicles,
        messages_per_s=received / took_s,
        duration_s=took_s,
        service_cores=(usages[-1].own_cpu_s - usages[0].own_cpu_s) / took_s,
        planner_cores=(usages[-1].workers_cpu_s - usages[0].workers_cpu_s) / took_s,
        resident_mib=tuple(round(usage.resident_mib, 1) for usage in usages),
        dropped=lost,
        command_to_ack=spread(console.latencies_s),
        aim_jitter=spread(_aim_jitter_s(heard.all)),
        heartbeat_jitter=spread(_heartbeat_jitter_s(heard.all)),
    )


def _aim_jitter_s(heard: Sequence[Heard]) -> list[float]:
    """Of each host's aims between two of its waypoints."""
    runs: dict[int, list[list[float]]] = defaultdict(lambda: [[]])
    for each in heard:
        if each.command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW:
            runs[each.system][-1].append(each.time_s)
        elif each.command == MavCmd.DO_REPOSITION:
            runs[each.system].append([])
    period_s = GimbalTolerances().least_period_s
    return [off for of_host in runs.values() for times_s in of_host for off in off_the_grid(times_s, period_s)]


def _heartbeat_jitter_s(heard: Sequence[Heard]) -> list[float]:
    times_s: dict[int, list[float]] = defaultdict(list)
    for each in heard:
        if each.command is None:
            times_s[each.system].append(each.time_s)
    return [off for of_host in times_s.values() for off in off_the_grid(of_host, HEARTBEAT_PERIOD_S)]


def _report_to_waypoint(reports: int, velocity: bool, seed: int, step: Step) -> tuple[Spread, int]:
    rng = np.random.default_rng(seed)
    latencies_s, missed = [], 0
    with _setup(PLANNED, "auto", step) as (_, client, heard):
        for number in range(reports):
            step(f"report {number + 1} of {reports}")
            names = [f"r{number}-{threat}" for threat in (1, 2)]
            wishes = [random_threat(name, rng) for name in names]
            heard.take()
            asked_at_s, came_at_s = time.time(), None
            while came_at_s is None and (now_s := time.time()) < asked_at_s + _LONGEST_WAIT_S:
                told = [wish.report(asked_at_s, now_s, velocity=velocity) for wish in wishes]
                post(client, "/api/v1/reports", told)
                came_at_s = heard.first(MavCmd.DO_REPOSITION, within_s=REPORT_EVERY_S)
            if came_at_s is None:
                missed += 1
            else:
                latencies_s.append(came_at_s - asked_at_s)
            _clear(client, rng)
    return spread(latencies_s), missed


def _clear(client: httpx2.Client, rng: np.random.Generator) -> None:
    """Dismiss every threat and wait until nothing is planned any more."""
    for threat in client.get("/api/v1/threats").raise_for_status().json():
        client.delete(f"/api/v1/threats/{threat['id']}").raise_for_status()
    made, quiet_s = -1, 0.0
    while quiet_s < 1.5:
        # Not a whole number of the mission's ticks: reports shall come at any moment of them.
        nap_s = float(rng.uniform(0.4, 0.6))
        time.sleep(nap_s)
        health = client.get("/api/v1/health").raise_for_status().json()
        quiet_s = quiet_s + nap_s if health["planning"]["plans_made"] == made else 0.0
        made = health["planning"]["plans_made"]


@contextmanager
def _setup(vehicles: int, autonomy: str, step: Step) -> Iterator[tuple[Service, httpx2.Client, Listener]]:
    """Run the service and the fleet, and wait until every vehicle can be sent and the planner is ready."""
    ports = free_udp_ports(vehicles)
    step("starting the service")
    with tempfile.TemporaryDirectory(prefix="hsop-gcs-bench-") as folder:
        config = Path(folder, "fleet.toml")
        config.write_text(_fleet_toml(ports, autonomy))
        with (
            running(config, Path(folder, "service.log")) as service,
            _fleet(ports) as heard,
            httpx2.Client(base_url=service.address, timeout=10.0) as client,
        ):
            step("waiting for the fleet and the planner")
            _wait_until_ready(client, vehicles, heard)
            yield service, client, heard


@contextmanager
def _fleet(ports: Sequence[int]) -> Iterator[Listener]:
    columns = math.ceil(math.sqrt(len(ports)))
    frame = LocalFrame(ORIGIN)
    corners = [(index % columns, -(index // columns), 0.0) for index in range(len(ports))]
    homes = [frame.to_geodetic(np.array(corner) * SPACING_M) for corner in corners]
    # spawn: a copy of this process would hold its threads' locks
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    peers = [("127.0.0.1", port) for port in ports]
    process = context.Process(target=run, args=(homes, HEIGHT_M, peers, theirs), daemon=True)
    process.start()
    try:
        yield Listener(ours, process)
    finally:
        with suppress(BrokenPipeError):
            ours.send("end")
        process.join(timeout=5)
        if process.is_alive():
            process.terminate()
            process.join()


def _wait_until_ready(client: httpx2.Client, vehicles: int, heard: Listener) -> None:
    give_up_at = time.monotonic() + _READY_S
    while time.monotonic() < give_up_at:
        health = client.get("/api/v1/health").raise_for_status().json()
        if health["planning"]["ready"] and health["hosts_available"] == vehicles:
            return
        heard.take()
        time.sleep(0.5)
    raise Unavailable(f"after {_READY_S:g} s {health['hosts_available']} of {vehicles} hosts could be sent")


def _fleet_toml(ports: Sequence[int], autonomy: str) -> str:
    head = f"""[site]
origin = {{ lat_deg = {ORIGIN.lat_deg}, lon_deg = {ORIGIN.lon_deg}, altitude_amsl_m = {ORIGIN.altitude_amsl_m} }}
[service]
autonomy = "{autonomy}"
"""
    hosts = [
        f'[[hosts]]\nid = "h{number}"\nsystem_id = {number}\nconnection = "udpin:127.0.0.1:{port}"\n'
        for number, port in enumerate(ports, start=1)
    ]
    return head + "".join(hosts)
