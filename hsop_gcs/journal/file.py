"""The journal's file: entries one a line, numbered; a torn end is cut off and told.

What a full disk leaves of a line is cut off before the next one. One process writes a journal at a time.
"""

import errno
import fcntl
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal.entry import Entry, line_of, parse

_BEGINNING = b'{"n":1,'
"""The first bytes of every journal, as far as they were written."""

Write = Callable[[int, bytes], int]
"""Writes to a file descriptor; returns how many bytes it took. Raises OSError."""


class JournalFile:
    """Appends lines to a file. Opening an existing one repairs its end and goes on with its numbers."""

    def __init__(self, path: Path, on_entry: Callable[[Entry], None], write: Write = os.write) -> None:
        """Open or create. on_entry: given each entry that is there already, in order.

        Raises Unavailable if the file cannot be written or another process writes it, BadInput if it is no journal or
        is damaged elsewhere than at its end, and what ``on_entry`` raises. A file that is refused is left alone.
        """
        self.path = path
        self.bytes_cut = 0
        """How much was cut off: a last line that was not written to its end."""
        self._number = self._end = 0
        self._torn = False
        self._write = write
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
            with ExitStack() as on_failure:
                on_failure.callback(os.close, self._file)
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._continue(on_entry)
                on_failure.pop_all()
        except BlockingIOError as error:
            raise Unavailable(f"journal {str(path)!r}: another process writes it") from error
        except OSError as error:
            raise Unavailable(f"journal {str(path)!r}: {error.strerror}") from error

    def _continue(self, on_entry: Callable[[Entry], None]) -> None:
        for entry, end in _entries(self.path):
            on_entry(entry)
            self._number, self._end = entry.number, end
        self.bytes_cut = self.path.stat().st_size - self._end
        if self.bytes_cut:
            os.ftruncate(self._file, self._end)

    def append(self, bodies: Sequence[bytes]) -> int:
        """Write entries; return how many were written whole: all, or those before the disk was full.

        Raises OSError if none was. What is not written whole is not in the journal, and the next one takes its number.
        """
        lines = [line_of(self._number + 1 + index, body) for index, body in enumerate(bodies)]
        data = b"".join(lines)
        if self._torn:
            os.ftruncate(self._file, self._end)
        self._torn = True
        taken = self._write(self._file, data)
        self._torn = taken < len(data)
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

    def close(self) -> None:
        """Close the file; what was appended is on its way to the disk."""
        os.close(self._file)


def read(path: Path) -> Iterator[Entry]:
    """Yield the entries of a journal; a torn last line is left out.

    Raises BadInput that names the line if any other line is damaged or out of sequence, and if the file is no journal
    or does not exist.
    """
    for entry, _ in _entries(path):
        yield entry


def _entries(path: Path) -> Iterator[tuple[Entry, int]]:
    """The sound entries with the offsets of their lines' ends. Only the last line may be unsound."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise BadInput(str(path), error.strerror or "cannot be read") from error
    with file:
        if not _BEGINNING.startswith(file.read(len(_BEGINNING))):
            raise BadInput(str(path), "is no journal")
        file.seek(0)
        size = os.fstat(file.fileno()).st_size
        end, expected = 0, 1
        for raw in file:
            entry = parse(raw)
            last = end + len(raw) == size
            if entry is None and last:
                return
            if entry is None or entry.number != expected:
                raise BadInput(str(path), f"line {expected} is damaged")
            end, expected = end + len(raw), expected + 1
            yield entry, end
