"""What answers while the service starts: its port is open before there is a mission to speak of.

starting: everything ──► 503, what is awaited        started: everything ──► the API
"""

from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from hsop_gcs.api.problems import problem

READY_PATH = "/api/v1/ready"


class Front:
    """The application of the service's port; ``open`` puts the API behind it."""

    def __init__(self) -> None:
        self.awaited = {"mission": "the journal is being read and the links are being opened"}
        """What the API waits for, each with the reason."""
        self._api: ASGIApp | None = None

    def open(self, api: ASGIApp) -> None:
        """Let the API answer from now on."""
        self._api = api

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._api is not None:
            await self._api(scope, receive, send)
            return
        answer: Response
        if scope["path"] == READY_PATH:
            answer = readiness(self.awaited)
        else:
            answer = problem(503, f"the service is starting: {'; '.join(self.awaited.values())}")
            answer.headers["Retry-After"] = "1"
        await answer(scope, receive, send)


def readiness(awaited: dict[str, str]) -> JSONResponse:
    """Return the answer to whether the service is ready: 200 if nothing is awaited, else 503."""
    return JSONResponse({"ready": not awaited, "awaited": awaited}, status_code=503 if awaited else 200)
