"""One client's connection: uvicorn's HTTP/1.1 over httptools, with bounds that httptools does not have.

    waiting ──first byte──> head ──headers──> body ──end──> answering ──answered──> waiting
       │                     │                 │
       └──── idle ───────────┴── deadline ─────┴──────> refused: answered why, read on for a moment, closed

httptools keeps whatever it is given of a header until the header is complete, and knows no time.
"""

import asyncio
import json
from collections.abc import Callable
from http import HTTPStatus

import httptools
import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from hsop_gcs.api.bounds import Account, Bounds, Excess
from hsop_gcs.api.problems import MEDIA_TYPE, body_of

_SLICE = 65_536
"""Bytes that are parsed between two looks at whether a request is too large."""
_CLOSING_S = 5.0
"""How long a closed connection may take to hand its last bytes to the network."""


class _Stop(Exception):
    """Ends parsing from within the parser."""


class Connection(HttpToolsProtocol):
    """A connection that is refused as soon as it is more than its bounds; see the module's diagram."""

    def __init__(
        self,
        config: uvicorn.Config,
        state: ServerState,
        bounds: Bounds,
        account: Account,
        address: str,
        on_begin: Callable[["Connection"], None],
        on_end: Callable[["Connection"], None],
    ) -> None:
        super().__init__(config, state, {})
        self.address = address
        self.since_s = self.loop.time()
        """Since when it has waited for its client; loop time."""
        self.answered = False
        """Whether it has ever been of use."""
        self._bounds, self._account = bounds, account
        self._on_begin, self._on_end = on_begin, on_end
        self._deadline_s: float | None = self.since_s + bounds.head_s
        self._late = Excess.HEAD_TIME
        self._began = False
        """Whether the request that is read began in the newest slice."""
        self._around = 0
        """Bytes of the request that is read, but for the slice in which it began, less twice those of its body."""
        self._body_in_slice = 0
        self._plain_left = 0
        """Bytes still to come of a body that the parser does not take for one."""
        self._excess: tuple[Excess, HTTPStatus, str] | None = None
        self._refused = False
        """Nothing is parsed any more."""
        self._unread_since_s: float | None = None
        self._closing_since_s: float | None = None

    @property
    def waits(self) -> bool:
        """Whether it waits for its client: with the service's own work on it, it does not."""
        return self.cycle is None or self.cycle.response_complete or self.cycle.more_body or self._refused

    @property
    def unread_bytes(self) -> int:
        """What its client has not taken of its answers yet."""
        size: int = self.transport.get_write_buffer_size()
        return size

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._on_begin(self)

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._unset_keepalive_if_required()
        self._on_end(self)

    def data_received(self, data: bytes) -> None:
        if self._refused:
            return
        self._unset_keepalive_if_required()
        if self._deadline_s is None and self.waits:
            self._deadline_s, self._late = self.loop.time() + self._bounds.head_s, Excess.HEAD_TIME
        for start in range(0, len(data), _SLICE):
            self._feed(data[start : start + _SLICE])
            if self._refused or self.parser is None:
                return

    def _feed(self, data: bytes) -> None:
        self._began, self._body_in_slice = False, 0
        try:
            self._parse(data)
        except httptools.HttpParserError:
            excess = self._excess or (Excess.NOT_HTTP, HTTPStatus.BAD_REQUEST, "this is not HTTP/1.1")
            self.refuse(*excess)
            return
        if self._deadline_s is None:
            return
        if not self._began:
            self._around = max(0, self._around + len(data) - 2 * self._body_in_slice)
        if self._around > self._bounds.head_bytes or len(self.headers or ()) > self._bounds.headers:
            self.refuse(*self._too_long())

    def _parse(self, data: bytes) -> None:
        data = self._take_plain(data)
        while data:
            try:
                self.parser.feed_data(data)
            except httptools.HttpParserUpgrade as upgrade:
                # nothing else is spoken here: the request is answered as if it had not asked
                data = self._take_plain(data[upgrade.args[0] :])
            else:
                return

    def _take_plain(self, data: bytes) -> bytes:
        """Take what is a body's that the parser leaves alone; return the rest."""
        if self._plain_left == 0 or not data:
            return data
        body, rest = data[: self._plain_left], data[self._plain_left :]
        self._plain_left -= len(body)
        self.on_body(body)
        if self._plain_left == 0:
            self._complete()
        return rest

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._began, self._around = True, 0
        if self._deadline_s is None:
            self._deadline_s = self.loop.time() + self._bounds.head_s
        self._late = Excess.HEAD_TIME

    def on_url(self, url: bytes) -> None:
        super().on_url(url)
        if len(self.url) > self._bounds.url_bytes:
            self._excess = (
                Excess.URL,
                HTTPStatus.REQUEST_URI_TOO_LONG,
                f"request line: more than {self._bounds.url_bytes} bytes",
            )
            raise _Stop

    def on_headers_complete(self) -> None:
        if len(self.headers) > self._bounds.headers or self._head_bytes() > self._bounds.head_bytes:
            self._excess = self._too_long()
            raise _Stop
        if len(self.pipeline) >= self._bounds.pipelined:
            # what is in line is answered, and the last answer says that the connection closes after it
            self.pipeline[0][0].keep_alive = False
            self._excess = (Excess.PIPELINED, HTTPStatus.TOO_MANY_REQUESTS, "")
            raise _Stop
        self._deadline_s, self._late = self.loop.time() + self._bounds.body_s, Excess.BODY_TIME
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        self._body_in_slice += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        if self.parser.should_upgrade():
            # the parser counts what follows as the other protocol's, also a body
            self._plain_left = int(dict(self.headers).get(b"content-length", b"0"))
        if self._plain_left == 0:
            self._complete()

    def _complete(self) -> None:
        super().on_message_complete()
        self._deadline_s = None

    def on_response_complete(self) -> None:
        self.answered = True
        self.since_s = self.loop.time()
        super().on_response_complete()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._unread_since_s = self.loop.time()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._unread_since_s = None

    def look(self, now_s: float) -> None:
        """Close the connection if its client took longer than it may; ``now_s``: loop time."""
        if self.transport.is_closing():
            self._closing_since_s = self._closing_since_s or now_s
            if now_s - self._closing_since_s > _CLOSING_S:
                self.transport.abort()
        elif self._unread_since_s is not None and now_s - self._unread_since_s > self._bounds.read_s:
            self.drop(Excess.UNREAD)
        elif self._deadline_s is not None and now_s > self._deadline_s:
            self._run_out()

    def _run_out(self) -> None:
        if self._refused:
            self.transport.abort()
        elif self.scope is None:
            self._account.tell(self._late, self.address)
            self.transport.close()
        elif self._late is Excess.HEAD_TIME:
            limit = f"headers: not complete after {self._bounds.head_s:g} s"
            self.refuse(self._late, HTTPStatus.REQUEST_TIMEOUT, limit)
        else:
            limit = f"body: not complete after {self._bounds.body_s:g} s"
            self.refuse(self._late, HTTPStatus.REQUEST_TIMEOUT, limit)

    def drop(self, excess: Excess) -> None:
        """Close the connection without a word."""
        self._account.tell(excess, self.address)
        self.transport.abort()

    def refuse(self, excess: Excess, status: HTTPStatus, detail: str) -> None:
        """Answer why nothing more is read, and close soon. Answers that are due come first, or there is none."""
        self._account.tell(excess, self.address)
        self._refused = True
        self._deadline_s = None
        if excess is Excess.PIPELINED:
            return
        unanswered = self.cycle is not None and not self.cycle.response_complete
        if unanswered and (self.pipeline or self.cycle.response_started or not self.cycle.more_body):
            self.transport.abort()
            return
        if unanswered:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.flow.resume_reading()
        self.transport.write(_answer(status, detail))
        self.transport.write_eof()
        self._deadline_s = self.loop.time() + self._bounds.linger_s

    def _head_bytes(self) -> int:
        return len(self.url) + sum([len(name) + len(value) + 4 for name, value in self.headers])

    def _too_long(self) -> tuple[Excess, HTTPStatus, str]:
        return (
            Excess.HEAD,
            HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE,
            f"headers: more than {self._bounds.headers}, or than {self._bounds.head_bytes} bytes",
        )


def _answer(status: HTTPStatus, detail: str) -> bytes:
    """Return a problem as it goes over the wire; the connection closes behind it."""
    body = json.dumps(body_of(status, detail)).encode()
    head = (
        f"HTTP/1.1 {status.value} {status.phrase}\r\ncontent-type: {MEDIA_TYPE}\r\n"
        f"content-length: {len(body)}\r\nconnection: close\r\n\r\n"
    )
    return head.encode() + body


FULL = _answer(
    HTTPStatus.SERVICE_UNAVAILABLE, "connections: as many are open as may be, and all are at work; come again"
)
"""What a connection is told that there is no room for."""
