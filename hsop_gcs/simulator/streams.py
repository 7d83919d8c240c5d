"""Which messages a vehicle sends unasked, and when each is due."""

import math


class Streams:
    """Message id -> interval, seconds. Messages due at one moment come in the order in which they were set."""

    def __init__(self, defaults: dict[int, float], now: float) -> None:
        self._defaults = defaults
        self._interval_s: dict[int, float] = {}
        self._due: dict[int, float] = {}
        for message_id, interval_s in defaults.items():
            self._interval_s[message_id] = interval_s
            self._due[message_id] = now

    @property
    def next_due(self) -> float:
        """When the next message is due; infinity if none is streamed."""
        return min(self._due.values(), default=math.inf)

    def interval_s(self, message_id: int) -> float | None:
        """Return the present interval, None for a message that is not streamed."""
        return self._interval_s.get(message_id)

    def set(self, message_id: int, interval_s: float, now: float) -> None:
        """Stream a message from one interval after ``now`` on."""
        self._interval_s[message_id] = interval_s
        self._due[message_id] = now + interval_s

    def stop(self, message_id: int) -> None:
        self._interval_s.pop(message_id, None)
        self._due.pop(message_id, None)

    def reset(self, message_id: int, now: float) -> None:
        """Return to what a fresh link has."""
        self.stop(message_id)
        if message_id in self._defaults:
            self.set(message_id, self._defaults[message_id], now)

    def take_due(self, now: float) -> list[int]:
        """Return the ids due by ``now``, each once, and schedule their next turn."""
        due = [message_id for message_id, at in self._due.items() if at <= now]
        for message_id in due:
            interval_s = self._interval_s[message_id]
            self._due[message_id] += math.floor((now - self._due[message_id]) / interval_s) * interval_s
            while self._due[message_id] <= now:
                self._due[message_id] += interval_s
        return due
