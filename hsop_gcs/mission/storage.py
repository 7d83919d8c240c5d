"""Where a mission is written down: its journal, the telemetry log, and the room on their disks.

Nothing here stops what flies. What does not fly yet waits while a restart would not know of it.
"""

import logging
from collections.abc import Iterator

from hsop_gcs.disk import DiskWatch
from hsop_gcs.journal import Journal
from hsop_gcs.link.tlog import TlogWriter
from hsop_gcs.mission.core import MissionState
from hsop_gcs.mission.inputs import Input
from hsop_gcs.mission.notices import DiskLow, DiskRecovered, JournalFailed, JournalResumed, Notice
from hsop_gcs.mission.records import to_record, worth_of
from hsop_gcs.mission.snapshots import to_snapshot

log = logging.getLogger(__name__)


class Storage:
    """What is written to disks; each of the three may be missing."""

    def __init__(self, journal: Journal | None, tlog: TlogWriter | None, disk: DiskWatch | None) -> None:
        self.journal = journal
        self.tlog = tlog
        self.disk = disk
        self._journal_failed = False
        self._disk_low = False

    def record(self, given: Input) -> None:
        """Give an input to the journal, which writes it before this returns if the disk takes it: see ``Journal``."""
        if self.journal is None:
            return
        try:
            kind, data = to_record(given)
            self.journal.append(kind, data, time_s=given.time_s, worth=worth_of(given))
        except Exception:  # the mission does not depend on it: what cannot be written down is told and has happened
            log.exception("%s cannot be written down", type(given).__name__)
            self.journal.lose(type(given).__name__, time_s=given.time_s)

    def tend(self, state: MissionState, now_s: float) -> Iterator[Notice]:
        """Save the mission when that is due, and yield what has changed for people; to be called now and then."""
        yield from self._tend_journal(state, now_s)
        problem = None if self.disk is None else self.disk.problem
        if self.tlog is not None:
            self.tlog.pausing = problem is not None
        if problem is not None and not self._disk_low:
            log.error("%s", problem)
            yield DiskLow(reason=problem)
        elif problem is None and self._disk_low:
            yield DiskRecovered()
        self._disk_low = problem is not None

    def _tend_journal(self, state: MissionState, now_s: float) -> Iterator[Notice]:
        if self.journal is None:
            return
        if self.journal.wants_snapshot:
            try:
                self.journal.save(to_snapshot(state), time_s=now_s)
            except Exception:  # the mission does not depend on it: only the next start takes longer
                self.journal.put_off_snapshot()
                log.exception("the mission could not be saved")
        status = self.journal.status
        if status.fault is not None and not self._journal_failed:
            self._journal_failed = True
            yield JournalFailed(reason=status.fault)
        elif self._journal_failed and not status.waiting:
            self._journal_failed = False
            yield JournalResumed(given_up=status.given_up)

    @property
    def why_nothing_new(self) -> str | None:
        """Why nothing that is not in the air yet, and no new plan, is to fly now; stops are never refused."""
        if self.journal is not None and self.journal.failing:
            return f"nothing new flies: the journal {self.journal.status.fault}"
        if self.disk is not None and self.disk.problem is not None:
            return f"nothing new flies: the disk is almost full: {self.disk.problem}"
        return None

    @property
    def problems(self) -> list[str]:
        """What does not work now, for a person."""
        problems = []
        if self.journal is not None and (fault := self.journal.status.fault) is not None:
            problems.append(f"journal: {fault}")
        if self.tlog is not None and self.tlog.fault is not None:
            problems.append(f"telemetry log: {self.tlog.fault}")
        if self.disk is not None and self.disk.problem is not None:
            problems.append(f"disk: {self.disk.problem}; no new plan flies and nobody takes off")
        return problems
