"""The whole mission as one entry of its journal: a start goes on from here, and reads nothing older.

Exact to the bit: what follows from a mission that was written and read is what would have followed from itself. Arrays
are written as their bytes.
"""

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from hsop_gcs.mission.core import MissionState
from hsop_gcs.mission.inputs import Input
from hsop_gcs.reports import Measurement
from hsop_gcs.tracks import Picture, Track, TrackRules
from hsop_gcs.tracks.history import Arrays
from hsop_gcs.tracks.sources import Watches
from hsop_gcs.tracks.table import Name, Packed, Table


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSaved(Input):
    """No input, but all that came of those before it."""

    state: MissionState


_TRACKS = {"picture", "unwanted"}
_PAIRS = {"dismissed"}
"""Mappings whose keys are pairs, which JSON does not have."""
_ADAPTERS: dict[str, TypeAdapter[Any]] = {
    name: TypeAdapter(kind) for name, kind in get_type_hints(MissionState).items() if name not in _TRACKS | _PAIRS
}
_MEASUREMENTS: TypeAdapter[list[Measurement]] = TypeAdapter(list[Measurement])
_NAMES: TypeAdapter[tuple[Name, ...]] = TypeAdapter(tuple[Name, ...])
_RULES = TypeAdapter(TrackRules)
_SOURCES: TypeAdapter[Watches] = TypeAdapter(Watches)
_DISMISSED: TypeAdapter[list[tuple[str, str, float]]] = TypeAdapter(list[tuple[str, str, float]])


def to_snapshot(state: MissionState) -> Any:
    """Return the mission as plain JSON."""
    rules = state.rules.tracks
    plain = {
        name: adapter.dump_python(getattr(state, name), mode="json", fallback=_plain, warnings=False)
        for name, adapter in _ADAPTERS.items()
    }
    plain["picture"] = {
        "tracks": _table_to_json(state.picture.tracks, rules),
        "sources": _SOURCES.dump_python(state.picture.sources, mode="json", fallback=_plain, warnings=False),
        "named": state.picture.named,
    }
    plain["unwanted"] = _table_to_json(state.unwanted, rules)
    plain["dismissed"] = [[*key, until_s] for key, until_s in state.dismissed.items()]
    return plain


def from_snapshot(plain: Any) -> MissionState:
    """Return the mission. What a service of before did not know yet has its default.

    Raises ValueError, KeyError or TypeError for what is no snapshot of one.
    """
    known = [name for name in _ADAPTERS if name in plain]
    values = {name: _ADAPTERS[name].validate_python(plain[name]) for name in known}
    values = {name: MappingProxyType(each) if isinstance(each, dict) else each for name, each in values.items()}
    picture = plain["picture"]
    values["picture"] = Picture(
        tracks=_table_of_json(picture["tracks"]),
        sources=MappingProxyType(dict(_SOURCES.validate_python(picture["sources"]))),
        named=int(picture["named"]),
    )
    values["unwanted"] = MappingProxyType(dict(_table_of_json(plain["unwanted"])))
    dismissed = _DISMISSED.validate_python(plain["dismissed"])
    values["dismissed"] = MappingProxyType({(source, name): until_s for source, name, until_s in dismissed})
    return MissionState(**values)


def _table_to_json(tracks: Mapping[str, Track], rules: TrackRules) -> Any:
    packed = Table.of(tracks, rules).packed()
    return {
        "names": _NAMES.dump_python(packed.names, mode="json"),
        "facts": _array_to_json(packed.facts),
        "steps": [_array_to_json(array) for array in packed.steps],
        "measurements": _MEASUREMENTS.dump_python(packed.measurements, mode="json", exclude_defaults=True),
        "rules": _RULES.dump_python(packed.rules, mode="json"),
    }


def _table_of_json(plain: Any) -> Table:
    return Table.of_packed(
        Packed(
            names=_NAMES.validate_python(plain["names"]),
            facts=_array_of_json(plain["facts"]),
            steps=Arrays(*map(_array_of_json, plain["steps"])),
            measurements=_MEASUREMENTS.validate_python(plain["measurements"]),
            rules=_RULES.validate_python(plain["rules"]),
        )
    )


def _array_to_json(array: np.ndarray[Any, Any]) -> Any:
    """Shape, type and bytes; little-endian, row by row."""
    kind = array.dtype.newbyteorder("<")
    return [list(array.shape), kind.str, base64.b64encode(array.astype(kind, order="C").tobytes()).decode()]


def _array_of_json(plain: Any) -> Any:
    shape, kind, text = plain
    array = np.frombuffer(base64.b64decode(text), np.dtype(kind)).reshape(shape)
    return array.astype(array.dtype.newbyteorder("="))


def _plain(value: Any) -> Any:
    """Return what pydantic can write of a value that it does not know: frozen mappings."""
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"no snapshot holds {type(value).__name__}")
