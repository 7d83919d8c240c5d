"""What one client may take of the service, and the account of what was more than that.

Every refusal is counted under one of a few categories, never under anything that the client chose.
"""

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from time import monotonic

_TOLD_EVERY_S = 60.0

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """How much clients may take. Address: the client's IP address; programs behind one proxy share one."""

    connections: int = 256
    """Open at the same time. One more closes the one that has waited for its client longest."""
    connections_per_address: int = 64
    """Connections of one address that are open at the same time."""
    connections_at_once: int = 16
    """Accepted before anything else has its turn again."""
    url_bytes: int = 8_192
    head_bytes: int = 32_768
    """Request line and headers together, and what a chunked body has around its bytes."""
    headers: int = 100
    pipelined: int = 8
    """Requests that wait on one connection behind the one that is answered."""
    head_s: float = 10.0
    """From a connection, or a request's first byte, to the end of its headers."""
    body_s: float = 30.0
    """From the end of the headers to the end of the body."""
    idle_s: int = 5
    """From an answer to the next request on the same connection."""
    read_s: float = 20.0
    """How long a client may leave an answer unread that does not fit into the network's buffers."""
    linger_s: float = 1.0
    """How long a connection stays open after it was refused, so that its client can read why."""
    unread_bytes: int = 32_000_000
    """Answers that all clients together leave unread; above that the largest goes first."""
    body_bytes: int = 1_000_000
    """One body of reports or detections."""
    question_bytes: int = 262_144
    """The body of a what-if question."""
    command_bytes: int = 65_536
    """The body of anything else."""
    held_bodies: int = 8
    """Bodies as large as they may be whose bytes one address may have waiting here."""
    requests_per_s: float = 1000.0
    """Requests of one address, steadily; a body of reports counts as one for each half millisecond that it takes."""
    burst_s: float = 2.0
    """For how many seconds' worth of requests an address that was quiet may come at once."""
    stops_per_s: float = 50.0
    """Holds and recalls of one address; what else it asks for does not count."""
    refusal_delay_s: float = 0.25
    """How long the answer waits that there were too many requests."""
    working_per_address: int = 2
    """Requests of one address that are worked on by turns; the others wait in line."""


class Excess(StrEnum):
    """What was more than its bound; the values stand in ``GET /api/v1/health``."""

    CONNECTIONS = "connections"
    FILE_DESCRIPTORS = "file descriptors"
    NOT_HTTP = "not HTTP"
    URL = "request line"
    HEAD = "headers"
    HEAD_TIME = "time for headers"
    BODY_TIME = "time for body"
    BODY = "body bytes"
    ENCODING = "content encoding"
    UNREAD = "answer not read"
    PIPELINED = "requests in line"
    REQUESTS = "requests a second"


class Account:
    """Counts what was more than its bound, and logs each category at most once a minute."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self.connections = 0
        """Open now."""
        self.excesses: Counter[Excess] = Counter()
        """Since the service started."""
        self._now = now
        self._told_s: dict[Excess, float] = {}

    def tell(self, excess: Excess, address: str) -> None:
        """Count an excess of a client at ``address``."""
        self.excesses[excess] += 1
        now_s = self._now()
        if now_s - self._told_s.get(excess, -_TOLD_EVERY_S) >= _TOLD_EVERY_S:
            self._told_s[excess] = now_s
            log.warning("too much of a client, %s: %s (%d since the start)", address, excess, self.excesses[excess])
