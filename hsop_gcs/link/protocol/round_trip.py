"""How long a message takes to a vehicle and back, by TIMESYNC.

    every two seconds:  tc1 = 0, ts1 = our clock ──►  the vehicle fills tc1 and returns ts1  ──► one sample

Source: MAVLink developer guide, "Time synchronization protocol v2".
"""

from collections import deque
from statistics import median

from hsop_gcs.link.events import Event
from hsop_gcs.link.messages import Message, Timesync

_PERIOD_S = 2.0
_OUTSTANDING = 4
"""An answer later than this many questions counts for nothing."""
_SAMPLES = 5


class RoundTrip:
    """Measures while the link is up."""

    def __init__(self) -> None:
        self._asked: deque[tuple[int, float]] = deque(maxlen=_OUTSTANDING)
        self._samples: deque[float] = deque(maxlen=_SAMPLES)
        self._due_s: float | None = None
        self._outgoing: list[Message] = []

    @property
    def seconds(self) -> float | None:
        """Median of the newest answers; None before the first."""
        return median(self._samples) if self._samples else None

    @property
    def wake_at(self) -> float | None:
        """When to ask again; None while the link is down."""
        return self._due_s

    def link_up(self, now: float) -> None:
        """Begin to ask."""
        self._due_s = now + _PERIOD_S / 2
        self._samples.clear()

    def link_lost(self) -> None:
        """Cease to ask."""
        self._due_s = None
        self._samples.clear()
        self._asked.clear()

    def receive(self, message: Message, now: float) -> None:
        """Take the answer to a question of ours; every question counts once."""
        if not isinstance(message, Timesync) or message.tc1 == 0:
            return
        for asked in self._asked:
            if asked[0] == message.ts1:
                self._asked.remove(asked)
                self._samples.append(now - asked[1])
                return

    def advance(self, now: float) -> None:
        """Ask if it is time."""
        if self._due_s is not None and now >= self._due_s:
            stamp_ns = round(now * 1e9)
            self._asked.append((stamp_ns, now))
            self._outgoing.append(Timesync(ts1=stamp_ns))
            self._due_s = now + _PERIOD_S

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent, once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def take_events(self) -> list[Event]:
        """Measuring has no events."""
        return []
