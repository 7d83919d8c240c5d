"""Hypothesis strategies: any message that MAVLink can carry."""

from typing import Any

from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link import messages
from hsop_gcs.link.messages import Message, Unknown

CLASSES = sorted(
    (
        cls
        for cls in vars(messages).values()
        if isinstance(cls, type) and issubclass(cls, Message) and hasattr(cls, "ID")
    ),
    key=lambda cls: cls.ID,
)
SPOKEN = [cls for cls in CLASSES if cls is not Unknown]


def number(kind: str) -> st.SearchStrategy[object]:
    if kind in ("float", "double"):
        return st.floats(width=32 if kind == "float" else 64)
    bits = int("".join(filter(str.isdigit, kind)))
    return st.integers(0, 2**bits - 1) if kind.startswith("u") else st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def text(size: int) -> st.SearchStrategy[str]:
    letters = st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=size)
    return letters.filter(lambda value: len(value.encode()) <= size)


@st.composite
def spoken(draw: st.DrawFn) -> Message:
    cls = draw(st.sampled_from(SPOKEN))
    wire = dialect.mavlink_map[cls.ID]
    kinds = dict(zip(wire.fieldnames, wire.fieldtypes, strict=True))
    values: dict[str, Any] = {}
    for name, size in zip(wire.ordered_fieldnames, wire.array_lengths, strict=True):
        kind = kinds[name]
        if kind == "char":
            values[name] = draw(text(size))
        elif size:
            values[name] = draw(st.tuples(*[number(kind)] * size))
        else:
            values[name] = draw(number(kind))
    return cls(**values)
