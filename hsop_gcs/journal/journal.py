"""The journal as the service holds it: entries go in and never raise, a thread of its own writes them.

    append ─▶ backlog ─▶ writer thread ─▶ file
      │                       │
      └── waits a moment ◀────┘ until the entry is the operating system's

While the disk takes what it is given, an entry is handed to the operating system before ``append`` returns, so that
the end of the process (SIGKILL included) loses nothing. A disk that is full, read-only, gone or slow costs a moment
once, then nothing: entries wait in memory, in order and within a bound, and are written when the disk takes them again.
"""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from hsop_gcs.journal.backlog import Backlog, Waiting
from hsop_gcs.journal.entry import Entry, Worth, body_of
from hsop_gcs.journal.file import JournalFile, Write
from hsop_gcs.journal.retention import KEEP_BYTES, Retention
from hsop_gcs.journal.segments import SNAPSHOT

BACKLOG_BYTES = 64_000_000
"""What waits in memory at most: minutes of a thousand reports a second, most of an hour of eighty."""
_PATIENCE_S = 0.1
"""How long ``append`` waits for the disk, at most."""
_PATIENCE_PER_S = 0.5
"""How much of each second all calls of ``append`` together wait for a disk that is slow."""
_RETRY_S = 0.5
_BATCH_BYTES = 1_000_000
_SLOW_S = 1.0
"""An entry that waits longer than this is told as a fault of the disk."""
_CLOSING_S = 5.0
_LOOK_S = 1.0
"""How often a journal that has nothing to write looks whether its file is still there."""
SEGMENT_BYTES = 8_000_000
"""How much is written between two snapshots of a mission: seconds of work for the next start."""
_SNAPSHOTS = 8
"""Between two snapshots so many times as much is written as a snapshot takes, however large it is."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalStatus:
    """How the journal stands."""

    fault: str | None
    """Why entries wait in memory, for a person; None: they do not."""
    waiting: int
    waiting_bytes: int
    given_up: Mapping[str, int]
    """Entries that were given up for room in memory, by kind, since the service started."""
    late: int
    """Entries that took effect before they were handed to the operating system, since the service started."""


class Journal:
    """Appends entries to a file. Opening an existing one repairs its end and goes on with its numbers."""

    def __init__(
        self,
        path: Path,
        on_entry: Callable[[Entry], None] = lambda _entry: None,
        *,
        backlog_bytes: int = BACKLOG_BYTES,
        segment_bytes: int = SEGMENT_BYTES,
        raw: Iterable[str] = (),
        keep_bytes: int = KEEP_BYTES,
        write: Write = os.write,
    ) -> None:
        """Open or create. on_entry: given the entries that are there already, in order, from the newest snapshot on.

        raw: the kinds of entries that old segments do without once all closed ones take more than ``keep_bytes``.
        write: puts bytes on the disk. Raises what ``JournalFile`` does.
        """
        self.path = path
        self._file = JournalFile(path, on_entry, write)
        self._backlog = Backlog(backlog_bytes)
        self._changed = threading.Condition()
        """Guards everything below and the backlog; the file is the writer's alone."""
        self._written = 0
        """The sequence number of the newest entry that is the operating system's."""
        self._late = 0
        self._segment_bytes = segment_bytes
        self._since_snapshot = self._file.since_snapshot
        """Bytes of entries after the newest snapshot."""
        self._snapshot_bytes = 0
        self._missing = 0
        """How many entries had been given up when the newest snapshot was made."""
        self._retention = Retention(path, raw=frozenset(raw) | {SNAPSHOT}, keep_bytes=keep_bytes)
        self._problem: str | None = None
        self._in_flight: list[Waiting] = []
        """What the writer has taken out of the backlog and is giving to the disk."""
        self._patience_s = _PATIENCE_PER_S
        self._patience_at_s = time.monotonic()
        self._closing = False
        self._writer = threading.Thread(target=self._run, name="journal", daemon=True)
        self._writer.start()

    @property
    def bytes_cut(self) -> int:
        """How much of a last line that was not written to its end was cut off when the journal was opened."""
        return self._file.bytes_cut

    @property
    def status(self) -> JournalStatus:
        """How the journal stands now."""
        with self._changed:
            return JournalStatus(
                fault=self._fault(),
                waiting=self._waiting,
                waiting_bytes=self._backlog.bytes + sum(len(each.body) for each in self._in_flight),
                given_up=dict(self._backlog.given_up),
                late=self._late,
            )

    @property
    def failing(self) -> bool:
        """Whether the disk refused what it was given last."""
        return self._problem is not None

    def append(self, kind: str, data: Any, *, time_s: float, worth: Worth = Worth.PLAIN) -> None:
        """Write one entry, as soon as the disk takes it. ``data``: what JSON can hold."""
        body = body_of(kind, data, time_s)
        with self._changed:
            now_s = time.monotonic()
            sequence = self._backlog.add(time_s=time_s, kind=kind, body=body, worth=worth, now_s=now_s)
            self._since_snapshot += len(body)
            self._changed.notify_all()
            self._wait_for(sequence, now_s)
            self._late += self._written < sequence

    def lose(self, kind: str, *, time_s: float) -> None:
        """Tell in its place of an entry that cannot be written down; the next snapshot makes up for it."""
        with self._changed:
            self._backlog.lose(kind, time_s=time_s, now_s=time.monotonic())
            self._changed.notify_all()

    @property
    def wants_snapshot(self) -> bool:
        """Whether it is time for ``save``: enough was written since, or entries are missing and the disk is back."""
        with self._changed:
            if self._problem is not None or self._saving:
                return False
            if self._backlog.given_up.total() != self._missing or self._file.removed:
                return True
            return self._since_snapshot > max(self._segment_bytes, _SNAPSHOTS * self._snapshot_bytes)

    def save(self, data: Any, *, time_s: float) -> None:
        """Write all that came of the entries so far, and begin a new segment with it: a start reads no older entries.

        ``data``: what JSON can hold.
        """
        body = body_of(SNAPSHOT, data, time_s)
        with self._changed:
            self._backlog.remove(SNAPSHOT)
            self._missing = self._backlog.given_up.total()
            self._since_snapshot, self._snapshot_bytes = 0, len(body)
            now_s = time.monotonic()
            self._backlog.add(time_s=time_s, kind=SNAPSHOT, body=body, worth=Worth.PROMISED, now_s=now_s)
            self._changed.notify_all()

    def put_off_snapshot(self) -> None:
        """Ask for a snapshot again when as much has been written once more."""
        with self._changed:
            self._since_snapshot, self._missing = 0, self._backlog.given_up.total()

    @property
    def _saving(self) -> bool:
        return self._backlog.holds(SNAPSHOT) or any(each.kind == SNAPSHOT for each in self._in_flight)

    def flush(self, timeout_s: float) -> bool:
        """Wait until everything is written; return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._waiting, timeout_s)

    def close(self) -> None:
        """Write what waits, if the disk takes it, and close the file."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._writer.join(_CLOSING_S)
        if self._waiting:
            log.error("journal %s: %d entries could not be written and are lost", self.path, self._waiting)
        self._retention.stop()
        if not self._writer.is_alive():
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _waiting(self) -> int:
        return len(self._backlog) + len(self._in_flight)

    def _behind_s(self, now_s: float) -> float:
        """How long the oldest entry has been waiting."""
        since_s = self._in_flight[0].since_s if self._in_flight else self._backlog.since_s
        return 0.0 if since_s is None else now_s - since_s

    def _wait_for(self, sequence: int, now_s: float) -> None:
        """Wait until an entry is the operating system's, if that is to be expected soon: a stall is waited for once."""
        gained_s = (now_s - self._patience_at_s) * _PATIENCE_PER_S
        self._patience_s = min(self._patience_s + gained_s, _PATIENCE_PER_S)
        if self._problem is None and self._behind_s(now_s) < _PATIENCE_S:
            patience_s = min(_PATIENCE_S, self._patience_s)
            self._changed.wait_for(lambda: self._written >= sequence or self._problem is not None, patience_s)
        self._patience_at_s = time.monotonic()
        self._patience_s -= self._patience_at_s - now_s

    def _fault(self) -> str | None:
        kept = f"{self._waiting} entries are kept in memory"
        if self._backlog.given_up:
            kept += f", {self._backlog.given_up.total()} were given up"
        if self._problem is not None:
            return f"cannot be written: {self._problem}; {kept}"
        behind_s = self._behind_s(time.monotonic())
        return f"the disk is slow: {behind_s:.0f} s behind; {kept}" if behind_s > _SLOW_S else None

    # The writer's thread

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or len(self._backlog), _LOOK_S)
                batch = self._in_flight = self._backlog.take(_BATCH_BYTES, alone=SNAPSHOT)
                if not batch and self._closing:
                    return
            try:
                written, problem = self._write(batch), None
            except OSError as error:
                written, problem = 0, error.strerror or str(error)
            except Exception as error:  # the thread must outlast whatever it meets
                log.exception("journal %s", self.path)
                written, problem = 0, f"{type(error).__name__}: {error}"
            with self._changed:
                self._note(batch, written, problem)
                if self._problem is not None:
                    if self._closing:
                        return
                    self._changed.wait_for(lambda: self._closing, _RETRY_S)

    def _write(self, batch: list[Waiting]) -> int:
        """Give a batch to the disk; return how many of its entries were written. Raises OSError if none was."""
        if not batch:
            self._file.look()
            return 0
        if batch[0].kind != SNAPSHOT:
            return self._file.append([each.body for each in batch], time_s=batch[-1].time_s)
        (snapshot,) = batch
        try:
            self._file.rotate(snapshot.body)
        except OSError as error:
            # a folder that takes no new file: the snapshot goes where the entries go
            self._file.append([snapshot.body], time_s=snapshot.time_s)
            log.warning("journal %s: no new segment can be begun: %s", self.path, error.strerror)
        self._file.snapshot_written()
        self._retention.start()
        return 1

    def _note(self, batch: list[Waiting], written: int, problem: str | None) -> None:
        """Put down how a batch came off."""
        self._in_flight = []
        self._backlog.put_back(batch[written:])
        if written:
            self._written = batch[written - 1].sequence
        if problem is not None and self._problem is None:
            log.error("journal %s cannot be written: %s; entries are kept in memory", self.path, problem)
        elif problem is None and self._problem is not None:
            lost = dict(self._backlog.given_up)
            log.warning("journal %s is written again; given up for room: %s", self.path, lost or "nothing")
        self._problem = problem
        self._changed.notify_all()
