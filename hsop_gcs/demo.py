"""The demonstration: a service, a simulated fleet in a process of its own, and a console that talks to both over HTTP.

Everything goes the way it would in the field: reports over HTTP, approval by a console, MAVLink over UDP. Only the
threats and the aircraft are made up.
"""

import asyncio
import json
import math
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from rich.console import Console
from rich.live import Live
from rich.table import Table

from hsop_gcs.app import running_service
from hsop_gcs.errors import Unavailable
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.settings import Settings
from hsop_gcs.simulator.truth import Truth, truth_from_json
from hsop_gcs.workers import deaf_to_ctrl_c

ORIGIN = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)
HOSTS = 4
SPACING_M = 15.0
TAKE_OFF_M = 35.0
REPORTS_PER_S = 2.0
POLLS_PER_S = 4.0
REPORT_SIGMA_M = 15.0
SETTLE_S = 4.0
SEEN_SIGMA_M = 2.0
"""A threat known better than this is seen by cameras: the reports leave several metres."""
HORIZON_S = 14.0
"""A little longer than the letter's 10 s: these threats are slow, and a plan should outlast the flight to it."""
LIMIT_S = 150.0
SEED = 0


TRUTH: dict[str, Any] = {
    "threats": [
        {"id": "t1", "position_m": [-10.0, 110.0, 40.0], "velocity_mps": [0.6, -1.0, 0.0]},
        {"id": "t2", "position_m": [60.0, 125.0, 40.0], "velocity_mps": [-0.8, -0.7, 0.0]},
    ]
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What ``demo --json`` prints; the errors are the worst of all hosts."""

    threats: int
    hosts: int
    all_arrived: bool
    hover_error_m: float | None
    heading_error_deg: float | None
    gimbal_error_deg: float | None
    duration_s: float
    report_error_m: float | None
    """Of the coarse reports against the truth, median."""
    final_error_m: float | None
    """Of the tracks against the truth at the end, mean of the threats."""
    journal: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """How far reports and tracks were from the truth, metres; None where there was none."""

    reports_m: float | None
    first_fix_m: float | None
    """When cameras had fixed a threat for the first time."""
    final_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One host at the end of the demonstration."""

    host: str
    status: str
    hover_error_m: float | None
    heading_error_deg: float | None
    gimbal_error_deg: float | None
    sees: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    summary: Summary
    rows: tuple[Row, ...]
    errors: Errors
    plan_cost: float | None
    problem: str


async def run_demo(autopilot: str) -> Outcome:
    """Run the demonstration; progress goes to stderr. Leaves no process behind, however it ends, only its journal."""
    started_s = time.monotonic()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, signal.raise_signal, signal.SIGINT)
    folder = Path(tempfile.mkdtemp(prefix="hsop-gcs-demo-"))
    async with AsyncExitStack() as stack:
        port = _free_udp_port()
        address = await stack.enter_async_context(running_service(_settings(port, folder / "journal")))
        client = await stack.enter_async_context(httpx2.AsyncClient(base_url=address, timeout=5.0))
        screen = stack.enter_context(Screen())
        show = await stack.enter_async_context(_simulated_fleet(autopilot, port, address))
        console = _DemoConsole(client, screen)
        problem = ""
        try:
            async with asyncio.timeout(LIMIT_S):
                await console.take_off()
            await console.planner_ready()  # while the hosts climb
            given = {**TRUTH, "epoch": _utc(time.time())}
            show(given)
            async with asyncio.timeout(LIMIT_S):
                await console.localize(truth_from_json(given, ORIGIN))
        except TimeoutError:
            problem = f"not all hosts were on station within {LIMIT_S:.0f} s: {console.doing}"
        hosts = await console.hosts()
    errors = console.errors
    rows = tuple(_row(host) for host in hosts if host["order"] is not None)
    summary = Summary(
        threats=len(console.truth.threats),
        hosts=len(rows),
        all_arrived=bool(rows) and not problem and all(row.status.startswith("on station") for row in rows),
        hover_error_m=_worst(row.hover_error_m for row in rows),
        heading_error_deg=_worst(row.heading_error_deg for row in rows),
        gimbal_error_deg=_worst(row.gimbal_error_deg for row in rows),
        duration_s=round(time.monotonic() - started_s, 2),
        report_error_m=errors.reports_m,
        final_error_m=errors.final_m,
        journal=str(folder / "journal"),
    )
    cost = None if console.plan is None else console.plan["placement"]["cost"]
    return Outcome(summary=summary, rows=rows, errors=errors, plan_cost=cost, problem=problem)


