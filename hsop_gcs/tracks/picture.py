"""The picture: all tracks at one moment, and how reports and time change it."""

import math
from collections.abc import Container, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hsop_gcs.reports import Measurement, Report, ReportRules
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.associate import associate, hints
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.lifecycle import aged, bind, release, take, tell, unknown
from hsop_gcs.tracks.measured import rows_of
from hsop_gcs.tracks.own import NO_OWN, OwnAircraft, Suspicion, hosts_it_may_be, suspicion
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.screen import refusal_of
from hsop_gcs.tracks.sources import Refusal, RefusalKind, Tally, Watches
from hsop_gcs.tracks.table import Name, Table
from hsop_gcs.tracks.track import Binding, Track

_NOTHING: Mapping[int, Refusal] = MappingProxyType({})
_CLOCK = ReportRules()
_NO_SCAN: tuple[list[int], float, set[str | None]] = ([], -math.inf, set())


class Picture(NamedTuple):
    """All tracks by id, and what is watched of each source. An update is a new picture."""

    tracks: Mapping[str, Track] = MappingProxyType({})
    sources: Watches = MappingProxyType({})
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
    own: OwnAircraft = NO_OWN,
    clock: ReportRules = _CLOCK,
    refused: Mapping[int, Refusal] = _NOTHING,
) -> tuple[Picture, tuple[Verdict, ...]]:
    """Return the picture with the measurements in it, and a verdict on each, in their order.

    Those that arrive together are judged together: of one source's scan each is of another threat. ``now_s``: when
    they arrived, on the clock of their times. ``own``: our own aircraft. ``clock``: how far a source's time may be from
    ours. ``refused``: those that are refused already, by their index. The same calls in the same order give the same
    pictures, to the bit.
    """
    work = _Work(picture, measurements, now_s, rules, own, clock)
    everything = range(len(measurements))
    if refused or work.suspects_hosts() or not (work.is_simple() and work.take(everything)):
        work.screen(refused)
        for scan in _scans(measurements, [index for index in everything if index not in work.verdicts], rules):
            if not work.take(scan):
                work.weigh(scan)
    return work.picture(), tuple([work.verdicts[index] for index in everything])


def prune(picture: Picture, now_s: float, rules: TrackRules) -> tuple[Picture, Mapping[str, float]]:
    """Return the picture as it stands at ``now_s``; and of the threats that left it the times of their last reports."""
    before = picture.tracks if isinstance(picture.tracks, Table) else Table.of(picture.tracks, rules)
    after, gone = aged(before, now_s, rules)
    sources = picture.sources
    if any([now_s - watch.last_heard_s > rules.source_memory_s for watch in sources.values()]):
        heard = {name: each for name, each in sources.items() if now_s - each.last_heard_s <= rules.source_memory_s}
        sources = MappingProxyType(heard)
    if after is before and sources is picture.sources:
        return picture, gone
    return Picture(picture.tracks if after is before else after, sources, picture.named), gone


def dismiss(picture: Picture, track_id: str) -> Picture:
    """Return the picture without a threat. Raises KeyError if there is none of this id."""
    left = dict(picture.tracks)
    del left[track_id]
    return picture._replace(tracks=MappingProxyType(left))


