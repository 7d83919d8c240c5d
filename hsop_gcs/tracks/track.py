"""One threat as we believe it to be: its last position and a velocity, given or worked out."""

from dataclasses import dataclass

from hsop_gcs.reports import Report, Vector3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One accepted position, seconds since the Unix epoch and ENU metres."""

    time_s: float
    position_m: Vector3


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A threat: its state at ``time_s`` in ENU metres and metres per second."""

    id: str
    source: str
    source_threat_id: str | None
    time_s: float
    position_m: Vector3
    velocity_mps: Vector3
    velocity_known: bool
    """False until a source gave a velocity or a second sighting showed one; the velocity is zero until then."""
    size_m: float
    sigma_m: float | None
    reports: int
    first_seen_s: float
    recent: tuple[Sighting, ...]
    """The sightings a velocity is worked out from, oldest first."""

    def position_at(self, time_s: float) -> Vector3:
        """Return where it is expected at ``time_s``, ENU metres: straight on at constant speed (Eq. 7)."""
        ahead_s = time_s - self.time_s
        x, y, z = (p + ahead_s * v for p, v in zip(self.position_m, self.velocity_mps, strict=True))
        return (x, y, z)


def begin(track_id: str, report: Report, *, default_size_m: float) -> Track:
    """Start a track from its first report."""
    return Track(
        id=track_id,
        source=report.source,
        source_threat_id=report.threat_id,
        time_s=report.time_s,
        position_m=report.position_m,
        velocity_mps=report.velocity_mps or (0.0, 0.0, 0.0),
        velocity_known=report.velocity_mps is not None,
        size_m=report.size_m or default_size_m,
        sigma_m=report.sigma_m,
        reports=1,
        first_seen_s=report.time_s,
        recent=(Sighting(time_s=report.time_s, position_m=report.position_m),),
    )


def extend(track: Track, report: Report, *, memory_s: float, min_baseline_s: float) -> Track:
    """Return the track with a newer report. A velocity the source did not give comes from the last ``memory_s``."""
    sighting = Sighting(time_s=report.time_s, position_m=report.position_m)
    recent = (*(old for old in track.recent if old.time_s >= report.time_s - memory_s), sighting)
    velocity = report.velocity_mps or _slope(recent, min_baseline_s) or track.velocity_mps
    return Track(
        id=track.id,
        source=track.source,
        source_threat_id=track.source_threat_id,
        time_s=report.time_s,
        position_m=report.position_m,
        velocity_mps=velocity,
        velocity_known=track.velocity_known or report.velocity_mps is not None or len(recent) > 1,
        size_m=report.size_m or track.size_m,
        sigma_m=report.sigma_m if report.sigma_m is not None else track.sigma_m,
        reports=track.reports + 1,
        first_seen_s=track.first_seen_s,
        recent=recent,
    )


def _slope(sightings: tuple[Sighting, ...], min_baseline_s: float) -> Vector3 | None:
    """Least-squares velocity through the sightings, or None while they span too little time to show one."""
    if sightings[-1].time_s - sightings[0].time_s < min_baseline_s:
        return None
    count = len(sightings)
    mean_s = sum(each.time_s for each in sightings) / count
    spread = sum((each.time_s - mean_s) ** 2 for each in sightings)
    east, north, up = (
        sum((each.time_s - mean_s) * each.position_m[axis] for each in sightings) / spread for axis in range(3)
    )
    return (east, north, up)
