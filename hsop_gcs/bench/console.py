"""The operator's console of the benchmark, played by a program, and the ear at its fleet's process."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import httpx2
import numpy as np

from hsop_gcs.bench.traffic import Heard
from hsop_gcs.errors import Unavailable
from hsop_gcs.geometry.frames import LocalFrame
from hsop_gcs.loopback import ORIGIN, report

HELD_AT_ONCE = 10
HOLD_EVERY_S = 1.0
TURNS_AFTER_S = 30.0
REPORT_EVERY_S = 0.5
HEIGHT_M = 40.0


class Listener:
    """What the fleet's process tells, in order."""

    def __init__(self, pipe: Connection, fleet: BaseProcess) -> None:
        self._pipe = pipe
        self._fleet = fleet
        self.all: list[Heard] = []

    def poll(self, wait_s: float) -> None:
        """Take in what was told, after waiting so long for something. Raises Unavailable if the fleet is gone."""
        if not self._fleet.is_alive():
            raise Unavailable("the fleet's process has ended")
        while self._pipe.poll(wait_s):
            self.all += self._pipe.recv()
            wait_s = 0.0

    def take(self) -> None:
        """Forget what was heard up to now."""
        self.poll(0.1)
        self.all.clear()

    def first(self, command: int, *, within_s: float) -> float | None:
        """Return when a command is heard for the first time; None if it is not within so long."""
        give_up_at = time.monotonic() + within_s
        while time.monotonic() < give_up_at:
            self.poll(0.1)
            for each in self.all:
                if each.command == command:
                    return each.time_s
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Threat:
    """On a straight way from a time on, to and fro; ENU metres."""

    name: str
    position_m: tuple[float, float]
    velocity_mps: tuple[float, float]

    def report(self, since_s: float, now_s: float, *, velocity: bool = True) -> dict[str, Any]:
        """Return a report as the API takes it. since_s: when the way began, and now_s, since the Unix epoch."""
        laps, after_s = divmod(now_s - since_s, TURNS_AFTER_S)
        ahead_s, sign = (TURNS_AFTER_S - after_s, -1.0) if laps % 2 else (after_s, 1.0)
        enu = [p + v * ahead_s for p, v in zip(self.position_m, self.velocity_mps, strict=True)]
        place = LocalFrame(ORIGIN).to_geodetic(np.array([*enu, HEIGHT_M]))
        east_mps, north_mps = (sign * each for each in self.velocity_mps)
        known = {"velocity": {"east_mps": east_mps, "north_mps": north_mps, "up_mps": 0.0}} if velocity else {}
        return report("bench", self.name, now_s, place, sigma_m=1.0) | known


def random_threat(name: str, rng: np.random.Generator) -> Threat:
    """Somewhere 80 to 160 m north of the fleet, at up to 5 m/s."""
    course, speed_mps = rng.uniform(0, 2 * math.pi), rng.uniform(1, 5)
    return Threat(
        name=name,
        position_m=(float(rng.uniform(-60, 60)), float(rng.uniform(80, 160))),
        velocity_mps=(float(speed_mps * math.sin(course)), float(speed_mps * math.cos(course))),
    )


class Console:
    """An operator's console, played by a program: reports two threats, approves plans, holds idle hosts."""

    def __init__(self, client: httpx2.Client, rng: np.random.Generator, idle: Sequence[str]) -> None:
        self._client = client
        self._rng = rng
        self._idle = list(idle)
        self._since_s = time.time()
        self._threats = [
            Threat(name="t1", position_m=(-60.0, 90.0), velocity_mps=(1.2, 0.4)),
            Threat(name="t2", position_m=(60.0, 120.0), velocity_mps=(-1.2, -0.4)),
        ]
        self._held: dict[str, float] = {}
        self._newest = 0
        self.latencies_s: list[float] = []

    def work(self, for_s: float, heard: "Listener") -> None:
        """Be busy for so long."""
        until_s, report_at_s, hold_at_s = time.monotonic() + for_s, 0.0, 0.0
        while (now := time.monotonic()) < until_s:
            if now >= report_at_s:
                report_at_s = now + REPORT_EVERY_S
                wall_s = time.time()
                post(self._client, "/api/v1/reports", [each.report(self._since_s, wall_s) for each in self._threats])
                self._approve()
            if now >= hold_at_s and self._idle:
                hold_at_s = now + HOLD_EVERY_S
                self._hold()
            self._listen()
            heard.poll(0.1)

    def frames(self) -> int:
        """Return how many frames the service has received."""
        return int(self._link()["received"])

    def dropped(self) -> int:
        """Return how many datagrams came faster than the service could take them."""
        return int(self._link()["dropped_datagrams"])

    def _link(self) -> dict[str, Any]:
        health: dict[str, Any] = self._client.get("/api/v1/health").raise_for_status().json()
        link: dict[str, Any] = health["link"]
        return link

    def _approve(self) -> None:
        proposed = self._client.get("/api/v1/plan").raise_for_status().json()["proposed"]
        if proposed is not None:
            # Refused if it is not safe any more; then the next one is proposed.
            self._client.post("/api/v1/plan/approve", json={"plan_id": proposed["id"]})

    def _hold(self) -> None:
        hosts = [str(host) for host in self._rng.choice(self._idle, min(HELD_AT_ONCE, len(self._idle)), replace=False)]
        hosts = [host for host in hosts if host not in self._held]
        self._held |= dict.fromkeys(hosts, time.time())
        post(self._client, "/api/v1/hosts/hold", {"hosts": hosts})

    def _listen(self) -> None:
        for event in self._client.get("/api/v1/events", params={"after": self._newest}).raise_for_status().json():
            self._newest = event["number"]
            if event["kind"] == "CommandFinished" and event["host"] in self._held:
                at_s = datetime.fromisoformat(event["time"]).timestamp()
                self.latencies_s.append(at_s - self._held.pop(event["host"]))


def post(client: httpx2.Client, path: str, body: Any) -> None:
    """Post JSON to the service. Raises Unavailable for an answer that is an error."""
    answer = client.post(path, json=body)
    if answer.is_error:
        raise Unavailable(f"{path}: {answer.text[:300]}")
