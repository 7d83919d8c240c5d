"""What is in a journal, and what of it is damaged: every line of every file is looked at, none of them is believed."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hsop_gcs.errors import BadInput
from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.entry import Entry, parse
from hsop_gcs.journal.segments import FORMAT, SNAPSHOT, Segment, check_beginning, header_of, parse_header, segments

DAMAGES_TOLD = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """A place where a file is not what it should be."""

    file: str
    line: int
    what: str


@dataclass(slots=True, kw_only=True)
class SegmentContents:
    """What is in one file."""

    file: str
    bytes: int
    kept: bool
    """Whether its raw entries have been taken out."""
    entries: int = 0
    first: int | None = None
    """The number of its first entry."""
    last: int | None = None
    from_s: float | None = None
    """The time of its first entry, seconds since the Unix epoch."""
    to_s: float | None = None
    begins_with_snapshot: bool = False

    def add(self, entry: Entry) -> None:
        if self.entries == 0:
            self.first, self.from_s = entry.number, entry.time_s
            self.begins_with_snapshot = entry.kind == SNAPSHOT
        self.entries += 1
        self.last, self.to_s = entry.number, entry.time_s


@dataclass(slots=True, kw_only=True)
class Contents:
    """What is in a journal."""

    file: str
    format: int = FORMAT
    segments: list[SegmentContents] = field(default_factory=list)
    kinds: dict[str, int] = field(default_factory=dict)
    """How many entries there are of each kind."""
    given_up: dict[str, int] = field(default_factory=dict)
    """What the service had to give up while it ran, by kind."""
    missing_segments: list[int] = field(default_factory=list)
    torn_bytes: int = 0
    """A last line that was not written to its end; a start cuts it off, and it is no damage."""
    damages: list[Damage] = field(default_factory=list)


def lines_of(segment: Segment) -> Iterator[tuple[int, bytes, Entry | None]]:
    """Yield every line after the header with its number in the file, and its entry if it is sound.

    Raises BadInput if the file cannot be opened, or is no journal of this format. What cannot be decompressed any more
    ends it, with a line that holds why.
    """
    with segment.open() as file:
        line = 0
        while True:
            line += 1
            try:
                raw = file.readline()
            except (OSError, EOFError, ValueError) as error:
                yield line, f"cannot be read: {error}".encode(), None
                return
            if not raw:
                return
            if line == 1:
                check_beginning(segment.path, raw[:64])
                if parse_header(raw) is None:
                    yield line, raw, None
            else:
                yield line, raw, parse(raw)


def check(path: Path) -> Contents:
    """Look through a journal. Raises BadInput if there is none, or it is of another format."""
    found = segments(path)
    if not found:
        raise BadInput(str(path), "No such file or directory")
    contents, kinds, lost, expected = Contents(file=str(path)), Counter[str](), Counter[str](), None
    numbers = [number for each in found if (number := _number_of(each)) is not None]
    if numbers:
        contents.missing_segments = sorted(set(range(numbers[0], numbers[-1])) - set(numbers))
    for segment in found:
        part = SegmentContents(file=segment.path.name, bytes=segment.path.stat().st_size, kept=segment.kept)
        contents.segments.append(part)
        problems = []
        expected = None
        for line, raw, entry in lines_of(segment):
            if entry is None:
                problems.append((line, len(raw), "its checksum is wrong, or it is not whole"))
                expected = None
                continue
            if expected is not None and not segment.kept and entry.number != expected:
                problems.append((line, len(raw), f"is entry {entry.number}, and {expected} was to come"))
            kinds[entry.kind] += 1
            if entry.kind == GIVEN_UP:
                lost.update(entry.data["kinds"])
            part.add(entry)
            # after a gap that is told numbers may go on from where it ends
            expected = None if entry.kind == GIVEN_UP else entry.number + 1
        at_the_end = segment.number is None and problems and problems[-1][0] == part.entries + len(problems) + 1
        if at_the_end and not _ended(segment):
            contents.torn_bytes = problems.pop()[1]
        contents.damages += [Damage(file=part.file, line=line, what=what) for line, _, what in problems]
    contents.kinds, contents.given_up = dict(kinds.most_common()), dict(lost)
    return contents


def _number_of(segment: Segment) -> int | None:
    """Return which segment a file is; None if its header is damaged. Raises BadInput for another format."""
    header = header_of(segment) if segment.number is None else None
    return segment.number if header is None else header.segment


def _ended(segment: Segment) -> bool:
    """Whether a file's last line was written to its end."""
    with segment.path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"
