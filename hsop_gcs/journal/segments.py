"""The files of one journal: the segment that is written now, and the closed ones before it.

    FILE.000001.kept.gz   what is left of an old segment: its entries without the raw ones
    FILE.000002.gz        a closed segment, compressed
    FILE.000003           the newest closed one
    FILE                  the segment that is written now

Every file begins with a header line; every segment but the first goes on with a snapshot of the mission, so that a
start reads one segment and not a day. Numbers of entries run on from one segment to the next.
"""

import gzip
import json
import os
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

from hsop_gcs.errors import BadInput
from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.entry import Entry, parse

FORMAT = 2
"""The number of the form that is written here, in each file's first line; a reader refuses others."""
SNAPSHOT = "Snapshot"
"""The kind of the entry that holds all that came of the entries before it."""
_BEGINNING = b'{"journal":"hsop-gcs","format":'
_FORMAT_1 = b'{"n":1,'
"""How journals began before they had a header."""
_CLOSED = re.compile(r"\.(\d{6,})(\.kept)?(\.gz)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """The first line of a file."""

    segment: int
    """Which one it is, from 1."""
    first: int
    """The number of its first entry."""

    def line(self) -> bytes:
        body = b'%b%d,"segment":%d,"first":%d}' % (_BEGINNING, FORMAT, self.segment, self.first)
        return b'%b,"crc":"%08x"}\n' % (body[:-1], zlib.crc32(body))


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One file of a journal."""

    path: Path
    number: int | None
    """None: it is the one that is written now."""
    kept: bool = False
    """Whether its raw entries have been taken out."""

    def open(self) -> IO[bytes]:
        """Open it to read its lines. Raises BadInput if that is not possible."""
        try:
            return cast("IO[bytes]", gzip.open(self.path) if self.path.suffix == ".gz" else self.path.open("rb"))
        except OSError as error:
            raise BadInput(str(self.path), error.strerror or "cannot be read") from error


def closed_path(path: Path, segment: int) -> Path:
    """Return the name of a closed segment that is not compressed."""
    return path.with_name(f"{path.name}.{segment:06d}")


def next_path(path: Path) -> Path:
    """Return the name under which a new segment is begun."""
    return path.with_name(f"{path.name}.next")


def segments(path: Path) -> list[Segment]:
    """Return the files of a journal that there are, in order."""
    found: dict[int, Segment] = {}
    names = sorted(os.listdir(path.parent)) if path.parent.is_dir() else []
    for name in names:
        form = _CLOSED.fullmatch(name[len(path.name) :]) if name.startswith(path.name) else None
        if form is not None:
            # of two forms of one segment the first is whole: the other one is removed only after that
            segment = Segment(path=path.with_name(name), number=int(form[1]), kept=form[2] is not None)
            found.setdefault(int(form[1]), segment)
    closed = [found[number] for number in sorted(found)]
    return [*closed, Segment(path=path, number=None)] if path.exists() else closed


def check_beginning(path: Path, beginning: bytes) -> None:
    """Raise BadInput unless a file's first bytes may be those of a journal of this format, as far as they go."""
    if beginning.startswith(_FORMAT_1):
        raise BadInput(str(path), f"is a journal of format 1, and format {FORMAT} is read here; begin another one")
    if beginning.startswith(_BEGINNING):
        number = re.match(rb"\d+", beginning[len(_BEGINNING) :])
        if number is not None and number[0] != b"%d" % FORMAT:
            raise BadInput(str(path), f"is a journal of format {number[0].decode()}, and format {FORMAT} is read here")
    elif not _BEGINNING.startswith(beginning) and not _FORMAT_1.startswith(beginning):
        raise BadInput(str(path), "is no journal")


def parse_header(raw: bytes) -> Header | None:
    """Return a file's header; None if it is not whole."""
    try:
        fields = json.loads(raw)
        header = Header(segment=fields["segment"], first=fields["first"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return header if header.line() == raw else None


def header_of(segment: Segment) -> Header | None:
    """Return a segment's header, None if it is not whole. Raises BadInput for what is no journal of this format."""
    with segment.open() as file:
        first = _line(file, segment)
    check_beginning(segment.path, first[:64])
    return parse_header(first)


def entries(segment: Segment) -> Iterator[tuple[Entry, int]]:
    """Yield the entries of one segment with the offsets of their lines' ends. Of a file that is written now the last
    line may be torn.

    Raises BadInput that names the line if any other line is damaged or out of sequence, and if it is no journal.
    """
    name = str(segment.path)
    with segment.open() as file:
        raw = _line(file, segment)
        check_beginning(segment.path, raw[:64])
        header = parse_header(raw)
        end = len(raw)
        if header is None:
            if segment.number is None and not _line(file, segment):
                return
            raise BadInput(name, f"line 1 is damaged{_MEND}")
        expected, line, after_gap = header.first, 1, segment.kept
        while raw := _line(file, segment):
            line += 1
            entry = parse(raw)
            if entry is None and segment.number is None and not _line(file, segment):
                return
            if entry is None or not (entry.number == expected or (after_gap and entry.number > expected)):
                raise BadInput(name, f"line {line} is damaged{_MEND}")
            end, expected = end + len(raw), entry.number + 1
            after_gap = segment.kept or entry.kind == GIVEN_UP
            yield entry, end


_MEND = "; hsop-gcs journal repair writes a good one of what can be read"


def _line(file: IO[bytes], segment: Segment) -> bytes:
    try:
        return file.readline()
    except (OSError, EOFError, zlib.error) as error:
        raise BadInput(str(segment.path), f"cannot be read: {error}") from error


def begins_whole(segment: Segment) -> bool:
    """Return whether a segment can be begun with: it is the first one, or its first entry is a snapshot."""
    header = header_of(segment)
    if header is None or segment.kept:
        return False
    return header.first == 1 or next((each.kind for each, _ in entries(segment)), None) == SNAPSHOT


def newest_part(path: Path) -> list[Segment]:
    """Return the segments that the present state follows from, the fewest there are."""
    found = segments(path)
    part: list[Segment] = []
    for segment in reversed(found):
        if segment.kept:
            break
        part.insert(0, segment)
        if begins_whole(segment):
            break
    return part


def read(path: Path) -> Iterator[Entry]:
    """Yield the entries of a journal, of all segments that are whole; a torn last line is left out.

    Raises BadInput that names the line if any other line is damaged or out of sequence, and if the file is no journal
    or does not exist.
    """
    found = segments(path)
    if not found:
        raise BadInput(str(path), os.strerror(2))
    for segment in found:
        if not segment.kept:
            for entry, _ in entries(segment):
                yield entry
