"""Which measurement is of which threat: by the id it bears where that is possible, else by global nearest neighbour.

An id binds a report to its track. It is let go when the report is impossible there while another source keeps the
track where it is: then the two were never one threat. A threat known by that one id alone has manoeuvred, or the
report is wrong if no aircraft flies so fast.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.gate import distances, gate, impossible, predicted
from hsop_gcs.tracks.history import can_take, state_before, step_before
from hsop_gcs.tracks.kernels import FORBIDDEN
from hsop_gcs.tracks.own import Suspicion
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.sources import Refusal, RefusalKind
from hsop_gcs.tracks.table import Table
from hsop_gcs.tracks.track import Binding, Track


@dataclass(slots=True)
class Association:
    """What became of one scan, by the index of each measurement in it; those in neither mapping are of new threats."""

    tracks: dict[int, int] = field(default_factory=dict)
    """The row of the track it belongs to."""
    refusals: dict[int, Refusal] = field(default_factory=dict)
    released: set[int] = field(default_factory=set)
    """Those whose id is bound no more to the track it was bound to."""


def associate(
    table: Table,
    scan: Sequence[Measurement],
    rows: FloatArray,
    hinted: Mapping[int, int],
    suspects: Mapping[int, Suspicion],
    rules: TrackRules,
) -> Association:
    """Give each measurement of a scan to at most one track, and each track at most one measurement.

    ``rows``: of the scan. ``hinted``: see ``hints``. ``suspects``: measurements that may be of a host of ours. They
    begin no track, and are refused unless they are of one: by their id, or, without an id, because they lie likelier at
    the threat than at the host, or because the track may be that host itself.
    """
    found = Association(
        refusals={
            index: each.refusal
            for index, each in suspects.items()
            if index not in hinted and scan[index].threat_id is not None
        }
    )
    if hinted:
        _follow_hints(table, scan, rows, hinted, rules, found)
    free = [index for index in range(len(scan)) if index not in found.tracks and index not in found.refusals]
    if free:
        barred = {index: hinted[index] for index in found.released}
        _add_nearest(table, scan, rows, free, barred, suspects, rules, found)
    for index, each in suspects.items():
        if index not in found.tracks:
            found.refusals.setdefault(index, each.refusal)
    return found


def _follow_hints(
    table: Table,
    scan: Sequence[Measurement],
    rows: FloatArray,
    hinted: Mapping[int, int],
    rules: TrackRules,
    found: Association,
) -> None:
    """Give measurements to the tracks their ids stand for, unless that is impossible."""
    newest = table.newest
    newest_s = table.log.steps.times_s[newest].tolist()
    steps: dict[int, int] = {}
    for index, row in hinted.items():
        measurement, steps[index] = scan[index], newest.item(row)
        if measurement.time_s <= newest_s[row]:
            track = table.track(row)
            steps[index] = step_before(track.steps, measurement.time_s)
            if (refusal := _untimely(track, measurement, rules)) is not None:
                found.refusals[index] = refusal
    open_ = [index for index in hinted if index not in found.refusals]
    for index, distance in zip(open_, _distances(table, scan, rows, steps, open_, rules), strict=True):
        measurement, row = scan[index], hinted[index]
        if distance < impossible(measurement, rules):
            found.tracks[index] = row
        elif isinstance(measurement, Bearing) or _is_held_by_others(track := table.track(row), measurement, rules):
            found.released.add(index)
        elif (refusal := _out_of_reach(track, measurement, rules)) is not None:
            found.refusals[index] = refusal
        else:
            found.tracks[index] = row


def _distances(
    table: Table,
    scan: Sequence[Measurement],
    rows: FloatArray,
    steps: Mapping[int, int],
    chosen: Sequence[int],
    rules: TrackRules,
) -> list[float]:
    """The squared Mahalanobis distances of chosen measurements of a scan from what was believed after steps."""
    at = np.array([steps[index] for index in chosen], dtype=np.int64)
    squared = kernels.distances(*table.log.steps[:3], at, rows[chosen], rules.acceleration_psd_m2ps3)
    for number, index in enumerate(chosen):
        if isinstance(bearing := scan[index], Bearing):
            squared[number] = distances([table.log.state(steps[index])], [bearing], rules)[0][0]
    found: list[float] = squared.tolist()
    return found


def hints(table: Table, scan: Sequence[Measurement]) -> dict[int, int]:
    """Return the row of the track that each measurement's id stands for, by index; a track at most once."""
    found: dict[int, int] = {}
    taken: set[int] = set()
    for index, each in enumerate(scan):
        if each.threat_id is None and each.track_id is None:
            continue
        row = None if each.track_id is None else table.rows.get(each.track_id)
        if row is None and each.threat_id is not None:
            row = _bound_to(table, (each.source, each.threat_id))
        if row is not None and row not in taken:
            found[index] = row
            taken.add(row)
    return found


def _bound_to(table: Table, binding: tuple[str, str]) -> int | None:
    """Return the row of the track that a source's id stands for. Most bear that very id, which spares the search."""
    namesake = table.rows.get(binding[1])
    if namesake is not None and binding in table.names[namesake].sources:
        return namesake
    return next((row for row, name in enumerate(table.names) if binding in name.sources), None)


