"""When a message was sent, on our clock: by its sender's own clock and the shortest way of late.

What waited on the link or in our own queue is older than its arrival says. A sender without a clock, or with one that
was set back, is taken at its arrival. Every sender has a clock of its own: a gimbal's began when the gimbal did.
"""

from collections import deque

_CLOCK_SET_S = 5.0
"""No message is this late: the sender's clock was set, or it restarted."""
_CLOCK_WINDOW_S = 2.0
"""How long a message counts as the one with the shortest way: a simulator short of processor time runs slow."""


class SenderClock:
    """The clock of one sender against ours."""

    def __init__(self) -> None:
        self._offsets: deque[tuple[float, float]] = deque()
        """When a message arrived, and by how much our clock was ahead: both rising, so that the first is least."""

    def sent_at(self, time_boot_ms: int, now: float) -> float:
        """Return when a message that arrived just now was sent, seconds on our clock."""
        if time_boot_ms == 0:
            return now
        boot_s = time_boot_ms * 1e-3
        offset_s = now - boot_s
        offsets = self._offsets
        if offsets and offset_s > offsets[0][1] + _CLOCK_SET_S:
            offsets.clear()
        while offsets and offsets[-1][1] >= offset_s:
            offsets.pop()
        offsets.append((now, offset_s))
        while offsets[0][0] < now - _CLOCK_WINDOW_S:
            offsets.popleft()
        return boot_s + offsets[0][1]
