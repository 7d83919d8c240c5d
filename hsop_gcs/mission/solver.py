"""Decisions made outside the event loop: one worker process that solves while reports and telemetry go on."""

import asyncio
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from hsop_gcs.mission.pipeline import Decision, PlanningRules, Situation, decide
from hsop_gcs.placement.search import warm_up

_PATIENCE_S = 30.0
"""On top of its time limit; after that the worker counts as hung."""


class Solver:
    """Runs ``decide`` in a process of its own. Use as an async context manager."""

    async def __aenter__(self) -> "Solver":
        self._start()
        return self

    async def __aexit__(self, *_: object) -> None:
        self._end_pool()

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
            self._end_pool()
            self._start()
            raise

    @property
    def ready(self) -> bool:
        """Whether the worker can solve at once; the first time on a machine it has to compile its kernels before."""
        return self._warm.done()

    def _start(self) -> None:
        # spawn: the service's threads and sockets must not be copied into the worker
        self._pool = ProcessPoolExecutor(max_workers=1, mp_context=get_context("spawn"))
        self._warm = self._pool.submit(warm_up)

    def _end_pool(self) -> None:
        # a solve that still runs is not waited for: its answer has nowhere to go
        workers = list((self._pool._processes or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
            worker.join()


def _decide(situation: Situation, rules: PlanningRules) -> Decision:
    return decide(situation, rules, now=time.monotonic)
