"""What the service itself tells people beside what happens to hosts; nothing of the mission depends on it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """Base of all notices."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalFailed(Notice):
    """The journal cannot be written: what happens is kept in memory, and a restart would not know of it."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalResumed(Notice):
    """The journal is written again, all that was kept in memory included."""

    given_up: Mapping[str, int]
    """Entries by kind that had no room in memory, since the service started."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskLow(Notice):
    """Less than the reserve is left on a disk: no new plan flies and nobody takes off; what flies goes on."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskRecovered(Notice):
    """There is room on the disk again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceBehind(Notice):
    """The service works off its link too late: no host departs until it has caught up; what flies is watched."""

    lag_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceCaughtUp(Notice):
    """The service works off its link in time again."""

    longest_s: float
    """By how much it was late at worst."""
