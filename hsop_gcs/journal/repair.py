"""A good journal of what can be read of a damaged one. Entries keep their numbers; what is lost leaves a gap that tells
how much."""

import gzip
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

from hsop_gcs.errors import BadInput
from hsop_gcs.journal.backlog import GIVEN_UP
from hsop_gcs.journal.check import lines_of
from hsop_gcs.journal.entry import body_of, line_of
from hsop_gcs.journal.file import locked
from hsop_gcs.journal.segments import Header, Segment, header_of, segments


@dataclass(frozen=True, slots=True, kw_only=True)
class Repaired:
    """What became of one file."""

    file: str
    entries: int
    """Entries that could be read, and are in the new file."""
    lost: int
    """Lines that could not be read."""


def repair(path: Path, out: Path) -> list[Repaired]:
    """Write a good journal; return what became of each file. The original is not touched.

    Raises BadInput if there is nothing to repair, or something is in the way of the new one.
    """
    found = segments(path)
    if not found:
        raise BadInput(str(path), "No such file or directory")
    if segments(out):
        raise BadInput(str(out), "exists already; a repaired journal takes the place of none")
    done: list[Repaired] = []
    last = 0
    for segment in found:
        suffix = segment.path.name.removeprefix(path.name)
        repaired, last = _repair(segment, out.with_name(out.name + suffix), last)
        done.append(repaired)
    return done


def put_in_place(path: Path, repaired: Path) -> None:
    """Give a repaired journal the name of the damaged one, which is called FILE.damaged from then on.

    Raises Unavailable if a service writes it, BadInput if there is a FILE.damaged already.
    """
    aside = path.with_name(f"{path.name}.damaged")
    if segments(aside):
        raise BadInput(str(aside), f"exists already; the repaired journal is {repaired}")
    with locked(path):
        for source, target in ((path, aside), (repaired, path)):
            for segment in segments(source):
                suffix = segment.path.name.removeprefix(source.name)
                segment.path.rename(target.with_name(target.name + suffix))


def _repair(segment: Segment, out: Path, last: int) -> tuple[Repaired, int]:
    """Write one file. last: the number of the last entry of the file before. Returns the same of this one, too."""
    entries = lost = pending = 0
    header, time_s = None, 0.0
    try:
        header = header_of(segment)
    except BadInput as error:
        if "format" in error.problem:
            raise
    last = last if header is None else header.first - 1
    with cast("IO[bytes]", gzip.open(out, "xb") if out.suffix == ".gz" else out.open("xb")) as file:
        number = segment.number or (1 if header is None else header.segment)
        file.write(Header(segment=number, first=last + 1).line())
        for line, raw, entry in lines_of(segment):
            if entry is None or entry.number <= last:
                lost += line > 1
                pending += line > 1
                continue
            if entry.number > last + 1 and not segment.kept and entry.kind != GIVEN_UP:
                file.write(_gap(last + 1, pending or entry.number - last - 1, time_s))
            elif pending and entry.number == last + 1:
                # lines that never were entries, such as rubbish between two
                pending = 0
            file.write(raw)
            entries, last, time_s, pending = entries + 1, entry.number, entry.time_s, 0
        if pending and segment.number is not None:
            file.write(_gap(last + 1, pending, time_s))
            last += 1
    return Repaired(file=out.name, entries=entries, lost=lost), last


def _gap(number: int, lines: int, time_s: float) -> bytes:
    data = {"kinds": {"damaged": lines}, "from_s": time_s, "to_s": time_s, "why": "damaged"}
    return line_of(number, body_of(GIVEN_UP, data, time_s))
