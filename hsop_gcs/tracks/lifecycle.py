"""The life of a track: tentative → confirmed ⇄ coasting → gone.

              M of N, or an id of its source's own
tentative ────────────────────────────────────────▶ confirmed ◀──────────┐
    │ nothing for tentative_timeout_s                   │ nothing for     │ a report
    ▼                                                   ▼ coast_after_s   │
   gone ◀──────────────────────────────────────────  coasting ───────────┘
                  nothing for timeout_s
"""

import math
from collections.abc import Sequence

import numpy as np

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks import kernels, track_kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.kernels import IntArray
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.table import Name, Table
from hsop_gcs.tracks.track import Binding, Track, TrackStatus


def begin(
    table: Table, names: Sequence[str], reports: Sequence[Report], rows: FloatArray, *, now_s: float, rules: TrackRules
) -> None:
    """Start tracks from their first reports."""
    log = table.log
    newest = log.begin(reports, rows, rules)
    start = len(table)
    facts = [(at, kernels.TENTATIVE, False, rules.default_size_m, 0, math.inf) for at in newest.tolist()]
    table.facts = np.concatenate((table.facts, np.array(facts)))
    for name, each in zip(names, reports, strict=True):
        table.add(Name(name, each.source, each.threat_id, ()))
    _live(table, np.arange(start, len(table)), newest, reports, rows, now_s, rules)


def tell(
    table: Table,
    tracks: IntArray,
    measurements: Sequence[Measurement],
    rows: FloatArray,
    *,
    now_s: float,
    rules: TrackRules,
) -> int:
    """Tell tracks, by their rows in the table, a measurement each; return how many were out of order."""
    newest = table.log.follow(table.newest[tracks], measurements, rows, rules)
    return _live(table, tracks, newest, measurements, rows, now_s, rules)


def take(
    table: Table, scan: Sequence[Measurement], rows: FloatArray, *, now_s: float, rules: TrackRules
) -> dict[int, int] | None:
    """Tell tracks the reports of a scan, by global nearest neighbour, unless there is more to weigh than distances.

    Return which row in the table each was told, by its index in the scan; None if nothing was told: see ``associate``.
    """
    log = table.log
    end = log.make_room(len(scan))
    tracks = track_kernels.take(
        *log.steps,
        table.facts,
        rows,
        end,
        rules.acceleration_psd_m2ps3,
        rules.scan_s,
        _life(now_s, rules),
    ).tolist()
    if not tracks:
        return None
    told = {index: track for index, track in enumerate(tracks) if track >= 0}
    log.measurements += [scan[index] for index in told]
    return told


def aged(table: Table, now_s: float, rules: TrackRules) -> tuple[Table, dict[str, float]]:
    """Return the table as it stands at ``now_s``, the same one if nothing has changed; and who left it, heard when."""
    facts, times_s = table.facts.copy(), table.log.steps.times_s
    if not track_kernels.age(times_s, facts, now_s, rules.coast_after_s, rules.tentative_timeout_s, rules.timeout_s):
        return table, {}
    statuses = facts[:, kernels.STATUS].tolist()
    kept = [row for row, status in enumerate(statuses) if status != kernels.GONE]
    gone = {
        table.names[row].id: times_s.item(int(facts.item(row, kernels.NEWEST)))
        for row, status in enumerate(statuses)
        if status == kernels.GONE
    }
    return table.only(kept, facts), gone


def has_left(track: Track, now_s: float, rules: TrackRules) -> bool:
    """Return whether nothing has come for so long that the track is over."""
    status = kernels.TENTATIVE if track.status is TrackStatus.TENTATIVE else kernels.CONFIRMED
    return track_kernels.has_left(status, track.time_s, now_s, rules.tentative_timeout_s, rules.timeout_s)


def release(table: Table, binding: Binding) -> None:
    """Let go of a source's id, whichever track it stands for."""
    for row, name in enumerate(table.names):
        if binding in name.sources:
            table.names[row] = name._replace(sources=tuple(each for each in name.sources if each != binding))


def _live(
    table: Table,
    tracks: IntArray,
    newest: IntArray,
    measurements: Sequence[Measurement],
    rows: FloatArray,
    now_s: float,
    rules: TrackRules,
) -> int:
    """Write down what measurements, which led to the ``newest`` steps, mean; return how many were out of order."""
    late = track_kernels.live(*table.log.life, table.facts, tracks, newest, rows, _life(now_s, rules))
    for row, each in zip(tracks.tolist(), measurements, strict=True):
        if each.threat_id is not None:
            binding, name = Binding(each.source, each.threat_id), table.names[row]
            if binding not in name.sources:
                table.names[row] = name._replace(sources=(*name.sources, binding))
    return late


def _life(now_s: float, rules: TrackRules) -> track_kernels.Life:
    known, hits, slots = rules.velocity_known_sigma_mps**2, float(rules.confirm_hits), float(rules.confirm_slots)
    return now_s, rules.coast_after_s, known, hits, slots, rules.confirm_slot_s
