"""All tracks side by side: numbers in arrays, for the kernels; a ``Track`` is made when somebody asks for it."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.history import History, Log
from hsop_gcs.tracks.kernels import IntArray
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.track import Binding, Track, TrackStatus

_STATUSES = (TrackStatus.TENTATIVE, TrackStatus.CONFIRMED, TrackStatus.COASTING)
"""By their numbers in the kernels."""


class Name(NamedTuple):
    """What a track is called; see ``Track``."""

    id: str
    source: str
    source_threat_id: str | None
    sources: tuple[Binding, ...] = ()


class Table(Mapping[str, Track]):
    """The tracks by id. Whoever changes one changes a copy that no picture holds yet."""

    __slots__ = ("_made", "facts", "log", "memory_s", "names", "rows")

    def __init__(self, log: Log, names: list[Name], rows: dict[str, int], facts: FloatArray, memory_s: float) -> None:
        self.log, self.names, self.facts, self.memory_s = log, names, facts, memory_s
        self.rows = rows
        self._made: dict[str, Track] = {}

    @classmethod
    def of(cls, tracks: Mapping[str, Track], rules: TrackRules) -> "Table":
        """Return a table of one's own with these tracks, its log with room for more."""
        table = tracks.copy() if isinstance(tracks, Table) else _gathered(list(tracks.values()), rules)
        if table.log.is_full or table.memory_s != rules.memory_s:
            table.log, table.facts[:, kernels.NEWEST] = table.log.without_the_past(table.newest, table.memory_s)
            table.memory_s = rules.memory_s
        return table

    def copy(self) -> "Table":
        return Table(self.log, self.names.copy(), self.rows.copy(), self.facts.copy(), self.memory_s)

    def only(self, rows: Sequence[int], facts: FloatArray) -> "Table":
        """Return a table of some of its tracks; ``facts``: of all of them."""
        names = [self.names[row] for row in rows]
        return Table(self.log, names, _rows(names), facts[rows], self.memory_s)

    def add(self, name: Name) -> None:
        """Add a track; its facts are for the caller to add."""
        self.rows[name.id] = len(self.names)
        self.names.append(name)

    @property
    def newest(self) -> IntArray:
        """(tracks,), the newest steps."""
        return self.facts[:, kernels.NEWEST].astype(np.int64)

    def track(self, row: int) -> Track:
        """Return the track in a row, as it stands."""
        name, (newest, status, known, size_m, reports, first_seen_s) = self.names[row], self.facts[row].tolist()
        return Track(
            id=name.id,
            source=name.source,
            source_threat_id=name.source_threat_id,
            sources=name.sources,
            status=_STATUSES[int(status)],
            velocity_known=bool(known),
            size_m=size_m,
            reports=int(reports),
            first_seen_s=first_seen_s,
            state=self.log.state(int(newest)),
            steps=History(self.log, int(newest), self.memory_s),
        )

    def __getitem__(self, track_id: str) -> Track:
        track = self._made.get(track_id)
        if track is None:
            track = self._made[track_id] = self.track(self.rows[track_id])
        return track

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, track_id: object) -> bool:
        return track_id in self.rows


def _gathered(tracks: Sequence[Track], rules: TrackRules) -> Table:
    """The table of tracks, whose steps may lie in different logs."""
    logs = {id(track.steps.log): track.steps.log for track in tracks}
    log = next(iter(logs.values())) if len(logs) == 1 else Log()
    facts = np.empty((len(tracks), kernels.FACTS))
    for row, track in enumerate(tracks):
        newest = track.steps.newest if track.steps.log is log else log.take(track.steps)
        status = _STATUSES.index(track.status)
        facts[row] = newest, status, track.velocity_known, track.size_m, track.reports, track.first_seen_s
    names = [Name(track.id, track.source, track.source_threat_id, track.sources) for track in tracks]
    return Table(
        log, names, _rows(names), facts, max((track.steps.memory_s for track in tracks), default=rules.memory_s)
    )


def _rows(names: Sequence[Name]) -> dict[str, int]:
    return {name.id: row for row, name in enumerate(names)}
