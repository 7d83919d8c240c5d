"""The life of a track: tentative → confirmed ⇄ coasting → gone.

              M of N, or an id of its source's own
tentative ────────────────────────────────────────▶ confirmed ◀──────────┐
    │ nothing for tentative_timeout_s                   │ nothing for     │ a report
    ▼                                                   ▼ coast_after_s   │
   gone ◀──────────────────────────────────────────  coasting ───────────┘
                  nothing for timeout_s
"""

from dataclasses import replace

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks.filter import first_state
from hsop_gcs.tracks.history import Step, Steps
from hsop_gcs.tracks.rules import ConfirmAtOnce, TrackRules
from hsop_gcs.tracks.track import Binding, Track, TrackStatus


def begin(track_id: str, report: Report, *, now_s: float, rules: TrackRules) -> Track:
    """Start a track from its first report."""
    steps = (Step(measurement=report, state=first_state(report, rules)),)
    track = Track(
        id=track_id,
        source=report.source,
        source_threat_id=report.threat_id,
        sources=(),
        status=TrackStatus.TENTATIVE,
        velocity_known=False,
        size_m=report.size_m or rules.default_size_m,
        reports=0,
        first_seen_s=report.time_s,
        steps=steps,
    )
    return extend(track, report, steps, now_s=now_s, rules=rules)


def extend(track: Track, measurement: Measurement, steps: Steps, *, now_s: float, rules: TrackRules) -> Track:
    """Return the track with a measurement that ``steps`` already hold."""
    size_m = measurement.size_m if isinstance(measurement, Report) else None
    confirmed = track.status is not TrackStatus.TENTATIVE or _confirms(measurement, rules) or _m_of_n(steps, rules)
    extended = Track(
        id=track.id,
        source=track.source,
        source_threat_id=track.source_threat_id,
        sources=_bound(track.sources, measurement),
        status=TrackStatus.CONFIRMED if confirmed else TrackStatus.TENTATIVE,
        velocity_known=steps[-1].state.velocity_variance_m2ps2 <= rules.velocity_known_sigma_mps**2,
        size_m=size_m or track.size_m,
        reports=track.reports + 1,
        first_seen_s=min(track.first_seen_s, steps[0].time_s),
        steps=steps,
    )
    return aged(extended, now_s, rules)


def aged(track: Track, now_s: float, rules: TrackRules) -> Track:
    """Return the track as it stands at ``now_s``: coasting if it was confirmed and nothing came lately."""
    if track.status is TrackStatus.TENTATIVE:
        return track
    coasting = now_s - track.time_s > rules.coast_after_s
    status = TrackStatus.COASTING if coasting else TrackStatus.CONFIRMED
    return track if status is track.status else replace(track, status=status)


def has_left(track: Track, now_s: float, rules: TrackRules) -> bool:
    """Return whether nothing has come for so long that the track is over."""
    tentative = track.status is TrackStatus.TENTATIVE
    return now_s - track.time_s > (min(rules.tentative_timeout_s, rules.timeout_s) if tentative else rules.timeout_s)


def without_id(track: Track, source: str, threat_id: str) -> Track:
    """Return the track to which a source's id does not belong any more."""
    return replace(
        track, sources=tuple(each for each in track.sources if (each.source, each.threat_id) != (source, threat_id))
    )


def _confirms(measurement: Measurement, rules: TrackRules) -> bool:
    if measurement.threat_id is None or not isinstance(measurement, Report):
        return False
    match rules.confirm_at_once:
        case ConfirmAtOnce.ID:
            return True
        case ConfirmAtOnce.ID_AND_VELOCITY:
            return measurement.velocity_mps is not None
        case ConfirmAtOnce.NEVER:
            return False


def _m_of_n(steps: Steps, rules: TrackRules) -> bool:
    newest_s = steps[-1].time_s
    slots = {round((newest_s - each.time_s) / rules.confirm_slot_s) for each in steps}
    return sum(slot < rules.confirm_slots for slot in slots) >= rules.confirm_hits


def _bound(bindings: tuple[Binding, ...], measurement: Measurement) -> tuple[Binding, ...]:
    if measurement.threat_id is None:
        return bindings
    source, threat_id, time_s = measurement.source, measurement.threat_id, measurement.time_s
    for index, each in enumerate(bindings):
        if each.source == source and each.threat_id == threat_id:
            newest = Binding(source=source, threat_id=threat_id, time_s=max(each.time_s, time_s))
            return (*bindings[:index], newest, *bindings[index + 1 :])
    return (*bindings, Binding(source=source, threat_id=threat_id, time_s=time_s))
