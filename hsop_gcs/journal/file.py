"""The journal's files as they are written: lines at the end of one, a new one now and then.

    FILE.next is written: header, snapshot ─▶ FILE becomes FILE.000003 ─▶ FILE.next becomes FILE

What a full disk leaves of a line is cut off before the next one. A process that ends between any two of these steps is
followed by one that finds its way. One process writes a journal at a time.
"""

import contextlib
import errno
import fcntl
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from hsop_gcs.disk import is_passing
from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.entry import Entry, body_of, line_of
from hsop_gcs.journal.segments import (
    Header,
    Segment,
    closed_path,
    entries,
    header_of,
    newest_part,
    next_path,
    segments,
)

Write = Callable[[int, bytes], int]
"""Writes to a file descriptor; returns how many bytes it took. Raises OSError."""

log = logging.getLogger(__name__)


class JournalFile:
    """Appends lines to a journal. Opening an existing one repairs its end and goes on with its numbers."""

    def __init__(self, path: Path, on_entry: Callable[[Entry], None], write: Write = os.write) -> None:
        """Open or create. on_entry: given the entries that are there already, in order, from the newest snapshot on.

        Raises Unavailable if the file cannot be written or another process writes it, BadInput if it is no journal or
        is damaged elsewhere than at its end, and what ``on_entry`` raises. A file that is refused is left alone.
        """
        self.path = path
        self.bytes_cut = 0
        """How much was cut off: a last line that was not written to its end."""
        self.since_snapshot = 0
        """Bytes that were read after the newest snapshot."""
        self._write = write
        self._segment, self._number, self._end = 1, 0, 0
        self._time_s = 0.0
        self._torn = False
        self._file: int | None = None
        self._identity: tuple[int, int] | None = None
        self._removed = False
        with ExitStack() as on_failure:
            self._lock = _locked(path)
            on_failure.callback(os.close, self._lock)
            with _told(path):
                _settle(path)
                self._read(on_entry)
                self._open_if_possible()
            on_failure.pop_all()

    @property
    def removed(self) -> bool:
        """Whether the file was taken away underneath, so that what was in it is missing."""
        return self._removed

    def _read(self, on_entry: Callable[[Entry], None]) -> None:
        for segment in newest_part(self.path):
            header = header_of(segment)
            if header is not None:
                self._segment, self._number = header.segment, header.first - 1
                end = len(header.line())
            else:
                end = 0
            for count, (entry, after) in enumerate(entries(segment)):
                on_entry(entry)
                self.since_snapshot += 0 if count == 0 else after - end
                self._number, self._time_s, end = entry.number, entry.time_s, after
            if segment.number is None:
                self._end = end
                self.bytes_cut = self.path.stat().st_size - end
                self._torn = self.bytes_cut > 0
            else:
                self._segment = segment.number + 1

    def _open_if_possible(self) -> None:
        try:
            self._open()
        except OSError as error:
            if not is_passing(error):
                raise

    def _open(self) -> int:
        """Return the file to write to, created if it is not there. Raises OSError."""
        self._keep_lock()
        if self._file is not None and not self._is_there():
            self._removed = True
            log.warning("journal %s was taken away underneath; it is begun again", self.path)
            os.close(self._file)
            self._file, self._segment, self._end, self._torn = None, self._segment + 1, 0, False
        if self._file is None:
            if self._end:
                self._file = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
                if self._torn:
                    os.ftruncate(self._file, self._end)
                    self._torn = False
            else:
                self._file = self._create(self.path, self._gap() if self._removed else b"")
            status = os.fstat(self._file)
            self._identity = status.st_dev, status.st_ino
        return self._file

    def _is_there(self) -> bool:
        return _identity_of(self.path) == self._identity

    def _keep_lock(self) -> None:
        """Lock again if the lock's file was taken away: another process would find none, and write this journal too.

        Raises OSError if one has done so meanwhile.
        """
        status, name = os.fstat(self._lock), _lock_path(self.path)
        if _identity_of(name) == (status.st_dev, status.st_ino):
            return
        try:
            lock = os.open(name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:
            return  # nothing can be created there now, and so by no other process either
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise OSError(errno.EBUSY, "another process writes it") from None
        os.close(self._lock)
        self._lock = lock

    def _gap(self) -> bytes:
        """The line that says that entries are missing before it."""
        data = {"kinds": {}, "from_s": 0.0, "to_s": self._time_s, "why": "the file was taken away"}
        return line_of(self._number + 1, body_of(GIVEN_UP, data, self._time_s))

    def _create(self, path: Path, line: bytes) -> int:
        """Begin a file with its header and a first entry, if there is one; nothing is left of it if that fails."""
        with contextlib.suppress(FileNotFoundError):
            if path == self.path and path.stat().st_size > 0 and not self._torn:
                raise OSError(errno.EEXIST, "another file has taken its place")
        header = Header(segment=self._segment + (path != self.path), first=self._number + 1).line()
        with ExitStack() as on_failure:
            file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
            on_failure.callback(path.unlink, missing_ok=True)
            on_failure.callback(os.close, file)
            if self._write(file, header + line) < len(header + line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            on_failure.pop_all()
        self._end, self._torn = len(header + line), False
        self._number += bool(line)
        return file

    def append(self, bodies: Sequence[bytes], *, time_s: float) -> int:
        """Write entries; return how many were written whole: all, or those before the disk was full.

        time_s: of the last one. Raises OSError if none was. What is not written whole is not in the journal, and the
        next one takes its number.
        """
        file = self._open()
        lines = [line_of(self._number + 1 + index, body) for index, body in enumerate(bodies)]
        data = b"".join(lines)
        if self._torn:
            os.ftruncate(file, self._end)
        self._torn = True
        taken = self._write(file, data)
        self._torn, self._time_s = taken < len(data), time_s
        whole = 0
        for line in lines:
            if len(line) > taken:
                break
            taken -= len(line)
            whole += 1
            self._number, self._end = self._number + 1, self._end + len(line)
        if whole == 0 and lines:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return whole

    def rotate(self, snapshot: bytes) -> None:
        """Close the segment and begin the next one with a snapshot. Raises OSError; then nothing has changed."""
        old, end, torn = self._open(), self._end, self._torn
        if torn:
            os.ftruncate(old, end)
        try:
            new = self._create(next_path(self.path), line_of(self._number + 1, snapshot))
        except OSError:
            self._end, self._torn = end, False
            raise
        closed = closed_path(self.path, self._segment)
        try:
            if closed.exists():
                raise OSError(errno.EEXIST, os.strerror(errno.EEXIST))
            self.path.rename(closed)
            next_path(self.path).rename(self.path)
        except OSError:
            os.close(new)
            with contextlib.suppress(OSError):
                next_path(self.path).unlink(missing_ok=True)
                if not self.path.exists():
                    closed.rename(self.path)
            self._number, self._end, self._torn = self._number - 1, end, False
            raise
        os.close(old)
        status = os.fstat(new)
        self._file, self._segment, self._identity = new, self._segment + 1, (status.st_dev, status.st_ino)

    def look(self) -> None:
        """See to it that the file is still there, and begin a new one if it is not. Raises OSError."""
        self._open()

    def snapshot_written(self) -> None:
        """Note that what was missing because the file was taken away is not missed any more."""
        self._removed = False

    def close(self) -> None:
        """Close the file; what was appended is on its way to the disk."""
        if self._file is not None:
            os.close(self._file)
        os.close(self._lock)


def _identity_of(path: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


def _lock_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


def _locked(path: Path) -> int:
    """Return the lock of a journal. Raises Unavailable if another process has it, or it cannot be had."""
    name = _lock_path(path)
    try:
        try:
            lock = os.open(name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            if not is_passing(error):
                raise
            # nothing can be created there now, and so by no other process either
            lock = os.open(path if not name.exists() else name, os.O_RDONLY | os.O_CLOEXEC)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise
    except BlockingIOError as error:
        raise Unavailable(f"journal {str(path)!r}: another process writes it") from error
    except OSError as error:
        raise Unavailable(f"journal {str(path)!r}: {error.strerror}") from error
    return lock


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Be the only process that changes a journal. Raises Unavailable if another one writes it."""
    lock = _locked(path)
    try:
        yield
    finally:
        os.close(lock)


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise Unavailable(f"journal {str(path)!r}: {error.strerror}") from error


def _settle(path: Path) -> None:
    """Finish, or take back, what a process that ended while it changed segments has left."""
    closed = [each for each in segments(path) if each.number is not None]
    newest = closed[-1] if closed and closed[-1].path.suffix != ".gz" else None
    begun = next_path(path)
    try:
        if not path.exists() and begun.exists() and _is_begun(Segment(path=begun, number=None)):
            begun.rename(path)
        elif newest is not None and (not path.exists() or not _is_begun(Segment(path=path, number=None))):
            # after a loss of power a new segment may be empty; the one before is whole
            newest.path.rename(path)
        begun.unlink(missing_ok=True)
    except OSError as error:
        if not is_passing(error):
            raise


def _is_begun(segment: Segment) -> bool:
    """Return whether a file has a whole header and first entry; one that is damaged otherwise is not judged here."""
    try:
        return header_of(segment) is not None and next(entries(segment), None) is not None
    except BadInput:
        return True
