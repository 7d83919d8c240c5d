"""The demonstration: a service, a simulated fleet in a process of its own, and a console that talks to both over HTTP.

Everything goes the way it would in the field: reports over HTTP, approval by a console, MAVLink over UDP. Only the
threats and the aircraft are made up.
"""

import asyncio
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
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

ORIGIN = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)
HOSTS = 4
SPACING_M = 15.0
TAKE_OFF_M = 25.0
REPORTS_PER_S = 2.0
POLLS_PER_S = 4.0
LIMIT_S = 80.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoThreat:
    """A made-up intruder on a straight path, ENU metres. Half of the sources know no velocity."""

    id: str
    start_m: tuple[float, float, float]
    velocity_mps: tuple[float, float, float]
    tells_velocity: bool

    def report(self, elapsed_s: float, now_s: float, frame: LocalFrame) -> dict[str, Any]:
        """Return what a radar would POST ``elapsed_s`` after the threat was first seen."""
        place = frame.to_geodetic(np.array(self.start_m) + elapsed_s * np.array(self.velocity_mps))
        east, north, up = self.velocity_mps
        return {
            "source": "demo-radar",
            "threat_id": self.id,
            "time": datetime.fromtimestamp(now_s, UTC).isoformat(),
            "position": {
                "lat_deg": place.lat_deg,
                "lon_deg": place.lon_deg,
                "altitude_m": place.altitude_amsl_m,
                "altitude_datum": "amsl",
            },
        } | ({"velocity": {"east_mps": east, "north_mps": north, "up_mps": up}} if self.tells_velocity else {})


THREATS = (
    DemoThreat(id="t1", start_m=(-10.0, 110.0, 40.0), velocity_mps=(0.6, -1.0, 0.0), tells_velocity=True),
    DemoThreat(id="t2", start_m=(60.0, 125.0, 40.0), velocity_mps=(-0.8, -0.7, 0.0), tells_velocity=False),
)


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
    plan_cost: float | None
    problem: str


async def run_demo(autopilot: str) -> Outcome:
    """Run the demonstration; progress goes to stderr. Leaves no process behind, however it ends."""
    started_s = time.monotonic()
    async with AsyncExitStack() as stack:
        port = _free_udp_port()
        address = await stack.enter_async_context(running_service(_settings(port)))
        await stack.enter_async_context(_simulated_fleet(autopilot, port))
        client = await stack.enter_async_context(httpx2.AsyncClient(base_url=address, timeout=5.0))
        screen = stack.enter_context(Screen())
        console = _DemoConsole(client, screen)
        problem = ""
        try:
            async with asyncio.timeout(LIMIT_S):
                await console.work()
        except TimeoutError:
            problem = f"not all hosts were on station within {LIMIT_S:.0f} s: {console.doing}"
        hosts = await console.hosts()
    return _outcome(hosts, console.plan, time.monotonic() - started_s, problem)


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

    def show(self, hosts: list[dict[str, Any]]) -> None:
        if self._is_terminal:
            self._live.update(_live_table(hosts))


