"""The life of a track: tentative → confirmed ⇄ coasting → gone.

              M of N, or an id of its source's own
tentative ────────────────────────────────────────▶ confirmed ◀──────────┐
    │ nothing for tentative_timeout_s                   │ nothing for     │ a report
    ▼                                                   ▼ coast_after_s   │
   gone ◀──────────────────────────────────────────  coasting ───────────┘
                  nothing for timeout_s
"""

from collections.abc import Mapping, Sequence

import numpy as np

from hsop_gcs.reports import Measurement, ReportRules
from hsop_gcs.tracks import kernels, track_kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.kernels import IntArray
from hsop_gcs.tracks.measured import numbers_of
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.table import Name, Table
from hsop_gcs.tracks.track import Binding, Track, TrackStatus


def unknown(table: Table, count: int) -> None:
    """Add the facts of tracks that have not been told anything."""
    new = np.empty((count, kernels.FACTS))
    for facts in new:
        track_kernels.unknown(facts, table.numbers)
    table.facts = np.concatenate((table.facts, new))


def tell(
    table: Table,
    tracks: IntArray,
    measurements: Sequence[Measurement],
    rows: FloatArray,
    *,
    now_s: float,
) -> int:
    """Tell tracks, by their rows in the table, a measurement each; return how many were out of order."""
    newest = table.log.follow(table.newest[tracks], measurements, rows, table.rules)
    table.facts = table.facts.copy()
    late = track_kernels.live(*table.log.life, table.facts, tracks, newest, rows, now_s, table.numbers)
    bind(table, tracks.tolist(), measurements)
    return late


def take(
    table: Table,
    scan: Sequence[Measurement],
    rows: FloatArray,
    hinted: Mapping[int, int],
    *,
    clock: ReportRules,
    now_s: float,
) -> list[int]:
    """Tell tracks the reports of a scan, begin those that are of none, unless there is more to weigh than distances.

    ``rows``: of the scan. ``hinted``: see ``associate.hints``. Return the row of the track of each in the table, where
    new ones await their names; nothing if nothing was done.
    """
    log, count = table.log, len(scan)
    for index, track in hinted.items():
        rows[index, kernels.HINT] = track + 1
    facts, tracks = np.empty((len(table.facts) + count, kernels.FACTS)), np.empty(count, np.int64)
    end = log.make_room(count)
    total = track_kernels.take(
        *log.steps,
        table.facts,
        facts,
        rows,
        tracks,
        end,
        now_s,
        clock.max_future_s,
        clock.max_age_s,
        table.numbers,
    )
    if total < 0:
        return []
    table.facts = facts[:total]
    log.measurements += scan
    told: list[int] = tracks.tolist()
    return told


def bind(table: Table, tracks: Sequence[int], measurements: Sequence[Measurement]) -> None:
    """Let the ids that measurements bear stand for their tracks, by their rows in the table."""
    names: list[Name] | None = None
    for row, each in zip(tracks, measurements, strict=True):
        if each.threat_id is not None:
            binding, name = Binding(each.source, each.threat_id), table.names[row]
            if binding not in name.sources:
                names = names or list(table.names)
                names[row] = name._replace(sources=(*name.sources, binding))
    if names is not None:
        table.names = tuple(names)


def aged(table: Table, now_s: float, rules: TrackRules) -> tuple[Table, dict[str, float]]:
    """Return the table as it stands at ``now_s``, the same one if nothing has changed; and who left it, heard when."""
    times_s, numbers = table.log.steps.times_s, table.numbers if rules is table.rules else numbers_of(rules)
    if not track_kernels.is_aged(times_s, table.facts, now_s, numbers):
        return table, {}
    facts, gone, heard_s = track_kernels.aged(times_s, table.facts, now_s, numbers)
    left = {table.names[row].id: time_s for row, time_s in zip(gone.tolist(), heard_s.tolist(), strict=True)}
    return table.without(left, facts), left


def has_left(track: Track, now_s: float, rules: TrackRules) -> bool:
    """Return whether nothing has come for so long that the track is over."""
    status = kernels.TENTATIVE if track.status is TrackStatus.TENTATIVE else kernels.CONFIRMED
    return track_kernels.status_at(status, track.time_s, now_s, numbers_of(rules)) == kernels.GONE


def release(table: Table, binding: Binding) -> None:
    """Let go of a source's id, whichever track it stands for."""
    table.names = tuple(
        [
            name._replace(sources=tuple(each for each in name.sources if each != binding))
            if binding in name.sources
            else name
            for name in table.names
        ]
    )
