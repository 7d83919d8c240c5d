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
        self._pool = _new_pool()
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
            async with asyncio.timeout(2 * rules.time_limit_s + _PATIENCE_S):
                return await loop.run_in_executor(self._pool, _decide, situation, rules)
        except (BrokenProcessPool, TimeoutError):
            self._end_pool()
            self._pool = _new_pool()
            raise

    def _end_pool(self) -> None:
        # a solve that still runs is not waited for: its answer has nowhere to go
        workers = list((self._pool._processes or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
            worker.join()


def _new_pool() -> ProcessPoolExecutor:
    # spawn: the service's threads and sockets must not be copied into the worker
    pool = ProcessPoolExecutor(max_workers=1, mp_context=get_context("spawn"))
    pool.submit(_warm_up)
    return pool


def _warm_up() -> None:
    """Load the search's compiled kernels before the first threat is reported, not after it."""
    warm_up()


def _decide(situation: Situation, rules: PlanningRules) -> Decision:
    return decide(situation, rules, now=time.monotonic)
