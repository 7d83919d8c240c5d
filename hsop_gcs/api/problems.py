"""Every error as RFC 9457 problem+json: what is wrong, with which field, and never a stack trace."""

import json
import logging
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from itertools import islice
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from hsop_gcs.errors import BadInput, HsopError, NotKnown, Refused

MEDIA_TYPE = "application/problem+json"
_STATUS_OF = {BadInput: 422, NotKnown: 404, Refused: 409}

MAX_SHOWN = 80
"""Characters of a value, or of a field's name, that are shown of what a client sent."""
MAX_FAULTS = 8
"""Faults of one body, or one report, that are told; the rest are mostly the same."""
_MAX_DETAIL = 500
_FEW = 4

log = logging.getLogger(__name__)


def body_of(status: int, detail: str, **more: Any) -> dict[str, Any]:
    """Return what a problem says; ``more`` are extension members."""
    detail = clipped(detail)
    return {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail, **more}


def problem(status: int, detail: str, *, headers: Mapping[str, str] | None = None, **more: Any) -> JSONResponse:
    """Return a problem answer; ``more`` are extension members."""
    return _ProblemAnswer(body_of(status, detail, **more), status_code=status, headers=headers)


def faults_of(errors: Sequence[Any]) -> list[dict[str, str]]:
    """Return pydantic's first errors as field and problem, with the value that was given."""
    faults = []
    for error in errors[:MAX_FAULTS]:
        field = ".".join(str(part)[:MAX_SHOWN] for part in error["loc"] if part != "body") or "body"
        message = error["msg"].removeprefix("Value error, ")
        given = "" if error["type"] == "missing" else f" (given: {shown(error.get('input'))})"
        faults.append({"field": field, "problem": message[:1].lower() + message[1:] + given})
    return faults


def fault_of(error: BadInput) -> dict[str, str]:
    """Return what is wrong with a value as field and problem."""
    return {"field": clipped(error.field), "problem": clipped(error.problem)}


def install(app: FastAPI) -> None:
    """Answer every error of the application with a problem."""

    @app.exception_handler(RequestValidationError)
    async def _invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        if any(fault["type"] == "json_invalid" for fault in error.errors()):
            return problem(400, f"the body is not JSON: {error.errors()[0]['ctx']['error']}")
        faults = faults_of(error.errors())
        return problem(422, f"{faults[0]['field']}: {faults[0]['problem']}", errors=faults)

    @app.exception_handler(HsopError)
    async def _told(_: Request, error: HsopError) -> JSONResponse:
        status = next((status for kind, status in _STATUS_OF.items() if isinstance(error, kind)), 503)
        if isinstance(error, BadInput):
            return problem(status, str(error), errors=[fault_of(error)])
        return problem(status, str(error))

    @app.exception_handler(NotJson)
    async def _no_json(_: Request, error: NotJson) -> JSONResponse:
        return problem(400, f"body: {error}")

    @app.exception_handler(TooManyFields)
    async def _fields(_: Request, error: TooManyFields) -> JSONResponse:
        return problem(422, f"body: {error.detail}", errors=[{"field": "body", "problem": error.detail}])

    @app.exception_handler(HTTPException)
    async def _http(_: Request, error: HTTPException) -> JSONResponse:
        answer = problem(error.status_code, str(error.detail))
        answer.headers.update(error.headers or {})
        return answer

    @app.exception_handler(Exception)
    async def _fault(request: Request, error: Exception) -> JSONResponse:
        log.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return problem(500, "an internal fault; the service's log has the details")


class NotJson(Exception):
    """A body that is no JSON; says where it ends being so."""


class TooManyFields(HTTPException):
    """A body with more fields than any request has; the framework lets this one pass from where it reads bodies."""

    def __init__(self, count: int, most: int) -> None:
        super().__init__(422, f"{count} fields; no request has more than {most}")


class _ProblemAnswer(JSONResponse):
    """Escapes all that is not ASCII: what is shown of a bad request may be no text that UTF-8 can carry."""

    media_type = MEDIA_TYPE

    def render(self, content: Any) -> bytes:
        return json.dumps(content).encode()


def shown(value: object, levels: int = 2) -> str:
    """Return a value that somebody gave, short, without looking through all of it; ``levels``: of what is nested."""
    if isinstance(value, str):
        text = repr(value[:MAX_SHOWN])
    elif isinstance(value, dict | list) and len(value) > 0 and levels == 0:
        text = "{...}" if isinstance(value, dict) else "[...]"
    elif isinstance(value, dict):
        items = [f"{shown(name)}: {shown(each, levels - 1)}" for name, each in islice(value.items(), _FEW)]
        text = "{" + ", ".join(items + ["..."] * (len(value) > _FEW)) + "}"
    elif isinstance(value, list):
        items = [shown(each, levels - 1) for each in islice(value, _FEW)]
        text = "[" + ", ".join(items + ["..."] * (len(value) > _FEW)) + "]"
    else:
        text = repr(value)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def clipped(text: str) -> str:
    """Return a sentence that may quote a client, no longer than anybody reads."""
    return text if len(text) <= _MAX_DETAIL else text[: _MAX_DETAIL - 3] + "..."