class Screen:
    """Progress for a person: a live table on a terminal, plain lines elsewhere; always on stderr."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._live = Live(console=self._console, refresh_per_second=4, transient=True)
        self._is_terminal = self._console.is_terminal

    def __enter__(self) -> "Screen":
        if self._is_terminal:
            self._live.__enter__()
        return self

    def __exit__(self, *exit_info: Any) -> None:
        if self._is_terminal:
            self._live.__exit__(*exit_info)

    def say(self, line: str) -> None:
        self._console.print(line, highlight=False)

    def show(self, hosts: list[dict[str, Any]], errors: Errors) -> None:
        if self._is_terminal:
            self._live.update(_live_table(hosts, errors))


class _DemoConsole:
    """An operator's console, played by a program: it knows the REST API, and for its scores the truth."""

    def __init__(self, client: httpx2.AsyncClient, screen: Screen) -> None:
        self._client = client
        self._screen = screen
        self.truth = Truth(threats=())
        self._report_errors: list[float] = []
        self._first_fix_m: float | None = None
        self._final_m: float | None = None
        self._rng = np.random.default_rng(SEED)
        self.plan: dict[str, Any] | None = None
        self.doing = "starting"

    @property
    def errors(self) -> Errors:
        reports_m = float(np.median(self._report_errors)) if self._report_errors else None
        return Errors(reports_m=reports_m, first_fix_m=self._first_fix_m, final_m=self._final_m)

    async def take_off(self) -> None:
        """Order the fleet into the air."""
        self._begin("waiting for the hosts' links")
        await self._until(lambda host: host["unavailable_reason"] == "the vehicle is not armed")
        self._begin(f"ordering take-off to {TAKE_OFF_M:.0f} m")
        await self._post("/api/v1/hosts/take-off", {"altitude_m": TAKE_OFF_M})

    async def planner_ready(self) -> None:
        """Wait until the service can plan."""
        while not (await self._client.get("/api/v1/health")).raise_for_status().json()["planning"]["ready"]:
            self._begin("waiting for the planner (compiled the first time on a machine, which can take half a minute)")
            await asyncio.sleep(1 / POLLS_PER_S)

    async def localize(self, truth: Truth) -> None:
        """Report threats, approve plans once the hosts have climbed, and wait until all of them see."""
        self.truth = truth
        self._begin(f"reporting {len(truth.threats)} threats, sigma {REPORT_SIGMA_M:.0f} m")
        async with asyncio.TaskGroup() as tasks:
            helpers = [tasks.create_task(work) for work in (self._report(), self._score())]
            self._begin("waiting for the hosts to climb")
            await self._until(lambda host: host["available"] and host["position_enu_m"][2] > TAKE_OFF_M - 2.0)
            helpers.append(tasks.create_task(self._approve()))
            await self._settled()
            for helper in helpers:
                helper.cancel()
        self._begin("all hosts are on station")

    async def hosts(self) -> list[dict[str, Any]]:
        answer = await self._client.get("/api/v1/hosts")
        return list(answer.raise_for_status().json())

    async def _settled(self) -> None:
        """Return when the hosts of a plan for all threats have been on station for a while."""
        since = None
        while since is None or time.monotonic() - since < SETTLE_S:
            await asyncio.sleep(1 / POLLS_PER_S)
            hosts = await self.hosts()
            self._screen.show(hosts, self.errors)
            ordered = [host for host in hosts if host["order"] is not None]
            there = bool(ordered) and all(host["order"]["status"] == "on station" for host in ordered)
            covered = {view["threat"] for host in ordered for view in host["order"]["views"]}
            threats = (await self._client.get("/api/v1/threats")).raise_for_status().json()
            seen = {threat["id"] for threat in threats if threat["sigma_m"] < SEEN_SIGMA_M}
            if not there or not {threat.id for threat in self.truth.threats} <= covered & seen:
                since = None
            elif since is None:
                since = time.monotonic()

    async def _until(self, done: Callable[[dict[str, Any]], bool]) -> None:
        while True:
            hosts = await self.hosts()
            self._screen.show(hosts, self.errors)
            if all(done(host) for host in hosts):
                return
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _report(self) -> None:
        """Report what a coarse radar would."""
        frame = LocalFrame(ORIGIN)
        while True:
            now_s = time.time()
            reports = []
            for state in self.truth.at(now_s - (self.truth.epoch_s or 0.0)):
                seen = np.array(state.position_m) + self._rng.normal(scale=REPORT_SIGMA_M, size=3)
                self._report_errors.append(math.dist(seen, state.position_m))
                reports.append(_report_of(state.id, frame.to_geodetic(seen), now_s))
            if reports:
                results = await self._post("/api/v1/reports", reports)
                for result in results["results"]:
                    if result["status"] == "rejected":
                        self._screen.say(f"report refused: {result['errors']}")
            await asyncio.sleep(1 / REPORTS_PER_S)

    async def _approve(self) -> None:
        """Approve every plan that covers all threats, as an operator would who trusts them."""
        while True:
            plans = (await self._client.get("/api/v1/plan")).raise_for_status().json()
            proposed, failed = plans["proposed"], plans["failed"]
            if proposed is not None and len(proposed["placement"]["pairs"]) == len(self.truth.threats):
                self._begin(
                    f"approving plan {proposed['id']}: {len(proposed['orders'])} hosts,"
                    f" cost {proposed['placement']['cost']:.4f}, because {proposed['trigger']}"
                )
                answer = await self._client.post("/api/v1/plan/approve", json={"plan_id": proposed["id"]})
                if answer.is_error:
                    self._screen.say(f"not flown: {answer.json()['detail']}")
                else:
                    self.plan = proposed
            elif failed is not None:
                self.doing = f"no plan: {failed['reason']}"
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _score(self) -> None:
        """Hold the tracks against the truth."""
        frame = LocalFrame(ORIGIN)
        while True:
            threats = (await self._client.get("/api/v1/threats")).raise_for_status().json()
            fixes = (await self._client.get("/api/v1/health")).raise_for_status().json()["detections"]["fixes"]
            errors = []
            for threat in threats:
                at_s = datetime.fromisoformat(threat["time"]).timestamp() - (self.truth.epoch_s or 0.0)
                true = {state.id: state.position_m for state in self.truth.at(at_s)}.get(threat["id"])
                if true is not None:
                    believed = frame.to_enu(GeodeticPoint(**threat["position"]))
                    errors.append(math.dist(believed, true))
            if errors:
                self._final_m = sum(errors) / len(errors)
                if fixes and self._first_fix_m is None:
                    self._first_fix_m = self._final_m
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _post(self, path: str, body: Any) -> Any:
        answer = await self._client.post(path, json=body)
        if answer.is_error:
            raise Unavailable(f"{path}: {answer.json()['detail']}")
        return answer.json()

    def _begin(self, doing: str) -> None:
        if doing != self.doing:
            self._screen.say(doing)
        self.doing = doing


