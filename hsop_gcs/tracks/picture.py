"""The picture: all tracks at one moment, and how reports and time change it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from hsop_gcs.reports import Measurement, Report, ReportRules, Vector3
from hsop_gcs.tracks.associate import associate
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.lifecycle import aged, begin, release, take, tell
from hsop_gcs.tracks.measured import rows_of
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.screen import on_own_host, refusal_of
from hsop_gcs.tracks.sources import Refusal, RefusalKind, Tally, Watches
from hsop_gcs.tracks.table import Table
from hsop_gcs.tracks.track import Binding, Track

NO_HOSTS: Mapping[str, Vector3] = MappingProxyType({})
_CLOCK = ReportRules()
_NO_SCAN: tuple[list[int], float, set[str | None]] = ([], -math.inf, set())


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """All tracks by id, and what is watched of each source. Frozen: an update is a new picture."""

    tracks: Mapping[str, Track] = field(default_factory=lambda: MappingProxyType({}))
    sources: Watches = field(default_factory=lambda: MappingProxyType({}))
    named: int = 0
    """How many tracks have been given a name of ours (T1, T2, ...)."""


Verdict = str | Refusal
"""What became of a measurement: the id of the track it is in now, or why it was refused."""


def update(
    picture: Picture,
    measurements: Sequence[Measurement],
    now_s: float,
    rules: TrackRules,
    *,
    hosts_m: Mapping[str, Vector3] = NO_HOSTS,
    clock: ReportRules = _CLOCK,
) -> tuple[Picture, tuple[Verdict, ...]]:
    """Return the picture with the measurements in it, and a verdict on each, in their order.

    Those that arrive together are judged together: of one source's scan each is of another threat. ``now_s``: when
    they arrived, seconds since the Unix epoch. ``hosts_m``: our own aircraft, ENU metres. ``clock``: how far a
    source's time may be from ours. The same calls in the same order give the same pictures, to the bit.
    """
    work = _Work(picture, measurements, now_s, rules)
    work.screen(hosts_m, clock)
    for scan in _scans(measurements, work.unjudged(), rules):
        work.take(scan)
    return work.picture(), tuple(map(work.verdicts.__getitem__, range(len(measurements))))


def prune(picture: Picture, now_s: float, rules: TrackRules) -> tuple[Picture, Mapping[str, float]]:
    """Return the picture as it stands at ``now_s``; and of the threats that left it the times of their last reports."""
    before = picture.tracks if isinstance(picture.tracks, Table) else Table.of(picture.tracks, rules)
    after, gone = aged(before, now_s, rules)
    forgotten = [name for name, watch in picture.sources.items() if now_s - watch.last_heard_s > rules.source_memory_s]
    if after is before and not forgotten:
        return picture, gone
    sources = {name: watch for name, watch in picture.sources.items() if name not in forgotten}
    tracks = picture.tracks if after is before else after
    return Picture(tracks=tracks, sources=MappingProxyType(sources), named=picture.named), gone


def dismiss(picture: Picture, track_id: str) -> Picture:
    """Return the picture without a threat. Raises KeyError if there is none of this id."""
    left = dict(picture.tracks)
    del left[track_id]
    return replace(picture, tracks=MappingProxyType(left))


class _Work:
    """One update in progress."""

    def __init__(self, picture: Picture, measurements: Sequence[Measurement], now_s: float, rules: TrackRules) -> None:
        self.verdicts: dict[int, Verdict] = {}
        self._table = Table.of(picture.tracks, rules)
        self._sources = picture.sources
        self._tallies: dict[str, Tally] = {}
        self._named = picture.named
        self._measurements = measurements
        self._suspects: dict[int, Refusal] = {}
        self._now_s = now_s
        self._rules = rules

    def picture(self) -> Picture:
        heard = {source: tally.watch() for source, tally in self._tallies.items()}
        sources = MappingProxyType({**self._sources, **heard})
        return Picture(tracks=self._table, sources=sources, named=self._named)

    def unjudged(self) -> list[int]:
        return [index for index in range(len(self._measurements)) if index not in self.verdicts]

    def screen(self, hosts_m: Mapping[str, Vector3], clock: ReportRules) -> None:
        """Watch the sources' clocks, and refuse what needs no track to be refused."""
        # most scans repeat no place, and hashing whole reports takes long
        places = {each.position_m if isinstance(each, Report) else each.direction for each in self._measurements}
        repeated = len(places) < len(self._measurements)
        seen: set[Measurement] = set()
        for index, each in enumerate(self._measurements):
            tally = self._tallies.get(each.source)
            if tally is None:
                tally = self._tallies[each.source] = Tally(self._sources.get(each.source), self._now_s)
            tally.offsets_s.append(each.time_s - self._now_s)
            refusal = refusal_of(each, self._now_s, clock)
            if repeated:
                if refusal is None and each in seen:
                    problem = f"{each.source!r} has sent the same report twice"
                    refusal = Refusal(RefusalKind.DUPLICATE, "time", problem)
                seen.add(each)
            if refusal is not None:
                self._refuse(index, refusal)
            elif hosts_m and (suspicion := on_own_host(each, self._rules, hosts_m)) is not None:
                self._suspects[index] = suspicion

    def take(self, scan: Sequence[int]) -> None:
        """Associate one scan, correct the tracks it speaks of and begin the new ones."""
        measurements = [self._measurements[index] for index in scan]
        rows = rows_of(measurements, self._rules)
        refused: Mapping[int, Refusal] = {}
        told = None if self._suspects else take(self._table, measurements, rows, now_s=self._now_s, rules=self._rules)
        if told is None:
            told, refused = self._weigh(scan, measurements, rows)
        self._tallies[measurements[0].source].accepted += len(told)
        for position, row in told.items():
            self.verdicts[scan[position]] = self._table.names[row].id
        if len(told) + len(refused) < len(scan):
            self._begin(scan, [each for each in range(len(scan)) if each not in told and each not in refused], rows)

    def _weigh(
        self, scan: Sequence[int], measurements: Sequence[Measurement], rows: FloatArray
    ) -> tuple[dict[int, int], dict[int, Refusal]]:
        """Associate a scan; return the rows of the tracks that were told, and what was refused."""
        suspects = {position: self._suspects[index] for position, index in enumerate(scan) if index in self._suspects}
        found = associate(self._table, measurements, rows, suspects, self._rules)
        for position in found.released:
            each = measurements[position]
            if each.threat_id is not None:
                release(self._table, Binding(each.source, each.threat_id))
        for position, refusal in found.refusals.items():
            self._refuse(scan[position], refusal)
        if found.tracks:
            positions, tracks = list(found.tracks), np.array(list(found.tracks.values()))
            chosen = [measurements[position] for position in positions]
            late = tell(self._table, tracks, chosen, rows[positions], now_s=self._now_s, rules=self._rules)
            self._tallies[measurements[0].source].out_of_order += late
        return found.tracks, found.refusals

    def _begin(self, scan: Sequence[int], new: Sequence[int], rows: FloatArray) -> None:
        """Begin tracks with the measurements that are of none."""
        reports: list[Report] = []
        names: list[str] = []
        for position in new:
            report = self._measurements[scan[position]]
            assert isinstance(report, Report), "an unexplained bearing is refused"
            reports.append(report)
            names.append(self._name(report, names))
            self.verdicts[scan[position]] = names[-1]
        self._tallies[reports[0].source].accepted += len(new)
        begin(self._table, names, reports, rows[new], now_s=self._now_s, rules=self._rules)

    def _refuse(self, index: int, refusal: Refusal) -> None:
        self.verdicts[index] = refusal
        self._tallies[self._measurements[index].source].refused.append(refusal.kind)

    def _name(self, report: Report, others: Sequence[str]) -> str:
        """The source's id where it is free, else made unique with the source's name; a report without one gets ours."""
        if report.threat_id is not None:
            for name in (report.threat_id, f"{report.source}/{report.threat_id}"):
                if name not in self._table and name not in others:
                    return name
        self._named += 1
        while (name := f"T{self._named}") in self._table or name in others:
            self._named += 1
        return name


def _scans(measurements: Sequence[Measurement], indices: Sequence[int], rules: TrackRules) -> list[list[int]]:
    """Put measurements in order of time and part them into scans: of one source, at one time, of different ids."""
    scans: list[list[int]] = []
    open_scans: dict[str, tuple[list[int], float, set[str | None]]] = {}
    times_s = [each.time_s for each in measurements]
    for index in sorted(indices, key=times_s.__getitem__):
        each = measurements[index]
        scan, last_s, ids = open_scans.get(each.source, _NO_SCAN)
        if each.time_s > last_s or (each.threat_id is not None and each.threat_id in ids):
            scan, ids = [], set()
            open_scans[each.source] = scan, each.time_s + rules.scan_s, ids
            scans.append(scan)
        scan.append(index)
        ids.add(each.threat_id)
    return scans
