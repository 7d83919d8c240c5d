"""The simulator's eyes at work: hosts look at a steady rate, and what they see is posted to the service.

    clock ──rate──▶ true poses, true threats ──look──▶ outbox ──latency──▶ POST ──▶ accepted | refused
                                                          ▲                 │
                                                          └── again, until too old ◀── no answer

Looking and posting are tasks of their own: a service that does not answer costs detections, never the flight.
"""

import asyncio
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import httpx2
import numpy as np

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.detections import Detection, Pose
from hsop_gcs.geometry.frames import Aim, LocalFrame
from hsop_gcs.simulator.body import Body
from hsop_gcs.simulator.eyes import Viewer, look, to_json
from hsop_gcs.simulator.fleet import SimulatedFleet
from hsop_gcs.simulator.truth import Truth

PATH = "/api/v1/detections"
LETTERS = CameraRig()
_LARGEST_POST = 500
_ANSWER_WITHIN_S = 2.0
_RETRY_AFTER_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class LookoutConfig:
    """Who looks, how often, and whom it is told. One host id per vehicle, as the service knows them."""

    service: str
    """Base address, such as http://127.0.0.1:8080."""
    host_ids: Sequence[str]
    rigs: Mapping[str, CameraRig] = field(default_factory=dict)
    """What hosts carry, by their ids; any other has the letter's."""
    rate_hz: float = 5.0
    latency_s: float = 0.1
    """From the exposure to the first attempt to post."""
    give_up_s: float = 2.0
    """A detection older than this is not worth posting any more."""
    seed: int = 0


@dataclass(slots=True)
class Tally:
    """What became of all detections, and how many posts were not answered."""

    seen: int = 0
    accepted: int = 0
    refused: int = 0
    too_old: int = 0
    failed_posts: int = 0
    last_problem: str = ""

    def __str__(self) -> str:
        problem = f" ({self.last_problem})" if self.last_problem else ""
        return (
            f"detections: {self.seen} seen, {self.accepted} accepted, {self.refused} refused,"
            f" {self.too_old} too old; {self.failed_posts} posts failed{problem}"
        )


class Outbox:
    """Detections on their way, in order of exposure."""

    def __init__(self, *, latency_s: float, give_up_s: float) -> None:
        self._latency_s = latency_s
        self._give_up_s = give_up_s
        self._waiting: deque[Detection] = deque()

    @property
    def next_due_s(self) -> float:
        """When there is something to post; infinity if nothing waits."""
        return self._waiting[0].time_s + self._latency_s if self._waiting else math.inf

    def put(self, detections: Sequence[Detection]) -> None:
        self._waiting.extend(detections)

    def put_back(self, detections: Sequence[Detection]) -> None:
        """Take back what could not be posted."""
        self._waiting.extendleft(reversed(detections))

    def take_due(self, now_s: float) -> list[Detection]:
        """Return the next post."""
        due: list[Detection] = []
        while self.next_due_s <= now_s and len(due) < _LARGEST_POST:
            due.append(self._waiting.popleft())
        return due

    def drop_old(self, now_s: float) -> int:
        """Forget what is not worth posting any more; return how many."""
        before = len(self._waiting)
        while self._waiting and now_s - self._waiting[0].time_s > self._give_up_s:
            self._waiting.popleft()
        return before - len(self._waiting)


class Lookout:
    """Lets a fleet see a truth. ``clock``: seconds since the Unix epoch, on which the true threats fly."""

    def __init__(
        self,
        fleet: SimulatedFleet,
        truth: Truth,
        frame: LocalFrame,
        config: LookoutConfig,
        *,
        clock: Callable[[], float],
    ) -> None:
        self.tally = Tally()
        self.epoch_s = clock() if truth.epoch_s is None else truth.epoch_s
        self._fleet = fleet
        self._truth = truth
        self._frame = frame
        self._config = config
        self._clock = clock
        self._rng = np.random.default_rng(config.seed)
        self._outbox = Outbox(latency_s=config.latency_s, give_up_s=config.give_up_s)
        self._more = asyncio.Event()

    async def run(self) -> None:
        """Look and post until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._look_steadily())
            tasks.create_task(self._post_steadily())

    def look(self) -> list[Detection]:
        """Look once, now."""
        self._fleet.advance()
        now_s = self._clock()
        viewers = [
            Viewer(host=host, pose=pose_of(vehicle, self._frame), rig=self._config.rigs.get(host, LETTERS))
            for host, vehicle in zip(self._config.host_ids, self._fleet.vehicles, strict=True)
        ]
        return look(viewers, self._truth.at(now_s - self.epoch_s), now_s, self._rng)

    async def _look_steadily(self) -> None:
        period_s = 1 / self._config.rate_hz
        next_s = self._clock()
        while True:
            seen = self.look()
            self.tally.seen += len(seen)
            self._outbox.put(seen)
            self._more.set()
            next_s = max(next_s + period_s, self._clock())
            await asyncio.sleep(next_s - self._clock())

    async def _post_steadily(self) -> None:
        # A proxy from the environment has no business between a simulator and its service.
        async with httpx2.AsyncClient(
            base_url=self._config.service, timeout=_ANSWER_WITHIN_S, trust_env=False
        ) as client:
            while True:
                self._more.clear()
                self.tally.too_old += self._outbox.drop_old(self._clock())
                due = self._outbox.take_due(self._clock())
                if not due:
                    await self._sleep_until_due()
                elif not await self._post(client, due):
                    self._outbox.put_back(due)
                    await asyncio.sleep(_RETRY_AFTER_S)

    async def _sleep_until_due(self) -> None:
        if self._outbox.next_due_s == math.inf:
            await self._more.wait()
        else:
            await asyncio.sleep(max(0.0, self._outbox.next_due_s - self._clock()))

    async def _post(self, client: httpx2.AsyncClient, due: Sequence[Detection]) -> bool:
        """Post detections; False if the service did not answer, or could not."""
        try:
            answer = await client.post(PATH, json=[to_json(each) for each in due])
        except httpx2.TransportError as error:
            self.tally.failed_posts += 1
            self.tally.last_problem = f"{type(error).__name__} {error}".strip()
            return False
        if answer.status_code >= 500:
            self.tally.failed_posts += 1
            self.tally.last_problem = f"HTTP {answer.status_code}"
            return False
        self._count(answer, len(due))
        return True

    def _count(self, answer: httpx2.Response, posted: int) -> None:
        try:
            body: Any = answer.json()
            accepted = int(body["accepted"]) if answer.is_success else 0
            problem = "" if answer.is_success else str(body["detail"])
        except (ValueError, KeyError, TypeError):
            accepted, problem = 0, f"HTTP {answer.status_code}"
        self.tally.accepted += accepted
        self.tally.refused += posted - accepted
        self.tally.last_problem = problem or self.tally.last_problem


def pose_of(body: Body, frame: LocalFrame) -> Pose:
    """Return how a simulated aircraft really is: not as its estimator sees it."""
    east, north, up = frame.to_enu(body.local.to_geodetic(np.array(body.state.position_m))).tolist()
    return Pose(
        position_m=(east, north, up),
        heading_deg=math.degrees(body.state.heading_rad) % 360.0,
        roll_deg=math.degrees(body.state.roll_rad),
        pitch_deg=math.degrees(body.state.pitch_rad),
        aim=Aim(pan_deg=math.degrees(body.gimbal.earth_yaw_rad) % 360.0, tilt_deg=math.degrees(body.gimbal.pitch_rad)),
    )
