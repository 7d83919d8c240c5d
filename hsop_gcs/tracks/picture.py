"""The picture: all tracks at one moment, and how reports and time change it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from hsop_gcs.reports import Measurement, Report, ReportRules, Vector3
from hsop_gcs.tracks.associate import associate
from hsop_gcs.tracks.filter import State
from hsop_gcs.tracks.gate import Stack
from hsop_gcs.tracks.history import insert
from hsop_gcs.tracks.lifecycle import aged, begin, extend, has_left, without_id
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.screen import on_own_host, refusal_of
from hsop_gcs.tracks.sources import Refusal, RefusalKind, Tally, Watches
from hsop_gcs.tracks.track import Track

NO_HOSTS: Mapping[str, Vector3] = MappingProxyType({})
_CLOCK = ReportRules()


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """All tracks by id, and what is watched of each source. Frozen: an update is a new picture."""

    tracks: Mapping[str, Track] = field(default_factory=lambda: MappingProxyType({}))
    sources: Watches = field(default_factory=lambda: MappingProxyType({}))
    named: int = 0
    """How many tracks have been given a name of ours (T1, T2, ...)."""
    stack: tuple[Mapping[str, Track], Stack] | None = field(default=None, compare=False, repr=False)
    """The tracks' newest states for the next update, and which tracks they are of; worth nothing for other tracks."""


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
    for index in range(len(measurements)):
        work.screen(index, hosts_m, clock)
    for scan in _scans(measurements, work.unjudged(), rules):
        work.take(scan)
    return work.picture(), tuple(work.verdicts[index] for index in range(len(measurements)))


def prune(picture: Picture, now_s: float, rules: TrackRules) -> tuple[Picture, tuple[Track, ...]]:
    """Return the picture as it stands at ``now_s``, and the threats that left it: not reported for too long."""
    before = picture.tracks
    left = {name: aged(track, now_s, rules) for name, track in before.items() if not has_left(track, now_s, rules)}
    gone = tuple(track for name, track in before.items() if name not in left)
    changed = gone or any(left[name] is not track for name, track in before.items())
    sources = {
        name: watch for name, watch in picture.sources.items() if now_s - watch.last_heard_s <= rules.source_memory_s
    }
    tracks = MappingProxyType(left) if changed else before
    return replace(picture, tracks=tracks, sources=MappingProxyType(sources)), gone


def dismiss(picture: Picture, track_id: str) -> Picture:
    """Return the picture without a threat. Raises KeyError if there is none of this id."""
    left = dict(picture.tracks)
    del left[track_id]
    return replace(picture, tracks=MappingProxyType(left))


