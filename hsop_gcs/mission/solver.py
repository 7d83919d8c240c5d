"""Decisions made outside the event loop: one worker process that solves while reports and telemetry go on."""

import asyncio
import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process

from hsop_gcs.mission.pipeline import Decision, PlanningRules, Situation, decide
from hsop_gcs.placement.search import warm_up, warm_up_beside

_SPAWN = get_context("spawn")
"""The service's threads and sockets must not be copied into a worker."""
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
        self._pool = worker()
        self._warm = self._pool.submit(warm_up)
        self._beside = _SPAWN.Process(target=_warm_up_beside, daemon=True)
        self._beside.start()

    def _end(self) -> None:
        end(self._pool)
        self._beside.kill()
        self._beside.join()


def worker(*, niceness: int = 0) -> ProcessPoolExecutor:
    """Return a pool of one process that ends with this one, however this one ends."""
    return ProcessPoolExecutor(max_workers=1, mp_context=_SPAWN, initializer=_prepare, initargs=(niceness,))


def end(pool: ProcessPoolExecutor) -> None:
    """End a pool's process. What it still works on is not waited for: the answer has nowhere to go."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()
        process.join()


def _prepare(niceness: int) -> None:
    os.nice(niceness)
    parent = parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _warm_up_beside() -> None:
    _prepare(0)
    warm_up_beside()


def _decide(situation: Situation, rules: PlanningRules) -> Decision:
    return decide(situation, rules, now=time.monotonic)
