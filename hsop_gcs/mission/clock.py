"""Mission time: UTC when the mission began, steadily on from there, whatever becomes of the system clock.

    system clock   ───────────────────┐  set back by 20 s
                                      └──────────────────────────
    mission time   ──────────────────────────────────────────────   ages, deadlines, the journal
    offset              0 s           │        -20 s                 what comes in and goes out

Everything inside a mission is on mission time, which never leaps and never goes back, also over restarts of the
service. The offset, system clock minus mission time, is added to what is shown. A source's times are taken by the
offset under which they make sense: it may follow our clock, or stay on the time that ours has left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hsop_gcs.clocks import STEP_S, Clock, read_together

_SLEW = 0.002
"""How fast mission time follows a system clock that drifts: faster than any slew (500 ppm), too slow for ages."""
_SLEW_EVERY_S = 1.0
_OFFSETS_KEPT = 4
_TOLD_FOR_S = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """What a mission knows of its time: where it has come to, and how the system clock has stood to it."""

    now_s: float | None = None
    """Mission time of the newest input; None: nothing has happened yet."""
    offsets_s: tuple[float, ...] = (0.0,)
    """System clock minus mission time, newest first: now, and before the clock was set."""
    stepped_at_s: float | None = None
    """When the clock was set last, mission time."""
    stepped_by_s: float = 0.0
    started_s: float = 0.0
    """When the service started last, mission time."""
    steady_s: float | None = None
    """The machine's steady clock at that moment, which counts on until the machine is started again."""
    boot: str | None = None
    """The machine's run of which ``steady_s`` is; None: the system does not tell."""

    @property
    def offset_s(self) -> float:
        """System clock minus mission time, now."""
        return self.offsets_s[0]

    def at(self, now_s: float) -> "Timeline":
        """Return the timeline after an input."""
        return replace(self, now_s=now_s if self.now_s is None else max(self.now_s, now_s))

    def started(self, now_s: float, *, steady_s: float | None, boot: str | None) -> "Timeline":
        """Return the timeline after a start of the service."""
        return replace(self, started_s=now_s, steady_s=steady_s, boot=boot)

    def stepped(self, now_s: float, *, by_s: float, offset_s: float) -> "Timeline":
        """Return the timeline after the system clock was set; one that is set to where it was before is there again."""
        before = [each for each in self.offsets_s if abs(each - offset_s) >= STEP_S]
        offsets_s = (offset_s, *before)[:_OFFSETS_KEPT]
        return replace(self, offsets_s=offsets_s, stepped_at_s=now_s, stepped_by_s=by_s)

    def problem(self, now_s: float) -> str | None:
        """Say for a person that the system clock has been set lately; None if it has not."""
        if self.stepped_at_s is None or now_s - self.stepped_at_s > _TOLD_FOR_S:
            return None
        which, ago_s = "forward" if self.stepped_by_s > 0 else "back", now_s - self.stepped_at_s
        return f"clock: the system clock was set {which} by {abs(self.stepped_by_s):.1f} s, {ago_s:.0f} s ago"

    def resumed_s(self, wall_s: float, steady_s: float, boot: str | None) -> float:
        """Return the mission time at which a service starts: it goes on by as much as has passed, and never back.

        Where the machine has run on, its steady clock says how much. Else the system clock does; one that has been set
        back meanwhile does not, and then nothing has passed.
        """
        if self.now_s is None:
            return wall_s
        if boot is not None and boot == self.boot and self.steady_s is not None:
            return self.now_s + max(steady_s - (self.steady_s + self.now_s - self.started_s), 0.0)
        return max(wall_s - self.offset_s, self.now_s)


class MissionClock:
    """Tells mission time from the system's clocks, and notices when the wall's is set.

    wall: seconds since the Unix epoch, may be set. steady: seconds, may not. before: of the mission that goes on.
    boot: see ``Timeline``.
    """

    def __init__(self, wall: Clock, steady: Clock, *, before: Timeline | None = None, boot: str | None = None) -> None:
        before = before or Timeline()
        self.boot = boot
        self.offset_s = before.offset_s
        """System clock minus mission time, but for drift: it changes when the system clock is set."""
        self._wall, self._steady = wall, steady
        wall_s, self._slewed_s = read_together(wall, steady)
        self.steady_s = self._slewed_s
        """The steady clock as it was read last."""
        self._now_s = before.resumed_s(wall_s, self.steady_s, boot)
        self._ahead_s = self._now_s - self.steady_s
        self._compare(wall_s)

    def __call__(self) -> float:
        """Return mission time, seconds."""
        wall_s, self.steady_s = read_together(self._wall, self._steady)
        # never the sum of many small steps: seconds since the epoch leave a quarter of a microsecond for rounding
        self._now_s = max(self._now_s, self.steady_s + self._ahead_s)
        self._compare(wall_s)
        return self._now_s

    def _compare(self, wall_s: float) -> None:
        apart_s = wall_s - self._now_s - self.offset_s
        if abs(apart_s) >= STEP_S:
            self.offset_s += apart_s
        elif (since_s := self.steady_s - self._slewed_s) >= _SLEW_EVERY_S:
            self._ahead_s += min(max(apart_s, -_SLEW * since_s), _SLEW * since_s)
            self._slewed_s = self.steady_s


def likeliest_offset_s(
    utc_s: float,
    now_s: float,
    offsets_s: Sequence[float],
    *,
    max_future_s: float,
    max_age_s: float,
    usual_age_s: float = 0.0,
) -> float:
    """Return the offset by which a source's time is meant: the one that makes what it sends as old as it usually is.

    utc_s: the newest of the times that arrived together, by the source's clock. now_s: mission time. offsets_s: newest
    first; the newest if the time makes no sense under any, so that it is refused by the clock that people see.
    """
    ages_s = [now_s - (utc_s - offset_s) for offset_s in offsets_s]
    possible = [index for index, age_s in enumerate(ages_s) if -max_future_s <= age_s <= max_age_s]
    if not -max_future_s <= usual_age_s <= max_age_s or math.isnan(usual_age_s):
        usual_age_s = 0.0
    return offsets_s[min(possible, key=lambda index: abs(ages_s[index] - usual_age_s), default=0)]