class _Work:
    """One update in progress."""

    def __init__(self, picture: Picture, measurements: Sequence[Measurement], now_s: float, rules: TrackRules) -> None:
        self.verdicts: dict[int, Verdict] = {}
        self._tracks = dict(picture.tracks)
        self._sources = picture.sources
        self._tallies: dict[str, Tally] = {}
        self._named = picture.named
        of, newest = picture.stack or (None, None)
        known = newest is not None and of is picture.tracks
        self._newest = newest.copy() if newest is not None and known else Stack(_states(picture.tracks))
        self._measurements = measurements
        self._seen: set[Measurement] = set()
        self._suspects: dict[int, Refusal] = {}
        self._now_s = now_s
        self._rules = rules

    def picture(self) -> Picture:
        heard = {source: tally.watch() for source, tally in self._tallies.items()}
        tracks = MappingProxyType(self._tracks)
        return Picture(
            tracks=tracks,
            sources=MappingProxyType({**self._sources, **heard}),
            named=self._named,
            stack=(tracks, self._newest),
        )

    def unjudged(self) -> list[int]:
        return [index for index in range(len(self._measurements)) if index not in self.verdicts]

    def screen(self, index: int, hosts_m: Mapping[str, Vector3], clock: ReportRules) -> None:
        """Watch the source's clock, and refuse what needs no track to be refused."""
        measurement = self._measurements[index]
        source = measurement.source
        if source not in self._tallies:
            self._tallies[source] = Tally(self._sources.get(source), self._now_s)
        self._tallies[source].hear(measurement.time_s)
        seen = len(self._seen)
        self._seen.add(measurement)
        refusal = refusal_of(measurement, self._now_s, clock)
        if refusal is None and len(self._seen) == seen:
            problem = f"{measurement.source!r} has sent the same report twice"
            refusal = Refusal(RefusalKind.DUPLICATE, "time", problem)
        if refusal is not None:
            self._refuse(index, refusal)
        elif (suspicion := on_own_host(measurement, self._rules, hosts_m)) is not None:
            self._suspects[index] = suspicion

    def take(self, scan: Sequence[int]) -> None:
        """Associate one scan, correct the tracks it speaks of and begin the new ones."""
        measurements = [self._measurements[index] for index in scan]
        suspects = {position: self._suspects[index] for position, index in enumerate(scan) if index in self._suspects}
        association = associate(self._tracks, self._newest, measurements, suspects, self._rules)
        for position in association.released:
            self._release(measurements[position])
        for position, refusal in association.refusals.items():
            self._refuse(scan[position], refusal)
        tracks = [self._tracks[track_id] for track_id in association.tracks.values()]
        matched = [measurements[position] for position in association.tracks]
        histories = insert([track.steps for track in tracks], matched, self._rules) if matched else []
        for position, track, steps in zip(association.tracks, tracks, histories, strict=True):
            measurement = measurements[position]
            self._tracks[track.id] = extend(track, measurement, steps, now_s=self._now_s, rules=self._rules)
            self._newest.put(track.id, steps[-1].state)
            self._believe(scan[position], track.id, out_of_order=measurement.time_s < track.time_s)
        for position, measurement in enumerate(measurements):
            if position not in association.tracks and position not in association.refusals:
                assert isinstance(measurement, Report), "an unexplained bearing is refused"
                track_id = self._name(measurement)
                track = begin(track_id, measurement, now_s=self._now_s, rules=self._rules)
                self._tracks[track_id] = track
                self._newest.put(track_id, track.state)
                self._believe(scan[position], track_id, out_of_order=False)

    def _believe(self, index: int, track_id: str, *, out_of_order: bool) -> None:
        self.verdicts[index] = track_id
        tally = self._tallies[self._measurements[index].source]
        tally.accepted += 1
        tally.out_of_order += out_of_order

    def _refuse(self, index: int, refusal: Refusal) -> None:
        self.verdicts[index] = refusal
        self._tallies[self._measurements[index].source].refuse(refusal.kind)

    def _release(self, measurement: Measurement) -> None:
        if measurement.threat_id is None:
            return
        for track in self._tracks.values():
            if track.is_bound_to(measurement.source, measurement.threat_id):
                self._tracks[track.id] = without_id(track, measurement.source, measurement.threat_id)

    def _name(self, report: Report) -> str:
        """The source's id where it is free, else made unique with the source's name; a report without one gets ours."""
        if report.threat_id is not None:
            for name in (report.threat_id, f"{report.source}/{report.threat_id}"):
                if name not in self._tracks:
                    return name
        self._named += 1
        while f"T{self._named}" in self._tracks:
            self._named += 1
        return f"T{self._named}"


def _states(tracks: Mapping[str, Track]) -> dict[str, State]:
    return {track.id: track.state for track in tracks.values()}


def _scans(measurements: Sequence[Measurement], indices: Sequence[int], rules: TrackRules) -> list[list[int]]:
    """Put measurements in order of time and part them into scans: of one source, at one time, of different ids."""
    scans: list[list[int]] = []
    open_scans: dict[str, tuple[list[int], float, set[str]]] = {}
    for index in sorted(indices, key=lambda each: measurements[each].time_s):
        each = measurements[index]
        scan, started_s, ids = open_scans.get(each.source, ([], -math.inf, set()))
        if each.time_s > started_s + rules.scan_s or each.threat_id in ids:
            scan, ids = [], set()
            open_scans[each.source] = (scan, each.time_s, ids)
            scans.append(scan)
        scan.append(index)
        if each.threat_id is not None:
            ids.add(each.threat_id)
    return scans
