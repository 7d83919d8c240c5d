"""Which sources are refused whatever they send: nobody looks at a source's answers, so that health has to say it.

For people alone: nothing is decided by it, and it is not in the journal.
"""

from dataclasses import dataclass, replace

_TOLD_AFTER = 3
"""Refusals in a row."""
_FORGOTTEN_AFTER_S = 60.0
_MOST_SOURCES = 64
_MOST_TOLD = 8


@dataclass(frozen=True, slots=True)
class _Row:
    """The refusals of one source since it was believed last."""

    since_s: float
    last_s: float
    count: int
    problem: str


class Refusals:
    """Keeps account of sources by their names: of the newest refused ones, if there are too many."""

    def __init__(self) -> None:
        self._rows: dict[str, _Row] = {}

    def accepted(self, source: str) -> None:
        """Something of a source was believed."""
        self._rows.pop(source, None)

    def refused(self, source: str, problem: str, now_s: float) -> None:
        """Something of a source was not, for a reason that is no opinion about the threat."""
        row = self._rows.pop(source, None)
        if row is None or now_s - row.last_s > _FORGOTTEN_AFTER_S:
            row = _Row(now_s, now_s, 0, problem)
        self._rows[source] = replace(row, last_s=now_s, count=row.count + 1, problem=problem)
        while len(self._rows) > _MOST_SOURCES:
            del self._rows[next(iter(self._rows))]

    def problems(self, now_s: float) -> list[str]:
        """Say for a person which sources are refused now, the newest first."""
        told = [
            f"source {source!r}: all {row.count} it sent for {now_s - row.since_s:.0f} s are refused: {row.problem}"
            for source, row in reversed(self._rows.items())
            if row.count >= _TOLD_AFTER and now_s - row.last_s <= _FORGOTTEN_AFTER_S
        ]
        more = len(told) - _MOST_TOLD
        return [*told[:_MOST_TOLD], f"and {more} more sources are refused"] if more > 0 else told
