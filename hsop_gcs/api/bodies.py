"""Bodies of many reports or detections, parsed and judged a little at a time: one of a megabyte stops nothing else."""

import asyncio
import json
import re
from collections.abc import Iterator
from time import perf_counter, thread_time
from typing import Any, get_args

from pydantic import BaseModel

from hsop_gcs.api.problems import NotJson
from hsop_gcs.errors import BadInput

MAX_AT_ONCE = 1000
MAX_ITEM = 8192
"""Characters of one report or detection."""
MAX_FIELDS = 16
"""Fields of one report or detection, or of an object in it."""
_BREATH_S = 0.005
_LONGEST_REST_S = 0.05
_NEAR = 8
"""Characters: an error so near to where a text was cut comes from the cut."""
_SPACE = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()


class Pace:
    """Parts long work, so that everything else has its turn: after a few milliseconds there is as long a rest.

    Of all work that goes on for longer, one part is done at a time: ``turn`` is held from the first rest to the end.
    Use as an async context manager.
    """

    def __init__(self, turn: asyncio.Lock) -> None:
        self._turn = turn
        self._holds = False
        self._worked_s = 0.0
        self._began()

    @property
    def worked_s(self) -> float:
        """Processor time since the beginning, without that of the others."""
        return self._worked_s + thread_time() - self._began_cpu_s

    async def breathe(self) -> None:
        """Let others go on, if it is time."""
        took_s = perf_counter() - self._began_s
        if took_s < _BREATH_S:
            return
        self._worked_s = self.worked_s
        if self._holds:
            self._turn.release()
            self._holds = False
        await self._turn.acquire()
        self._holds = True
        await asyncio.sleep(min(took_s, _LONGEST_REST_S))
        self._began()

    async def __aenter__(self) -> "Pace":
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._holds:
            self._turn.release()

    def _began(self) -> None:
        self._began_s, self._began_cpu_s = perf_counter(), thread_time()


async def one_or_many(body: bytes, what: str, pace: Pace) -> list[Any]:
    """Return what a body holds: an object, or each item of an array.

    Raises NotJson; BadInput if it is neither, if there are too many, and for one that is longer than any can be.
    """
    try:
        text = body.decode(json.detect_encoding(body), "surrogatepass")
    except UnicodeDecodeError as error:
        raise NotJson(f"not JSON: {error.reason} at byte {error.start}") from error
    begin = _skip(text, 0)
    if text[begin : begin + 1] != "[":
        value, end = _item(text, begin, what)
        _require_end(text, end)
        if not isinstance(value, dict):
            raise BadInput("body", f"must be a {what} or an array of {what}s")
        return [value]
    items = []
    for each in _items(text, begin + 1, what):
        items.append(each)
        if len(items) > MAX_AT_ONCE:
            raise BadInput("body", f"more than {MAX_AT_ONCE} {what}s; 1 to {MAX_AT_ONCE} are taken at once")
        await pace.breathe()
    if not items:
        raise BadInput("body", f"0 {what}s; 1 to {MAX_AT_ONCE} are taken at once")
    return items


def _items(text: str, at: int, what: str) -> Iterator[Any]:
    """Yield the items of the array whose bracket is just before ``at``."""
    at = _skip(text, at)
    if text[at : at + 1] == "]":
        _require_end(text, at + 1)
        return
    while True:
        value, at = _item(text, at, what)
        yield value
        at = _skip(text, at)
        match text[at : at + 1]:
            case ",":
                at = _skip(text, at + 1)
            case "]":
                _require_end(text, at + 1)
                return
            case _:
                raise _fault("Expecting ',' delimiter", text, at)


def _item(text: str, at: int, what: str) -> tuple[Any, int]:
    """Return one value and where it ends, looking no farther than an item may be long."""
    part = text[at : at + MAX_ITEM]
    cut = at + MAX_ITEM < len(text)
    try:
        value, length = _DECODER.raw_decode(part)
    except json.JSONDecodeError as error:
        if cut and (error.pos >= MAX_ITEM - _NEAR or error.msg.startswith("Unterminated")):
            raise BadInput("body", f"a {what} of more than {MAX_ITEM} characters") from None
        raise _fault(error.msg, text, at + error.pos) from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits; nested too deeply
        raise NotJson(f"not JSON: {error}") from error
    if cut and length == MAX_ITEM:
        raise BadInput("body", f"a {what} of more than {MAX_ITEM} characters")
    return value, at + length


def _skip(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    return at if found is None else found.end()


def _require_end(text: str, at: int) -> None:
    at = _skip(text, at)
    if at < len(text):
        raise _fault("Extra data", text, at)


def _fault(problem: str, text: str, at: int) -> NotJson:
    error = json.JSONDecodeError(problem, text, at)
    return NotJson(f"not JSON: {error.msg} at line {error.lineno} column {error.colno}")


def has_too_many_fields(value: Any) -> bool:
    """Whether an object, or one in it, has more fields than any report: each would be a fault of its own."""
    if not isinstance(value, dict):
        return False
    inner = [each for each in value.values() if isinstance(each, dict)] if len(value) <= MAX_FIELDS else []
    return len(value) > MAX_FIELDS or any([len(each) > MAX_FIELDS for each in inner])


def field_paths(model: type[BaseModel]) -> frozenset[str]:
    """Return the fields that a body of this model may have, those of objects in it behind a dot; and ``body``."""
    found = {"body"}
    for name, field in model.model_fields.items():
        found.add(name)
        inner = [kind for kind in (field.annotation, *get_args(field.annotation)) if isinstance(kind, type)]
        for kind in inner:
            if issubclass(kind, BaseModel):
                found |= {f"{name}.{path}" for path in field_paths(kind) if path != "body"}
    return frozenset(found)


def counted(field: str, known: frozenset[str]) -> str:
    """Return what a fault is counted under: the field, unless its name is the client's invention."""
    return field if field in known else "unknown field"
