"""What is watched of each source: its clock beside ours, what it was believed and what it was refused."""

import statistics
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from hsop_gcs.errors import BadInput

_OFFSETS_KEPT = 31


class RefusalKind(StrEnum):
    CLOCK = "clock"
    """Its time is too far from ours."""
    INVALID = "invalid"
    """Numbers that are no measurement."""
    OWN_HOST = "own host"
    DUPLICATE = "duplicate"
    LATE = "late"
    """Older than its threat's newest report by more than the lag."""
    IMPOSSIBLE = "impossible"
    """Its threat could not have flown there."""
    DISMISSED = "dismissed"
    """Of a threat that an operator took out of the picture."""
    UNEXPLAINED = "unexplained"
    """A bearing in which no known threat lies."""


class Refusal(BadInput):
    """Why a report was not believed."""

    def __init__(self, kind: RefusalKind, field: str, problem: str) -> None:
        super().__init__(field, problem)
        self.kind = kind


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceWatch:
    """One source of reports, since it was first heard or last forgotten."""

    last_heard_s: float
    accepted: int = 0
    out_of_order: int = 0
    """Of those accepted: how many came after a newer one and were put in their place."""
    refused: Mapping[RefusalKind, int] = field(default_factory=dict)
    clock_samples: int = 0
    recent_offsets_s: tuple[float, ...] = ()

    @property
    def clock_offset_s(self) -> float:
        """Its clock minus ours, seconds, less what the report took to arrive: the median of the newest reports."""
        return statistics.median(self.recent_offsets_s) if self.recent_offsets_s else 0.0


Watches = Mapping[str, SourceWatch]


def heard(watch: SourceWatch | None, time_s: float, now_s: float) -> SourceWatch:
    """Return the watch after a report of ``time_s`` has arrived at ``now_s``, believed or not."""
    watch = watch or SourceWatch(last_heard_s=now_s)
    return replace(
        watch,
        last_heard_s=now_s,
        clock_samples=watch.clock_samples + 1,
        recent_offsets_s=(*watch.recent_offsets_s[1 - _OFFSETS_KEPT :], time_s - now_s),
    )


def believed(watch: SourceWatch, *, out_of_order: bool) -> SourceWatch:
    return replace(watch, accepted=watch.accepted + 1, out_of_order=watch.out_of_order + out_of_order)


def refused(watch: SourceWatch, kind: RefusalKind) -> SourceWatch:
    return replace(watch, refused={**watch.refused, kind: watch.refused.get(kind, 0) + 1})