class _DemoConsole:
    """An operator's console, played by a program: it knows nothing but the REST API."""

    def __init__(self, client: httpx2.AsyncClient, screen: Screen) -> None:
        self._client = client
        self._screen = screen
        self.plan: dict[str, Any] | None = None
        self.doing = "starting"

    async def work(self) -> None:
        """Bring the fleet into the air, report threats, approve the plan and wait until all its hosts see."""
        self._begin("waiting for the hosts' links")
        await self._until(lambda host: host["position"] is not None and host["in_air"] is not None)
        self._begin(f"ordering take-off to {TAKE_OFF_M:.0f} m")
        await self._post("/api/v1/hosts/take-off", {"altitude_m": TAKE_OFF_M})
        await self._until(lambda host: host["available"] and host["position_enu_m"][2] > TAKE_OFF_M - 2.0)
        self._begin(f"reporting {len(THREATS)} threats")
        async with asyncio.TaskGroup() as tasks:
            reporting = tasks.create_task(self._report())
            self.plan = await self._proposal()
            placement = self.plan["placement"]
            self._begin(
                f"approving plan {self.plan['id']}: {len(self.plan['orders'])} hosts, cost {placement['cost']:.4f},"
                f" solved in {placement['solve_time_s']:.2f} s"
            )
            await self._post("/api/v1/plan/approve", {"plan_id": self.plan["id"]})
            flying = {order["host"] for order in self.plan["orders"]}
            await self._until(
                lambda host: host["id"] not in flying or (host["order"] or {}).get("status") == "on station"
            )
            reporting.cancel()
        self._begin("all hosts are on station")

    async def hosts(self) -> list[dict[str, Any]]:
        answer = await self._client.get("/api/v1/hosts")
        return list(answer.raise_for_status().json())

    async def _until(self, done: Any) -> None:
        while True:
            hosts = await self.hosts()
            self._screen.show(hosts)
            if all(done(host) for host in hosts):
                return
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _report(self) -> None:
        frame, begun_s = LocalFrame(ORIGIN), time.time()
        while True:
            now_s = time.time()
            reports = [threat.report(now_s - begun_s, now_s, frame) for threat in THREATS]
            results = await self._post("/api/v1/reports", reports)
            if results["rejected"]:
                self._screen.say(f"rejected: {results['results']}")
            await asyncio.sleep(1 / REPORTS_PER_S)

    async def _proposal(self) -> dict[str, Any]:
        """Wait for a plan that covers all threats."""
        while True:
            plans = (await self._client.get("/api/v1/plan")).raise_for_status().json()
            proposed = plans["proposed"]
            if proposed is not None and len(proposed["placement"]["pairs"]) == len(THREATS):
                return dict(proposed)
            if plans["failed"] is not None:
                self.doing = f"no plan: {plans['failed']['reason']}"
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _post(self, path: str, body: Any) -> Any:
        answer = await self._client.post(path, json=body)
        if answer.is_error:
            raise Unavailable(f"{path}: {answer.json()['detail']}")
        return answer.json()

    def _begin(self, doing: str) -> None:
        self.doing = doing
        self._screen.say(doing)


@asynccontextmanager
async def _simulated_fleet(autopilot: str, port: int) -> AsyncIterator[None]:
    """Run ``hsop-gcs simulate`` as a process that ends when our end of its stdin does."""
    origin = f"{ORIGIN.lat_deg},{ORIGIN.lon_deg},{ORIGIN.altitude_amsl_m}"
    command = [sys.executable, "-m", "hsop_gcs", "simulate", "--vehicles", str(HOSTS), "--autopilot", autopilot]
    command += ["--origin", origin, "--spacing-m", str(SPACING_M), "--target", f"127.0.0.1:{port}", "--shared-port"]
    command += ["--local-port", "0", "--exit-with-stdin"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        assert process.stdin is not None
        process.stdin.close()
        try:
            process.wait(timeout=3)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _settings(port: int) -> Settings:
    hosts = [
        {"id": f"h{number}", "system_id": number, "connection": f"udpin:127.0.0.1:{port}"}
        for number in range(1, HOSTS + 1)
    ]
    origin = {"lat_deg": ORIGIN.lat_deg, "lon_deg": ORIGIN.lon_deg, "altitude_amsl_m": ORIGIN.altitude_amsl_m}
    return Settings.model_validate(
        {"site": {"origin": origin}, "service": {"port": 0}, "planning": {"hosts": "all"}, "hosts": hosts}
    )


def _free_udp_port() -> int:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _live_table(hosts: list[dict[str, Any]]) -> Table:
    table = Table()
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


def _outcome(hosts: list[dict[str, Any]], plan: dict[str, Any] | None, duration_s: float, problem: str) -> Outcome:
    rows = tuple(
        Row(
            host=host["id"],
            status=order["status"] + (f" ({order['note']})" if order["note"] else ""),
            hover_error_m=order["hover_error_m"],
            heading_error_deg=order["heading_error_deg"],
            gimbal_error_deg=order["gimbal_error_deg"],
            sees=tuple((view["threat"], view["camera"]) for view in order["views"]),
        )
        for host in hosts
        if (order := host["order"]) is not None
    )
    summary = Summary(
        threats=len(THREATS),
        hosts=len(rows),
        all_arrived=bool(rows) and not problem and all(row.status == "on station" for row in rows),
        hover_error_m=_worst(row.hover_error_m for row in rows),
        heading_error_deg=_worst(row.heading_error_deg for row in rows),
        gimbal_error_deg=_worst(row.gimbal_error_deg for row in rows),
        duration_s=round(duration_s, 2),
    )
    cost = None if plan is None else plan["placement"]["cost"]
    return Outcome(summary=summary, rows=rows, plan_cost=cost, problem=problem)


def _worst(values: Any) -> float | None:
    known = [abs(value) for value in values if value is not None]
    return max(known) if known else None
