"""What the tracker assumes, and when it gives up. Every number can be set."""

from dataclasses import dataclass
from enum import StrEnum


class ConfirmAtOnce(StrEnum):
    """Whose first report confirms a track. M of N is for plots; a source's own id comes from a tracker behind it,
    or a person, who has confirmed the threat already."""

    ID = "id"
    ID_AND_VELOCITY = "id and velocity"
    NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRules:
    """How reports become tracks, and how long a track lives without one."""

    timeout_s: float = 10.0
    """A threat not reported for this long has left."""
    tentative_timeout_s: float = 4.0
    """The same for a track that was never confirmed."""
    coast_after_s: float = 2.0
    """A confirmed track not reported for this long coasts."""
    lag_s: float = 3.0
    """A report this much older than its track's newest is still put in its place; an older one is refused."""
    scan_s: float = 0.02
    """Reports of one source within this time are one scan: each is of another threat."""

    acceleration_psd_m2ps3: float = 0.25
    """Power spectral density of the threats' acceleration, each axis: velocity wanders by its root in a second."""
    default_sigma_m: float = 2.0
    """Of a position whose source does not say."""
    min_sigma_m: float = 0.05
    """No position is believed to be better than this."""
    velocity_sigma_mps: float = 0.5
    """Of a velocity whose source does not say."""
    min_velocity_sigma_mps: float = 0.05
    first_velocity_sigma_mps: float = 10.0
    """How fast threats fly, each horizontal axis, before anything shows it."""
    first_climb_sigma_mps: float = 3.0
    """And how fast they climb or sink."""
    velocity_known_sigma_mps: float = 3.0
    """A velocity is known once its standard deviation, each axis, is below this."""

    gate_probability: float = 0.9999
    """How likely a threat's own report lies within its gate."""
    impossible_probability: float = 1e-9
    """A report less likely than this is of another threat, whatever id it bears."""
    max_speed_mps: float = 100.0
    """A report that asks for more than this is not the same threat (or not true)."""
    reach_m: float = 10.0
    """On top of what speed and sigma allow."""

    confirm_hits: int = 3
    """M: so many of the newest N slots of time must hold a report. Slots, not reports: a burst proves nothing."""
    confirm_slots: int = 5
    confirm_slot_s: float = 0.5
    confirm_at_once: ConfirmAtOnce = ConfirmAtOnce.ID

    host_radius_m: float = 5.0
    """A report this near to a host of our own, or within twice its sigma, is of that host, unless it is surely of a
    threat that was seen apart from the host before: a threat that passes a host does not vanish."""
    max_host_radius_m: float = 10.0
    """However coarse a report is: a threat beside a host must not be hidden by it."""
    host_doubt_m: float = 40.0
    """Farther from all hosts than this a track is of none of them, however coarse it is. What may be a host of ours is
    not confirmed."""
    host_lag_s: float = 2.5
    """How old what a source saw may be when it arrives, whatever its time says: so long ago a host's place counts."""
    source_memory_s: float = 600.0
    """A source silent for this long is no longer shown."""
    max_tracks: int = 500
    """Reports that would begin one more are refused; those of known threats go on."""
    max_sources: int = 1000
    """Reports of one more are refused, until one has been silent for a minute. Cameras count, and are never refused."""
    default_size_m: float = 1.0

    @property
    def memory_s(self) -> float:
        """How long a track remembers its reports: for late ones, and for its confirmation."""
        return max(self.lag_s, self.confirm_slots * self.confirm_slot_s)
