"""What stands before the routes: how much each client may ask, its body as a whole, and whose turn it is.

One address has its share of requests a second, and a few of its requests are worked on by turns, so that a flood of
one waits for itself and not the others for it. Holds and recalls have a share of their own and wait for no turn.
"""

import asyncio
import math
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from time import monotonic

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hsop_gcs.api.bounds import Account, Bounds, Excess
from hsop_gcs.api.problems import problem, shown

STOPS = frozenset({"/api/v1/hosts/hold", "/api/v1/hosts/recall"})
_SHARE = "hsop_gcs.share"
_ADDRESSES = 4096
"""Whose requests are counted at the same time; who has been quiet longest is forgotten."""
_REQUEST_S = 0.0005
"""Processor time that counts as one request."""
_MOST_OWED_S = 30.0


class Allowance:
    """Token buckets, one for each address: requests a second, and a burst of them."""

    def __init__(self, per_s: float, burst_s: float) -> None:
        self.per_s = per_s
        self._most = max(1.0, per_s * burst_s)
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()
        """What each address may still ask for, and when that was so."""

    def wait_s(self, address: str, now_s: float) -> float:
        """Take one request; return 0, or how long the address has to wait until it may ask again."""
        left = self._left_at(address, now_s)
        granted = left >= 1.0
        self._keep(address, left - granted, now_s)
        return 0.0 if granted else (1.0 - left) / self.per_s

    def charge(self, address: str, requests: float, now_s: float) -> None:
        """Take the worth of more requests for one that was granted; the address may come to owe some."""
        self._keep(address, max(self._left_at(address, now_s) - requests, -_MOST_OWED_S * self.per_s), now_s)

    def _left_at(self, address: str, now_s: float) -> float:
        left, then_s = self._left.get(address, (self._most, now_s))
        return min(self._most, left + (now_s - then_s) * self.per_s)

    def _keep(self, address: str, left: float, now_s: float) -> None:
        self._left[address] = (left, now_s)
        self._left.move_to_end(address)
        if len(self._left) > _ADDRESSES:
            self._left.popitem(last=False)


class Share:
    """One request's part of the service."""

    def __init__(self, charge: Callable[[float], None], release: Callable[[], None]) -> None:
        self._charge, self._release = charge, release

    def charge(self, worked_s: float) -> None:
        """Count a request that took so much processor time as several."""
        self._charge(worked_s / _REQUEST_S)

    def give_way(self) -> None:
        """End the request's turn: from now on it waits for something else."""
        self._release()
        self._release = lambda: None


def share_of(scope: Scope) -> Share:
    """Return the part of the service that a request has."""
    share: Share = scope[_SHARE]
    return share


class Turns:
    """A few requests of each address at a time; the others in the order in which they came."""

    def __init__(self, at_once: int) -> None:
        self._at_once = at_once
        self._lines: dict[str, tuple[asyncio.Semaphore, int]] = {}

    @asynccontextmanager
    async def of(self, address: str) -> AsyncIterator[Callable[[], None]]:
        """Wait for a turn; it ends with the block, or when what is yielded is called."""
        line, users = self._lines.get(address, (asyncio.Semaphore(self._at_once), 0))
        self._lines[address] = (line, users + 1)
        held = False

        def release() -> None:
            nonlocal held
            if held:
                held = False
                line.release()

        try:
            await line.acquire()
            held = True
            yield release
        finally:
            release()
            _, users = self._lines[address]
            if users > 1:
                self._lines[address] = (line, users - 1)
            else:
                del self._lines[address]


