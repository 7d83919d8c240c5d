"""Decisions made outside the event loop: one worker process that solves while reports and telemetry go on."""

import asyncio
import time
from concurrent.futures.process import BrokenProcessPool

from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.placement.search import warm_up, warm_up_beside
from hsop_gcs.workers import SPAWN, end, end_with_parent, workers

_PATIENCE_S = 30.0
"""On top of its time limit; after that the worker counts as hung."""


class Solver:
    """Runs ``decide`` in a process of its own. Use as an async context manager."""

    async def __aenter__(self) -> "Solver":
        self._start()
        return self

    async def __aexit__(self, *_: object) -> None:
        self._end()

    async def decide(self, situation: Situation, rules: PlanningRules) -> Decision:
        """Return the decision for a situation.

        Raises what ``decide`` raises; BrokenProcessPool if the worker died and TimeoutError if it hung: then the next
        call gets a new worker.
        """
        loop = asyncio.get_running_loop()
        try:
            await asyncio.wrap_future(self._warm)
            async with asyncio.timeout(2 * rules.time_limit_s + _PATIENCE_S):
                return await loop.run_in_executor(self._pool, _decide, situation, rules)
        except (BrokenProcessPool, TimeoutError):
            self._end()
            self._start()
            raise

    @property
    def ready(self) -> bool:
        """Whether the worker can solve at once; the first time on a machine it has to compile its kernels before."""
        return self._warm.done()

    def _start(self) -> None:
        self._pool = workers()
        self._warm = self._pool.submit(warm_up)
        self._beside = SPAWN.Process(target=_warm_up_beside, daemon=True)
        self._beside.start()

    def _end(self) -> None:
        end(self._pool)
        self._beside.kill()
        self._beside.join()


def _warm_up_beside() -> None:
    end_with_parent()
    warm_up_beside()


def _decide(situation: Situation, rules: PlanningRules) -> Decision:
    return decide(situation, rules, now=time.monotonic)
