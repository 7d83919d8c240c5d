"""An operator's console, played by a program: it knows the REST API, and for its scores the truth."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import httpx2

from hsop_gcs.clocks import RisingClock
from hsop_gcs.demo.outcome import Errors, TrackScore
from hsop_gcs.demo.radar import SIGMA_M, Radar
from hsop_gcs.demo.screen import Screen
from hsop_gcs.errors import Unavailable
from hsop_gcs.simulator.truth import Truth

TAKE_OFF_M = 35.0
REPORTS_PER_S = 2.0
POLLS_PER_S = 4.0
SETTLE_S = 4.0
SEEN_SIGMA_M = 2.0
"""A threat known better than this is seen by cameras: the reports leave several metres."""


class Console:
    """Lets hosts take off, reports threats, approves plans and waits until all threats are seen."""

    def __init__(self, client: httpx2.AsyncClient, screen: Screen) -> None:
        self._client = client
        self._screen = screen
        self._expect(Truth(threats=()))
        self.plan: dict[str, Any] | None = None
        """What was approved last, as the API showed it."""
        self.doing = "starting"

    def _expect(self, truth: Truth) -> None:
        self.threats = {threat.id for threat in truth.threats}
        self._radar = Radar(truth)
        self._score = TrackScore(truth)

    @property
    def errors(self) -> Errors:
        """How far reports and tracks were from the truth up to now."""
        score = self._score
        return Errors(reports_m=self._radar.error_m, first_fix_m=score.first_fix_m, final_m=score.newest_m)

    async def take_off(self) -> None:
        """Order the fleet into the air."""
        self._begin("waiting for the hosts' links")
        await self._until(lambda host: host["unavailable_reason"] == "the vehicle is not armed")
        self._begin(f"ordering take-off to {TAKE_OFF_M:.0f} m")
        await self._post("hosts/take-off", {"altitude_m": TAKE_OFF_M, "hosts": "all"})

    async def planner_ready(self) -> None:
        """Wait until the service can plan."""
        while not (await self._get("health"))["planning"]["ready"]:
            self._begin("waiting for the planner (compiled the first time on a machine, which can take half a minute)")
            await asyncio.sleep(1 / POLLS_PER_S)

    async def localize(self, truth: Truth) -> None:
        """Report threats, approve plans once the hosts have climbed, and wait until all of them see."""
        self._expect(truth)
        self._begin(f"reporting {len(self.threats)} threats, sigma {SIGMA_M:.0f} m")
        async with asyncio.TaskGroup() as tasks:
            helpers = [tasks.create_task(work) for work in (self._report(), self._judge())]
            self._begin("waiting for the hosts to climb")
            await self._until(lambda host: host["available"] and host["position_enu_m"][2] > TAKE_OFF_M - 2.0)
            helpers.append(tasks.create_task(self._approve()))
            await self._settled()
            for helper in helpers:
                helper.cancel()
        self._begin("all hosts are on station")

    async def hosts(self) -> list[dict[str, Any]]:
        """Return the hosts as the API shows them, on the screen too."""
        hosts: list[dict[str, Any]] = await self._get("hosts")
        self._screen.show(hosts, self._score.newest_m)
        return hosts

    async def _settled(self) -> None:
        """Return when the hosts of a plan for all threats have been on station for a while."""
        since = None
        while since is None or time.monotonic() - since < SETTLE_S:
            await asyncio.sleep(1 / POLLS_PER_S)
            ordered = [host for host in await self.hosts() if host["order"] is not None]
            there = bool(ordered) and all(host["order"]["status"] == "on station" for host in ordered)
            covered = {view["threat"] for host in ordered for view in host["order"]["views"]}
            seen = {threat["id"] for threat in await self._get("threats") if threat["sigma_m"] < SEEN_SIGMA_M}
            if not there or not self.threats <= covered & seen:
                since = None
            elif since is None:
                since = time.monotonic()

    async def _until(self, done: Callable[[dict[str, Any]], bool]) -> None:
        while not all(done(host) for host in await self.hosts()):
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _report(self) -> None:
        """Report what the radar sees."""
        clock = RisingClock()
        while True:
            reports = self._radar.scan(clock())
            if reports:
                for result in (await self._post("reports", reports))["results"]:
                    if result["status"] == "rejected":
                        self._screen.say(f"report refused: {result['errors']}")
            await asyncio.sleep(1 / REPORTS_PER_S)

    async def _approve(self) -> None:
        """Approve every plan that covers all threats, as an operator would who trusts them."""
        while True:
            plans = await self._get("plan")
            proposed, failed = plans["proposed"], plans["failed"]
            if proposed is not None and len(proposed["placement"]["pairs"]) == len(self.threats):
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

    async def _judge(self) -> None:
        """Hold the tracks against the truth."""
        while True:
            picture = await self._get("threats")
            fixes = (await self._get("health"))["detections"]["fixes"]
            self._score.take(picture, fixed=fixes > 0)
            await asyncio.sleep(1 / POLLS_PER_S)

    async def _get(self, path: str) -> Any:
        return (await self._client.get(f"/api/v1/{path}")).raise_for_status().json()

    async def _post(self, path: str, body: Any) -> Any:
        answer = await self._client.post(f"/api/v1/{path}", json=body)
        if answer.is_error:
            raise Unavailable(f"/api/v1/{path}: {answer.json()['detail']}")
        return answer.json()

    def _begin(self, doing: str) -> None:
        if doing != self.doing:
            self._screen.say(doing)
        self.doing = doing
