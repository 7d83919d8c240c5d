"""Decisions made outside the event loop: one worker process that solves while reports and telemetry go on.

    loading ──kernels are there──► ready ──asked──► solving ──answered──► ready
       ▲                             │                 │
       └──────── it died ────────────┴── it died, or hung

A worker that dies is noticed within a second, whether it was asked anything or not, and another one is started.
"""

import asyncio
import contextlib
import logging
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.placement.search import warm_up, warm_up_beside
from hsop_gcs.workers import SPAWN, end, end_with_parent, ended, workers

_PATIENCE_S = 30.0
"""On top of a decision's time limit; a worker that takes longer counts as hung."""
_LOOK_EVERY_S = 0.25
"""Between looks at whether the worker lives."""
_LONGEST_PAUSE_S = 8.0
"""Before a worker is started again that has never become ready: twice as long each time, up to this."""
_BESIDE_AFTER_S = 6.0
"""Loading kernels takes less time than this; compiling them, the first time on a machine, takes a second process."""

log = logging.getLogger(__name__)


class Solver:
    """Runs ``decide`` in a process of its own. Use as an async context manager."""

    def __init__(self) -> None:
        self.restarts = 0
        """How many workers had to be replaced."""

    async def __aenter__(self) -> "Solver":
        self._start()
        self._supervision = asyncio.create_task(self._supervise(), name="solver supervision")
        return self

    async def __aexit__(self, *_: object) -> None:
        self._supervision.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self._supervision
        self._end()

    async def decide(self, situation: Situation, rules: PlanningRules) -> Decision:
        """Return the decision for a situation.

        Raises what ``decide`` raises; BrokenProcessPool if the worker died and TimeoutError if it hung: then the next
        call gets a new worker.
        """
        loop, pool = asyncio.get_running_loop(), self._pool
        patience_s = 2 * rules.time_limit_s + _PATIENCE_S
        try:
            await asyncio.wrap_future(self._warm)
            async with asyncio.timeout(patience_s):
                return await loop.run_in_executor(pool, _decide, situation, rules, time.monotonic())
        except BrokenProcessPool:
            self._give_up(pool)
            raise
        except TimeoutError:
            self._give_up(pool)
            raise TimeoutError(f"no answer for {patience_s:g} s; the planner's process was started again") from None

    @property
    def ready(self) -> bool:
        """Whether the worker can solve at once: it lives, and its kernels are loaded."""
        warm = self._warm
        return warm.done() and not warm.cancelled() and warm.exception() is None and not ended(self._pool)

    def _start(self) -> None:
        self._started_s = time.monotonic()
        self._pool = workers()
        self._warm = self._pool.submit(warm_up)
        self._beside = SPAWN.Process(target=_warm_up_beside, daemon=True)

    def _end(self) -> None:
        end(self._pool)
        if self._beside.pid is not None:
            self._beside.kill()
            self._beside.join()

    def _give_up(self, pool: ProcessPoolExecutor) -> None:
        """Replace the pool, unless the supervision has."""
        if pool is self._pool:
            self._replace()

    def _replace(self) -> None:
        self._end()
        self.restarts += 1
        self._start()

    async def _supervise(self) -> None:
        pause_s = _LOOK_EVERY_S
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            if ended(self._pool):
                pause_s = _LOOK_EVERY_S if self.ready else min(2 * pause_s, _LONGEST_PAUSE_S)
                log.error("the planner's process has ended and is started again in %.1f s", pause_s - _LOOK_EVERY_S)
                await asyncio.sleep(pause_s - _LOOK_EVERY_S)
                if ended(self._pool):
                    self._replace()
            elif not self.ready and self._beside.pid is None and time.monotonic() > self._started_s + _BESIDE_AFTER_S:
                self._beside.start()


def _warm_up_beside() -> None:
    end_with_parent()
    warm_up_beside()


def _decide(situation: Situation, rules: PlanningRules, asked_s: float) -> Decision:
    """The decision, within its time limit since it was asked for: the clock is the same in all processes."""
    return decide(situation, rules, now=time.monotonic, late_s=time.monotonic() - asked_s)
