"""What-if placements: a scenario in, a plan or a frontier out, nothing flown.

Solved in a worker process of low priority that starts with the first question, so that neither the event loop nor the
mission's own decisions wait for it. Who asks when it has enough to do is told so. A question whose client has left is
given up, and its worker ended.
"""

import asyncio
import time
from collections import Counter
from collections.abc import Coroutine
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.types import Receive

from hsop_gcs.api.commands import BoundedRoute
from hsop_gcs.api.examples import ANSWERS
from hsop_gcs.api.gate import share_of
from hsop_gcs.api.problems import MEDIA_TYPE
from hsop_gcs.api.schemas import Number
from hsop_gcs.errors import BadInput, HsopError, Unavailable
from hsop_gcs.placement import place
from hsop_gcs.placement.frontier import frontier, frontier_to_json
from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.scenario import plan_to_json, problem_from_json
from hsop_gcs.workers import end, workers

T = TypeVar("T")

MAX_THREATS = 50
MAX_HOSTS = 2 * MAX_THREATS
MAX_KEEP_OUTS = 100
MAX_CORNERS = 1000
MAX_AT_ONCE = 3
"""One that is solved, and two that wait."""
MAX_PER_CLIENT = 2
"""Questions of one address: another address is always heard."""
NICENESS = 10
_PATIENCE_S = 60.0
"""On top of the time limit; after that the worker counts as hung."""


class PlacementIn(BaseModel):
    """A scenario, and how to place hosts for it."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        json_schema_extra={
            "examples": [
                {
                    "scenario": {
                        "threats": [{"id": "t1", "position_m": [12.0, 40.0, 0.0], "velocity_mps": [1.5, -0.5, 0.0]}]
                    },
                    "n_hosts": 2,
                }
            ]
        },
    )

    scenario: Annotated[dict[str, Any], Field(description="a scenario file: threats, and optionally hosts, parameters")]
    n_hosts: Annotated[int | None, Field(ge=2, strict=True, description="by default the fewest that see all")] = None
    target_error_m: Annotated[
        Number | None, Field(gt=0, le=1e6, description="instead: the fewest that bring every expected error to this")
    ] = None
    frontier: Annotated[bool, Field(strict=True, description="a plan for every number of hosts")] = False
    formulation: Formulation = Formulation.OPERATIONAL
    objective: Objective = Objective.LETTER
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 0
    time_limit_s: Annotated[Number, Field(gt=0, le=10)] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What the worker is asked."""

    problem: Problem
    n_hosts: int | None
    target_error_m: float | None
    frontier: bool
    seed: int
    time_limit_s: float


class WhatIf:
    """Answers questions one after the other in a process of its own. Use as an async context manager."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._asked: Counter[str] = Counter()
        """Questions that are solved or wait, by the address that asked; addresses without any are left out."""
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> "WhatIf":
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._end_pool()

    async def answer(self, question: Question, client: str = "") -> dict[str, Any]:
        """Return a plan file's content, or a frontier file's. Cancelled, it gives the question up.

        client: the address that asks. Raises Unavailable when there are enough questions already, of all clients or
        of this one, and when the worker died or hung.
        """
        if self._asked.total() >= MAX_AT_ONCE or self._asked[client] >= MAX_PER_CLIENT:
            raise Unavailable(
                f"{self._asked.total()} what-if placements are being made or wait, {self._asked[client]} of this"
                f" client; the limits are {MAX_AT_ONCE} and {MAX_PER_CLIENT}: ask again when they are done"
            )
        self._asked[client] += 1
        try:
            async with self._turn:
                return await self._solve(question)
        finally:
            self._asked[client] -= 1
            self._asked += Counter()  # forgets who asks no more

    async def _solve(self, question: Question) -> dict[str, Any]:
        self._pool = self._pool or workers(niceness=NICENESS)
        answered = False
        try:
            async with asyncio.timeout(question.time_limit_s + _PATIENCE_S):
                found: dict[str, Any] = await asyncio.get_running_loop().run_in_executor(self._pool, solve, question)
            answered = True
            return found
        except (BrokenProcessPool, TimeoutError) as error:
            raise Unavailable(f"the what-if worker did not answer ({type(error).__name__}); ask again") from error
        except HsopError:
            answered = True
            raise
        finally:
            if not answered:
                await self._end_pool()

    async def _end_pool(self) -> None:
        pool, self._pool = self._pool, None
        if pool is not None:
            await asyncio.to_thread(end, pool)


async def unless_left(work: Coroutine[Any, Any, T], receive: Receive) -> T | None:
    """Return what comes of work for a client; None, and the work is cancelled, if the client leaves before."""
    working, leaving = asyncio.ensure_future(work), asyncio.ensure_future(_left(receive))
    try:
        await asyncio.wait((working, leaving), return_when=asyncio.FIRST_COMPLETED)
        return working.result() if working.done() else None
    finally:
        for task in (working, leaving):
            task.cancel()
        await asyncio.gather(working, leaving, return_exceptions=True)


async def _left(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass


def solve(question: Question) -> dict[str, Any]:
    """Answer a question: the worker's part."""
    # Imported here so that the service's own process does without the compiled kernels.
    from hsop_gcs.placement.search import warm_up

    warm_up()
    if question.frontier:
        found = frontier(question.problem, seed=question.seed, time_limit_s=question.time_limit_s, now=time.monotonic)
        if found:
            return frontier_to_json(found)
    placement = place(
        question.problem,
        n_hosts=question.n_hosts,
        target_error_m=question.target_error_m,
        seed=question.seed,
        time_limit_s=question.time_limit_s,
        now=time.monotonic,
        partial=True,
    )
    return plan_to_json(placement)


