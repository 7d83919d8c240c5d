"""The machine's clocks: the wall's, which tells UTC and may be set, and a steady one, which may not.

wall     ──────────┐ set back        ┌ set forward ───────
                   └─────────────────┘
steady   ─────────────────────────────────────────────────
rising   ──────────────────────────────────────────────────  the wall's, but never back
"""

import time
from collections.abc import Callable
from pathlib import Path

Clock = Callable[[], float]
"""Seconds."""

STEP_S = 0.5
"""By how much the wall's clock must leave the steady one to have been set: what is less is drift, or a slew."""
_TOGETHER_S = 0.05
_TRIES = 5
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def steady_s() -> float:
    """Return the steady clock, which also counts while the machine is suspended, where the system tells that."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()


def boot_id() -> str | None:
    """Return what the machine's present run is called: its steady clock counts on over restarts of a process."""
    try:
        return _BOOT_ID.read_text().strip() or None
    except OSError:
        return None


def read_together(wall: Clock, steady: Clock) -> tuple[float, float]:
    """Return both clocks as of one moment: a process that is stopped between two readings would see a step."""
    for _ in range(_TRIES):
        before_s, wall_s, after_s = steady(), wall(), steady()
        if after_s - before_s <= _TOGETHER_S:
            break
    return wall_s, after_s


class RisingClock:
    """UTC that never goes back: it follows the wall's clock forwards, and goes on by itself where that is set back.

    For what must rise whatever happens: stamps of signatures and of telemetry logs, and when a program is due.
    """

    def __init__(self, wall: Clock = time.time, steady: Clock = steady_s) -> None:
        self._wall, self._steady = wall, steady
        self._last_s, self._steady_s = read_together(wall, steady)

    def __call__(self) -> float:
        """Return seconds since the Unix epoch."""
        wall_s, at_s = read_together(self._wall, self._steady)
        risen_s = self._last_s + at_s - self._steady_s
        self._last_s = risen_s if risen_s - wall_s >= STEP_S else max(self._last_s, wall_s)
        self._steady_s = at_s
        return self._last_s
