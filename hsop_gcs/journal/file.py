"""The journal's file: one JSON object a line, numbered, each with a checksum; a torn end is cut off and told.

    {"n": 1, "t": 1763800000.25, "kind": "report", "data": {...}, "crc": "1c291ca3"}

A line is handed to the operating system before what it records takes effect, so that the end of the process (SIGKILL
included) loses nothing; only a line that was being written can be torn, and that one had no effect yet. What a full
disk leaves of a line is cut off before the next one. One process writes a journal at a time.
"""

import errno
import fcntl
import json
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from hsop_gcs.errors import BadInput, Unavailable

_BEGINNING = b'{"n":1,'
"""Of every journal, as far as it was written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One line: its number, its time in seconds since the Unix epoch, what it is and what it says."""

    number: int
    time_s: float
    kind: str
    data: Any


class Journal:
    """Appends entries to a file. Opening an existing one repairs its end and goes on with its numbers."""

    def __init__(self, path: Path, on_entry: Callable[[Entry], None] = lambda _entry: None) -> None:
        """Open or create. on_entry: given each entry that is there already, in order.

        Raises Unavailable if the file cannot be written or another process writes it, BadInput if it is no journal or
        is damaged elsewhere than at its end, and what ``on_entry`` raises. A file that is refused is left alone.
        """
        self.path = path
        self.bytes_cut = 0
        """Of a last line that was not written to its end."""
        self._number = self._end = 0
        self._torn = False
        try:
            self._file: BinaryIO = path.open("ab", buffering=0)
            with ExitStack() as on_failure:
                on_failure.callback(self._file.close)
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
            os.ftruncate(self._file.fileno(), self._end)

    def append(self, kind: str, data: Any, *, time_s: float) -> int:
        """Write one entry and return its number. ``data``: what JSON can hold.

        Raises OSError if it is not written whole; then it is not in the journal, and the next one takes its number.
        """
        number = self._number + 1
        body = json.dumps(
            {"n": number, "t": time_s, "kind": kind, "data": data}, ensure_ascii=False, separators=(",", ":")
        )
        line = f'{body[:-1]},"crc":"{zlib.crc32(body.encode()):08x}"}}\n'.encode()
        if self._torn:
            os.ftruncate(self._file.fileno(), self._end)
        self._torn = True
        if self._file.write(line) < len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._torn = False
        self._number, self._end = number, self._end + len(line)
        return number

    def close(self) -> None:
        """Close the file; what was appended is on its way to the disk."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


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
            entry = _parse(raw)
            last = end + len(raw) == size
            if entry is None and last:
                return
            if entry is None or entry.number != expected:
                raise BadInput(str(path), f"line {expected} is damaged")
            end, expected = end + len(raw), expected + 1
            yield entry, end


def _parse(raw: bytes) -> Entry | None:
    """The entry of one line; None if it is not whole."""
    if not raw.endswith(b'"}\n'):
        return None
    try:
        text = raw.decode()
        fields = json.loads(text)
        body = text[: text.rindex(',"crc":')] + "}"
        if f"{zlib.crc32(body.encode()):08x}" != fields["crc"]:
            return None
        return Entry(number=fields["n"], time_s=fields["t"], kind=fields["kind"], data=fields["data"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
