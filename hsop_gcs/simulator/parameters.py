"""The few parameters of a simulated vehicle: only such that change what it does.

On the wire a parameter is a float. PX4 puts the bits of an integer into it, ArduPilot its value.
"""

import math
import struct
from dataclasses import dataclass

from hsop_gcs.link.messages import ParamValue

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE."""


@dataclass(slots=True)
class Parameter:
    value: float
    type: int = REAL32


class Parameters:
    """Name -> value, in the order in which they are listed."""

    def __init__(self, table: dict[str, Parameter], *, bytewise: bool) -> None:
        self._table = table
        self._names = list(table)
        self._bytewise = bytewise

    def __getitem__(self, name: str) -> float:
        return self._table[name].value

    def __contains__(self, name: str) -> bool:
        return name in self._table

    def listing(self) -> list[ParamValue]:
        return [self.report(name) for name in self._names]

    def text(self) -> bytes:
        """Return every name with its value, a line each."""
        return "".join(f"{name} {parameter.value:g}\n" for name, parameter in self._table.items()).encode()

    def name_at(self, index: int) -> str | None:
        return self._names[index] if 0 <= index < len(self._names) else None

    def report(self, name: str) -> ParamValue:
        parameter = self._table[name]
        return ParamValue(
            param_id=name,
            param_value=self._to_wire(parameter),
            param_type=parameter.type,
            param_count=len(self._names),
            param_index=self._names.index(name),
        )

    def set(self, name: str, wire_value: float) -> None:
        """Set from a float as it came over the wire; what is no number changes nothing."""
        parameter = self._table[name]
        if parameter.type != REAL32 and self._bytewise:
            parameter.value = struct.unpack("<i", struct.pack("<f", wire_value))[0]
        elif math.isfinite(wire_value):
            parameter.value = wire_value if parameter.type == REAL32 else round(wire_value)

    def _to_wire(self, parameter: Parameter) -> float:
        if parameter.type == REAL32 or not self._bytewise:
            return float(parameter.value)
        wire_value: float = struct.unpack("<f", struct.pack("<i", int(parameter.value)))[0]
        return wire_value
