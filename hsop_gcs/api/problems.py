"""Every error as RFC 9457 problem+json: what is wrong, with which field, and never a stack trace."""

import json
import logging
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hsop_gcs.errors import BadInput, HsopError, NotKnown, Refused

MEDIA_TYPE = "application/problem+json"
_STATUS_OF = {BadInput: 422, NotKnown: 404, Refused: 409}

log = logging.getLogger(__name__)


def problem(status: int, detail: str, **more: Any) -> JSONResponse:
    """Return a problem answer; ``more`` are extension members."""
    body = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail, **more}
    return _ProblemAnswer(body, status_code=status)


def faults_of(errors: Sequence[Any]) -> list[dict[str, str]]:
    """Return pydantic's errors as field and problem, with the value that was given."""
    faults = []
    for error in errors:
        field = ".".join(str(part) for part in error["loc"] if part != "body") or "body"
        message = error["msg"].removeprefix("Value error, ")
        given = "" if error["type"] == "missing" else f" (given: {_short(error.get('input'))})"
        faults.append({"field": field, "problem": message[:1].lower() + message[1:] + given})
    return faults


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
        faults = {"errors": [{"field": error.field, "problem": error.problem}]} if isinstance(error, BadInput) else {}
        return problem(_STATUS_OF.get(type(error), 503), str(error), **faults)

    @app.exception_handler(HTTPException)
    async def _http(_: Request, error: HTTPException) -> JSONResponse:
        answer = problem(error.status_code, str(error.detail))
        answer.headers.update(error.headers or {})
        return answer

    @app.exception_handler(Exception)
    async def _fault(request: Request, error: Exception) -> JSONResponse:
        log.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return problem(500, "an internal fault; the service's log has the details")


class _ProblemAnswer(JSONResponse):
    """Escapes all that is not ASCII: what is shown of a bad request may be no text that UTF-8 can carry."""

    media_type = MEDIA_TYPE

    def render(self, content: Any) -> bytes:
        return json.dumps(content).encode()


class PlainErrorsAsProblems:
    """Turns an error that a middleware below answers in plain text into a problem like all others."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        replaced: JSONResponse | None = None

        async def send_problem(message: Message) -> None:
            nonlocal replaced
            if message["type"] == "http.response.start" and message["status"] >= 400:
                kind = Headers(raw=message["headers"]).get("content-type", "")
                if kind.startswith("text/plain"):
                    status = message["status"]
                    replaced = problem(status, HTTPStatus(status).phrase)
                    return
            if replaced is None:
                await send(message)
            elif not message.get("more_body", False):
                await replaced(scope, receive, send)

        await self._app(scope, receive, send_problem)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
