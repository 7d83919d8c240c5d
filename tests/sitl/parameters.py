"""The parameter files of sitl_configs/, read as the autopilots' tools read them."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "sitl_configs"
_ARDUPILOT_LONGEST_LINE = 98
"""AP_Param reads lines into 100 bytes; the rest of a longer one would be taken for a line of its own."""
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
_QGC_INT32, _QGC_FLOAT = "6", "9"


def ardupilot(*names: str) -> dict[str, float]:
    """Read ``NAME VALUE`` files, later ones over earlier ones, as ``--defaults`` does."""
    values: dict[str, float] = {}
    for name in names:
        lines = (CONFIGS / "ardupilot" / f"{name}.parm").read_text(encoding="ascii").splitlines()
        for why, line in _commented(name, lines):
            assert max(len(why), len(line)) <= _ARDUPILOT_LONGEST_LINE, f"{name}: {line}"
            parameter, value = line.split(" ")
            _put(values, parameter, float(value), name)
    return values


def px4(*names: str) -> dict[str, float]:
    """Read QGroundControl's files: vehicle, component, name, value and MAV_PARAM_TYPE between tabs."""
    values: dict[str, float] = {}
    for name in names:
        lines = (CONFIGS / "px4" / f"{name}.params").read_text(encoding="ascii").splitlines()
        for _, line in _commented(name, lines):
            vehicle, component, parameter, value, kind = line.split("\t")
            assert (vehicle, component) == ("1", "1"), line
            assert kind == (_QGC_FLOAT if "." in value else _QGC_INT32), line
            _put(values, parameter, float(value), name)
    return values


def _commented(name: str, lines: list[str]) -> list[tuple[str, str]]:
    """Return each parameter's line with the comment above it; every one must have its own."""
    pairs = [(lines[at - 1] if at else "", line) for at, line in enumerate(lines) if not line.startswith("#")]
    assert pairs, name
    for why, line in pairs:
        assert why.startswith("# "), f"{name}: nothing says why {line!r}"
    assert all(len(line) <= 120 for line in lines), name
    return pairs


def _put(values: dict[str, float], parameter: str, value: float, name: str) -> None:
    assert _NAME.fullmatch(parameter), f"{name}: {parameter}"
    assert parameter not in values, f"{name}: {parameter} a second time"
    values[parameter] = value
