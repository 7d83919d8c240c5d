"""One threat as we believe it to be."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from hsop_gcs.reports import Vector3
from hsop_gcs.tracks.filter import FloatArray, State
from hsop_gcs.tracks.history import History


class TrackStatus(StrEnum):
    TENTATIVE = "tentative"
    """Seen, and perhaps nothing: shown to people, not planned for."""
    CONFIRMED = "confirmed"
    COASTING = "coasting"
    """Confirmed once, and not reported lately."""


class Binding(NamedTuple):
    """A source's own id that stands for the track."""

    source: str
    threat_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A threat: its state at ``time_s``, the newest of its reports, in ENU metres and metres per second."""

    id: str
    source: str
    """Who reported it first, and under which id."""
    source_threat_id: str | None
    sources: tuple[Binding, ...]
    """All ids that stand for it, one per source."""
    status: TrackStatus
    velocity_known: bool
    """Whether reports have shown the velocity, or given it; before that ``velocity_mps`` is the best guess."""
    size_m: float
    reports: int
    first_seen_s: float
    state: State
    not_apart: frozenset[str] = frozenset()
    """Hosts of ours that it may be: those whose place was never known when it was seen, beside them or elsewhere."""
    steps: History
    """What it was told lately, and what was believed after each."""

    @property
    def time_s(self) -> float:
        """When it was measured last, seconds since the Unix epoch."""
        return self.state.time_s

    @property
    def position_m(self) -> Vector3:
        """ENU, at ``time_s``."""
        east, north, up = self.state.mean[:3].tolist()
        return (east, north, up)

    @property
    def velocity_mps(self) -> Vector3:
        """ENU, at ``time_s``."""
        east, north, up = self.state.mean[3:].tolist()
        return (east, north, up)

    @property
    def covariance(self) -> FloatArray:
        """(6, 6): position, then velocity."""
        return self.state.covariance

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position, each axis, root mean square over the axes."""
        return math.sqrt(self.state.position_variance_m2)

    @property
    def velocity_sigma_mps(self) -> float:
        """Standard deviation of the velocity, each axis, root mean square over the axes."""
        return math.sqrt(self.state.velocity_variance_m2ps2)

    def position_at(self, time_s: float) -> Vector3:
        """Return where it is expected at ``time_s``, ENU metres: straight on at constant speed (Eq. 7)."""
        ahead_s = time_s - self.time_s
        x, y, z, vx, vy, vz = self.state.mean.tolist()
        return (x + ahead_s * vx, y + ahead_s * vy, z + ahead_s * vz)
