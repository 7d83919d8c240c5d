"""One line of a journal: a JSON object with its number, its time, what it is and what it says, and a checksum.

{"n": 1, "t": 1763800000.25, "kind": "report", "data": {...}, "crc": "1c291ca3"}
"""

import json
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One line: its number, its time in seconds since the Unix epoch, what it is and what it says."""

    number: int
    time_s: float
    kind: str
    data: Any


class Worth(IntEnum):
    """Which entries are given up first where the disk takes none and memory is full."""

    RAW = 0
    """What comes many times a second, such as reports: without it a mission can be told, not repeated."""
    PLAIN = 1
    """What the mission, its hosts and the planner did."""
    PROMISED = 2
    """What an operator was told is done."""


def body_of(kind: str, data: Any, time_s: float) -> bytes:
    """Return an entry's line without its beginning, the number, which it gets when it is written, and its checksum."""
    text = json.dumps({"t": time_s, "kind": kind, "data": data}, ensure_ascii=False, separators=(",", ":"))
    return text[1:].encode()


def line_of(number: int, body: bytes) -> bytes:
    """Return an entry's whole line."""
    numbered = b'{"n":%d,%b' % (number, body)
    return b'%b,"crc":"%08x"}\n' % (numbered[:-1], zlib.crc32(numbered))


def parse(raw: bytes) -> Entry | None:
    """Return the entry of one line; None if the line is not whole."""
    if not raw.endswith(b'"}\n'):
        return None
    try:
        numbered = raw[: raw.rindex(b',"crc":')] + b"}"
        fields = json.loads(raw)
        if f"{zlib.crc32(numbered):08x}" != fields["crc"]:
            return None
        return Entry(number=fields["n"], time_s=fields["t"], kind=fields["kind"], data=fields["data"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