def _add_nearest(
    table: Table,
    scan: Sequence[Measurement],
    rows: FloatArray,
    free: Sequence[int],
    barred: Mapping[int, int],
    suspects: Mapping[int, Suspicion],
    rules: TrackRules,
    found: Association,
) -> None:
    """Global nearest neighbour: the pairs inside their gates with the least sum of -2 log likelihood."""
    cost, doubtful = kernels.in_gates(
        *table.log.steps[:3],
        table.facts,
        rows if len(free) == len(scan) else rows[free],
        rules.acceleration_psd_m2ps3,
        rules.scan_s,
    )
    doubts = set(map(tuple, doubtful.tolist()))
    for number, index in enumerate(free):
        if isinstance(bearing := scan[index], Bearing) and table.names:
            cost[number, : len(table)] = _costs(table, bearing, rules)
            doubts |= {(number, row) for row in range(len(table)) if cost[number, row] < FORBIDDEN}
    if found.tracks:
        cost[:, list(found.tracks.values())] = FORBIDDEN
    for number, index in enumerate(free):
        if index in suspects:
            for row in np.nonzero(cost[number, : len(table.names)] < FORBIDDEN)[0].tolist():
                if not _outweighs(table, row, scan[index], suspects[index], rules):
                    cost[number, row] = FORBIDDEN
    # looked up once for all pairs they are in: where every track lies in every gate, the pairs are very many
    told: dict[int, list[Measurement]] = {}
    from_s = min(scan[index].time_s for index in free) - rules.scan_s
    for number, row in sorted(doubts):
        if cost[number, row] == FORBIDDEN:
            continue
        index = free[number]
        if row not in told:
            told[row] = list(table.history(row).since(from_s))
        same_scan = _of_same_scan(told[row], scan[index], rules)
        barring = barred.get(index) == row or _has_other_id(table.names[row].sources, scan[index])
        if barring or same_scan:
            cost[number, row] = FORBIDDEN
        if scan[index] in same_scan and not barring:
            found.refusals[index] = _duplicate(table.track(row))
    for number, row in enumerate(kernels.assigned(cost).tolist()):
        index = free[number]
        if cost[number, row] < FORBIDDEN and index not in found.refusals:
            doubted = (number, row) in doubts
            refusal = _untimely(table.track(row), scan[index], rules) if doubted else None
            if refusal is None:
                found.tracks[index] = row
            else:
                found.refusals[index] = refusal
    for index in free:
        if isinstance(bearing := scan[index], Bearing) and index not in found.tracks and index not in found.refusals:
            found.refusals[index] = Refusal(
                RefusalKind.UNEXPLAINED, "direction", f"no known threat lies there, as {bearing.source!r} sees it"
            )


def _outweighs(table: Table, row: int, measurement: Measurement, suspicion: Suspicion, rules: TrackRules) -> bool:
    """Whether a measurement that may be of a host of ours is likelier of a track, or that track may be the host."""
    assert isinstance(measurement, Report), "a bearing is of no host"
    name, state = table.names[row], table.log.state(int(table.facts[row, kernels.NEWEST]))
    if suspicion.host in name.not_apart:
        return True
    mean, covariance = predicted([state], [measurement.time_s], rules)
    sigma_m = rules.default_sigma_m if measurement.sigma_m is None else measurement.sigma_m
    noise = np.eye(3) * sigma_m**2 if measurement.covariance_m2 is None else np.array(measurement.covariance_m2)
    spread, off_m = covariance[0, :3, :3] + noise, mean[0, :3] - np.array(measurement.position_m)
    cost = float(off_m @ np.linalg.solve(spread, off_m)) + float(np.linalg.slogdet(spread)[1])
    return cost < suspicion.cost


def _costs(table: Table, bearing: Bearing, rules: TrackRules) -> FloatArray:
    """Return what it costs to give a bearing to each track, as ``kernels.in_gates`` does."""
    squared, log_det = distances([table.log.state(at) for at in table.newest.tolist()], [bearing] * len(table), rules)
    second = np.where(table.facts[:, kernels.STATUS] == kernels.TENTATIVE, kernels.SECOND_CHOICE, 0.0)
    return np.where(squared <= gate(bearing, rules), squared + log_det + second, FORBIDDEN)


def _has_other_id(bindings: Sequence[Binding], measurement: Measurement) -> bool:
    """Whether the source knows a track of these ids by another one: it says that these are two threats."""
    if measurement.threat_id is None:
        return False
    return any([each.source == measurement.source and each.threat_id != measurement.threat_id for each in bindings])


def _of_same_scan(lately: Sequence[Measurement], measurement: Measurement, rules: TrackRules) -> list[Measurement]:
    """Return what the same source has said of the track at the same time, of what the track was told lately."""
    from_s, to_s = measurement.time_s - rules.scan_s, measurement.time_s + rules.scan_s
    return [each for each in lately if from_s <= each.time_s <= to_s and each.source == measurement.source]


def _untimely(track: Track, measurement: Measurement, rules: TrackRules) -> Refusal | None:
    if measurement.time_s > track.time_s:
        return None
    if not can_take(track.steps, measurement, rules):
        late_s = track.time_s - measurement.time_s
        return Refusal(
            RefusalKind.LATE,
            "time",
            f"{late_s:.1f} s older than the newest report of threat {track.id!r}; the limit is {rules.lag_s:g} s",
        )
    told = track.steps.since(measurement.time_s)
    repeated = any(each.time_s == measurement.time_s and _same_sighting(each, measurement) for each in told)
    return _duplicate(track) if repeated else None


def _same_sighting(known: Measurement, new: Measurement) -> bool:
    if known.source != new.source:
        return False
    return known == new if new.threat_id is None else known.threat_id == new.threat_id


def _duplicate(track: Track) -> Refusal:
    return Refusal(RefusalKind.DUPLICATE, "time", f"threat {track.id!r} has already been reported at this time")


def _is_held_by_others(track: Track, measurement: Report, rules: TrackRules) -> bool:
    """Whether another source, or another id, has lately reported the track."""
    told = track.steps.since(measurement.time_s - rules.coast_after_s)
    return any((each.source, each.threat_id) != (measurement.source, measurement.threat_id) for each in told)


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