class Gate:
    """ASGI middleware: lets a request through to the routes in its turn, with its body, or answers why not."""

    def __init__(self, app: ASGIApp, bounds: Bounds, account: Account, now: Callable[[], float] = monotonic) -> None:
        self._app, self._bounds, self._account, self._now = app, bounds, account, now
        self._allowance = Allowance(bounds.requests_per_s, bounds.burst_s)
        self._stops = Allowance(bounds.stops_per_s, bounds.burst_s)
        self._turns = Turns(bounds.working_per_address)
        self._held: Counter[str] = Counter()
        """Bytes of bodies that wait here, by address; addresses without any are left out."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        address, stops = (scope.get("client") or ("",))[0], scope["path"] in STOPS
        allowance = self._stops if stops else self._allowance
        wait_s = allowance.wait_s(address, self._now())
        if wait_s > 0:
            self._account.tell(Excess.REQUESTS, address)
            # who does not wait by himself is made to: answers by the thousand cost more than they are worth
            await asyncio.sleep(self._bounds.refusal_delay_s)
            await _too_many(allowance.per_s, wait_s)(scope, receive, send)
            return

        def charge(requests: float) -> None:
            allowance.charge(address, requests, self._now())

        body = _Body(self._bounds, self._account, self._held, scope, address)
        try:
            refusal = await body.read(receive)
            if refusal is not None:
                await refusal(scope, receive, send)
            elif body.complete and stops:
                scope[_SHARE] = Share(charge, lambda: None)
                await self._app(scope, body.again(receive), send)
            elif body.complete:
                async with self._turns.of(address) as give_way:
                    scope[_SHARE] = Share(charge, give_way)
                    await self._app(scope, body.again(receive), send)
        finally:
            body.let_go()


class _Body:
    """A request's body, read as a whole before its turn comes: a slow one holds up nobody."""

    def __init__(self, bounds: Bounds, account: Account, held: Counter[str], scope: Scope, address: str) -> None:
        self.complete = False
        """False after reading: the client has left."""
        self._bounds, self._account, self._held = bounds, account, held
        self._headers, self._address = Headers(scope=scope), address
        self._limit = _limit(scope["path"], bounds)
        self._content = bytearray()

    async def read(self, receive: Receive) -> Response | None:
        """Read all of it; return an answer if it cannot be taken."""
        encoding = self._headers.get("content-encoding", "identity")
        if encoding.lower() != "identity":
            self._account.tell(Excess.ENCODING, self._address)
            return problem(415, f"content-encoding: {shown(encoding)}; a body is taken as it is, without any")
        announced = self._headers.get("content-length", "0")
        if int(announced) > self._limit:
            return self._too_large(announced)
        while not self.complete:
            message = await receive()
            if message["type"] == "http.disconnect":
                return None
            self.complete = not message.get("more_body", False)
            content = message.get("body", b"")
            self._content += content
            self._held[self._address] += len(content)
            if len(self._content) > self._limit:
                return self._too_large(f"more than {self._limit}")
            if self._held[self._address] > self._bounds.held_bodies * self._bounds.body_bytes:
                self._account.tell(Excess.BODY, self._address)
                return problem(
                    503,
                    f"body: {self._held[self._address]} bytes of this client wait to be read;"
                    f" the limit is {self._bounds.held_bodies * self._bounds.body_bytes}",
                    headers={"retry-after": "1"},
                )
        return None

    def again(self, receive: Receive) -> Receive:
        """Return what gives the body to the routes, and after that what comes from the client."""
        given = False

        async def receive_again() -> Message:
            nonlocal given
            if given:
                return await receive()
            given = True
            return {"type": "http.request", "body": bytes(self._content), "more_body": False}

        return receive_again

    def let_go(self) -> None:
        """Count its bytes no more."""
        self._held[self._address] -= len(self._content)
        if not self._held[self._address]:
            del self._held[self._address]

    def _too_large(self, size: str) -> Response:
        self._account.tell(Excess.BODY, self._address)
        fault = f"{shown(size)} bytes; at most {self._limit} are taken"
        status = 413 if self._limit == self._bounds.body_bytes else 422
        return problem(status, f"body: {fault}", errors=[{"field": "body", "problem": fault}])


def _limit(path: str, bounds: Bounds) -> int:
    match path:
        case "/api/v1/reports" | "/api/v1/detections":
            return bounds.body_bytes
        case "/api/v1/placements":
            return min(bounds.question_bytes, bounds.body_bytes)
        case _:
            return min(bounds.command_bytes, bounds.body_bytes)


def _too_many(per_s: float, wait_s: float) -> Response:
    return problem(
        429,
        f"requests: more than {per_s:g} a second of this client",
        headers={"retry-after": str(math.ceil(wait_s))},
    )
