"""What is watched of each source: its clock beside ours, what it was believed and what it was refused."""

import statistics
from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import NamedTuple

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
    FULL = "full"
    """A report of one more threat, or source, than the picture holds."""
    UNEXPLAINED = "unexplained"
    """A bearing in which no known threat lies."""


class Refusal(BadInput):
    """Why a report was not believed."""

    def __init__(self, kind: RefusalKind, field: str, problem: str, *, host: str | None = None) -> None:
        super().__init__(field, problem)
        self.kind = kind
        self.host = host
        """The host of ours that the report is of."""


class SourceWatch(NamedTuple):
    """One source of reports, since it was first heard or last forgotten."""

    last_heard_s: float
    accepted: int = 0
    out_of_order: int = 0
    """Of those accepted: how many came after a newer one and were put in their place."""
    refused: Mapping[RefusalKind, int] = MappingProxyType({})
    clock_samples: int = 0
    recent_offsets_s: tuple[float, ...] = ()

    @property
    def clock_offset_s(self) -> float:
        """Its clock minus ours, seconds, less what the report took to arrive: the median of the newest reports."""
        return statistics.median(self.recent_offsets_s) if self.recent_offsets_s else 0.0


Watches = Mapping[str, SourceWatch]


class Tally:
    """What one update hears of one source: a watch in the making."""

    __slots__ = ("_now_s", "_watch", "accepted", "offsets_s", "out_of_order", "refused")

    def __init__(self, watch: SourceWatch | None, now_s: float) -> None:
        self._watch = watch or SourceWatch(last_heard_s=now_s)
        self._now_s = now_s
        self.offsets_s: list[float] = []
        """The times of its reports minus ours, believed or not."""
        self.accepted = 0
        self.out_of_order = 0
        self.refused: list[RefusalKind] = []

    def watch(self) -> SourceWatch:
        """Return the watch with all that was heard."""
        before = self._watch
        refused = before.refused
        for kind in self.refused:
            refused = {**refused, kind: refused.get(kind, 0) + 1}
        return SourceWatch(
            self._now_s,
            before.accepted + self.accepted,
            before.out_of_order + self.out_of_order,
            refused,
            before.clock_samples + len(self.offsets_s),
            (*before.recent_offsets_s, *self.offsets_s)[-_OFFSETS_KEPT:],
        )
