"""The picture: all tracks at one moment, and how a report changes it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from hsop_gcs.errors import BadInput
from hsop_gcs.reports import Report
from hsop_gcs.tracks.track import Track, begin, extend


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRules:
    """How reports become tracks, and how long a track lives without one."""

    timeout_s: float = 10.0
    """A threat not reported for this long has left."""
    gate_m: float = 30.0
    """How far from its prediction a report without a threat id may lie and still be the same threat."""
    velocity_memory_s: float = 5.0
    velocity_baseline_s: float = 0.4
    """Sightings closer in time than this show noise, not speed."""
    max_speed_mps: float = 100.0
    """A report that asks for more than this is not the same threat (or not true)."""
    default_size_m: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """All tracks by id. Frozen: an update is a new picture."""

    tracks: Mapping[str, Track] = field(default_factory=lambda: MappingProxyType({}))
    named: int = 0
    """How many tracks have been given a name of ours (T1, T2, ...)."""


def update(picture: Picture, report: Report, rules: TrackRules) -> tuple[Picture, Track]:
    """Return the picture with the report in it, and the track it belongs to.

    Raises BadInput for a report that is not newer than what its threat already has, or that its threat could not
    have flown to.
    """
    known = _find(picture, report, rules)
    if known is None:
        track_id, named = _name(picture, report)
        track = begin(track_id, report, default_size_m=rules.default_size_m)
        picture = replace(picture, named=named)
    else:
        _check_follows(known, report, rules)
        track = extend(known, report, memory_s=rules.velocity_memory_s, min_baseline_s=rules.velocity_baseline_s)
    return replace(picture, tracks=MappingProxyType({**picture.tracks, track.id: track})), track


def prune(picture: Picture, now_s: float, rules: TrackRules) -> tuple[Picture, tuple[Track, ...]]:
    """Return the picture without threats that have not been reported for too long, and those threats."""
    gone = tuple(track for track in picture.tracks.values() if now_s - track.time_s > rules.timeout_s)
    if not gone:
        return picture, ()
    left = {track.id: track for track in picture.tracks.values() if track not in gone}
    return replace(picture, tracks=MappingProxyType(left)), gone


def _find(picture: Picture, report: Report, rules: TrackRules) -> Track | None:
    """By the source's own id where it gives one, else the nearest prediction within the gate."""
    same_source = [track for track in picture.tracks.values() if track.source == report.source]
    if report.threat_id is not None:
        return next((track for track in same_source if track.source_threat_id == report.threat_id), None)
    gate_m = max(rules.gate_m, 3 * (report.sigma_m or 0.0))
    near = [
        (math.dist(track.position_at(report.time_s), report.position_m), track.id, track)
        for track in same_source
        if track.source_threat_id is None
    ]
    distance_m, _, nearest = min(near, default=(math.inf, "", None))
    return nearest if distance_m <= gate_m else None


def _name(picture: Picture, report: Report) -> tuple[str, int]:
    """The source's id where it is free, else made unique with the source's name; a report without one gets ours."""
    if report.threat_id is not None:
        free = report.threat_id not in picture.tracks
        return (report.threat_id if free else f"{report.source}/{report.threat_id}"), picture.named
    named = picture.named + 1
    while f"T{named}" in picture.tracks:
        named += 1
    return f"T{named}", named


def _check_follows(track: Track, report: Report, rules: TrackRules) -> None:
    elapsed_s = report.time_s - track.time_s
    if elapsed_s <= 0:
        raise BadInput("time", f"{-elapsed_s:.3f} s older than the newest report of threat {track.id!r}, or the same")
    sigma_m = max(report.sigma_m or 0.0, track.sigma_m or 0.0)
    reach_m = rules.gate_m + 6 * sigma_m + rules.max_speed_mps * elapsed_s
    jump_m = math.dist(track.position_m, report.position_m)
    if jump_m > reach_m:
        raise BadInput(
            "position",
            f"{jump_m:.0f} m from threat {track.id!r} {elapsed_s:.2f} s earlier; more than {rules.max_speed_mps:g} m/s",
        )
