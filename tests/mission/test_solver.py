"""Decisions are made in a process of their own: the event loop goes on, and a worker that dies is replaced."""

import asyncio
import os
import signal
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children

import pytest

from hsop_gcs.mission.planning import PlanningRules
from hsop_gcs.mission.solver import Solver
from tests.mission.test_host_policy import situation

RULES = PlanningRules(hosts="fewest", time_limit_s=0.5)


def test_the_event_loop_goes_on_while_a_decision_is_made() -> None:
    async def scenario() -> None:
        async with Solver() as solver:
            await solver.decide(situation(1, 2), RULES)  # from here on the kernels are compiled
            deciding = asyncio.create_task(solver.decide(situation(3, 6), RULES))
            turns = 0
            while not deciding.done():
                await asyncio.sleep(0.001)
                turns += 1
            assert (await deciding).orders
            assert turns > 10

    asyncio.run(scenario())


async def ready(solver: Solver) -> None:
    async with asyncio.timeout(120):
        while not solver.ready:
            await asyncio.sleep(0.05)


def test_a_worker_that_dies_unasked_is_replaced_and_one_that_is_stopped_does_not_keep_the_service_from_ending() -> None:
    async def scenario() -> None:
        async with Solver() as solver:
            await ready(solver)
            for worker in active_children():
                worker.kill()
            async with asyncio.timeout(10):
                while solver.restarts < 1:
                    await asyncio.sleep(0.05)
            assert not solver.ready
            await ready(solver)
            for worker in active_children():
                assert worker.pid is not None
                os.kill(worker.pid, signal.SIGSTOP)

    asyncio.run(asyncio.wait_for(scenario(), 120))


def test_a_worker_that_dies_fails_its_decision_alone() -> None:
    async def scenario() -> None:
        async with Solver() as solver:
            await solver.decide(situation(1, 2), RULES)
            deciding = asyncio.create_task(solver.decide(situation(3, 6), RULES))
            await asyncio.sleep(0)
            for worker in active_children():
                worker.kill()
            with pytest.raises(BrokenProcessPool):
                await deciding
            assert (await solver.decide(situation(1, 2), RULES)).orders

    asyncio.run(scenario())
