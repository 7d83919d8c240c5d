"""Faults of our own: what must not happen, and must not spread when it does.

What a radio brings is noise and is counted elsewhere; here is an exception out of our own code, whatever set it off. It
costs the frame, the vehicle or the listener that it came from: counted, told, and gone on.
"""

import traceback
from collections import Counter

_TOLD_AGAIN_S = 10.0
_PROBLEM_FOR_S = 60.0
_QUIET_S = 10.0
"""So long without another fault, and a vehicle whose machines failed more than once is trusted again."""


def describe(error: BaseException) -> str:
    """Return an exception in one line, for a person; of a group the first."""
    if isinstance(error, BaseExceptionGroup):
        return describe(error.exceptions[0])
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def trace_of(error: BaseException) -> str:
    """Return where an exception comes from, for a log."""
    return "".join(traceback.format_exception(error)).rstrip()


class Faults:
    """Faults by where they happened, of which each place is told at most every ten seconds."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._newest: dict[str, tuple[float, str]] = {}
        self._told_s: dict[str, float] = {}

    def note(self, where: str, error: BaseException, now: float) -> bool:
        """Count a fault; return whether it is to be told."""
        self.counts[where] += 1
        self._newest[where] = (now, describe(error))
        told_s = self._told_s.get(where)
        if told_s is not None and now < told_s + _TOLD_AGAIN_S:
            return False
        self._told_s[where] = now
        return True

    def problems(self, now: float) -> list[str]:
        """Return what has failed within the last minute, for a person."""
        return [
            f"a fault in {where}, {self.counts[where]} in all, the newest: {what}"
            for where, (at_s, what) in self._newest.items()
            if now < at_s + _PROBLEM_FOR_S
        ]


class Illness:
    """Whether a vehicle's machines can be trusted.

    well ──fault──► ill ──next good frame──► well
                     │                        ▲
                     └──fault again within 10 s: ill until 10 s have passed without one
    """

    def __init__(self) -> None:
        self.faults = 0
        self.newest: str | None = None
        """What the newest fault was, for a person; None: well."""
        self._at_s: float | None = None
        self._until_s = 0.0

    def note(self, what: str, now: float) -> bool:
        """Count a fault; return whether it is a first one, and to be told."""
        again = self._at_s is not None and now < self._at_s + _QUIET_S
        first = self.newest is None and not again
        self.faults += 1
        self.newest, self._at_s = what, now
        self._until_s = now + _QUIET_S if again else now
        return first

    def recovers(self, now: float) -> bool:
        """Take a frame that was handled without a fault; return whether it ends the illness."""
        if self.newest is None or now < self._until_s:
            return False
        self.newest = None
        return True
