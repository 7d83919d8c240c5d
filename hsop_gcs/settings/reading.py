"""Reading FLEET.toml: the settings, or every fault with the line it is on."""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from hsop_gcs.errors import BadInput
from hsop_gcs.settings.settings import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something wrong with FLEET.toml; ``line`` is where the field, or the table it belongs to, is written."""

    field: str
    problem: str
    line: int | None = None

    def __str__(self) -> str:
        return f"{self.field}: {self.problem}"


def check_settings(path: Path) -> tuple[Settings | None, tuple[Fault, ...]]:
    """Read FLEET.toml; return the settings, or None and everything that is wrong with them."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        return None, (Fault(field="--config", problem=f"cannot read {str(path)!r}: {error}"),)
    try:
        settings = Settings.model_validate(tomllib.loads(text), context=path.parent)
    except tomllib.TOMLDecodeError as error:
        return None, (Fault(field=str(path), problem=f"not TOML: {error}"),)
    except ValidationError as error:
        lines = _lines(text)
        return None, tuple(
            Fault(field=field, problem=problem, line=_line_of(field, lines)) for field, problem in _faults(error)
        )
    return settings, ()


def read_settings(path: Path) -> Settings:
    """Read FLEET.toml. Raises BadInput that names the field and the value of the first fault."""
    settings, faults = check_settings(path)
    if settings is None:
        more = f" (and {len(faults) - 1} more: hsop-gcs check-config {path})" if len(faults) > 1 else ""
        raise BadInput(faults[0].field, faults[0].problem + more)
    return settings


def _faults(error: ValidationError) -> Iterator[tuple[str, str]]:
    for fault in error.errors(include_url=False):
        field = ".".join(str(part) for part in fault["loc"]) or "input"
        problem = fault["msg"].removeprefix("Value error, ")
        shown = "" if fault["type"] in ("missing", "value_error") else f" (given: {_short(fault.get('input'))})"
        yield field, problem[:1].lower() + problem[1:] + shown


def _lines(text: str) -> dict[str, int]:
    """The line of every table and key that is written on a line of its own, by its name as faults have it."""
    lines: dict[str, int] = {}
    table, seen = "", Counter[str]()
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*(\[\[?)\s*([\w.\s-]+?)\s*\]", line)
        key = re.match(r"\s*([\w.-]+)\s*=", line)
        if header is not None:
            table = header[2]
            if header[1] == "[[":
                table = f"{header[2]}.{seen[header[2]]}"
                seen[header[2]] += 1
            lines.setdefault(header[2], number)
            lines[table] = number
        elif key is not None:
            lines[f"{table}.{key[1]}" if table else key[1]] = number
    return lines


def _line_of(field: str, lines: dict[str, int]) -> int | None:
    while field and field not in lines:
        field = field.rpartition(".")[0]
    return lines.get(field)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
