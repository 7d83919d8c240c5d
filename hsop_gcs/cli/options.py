"""What is asked of the values of many options."""

from collections.abc import Iterable

from hsop_gcs.errors import BadInput


def within(option: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise BadInput for a value beyond either limit, or that is no number. unit: of the limits, for the message."""
    if not low <= value <= high:
        raise BadInput(option, f"{value} is not between {low} and {high}" + f" {unit}".rstrip())


def one_of(option: str, value: str, known: Iterable[str]) -> str:
    """Return the value. Raises BadInput, with all that are known, for any other."""
    names = list(known)
    if value not in names:
        raise BadInput(option, f"{value!r} is not one of {', '.join(map(str, names))}")
    return value