class _Work:
    """One update in progress: a scan at a time, all at once if it is one and nothing can be said against it."""

    def __init__(
        self,
        picture: Picture,
        measurements: Sequence[Measurement],
        now_s: float,
        rules: TrackRules,
        own: OwnAircraft,
        clock: ReportRules,
    ) -> None:
        self.verdicts: dict[int, Verdict] = {}
        self._table = Table.of(picture.tracks, rules)
        self._sources = picture.sources
        self._named = picture.named
        self._measurements = measurements
        self._suspects: dict[int, Suspicion] = {}
        self._now_s, self._rules = now_s, rules
        self._own, self._clock = own, clock
        self._unheard = frozenset(own.unheard)
        self._ours: set[str] = set()
        """Tracks that have turned out to be aircraft of ours."""
        self._tallies: dict[str, Tally] = {}
        self._any_id = False
        for each in measurements:
            self._any_id |= each.threat_id is not None or each.track_id is not None
            tally = self._tallies.get(each.source)
            if tally is None:
                tally = self._tallies[each.source] = Tally(self._sources.get(each.source), now_s)
            tally.offsets_s.append(each.time_s - now_s)

    def picture(self) -> Picture:
        heard = {source: tally.watch() for source, tally in self._tallies.items()}
        if self._ours:
            left = [row for row, name in enumerate(self._table.names) if name.id not in self._ours]
            self._table = self._table.without(self._ours, self._table.facts[left])
        return Picture(self._table, MappingProxyType({**self._sources, **heard}), self._named)

    def is_simple(self) -> bool:
        """Whether all measurements are of one source, and of different ids."""
        if not self._any_id:
            return len(self._tallies) == 1
        ids = [each.threat_id for each in self._measurements if each.threat_id is not None]
        return len(self._tallies) == 1 and len(set(ids)) == len(ids)

    def suspects_hosts(self) -> bool:
        """Whether a measurement may be of a host of ours, or needs to be screened before that can be said."""
        return bool(self._own.paths) and any(
            isinstance(each, Report)
            and (each.covariance_m2 is not None or suspicion(each, self._now_s, self._rules, self._own) is not None)
            for each in self._measurements
        )

    def screen(self, refused: Mapping[int, Refusal]) -> None:
        """Refuse what needs no track to be refused."""
        # most scans repeat no place, and hashing whole reports takes long
        places = {each.position_m if isinstance(each, Report) else each.direction for each in self._measurements}
        repeated = len(places) < len(self._measurements)
        seen: set[Measurement] = set()
        for index, each in enumerate(self._measurements):
            refusal = refused.get(index) or refusal_of(each, self._now_s, self._clock)
            if repeated:
                if refusal is None and each in seen:
                    problem = f"{each.source!r} has sent the same report twice"
                    refusal = Refusal(RefusalKind.DUPLICATE, "time", problem)
                seen.add(each)
            if refusal is not None:
                self._refuse(index, refusal)
            elif (suspect := suspicion(each, self._now_s, self._rules, self._own)) is not None:
                self._suspects[index] = suspect

    def take(self, scan: Sequence[int]) -> bool:
        """Give the reports of one scan to the tracks nearest to them and begin the new ones.

        False, and nothing is done, if they must be screened or weighed.
        """
        if self._suspects and any(index in self._suspects for index in scan):
            return False
        known = len(self._table.names)
        if known + len(scan) > self._rules.max_tracks:
            return False
        chosen = [self._measurements[index] for index in scan]
        rows, hinted = rows_of(chosen, self._rules), hints(self._table, chosen) if self._any_id else {}
        tracks = take(self._table, chosen, rows, hinted, clock=self._clock, now_s=self._now_s)
        if not tracks:
            return False
        if len(self._table.facts) > known:
            self._christen([each for each, row in zip(chosen, tracks, strict=True) if row >= known])
        if self._any_id:
            bind(self._table, tracks, chosen)
        self._accept(scan, tracks)
        return True

    def weigh(self, scan: Sequence[int]) -> None:
        """Associate one scan, correct the tracks it speaks of and begin the new ones."""
        chosen = [self._measurements[index] for index in scan]
        rows = rows_of(chosen, self._rules)
        suspects = {position: self._suspects[index] for position, index in enumerate(scan) if index in self._suspects}
        found = associate(self._table, chosen, rows, hints(self._table, chosen), suspects, self._rules)
        for position in found.released:
            each = chosen[position]
            if each.threat_id is not None:
                release(self._table, Binding(each.source, each.threat_id))
        for position, refusal in found.refusals.items():
            self._refuse(scan[position], refusal)
        known = len(self._table.names)
        self._tell(scan, list(found.tracks), list(found.tracks.values()), rows)
        new = [each for each in range(len(scan)) if each not in found.tracks and each not in found.refusals]
        room = max(0, self._rules.max_tracks - known)
        for position in new[room:]:
            problem = f"a new threat, and the picture holds {self._rules.max_tracks} already, its most"
            self._refuse(scan[position], Refusal(RefusalKind.FULL, "threat_id", problem))
        if new := new[:room]:
            unknown(self._table, len(new))
            self._christen([chosen[position] for position in new])
            self._tell(scan, new, range(known, known + len(new)), rows)

    def _tell(self, scan: Sequence[int], positions: Sequence[int], tracks: Sequence[int], rows: FloatArray) -> None:
        """Tell tracks measurements of a scan by their places in it."""
        if positions:
            indices = [scan[position] for position in positions]
            chosen = [self._measurements[index] for index in indices]
            late = tell(self._table, np.array(tracks), chosen, rows[positions], now_s=self._now_s)
            self._tallies[chosen[0].source].out_of_order += late
            self._accept(indices, tracks)

    def _accept(self, indices: Sequence[int], tracks: Sequence[int]) -> None:
        names = self._table.names
        for index, row in zip(indices, tracks, strict=True):
            self.verdicts[index] = names[row].id
            if names[row].not_apart and isinstance(self._measurements[index], Report):
                self._tell_apart(row)
        self._tallies[self._measurements[indices[0]].source].accepted += len(indices)

    def _tell_apart(self, row: int) -> None:
        """After a report a track is apart from all hosts that are heard elsewhere. What may be one of those that are
        heard is not confirmed, and once it surely is one, it is no threat.
        """
        state, names = self._table.log.state(int(self._table.facts[row, kernels.NEWEST])), list(self._table.names)
        beside = hosts_it_may_be(state, self._now_s, self._rules, self._own)
        not_apart = names[row].not_apart & self._unheard.union(beside)
        names[row] = names[row]._replace(not_apart=not_apart)
        self._table.names = tuple(names)
        suspected = not_apart.intersection(beside)
        if suspected:
            self._table.facts[row, kernels.STATUS] = kernels.TENTATIVE
        if any(beside[host] for host in suspected):
            self._ours.add(names[row].id)

    def _christen(self, reports: Sequence[Measurement]) -> None:
        """Name the newest tracks, whose first reports these are."""
        names: dict[str, Name] = {}
        for each in reports:
            assert isinstance(each, Report), "an unexplained bearing is refused"
            name = self._name(each, names)
            may_be = self._unheard.union(self._own.paths)
            names[name] = Name(name, each.source, each.threat_id, not_apart=may_be)
        self._table.add(list(names.values()))

    def _refuse(self, index: int, refusal: Refusal) -> None:
        self.verdicts[index] = refusal
        self._tallies[self._measurements[index].source].refused.append(refusal.kind)

    def _name(self, report: Report, others: Container[str]) -> str:
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
