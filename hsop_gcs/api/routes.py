"""The REST API, /api/v1."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any

from fastapi import APIRouter, FastAPI, Path, Query, Request
from fastapi.responses import Response
from pydantic import TypeAdapter
from starlette.routing import Route

from hsop_gcs.api import detections, intake, placements, views
from hsop_gcs.api.bodies import MAX_AT_ONCE, Pace
from hsop_gcs.api.bounds import Account, Bounds
from hsop_gcs.api.commands import BoundedRoute, distinct
from hsop_gcs.api.examples import ANSWERS
from hsop_gcs.api.front import readiness
from hsop_gcs.api.gate import Gate, share_of
from hsop_gcs.api.picture import PictureAsJson
from hsop_gcs.api.problems import MEDIA_TYPE, install, problem
from hsop_gcs.api.schemas import (
    ApprovalIn,
    EventOut,
    HealthOut,
    HoldIn,
    HostOut,
    HostsIn,
    HostsOut,
    PlansOut,
    ReadyOut,
    RecalledOut,
    RegisterIn,
    ReportIn,
    ReportResults,
    TakeOffIn,
    ThreatOut,
)
from hsop_gcs.mission.controller import Mission

_REF = "#/components/schemas/{model}"
_PROBLEM: dict[str, Any] = {
    "description": "What is wrong, with the field and the value",
    "content": {MEDIA_TYPE: {"schema": {"$ref": _REF.format(model="Problem")}}},
}


def _problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    return dict.fromkeys(statuses, _PROBLEM)


_JSON = "application/json"
MAX_THREAT_ID = 256
"""Characters; one of two sources that use the same id has its source's name before it."""
_HOSTS = TypeAdapter(list[HostOut])
_EVENTS = TypeAdapter(list[EventOut])


def create_api(
    mission: Mission, what_if: placements.WhatIf, bounds: Bounds | None = None, account: Account | None = None
) -> FastAPI:
    """Return the application that serves one mission, and answers what-if questions, to each client its share."""
    account = account or Account()
    app = FastAPI(
        title="hsop_gcs",
        summary="Threat reports in; hover points, headings and camera aims out.",
        version="1",
        redirect_slashes=False,
    )
    app.include_router(_routes(mission, account))
    app.include_router(placements.routes(what_if))
    install(app)
    app.add_middleware(Gate, bounds=bounds or Bounds(), account=account)
    _describe_more(app)
    return app