def _report_of(threat_id: str, place: GeodeticPoint, now_s: float) -> dict[str, Any]:
    return {
        "source": "demo-radar",
        "threat_id": threat_id,
        "time": _utc(now_s),
        "position": {
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "altitude_m": place.altitude_amsl_m,
            "altitude_datum": "amsl",
        },
        "sigma_m": REPORT_SIGMA_M,
    }


def _utc(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat()


@asynccontextmanager
async def _simulated_fleet(autopilot: str, port: int, service: str) -> AsyncIterator[Callable[[Any], None]]:
    """Run ``hsop-gcs simulate`` as a process that ends when its stdin does; yields what shows it a truth."""
    origin = f"{ORIGIN.lat_deg},{ORIGIN.lon_deg},{ORIGIN.altitude_amsl_m}"
    command = [sys.executable, "-m", "hsop_gcs", "simulate", "--vehicles", str(HOSTS), "--autopilot", autopilot]
    command += ["--origin", origin, "--spacing-m", str(SPACING_M), "--target", f"127.0.0.1:{port}", "--shared-port"]
    command += ["--local-port", "0", "--exit-with-stdin", "--truth", "-", "--detections-to", service]
    with deaf_to_ctrl_c():
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, bufsize=1)
    stdin = process.stdin
    assert stdin is not None
    try:
        yield lambda truth: print(json.dumps(truth), file=stdin)
    finally:
        stdin.close()
        try:
            process.wait(timeout=3)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _settings(port: int, journal: Path) -> Settings:
    hosts = [
        {"id": f"h{number}", "system_id": number, "connection": f"udpin:127.0.0.1:{port}"}
        for number in range(1, HOSTS + 1)
    ]
    origin = {"lat_deg": ORIGIN.lat_deg, "lon_deg": ORIGIN.lon_deg, "altitude_amsl_m": ORIGIN.altitude_amsl_m}
    return Settings.model_validate(
        {
            "site": {"origin": origin},
            "service": {"port": 0, "journal": str(journal)},
            "planning": {"hosts": "all", "horizon_s": HORIZON_S},
            "tracks": {"acceleration_psd_m2ps3": 0.02},
            "hosts": hosts,
        }
    )


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _live_table(hosts: list[dict[str, Any]], errors: Errors) -> Table:
    track = "" if errors.final_m is None else f"tracks are {errors.final_m:.2f} m from the truth"
    table = Table(caption=track)
    for heading in ("host", "mode", "altitude", "order", "to go", "heading", "gimbal"):
        table.add_column(heading)
    for host in hosts:
        order = host["order"] or {}
        local = host["position_enu_m"]
        table.add_row(
            host["id"],
            host["mode"] or host["unavailable_reason"] or "",
            "" if local is None else f"{local[2]:.0f} m",
            order.get("status", ""),
            _shown(order.get("hover_error_m"), " m"),
            _shown(order.get("heading_error_deg"), "°"),
            _shown(order.get("gimbal_error_deg"), "°"),
        )
    return table


def _shown(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.1f}{unit}"


def _row(host: dict[str, Any]) -> Row:
    order = host["order"]
    return Row(
        host=host["id"],
        status=order["status"] + (f" ({order['note']})" if order["note"] else ""),
        hover_error_m=order["hover_error_m"],
        heading_error_deg=order["heading_error_deg"],
        gimbal_error_deg=order["gimbal_error_deg"],
        sees=tuple((view["threat"], view["camera"]) for view in order["views"]),
    )


def _worst(values: Iterable[float | None]) -> float | None:
    known = [abs(value) for value in values if value is not None]
    return max(known) if known else None