def to_question(given: PlacementIn) -> Question:
    """Return what is asked. Raises BadInput naming the field of the scenario, or options that do not go together."""
    for name, most in (("threats", MAX_THREATS), ("hosts", MAX_HOSTS), ("keep_outs", MAX_KEEP_OUTS)):
        _require_at_most(given.scenario.get(name), most, f"scenario.{name}")
    _require_at_most(given.scenario.get("fence"), MAX_CORNERS, "scenario.fence")
    for number, area in enumerate(given.scenario.get("keep_outs") or ()):
        if isinstance(area, dict):
            _require_at_most(area.get("polygon"), MAX_CORNERS, f"scenario.keep_outs[{number}].polygon")
    try:
        problem = problem_from_json(given.scenario, formulation=given.formulation, objective=given.objective)
    except BadInput as error:
        raise BadInput(f"scenario.{error.field}", error.problem) from None
    threats = len(problem.threats)
    if given.n_hosts is not None and given.n_hosts > 2 * threats:
        raise BadInput("n_hosts", f"{given.n_hosts} is outside 2..{2 * threats}: more than two per threat have no use")
    options = {"n_hosts": given.n_hosts, "target_error_m": given.target_error_m, "frontier": given.frontier or None}
    chosen = [name for name, value in options.items() if value is not None]
    if len(chosen) > 1:
        raise BadInput(chosen[1], f"does not go together with {chosen[0]}: each says how many hosts there are")
    return Question(
        problem=problem,
        n_hosts=given.n_hosts,
        target_error_m=given.target_error_m,
        frontier=given.frontier,
        seed=given.seed,
        time_limit_s=given.time_limit_s,
    )


def _require_at_most(items: Any, most: int, field: str) -> None:
    """Refuse a list that is too long before anything looks at what is in it."""
    if isinstance(items, list) and len(items) > most:
        raise BadInput(field, f"must be at most {most}, not {len(items)}")


def routes(what_if: WhatIf) -> APIRouter:
    """Return the route that answers what-if questions."""
    router = APIRouter(prefix="/api/v1", route_class=BoundedRoute)
    trouble = {
        "description": "What is wrong, with the field and the value",
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }

    shown = {"content": {"application/json": {"example": ANSWERS["PlanFile"]}}}

    @router.post(
        "/placements",
        operation_id="postPlacement",
        response_model=dict[str, Any],
        responses={200: shown, **dict.fromkeys((400, 413, 422, 503), trouble)},
    )
    async def post_placement(request: Request, given: PlacementIn) -> Response:
        """Place hosts for a scenario, without flying anything.

        Answers a plan file, also for an infeasible scenario (its ``status`` and ``reason`` say so), or with
        ``frontier`` a list of them, one for each number of hosts. Where not all threats can be seen, or not in the time
        limit, the most valuable ones are: then ``status`` is ``partial``, and ``left_out`` has the others, and why. In
        the operational formulation only.
        """
        question = to_question(given)
        share_of(request.scope).give_way()
        client = "" if request.client is None else request.client.host
        # a client that has left reads no answer
        return JSONResponse(await unless_left(what_if.answer(question, client), request.receive))

    return router