def _routes(mission: Mission, account: Account) -> APIRouter:
    router = APIRouter(prefix="/api/v1", route_class=BoundedRoute)
    started_at_s = mission.clock()
    turn = asyncio.Lock()
    picture = PictureAsJson(mission, turn)

    @router.post(
        "/reports",
        response_model=ReportResults,
        operation_id="postReports",
        responses=_problems(400, 413, 422),
        openapi_extra=_one_or_many("ReportIn"),
    )
    async def post_reports(request: Request) -> Response:
        """Report one threat, or many; each is judged by itself and answered at its own index.

        200 if at least one was accepted, 422 if none was.
        """
        async with _charged(request, turn) as pace:
            return _judged(await intake.take(await request.body(), mission, pace))

    @router.post(
        "/detections",
        response_model=detections.DetectionResults,
        operation_id="postDetections",
        responses=_problems(400, 413, 422),
        openapi_extra=_one_or_many("DetectionIn"),
    )
    async def post_detections(request: Request) -> Response:
        """Tell what a host's camera saw, or many such sights; each is judged by itself.

        200 if at least one was accepted, 422 if none was.
        """
        async with _charged(request, turn) as pace:
            body, refuse = await request.body(), mission.refuse_report
            return _judged(await detections.take(body, mission.fleet, mission.detect, refuse, pace))

    @router.get("/threats", operation_id="getThreats", response_model=list[ThreatOut])
    async def get_threats() -> Response:
        """All threats in the picture, each at its newest report."""
        return Response(await picture.threats(), media_type=_JSON)

    @router.delete(
        "/threats/{threat_id:path}", operation_id="dismissThreat", status_code=204, responses=_problems(404, 422)
    )
    async def dismiss_threat(threat_id: Annotated[str, Path(max_length=MAX_THREAT_ID)]) -> None:
        """Take a threat out of the picture, and refuse its sources' reports of it for five minutes."""
        mission.dismiss(threat_id)

    @router.get("/hosts", operation_id="getHosts", response_model=list[HostOut])
    async def get_hosts() -> Response:
        """All hosts of the fleet: link, state, newest order and how far it is carried out."""
        return Response(_HOSTS.dump_json(views.hosts_out(mission)), media_type=_JSON)

    @router.get("/plan", operation_id="getPlan")
    async def get_plan() -> PlansOut:
        """The plan that waits for approval, the one that flies, and why there is none if there is none."""
        return views.plans_out(mission)

    @router.post("/plan/approve", operation_id="approvePlan", responses=_problems(404, 409, 422, 503))
    async def approve_plan(approval: ApprovalIn) -> PlansOut:
        """Let the proposed plan fly. The id makes sure that it is the plan that was looked at."""
        mission.approve(approval.plan_id)
        return views.plans_out(mission)

    @router.post("/hosts/take-off", operation_id="takeOff", responses=_problems(404, 409, 422, 503))
    async def take_off(wanted: TakeOffIn) -> HostsOut:
        """Order hosts into the air. Nothing else in this service makes a host take off."""
        return HostsOut(hosts=mission.take_off(wanted.altitude_m, distinct(wanted.hosts, mission.fleet)))

    @router.post("/hosts/hold", operation_id="hold", responses=_problems(404, 422, 503))
    async def hold(wanted: HoldIn | None = None) -> HostsOut:
        """Stop hosts where they are, all if none is named or there is no body; from then on no plan flies without
        approval.
        """
        return HostsOut(hosts=mission.hold(None if wanted is None else distinct(wanted.hosts, mission.fleet)))

    @router.post("/hosts/recall", operation_id="recall", responses=_problems(404, 422, 503))
    async def recall(wanted: HostsIn) -> RecalledOut:
        """Send hosts home to land; they stay out of plans until released, and no plan flies without approval."""
        recalled = mission.recall(distinct(wanted.hosts, mission.fleet))
        return RecalledOut(hosts=recalled, on_the_ground=mission.on_the_ground(recalled))

    @router.post("/hosts/release", operation_id="release", responses=_problems(404, 422, 503))
    async def release(wanted: HostsIn) -> HostsOut:
        """Give hosts back to the mission. If "all" are, plans fly by its own autonomy again."""
        return HostsOut(hosts=mission.release(distinct(wanted.hosts, mission.fleet)))

    @router.post("/hosts/register", operation_id="registerHost", status_code=204, responses=_problems(404, 422))
    async def register_host(wanted: RegisterIn) -> None:
        """Listen to a host at another address than before. The address makes sure that it is the one looked at."""
        mission.register(wanted.host, wanted.address)

    @router.get("/events", operation_id="getEvents", response_model=list[EventOut], responses=_problems(422))
    async def get_events(after: Annotated[int, Query(ge=0)] = 0) -> Response:
        """What happened to hosts and orders, oldest first: the newest 500 with a number above ``after``."""
        shown = [views.event_out(event, mission) for event in mission.events if event.number > after]
        return Response(_EVENTS.dump_json(shown), media_type=_JSON)

    @router.get("/ready", operation_id="getReady", responses={503: {"model": ReadyOut}}, response_model=ReadyOut)
    async def get_ready() -> Response:
        """Whether reports are taken and plans are made: 200, or 503 with what is still awaited."""
        return readiness(mission.awaited)

    @router.get("/health", operation_id="getHealth")
    async def get_health() -> HealthOut:
        """Whether everything works, what does not, and the counters that show nothing is dropped in silence."""
        return views.health_out(mission, started_at_s, account)

    return router


def _one_or_many(model: str) -> dict[str, Any]:
    one = {"$ref": _REF.format(model=model)}
    schema = {"anyOf": [one, {"type": "array", "items": one, "maxItems": MAX_AT_ONCE}]}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


@asynccontextmanager
async def _charged(request: Request, turn: asyncio.Lock) -> AsyncIterator[Pace]:
    """Work that is parted to let others go on, and counted to its client."""
    async with Pace(turn) as pace:
        try:
            yield pace
        finally:
            share_of(request.scope).charge(pace.worked_s)


def _judged(results: ReportResults | detections.DetectionResults) -> Response:
    """The results, or a problem if nothing was accepted: the first fault, and all of them behind it."""
    if results.accepted > 0:
        return Response(results.model_dump_json(), media_type=_JSON)
    first = results.results[0].errors
    return problem(
        422,
        f"{first[0].field}: {first[0].problem}",
        errors=[fault.model_dump() for fault in first],
        results=[result.model_dump(mode="json") for result in results.results],
    )


def _describe_more(app: FastAPI) -> None:
    """Add to the OpenAPI document what no route's signature shows: requests judged by hand, problems and examples."""
    generate = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = generate()
            schemas = document["components"]["schemas"]
            for model in (ReportIn, detections.DetectionIn):
                schema = model.model_json_schema(ref_template=_REF)
                schemas.update(schema.pop("$defs"))
                schemas[model.__name__] = schema
            schemas["Problem"] = {
                "title": "Problem",
                "description": "RFC 9457 problem details.",
                "type": "object",
                "required": ["type", "title", "status", "detail"],
                "properties": {
                    "type": {"type": "string"},
                    "title": {"type": "string"},
                    "status": {"type": "integer"},
                    "detail": {"type": "string"},
                    "errors": {"type": "array", "items": {"$ref": _REF.format(model="FieldFault")}},
                },
            }
            for name in ANSWERS.keys() & schemas.keys():
                schemas[name]["examples"] = [ANSWERS[name]]
        return app.openapi_schema or {}

    app.openapi = openapi  # type: ignore[method-assign]

    async def document(_: Request) -> Response:
        # made when it is first asked for, which takes a tenth of a second
        return Response(await asyncio.to_thread(lambda: json.dumps(app.openapi())), media_type=_JSON)

    app.router.routes.insert(0, Route("/openapi.json", document))
