"""Which measurement is of which threat: by the id it bears where that is possible, else by global nearest neighbour.

An id binds a report to its track. It is let go when the report is impossible there while another source keeps the
track where it is: then the two were never one threat. A threat known by that one id alone has manoeuvred, or the
report is wrong if no aircraft flies so fast.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks.filter import FloatArray, State, surely_within
from hsop_gcs.tracks.gate import Stack, distances, gate, impossible
from hsop_gcs.tracks.history import Steps, can_take, state_before
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.sources import Refusal, RefusalKind
from hsop_gcs.tracks.track import Track, TrackStatus

_FORBIDDEN = 1e9
"""Cost of a pair outside its gate; above any sum of the others."""
_SECOND_CHOICE = 1e4
"""Added for a tentative track; above any sum of distances inside gates: confirmed ones come first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Association:
    """What became of one scan, by the index of each measurement in it; those in neither mapping are of new threats."""

    tracks: Mapping[int, str]
    """The id of the track it belongs to."""
    refusals: Mapping[int, Refusal]
    released: frozenset[int]
    """Those whose id is bound no more to the track it was bound to."""


def associate(
    tracks: Mapping[str, Track],
    newest: Stack,
    scan: Sequence[Measurement],
    suspects: Mapping[int, Refusal],
    rules: TrackRules,
) -> Association:
    """Give each measurement of a scan to at most one track, and each track at most one measurement.

    ``newest``: of all tracks. ``suspects``: measurements that are refused unless they bear a known threat's id and lie
    in its gate.
    """
    hinted = _hints(tracks, scan)
    found = _Found(refusals={index: refusal for index, refusal in suspects.items() if index not in hinted})
    _follow_hints(tracks, scan, hinted, suspects, rules, found)
    free = {index: each for index, each in enumerate(scan) if index not in found.tracks and index not in found.refusals}
    if free:
        _add_nearest(tracks, newest, free, {index: hinted[index] for index in found.released}, rules, found)
    return Association(tracks=found.tracks, refusals=found.refusals, released=frozenset(found.released))


@dataclass(slots=True, kw_only=True)
class _Found:
    """An association in the making."""

    tracks: dict[int, str] = field(default_factory=dict)
    refusals: dict[int, Refusal]
    released: set[int] = field(default_factory=set)


def _follow_hints(
    tracks: Mapping[str, Track],
    scan: Sequence[Measurement],
    hinted: Mapping[int, str],
    suspects: Mapping[int, Refusal],
    rules: TrackRules,
    found: _Found,
) -> None:
    """Give measurements to the tracks their ids stand for, unless that is impossible."""
    states: dict[int, State] = {}
    for index, track_id in hinted.items():
        measurement, track = scan[index], tracks[track_id]
        state = state_before(track.steps, measurement.time_s)
        if (refusal := _untimely(track, measurement, rules)) is not None:
            found.refusals[index] = refusal
        elif isinstance(measurement, Report) and surely_within(state, measurement, gate(measurement, rules), rules):
            found.tracks[index] = track_id
        else:
            states[index] = state
    if not states:
        return
    squared, _ = distances(list(states.values()), [scan[index] for index in states], rules)
    for index, distance in zip(states, squared.tolist(), strict=True):
        measurement, track = scan[index], tracks[hinted[index]]
        if index in suspects and distance > gate(measurement, rules):
            found.refusals[index] = suspects[index]
        elif distance < impossible(measurement, rules):
            found.tracks[index] = track.id
        elif isinstance(measurement, Bearing) or _is_held_by_others(track, measurement, rules):
            found.released.add(index)
        elif (refusal := _out_of_reach(track, measurement, rules)) is not None:
            found.refusals[index] = refusal
        else:
            found.tracks[index] = track.id


def _hints(tracks: Mapping[str, Track], scan: Sequence[Measurement]) -> dict[int, str]:
    """Return the track that each measurement's id stands for, by index; a track at most once."""
    found: dict[int, str] = {}
    taken: set[str] = set()
    for index, each in enumerate(scan):
        track_id = each.track_id if each.track_id in tracks else _bound_to(tracks, each.source, each.threat_id)
        if track_id is not None and track_id not in taken:
            found[index] = track_id
            taken.add(track_id)
    return found


def _bound_to(tracks: Mapping[str, Track], source: str, threat_id: str | None) -> str | None:
    """Return the track that a source's id stands for. Most bear that very id, which spares the search."""
    if threat_id is None:
        return None
    namesake = tracks.get(threat_id)
    if namesake is not None and namesake.is_bound_to(source, threat_id):
        return namesake.id
    return next((track.id for track in tracks.values() if track.is_bound_to(source, threat_id)), None)


