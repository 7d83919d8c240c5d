"""All tracks side by side: numbers in arrays, for the kernels; a ``Track`` is made when somebody asks for it."""

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsop_gcs.reports import Measurement
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.history import Arrays, History, Log
from hsop_gcs.tracks.kernels import IntArray
from hsop_gcs.tracks.measured import numbers_of
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
    not_apart: frozenset[str] = frozenset()


class Packed(NamedTuple):
    """A table as plain values: all that its future depends on."""

    names: tuple[Name, ...]
    facts: FloatArray
    """(tracks, kernels.FACTS); the newest steps are places in ``steps``."""
    steps: Arrays
    """Nothing but what tracks remember."""
    measurements: list[Measurement]
    """One for each step."""
    rules: TrackRules


class Table(Mapping[str, Track]):
    """The tracks by id. What it holds is replaced, never changed, but for its log, which is only added to."""

    __slots__ = ("_made", "facts", "log", "names", "numbers", "rows", "rules")

    def __init__(
        self,
        log: Log,
        names: tuple[Name, ...],
        rows: dict[str, int],
        facts: FloatArray,
        rules: TrackRules,
        numbers: FloatArray,
    ) -> None:
        self.log, self.names, self.rows, self.facts, self.rules, self.numbers = log, names, rows, facts, rules, numbers
        self._made: dict[str, Track] = {}

    @classmethod
    def of(cls, tracks: Mapping[str, Track], rules: TrackRules) -> "Table":
        """Return a table of one's own with these tracks, its log with room for more."""
        if not isinstance(tracks, Table):
            tracks = _gathered(list(tracks.values()), rules)
        table = Table(tracks.log, tracks.names, tracks.rows, tracks.facts, tracks.rules, tracks.numbers)
        if table.log.is_full or table.rules is not rules:
            table.log, newest = table.log.without_the_past(table.newest, table.rules.memory_s)
            table.facts = table.facts.copy()
            table.facts[:, kernels.NEWEST] = newest
            table.rules, table.numbers = rules, numbers_of(rules)
        return table

    def packed(self) -> Packed:
        """Return the table as plain values."""
        log, newest = self.log.without_the_past(self.newest, self.rules.memory_s)
        facts = self.facts.copy()
        facts[:, kernels.NEWEST] = newest
        size = len(log.measurements)
        return Packed(self.names, facts, log.steps.changed(lambda array: array[:size]), log.measurements, self.rules)

    @classmethod
    def of_packed(cls, packed: Packed) -> "Table":
        """Return the table of plain values; what is made of it afterwards is the same to the bit.

        Raises ValueError for arrays that are not of the tracker's shapes.
        """
        log = Log()
        shapes = [(packed.facts.shape[1:], (kernels.FACTS,))]
        shapes += [(given.shape[1:], array.shape[1:]) for given, array in zip(packed.steps, log.steps, strict=True)]
        if any(given != wanted for given, wanted in shapes) or len(packed.facts) != len(packed.names):
            raise ValueError("tracks of another tracker than this one")
        log.make_room(len(packed.measurements))
        for array, given in zip(log.steps, packed.steps, strict=True):
            array[: len(packed.measurements)] = given
        log.measurements = list(packed.measurements)
        return cls(log, packed.names, _rows(packed.names), packed.facts, packed.rules, numbers_of(packed.rules))

    def without(self, track_ids: Container[str], facts: FloatArray) -> "Table":
        """Return a table of the other tracks, whose ``facts`` these are."""
        names = tuple([name for name in self.names if name.id not in track_ids])
        return Table(self.log, names, _rows(names), facts, self.rules, self.numbers)

    def add(self, names: Sequence[Name]) -> None:
        """Add tracks; their facts are for the caller to add."""
        self.rows = self.rows | {name.id: row for row, name in enumerate(names, len(self.names))}
        self.names = (*self.names, *names)

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
            not_apart=name.not_apart,
            status=_STATUSES[int(status)],
            velocity_known=bool(known),
            size_m=size_m,
            reports=int(reports),
            first_seen_s=first_seen_s,
            state=self.log.state(int(newest)),
            steps=self.history(row),
        )

    def history(self, row: int) -> History:
        """Return what the track in a row was told lately."""
        return History(self.log, int(self.facts[row, kernels.NEWEST]), self.rules.memory_s)

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
    names = tuple(
        [Name(track.id, track.source, track.source_threat_id, track.sources, track.not_apart) for track in tracks]
    )
    return Table(log, names, _rows(names), facts, rules, numbers_of(rules))


def _rows(names: Sequence[Name]) -> dict[str, int]:
    return {name.id: row for row, name in enumerate(names)}