def _add_nearest(
    tracks: Mapping[str, Track],
    newest: Stack,
    scan: Mapping[int, Measurement],
    barred: Mapping[int, str],
    rules: TrackRules,
    found: _Found,
) -> None:
    """Global nearest neighbour: the pairs inside their gates with the least sum of -2 log likelihood."""
    indices, measurements = list(scan), list(scan.values())
    values = _in_gates(tracks, newest, measurements, rules)
    taken = set(found.tracks.values())
    cost = np.full(values.shape, _FORBIDDEN)
    for row, column in np.argwhere(values < np.inf).tolist():
        track, measurement, index = tracks[newest.ids[column]], measurements[row], indices[row]
        if track.id in taken or barred.get(index) == track.id or _has_other_id(track, measurement):
            continue
        same_scan = _of_same_scan(track.steps, measurement, rules)
        if measurement in same_scan:
            found.refusals[index] = _duplicate(track)
        elif not same_scan:
            second = _SECOND_CHOICE if track.status is TrackStatus.TENTATIVE else 0.0
            cost[row, column] = values[row, column] + second
    assigned_rows, assigned_columns = linear_sum_assignment(cost)
    for row, column in zip(assigned_rows.tolist(), assigned_columns.tolist(), strict=True):
        index = indices[row]
        if cost[row, column] < _FORBIDDEN and index not in found.refusals:
            track = tracks[newest.ids[column]]
            refusal = _untimely(track, measurements[row], rules)
            if refusal is None:
                found.tracks[index] = track.id
            else:
                found.refusals[index] = refusal
    for index, measurement in scan.items():
        if isinstance(measurement, Bearing) and index not in found.tracks and index not in found.refusals:
            found.refusals[index] = Refusal(
                RefusalKind.UNEXPLAINED, "direction", f"no known threat lies there, as {measurement.source!r} sees it"
            )


def _in_gates(
    tracks: Mapping[str, Track], newest: Stack, measurements: Sequence[Measurement], rules: TrackRules
) -> FloatArray:
    """Return (measurements, tracks): squared distance plus log det S of each pair inside its gate, else infinity."""
    values = np.full((len(measurements), len(newest.ids)), np.inf)
    rows = [row for row, each in enumerate(measurements) if isinstance(each, Report)]
    if rows:
        values[rows] = newest.in_gates([each for each in measurements if isinstance(each, Report)], rules)
    for row, bearing in enumerate(measurements):
        if isinstance(bearing, Bearing) and tracks:
            states = [tracks[track_id].state for track_id in newest.ids]
            squared, log_det = distances(states, [bearing] * len(states), rules)
            values[row] = np.where(squared <= gate(bearing, rules), squared + log_det, np.inf)
    return values


def _has_other_id(track: Track, measurement: Measurement) -> bool:
    """Whether the source knows the track by another id: it says that these are two threats."""
    return measurement.threat_id is not None and any(
        each.source == measurement.source and each.threat_id != measurement.threat_id for each in track.sources
    )


def _of_same_scan(steps: Steps, measurement: Measurement, rules: TrackRules) -> list[Measurement]:
    """Return what the same source has said of the track at the same time."""
    found: list[Measurement] = []
    for each in reversed(steps):
        if each.time_s < measurement.time_s - rules.scan_s:
            break
        if each.measurement.source == measurement.source and each.time_s <= measurement.time_s + rules.scan_s:
            found.append(each.measurement)
    return found


def _untimely(track: Track, measurement: Measurement, rules: TrackRules) -> Refusal | None:
    if not can_take(track.steps, measurement, rules):
        late_s = track.time_s - measurement.time_s
        return Refusal(
            RefusalKind.LATE,
            "time",
            f"{late_s:.1f} s older than the newest report of threat {track.id!r}; the limit is {rules.lag_s:g} s",
        )
    if measurement.time_s > track.time_s:
        return None
    repeated = any(
        each.time_s == measurement.time_s and _same_sighting(each.measurement, measurement) for each in track.steps
    )
    return _duplicate(track) if repeated else None


def _same_sighting(known: Measurement, new: Measurement) -> bool:
    if known.source != new.source:
        return False
    return known == new if new.threat_id is None else known.threat_id == new.threat_id


def _duplicate(track: Track) -> Refusal:
    return Refusal(RefusalKind.DUPLICATE, "time", f"threat {track.id!r} has already been reported at this time")


def _is_held_by_others(track: Track, measurement: Report, rules: TrackRules) -> bool:
    """Whether another source, or another id, has lately reported the track."""
    oldest_s = measurement.time_s - rules.coast_after_s
    return any(
        each.time_s >= oldest_s
        and (each.measurement.source, each.measurement.threat_id) != (measurement.source, measurement.threat_id)
        for each in track.steps
    )


def _out_of_reach(track: Track, report: Report, rules: TrackRules) -> Refusal | None:
    before = state_before(track.steps, report.time_s)
    elapsed_s = abs(report.time_s - before.time_s)
    sigma_m = max(report.sigma_m or 0.0, math.sqrt(before.position_variance_m2))
    jump_m = math.dist(before.mean[:3].tolist(), report.position_m)
    if jump_m <= rules.reach_m + 6 * sigma_m + rules.max_speed_mps * elapsed_s:
        return None
    return Refusal(
        RefusalKind.IMPOSSIBLE,
        "position",
        f"{jump_m:.0f} m from threat {track.id!r} {elapsed_s:.2f} s earlier; more than {rules.max_speed_mps:g} m/s",
    )
