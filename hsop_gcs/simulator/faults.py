"""Faults on demand, as ``hsop-gcs simulate --fault`` takes them.

    [VEHICLE:]KIND[=COMMAND][,count=N][,result=RESULT][@START[+LENGTH]]

VEHICLE is ``h2`` or ``2``, the second one; without it every vehicle has the fault. START and LENGTH are seconds of
simulated time since the start; without START the fault is there from the beginning, without LENGTH it stays.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from hsop_gcs.errors import BadInput
from hsop_gcs.link.enums import MavCmd, MavResult


class FaultKind(StrEnum):
    """What can go wrong."""

    REJECT = "reject"
    IGNORE = "ignore"
    DENY_ARM = "deny-arm"
    GIMBAL_STUCK = "gimbal-stuck"
    GIMBAL_TAKEN = "gimbal-taken"
    GPS_LOST = "gps-lost"
    LINK_CUT = "link-cut"
    GALE = "gale"


FORM = "[VEHICLE:]KIND[=COMMAND][,count=N][,result=RESULT][@START[+LENGTH]]"
MEANING = {
    FaultKind.REJECT: "answers COMMAND with RESULT (TEMPORARILY_REJECTED if not given) and does not obey it",
    FaultKind.IGNORE: "neither obeys COMMAND nor answers it",
    FaultKind.DENY_ARM: "refuses to arm, as the stack does when a check fails",
    FaultKind.GIMBAL_STUCK: "the gimbal accepts orders and does not move",
    FaultKind.GIMBAL_TAKEN: "another ground station takes the gimbal and looks down; insists for LENGTH if given",
    FaultKind.GPS_LOST: "the position is lost, a vehicle in the air comes down where it is",
    FaultKind.LINK_CUT: "nothing passes in either direction",
    FaultKind.GALE: "a west wind of 18 m/s carries the vehicle away, faster than it flies",
}
_WITH_COMMAND = {FaultKind.REJECT, FaultKind.IGNORE}
_FORM = re.compile(
    r"(?:h?(?P<vehicle>\d+):)?(?P<kind>[a-z-]+)(?:=(?P<command>\w+))?(?P<options>(?:,\w+=\w+)*)"
    r"(?:@(?P<start>[\d.]+)(?:\+(?P<length>[\d.]+))?)?"
)
_FOR_EVER_S = float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault. ``vehicle``: its number in the fleet, from 1; None: every vehicle's. Times: since the start."""

    kind: FaultKind
    vehicle: int | None = None
    command: int | None = None
    count: int | None = None
    """How many commands it meets; None: all."""
    result: MavResult = MavResult.TEMPORARILY_REJECTED
    start_s: float = 0.0
    length_s: float | None = None

    @property
    def end_s(self) -> float:
        return _FOR_EVER_S if self.length_s is None else self.start_s + self.length_s


def parse_fault(text: str, vehicles: int) -> Fault:
    """Read one ``--fault``; ``vehicles``: how many there are. Raises BadInput that names what is wrong with it."""
    found = _FORM.fullmatch(text)
    if found is None:
        raise BadInput("--fault", f"{text!r} is not {FORM}")

    def wrong(problem: str) -> BadInput:
        return BadInput("--fault", f"{problem} in {text!r}")

    if found["kind"] not in list(FaultKind):
        raise wrong(f"{found['kind']!r} is none of {', '.join(FaultKind)}")
    kind = FaultKind(found["kind"])
    if (found["command"] is not None) != (kind in _WITH_COMMAND):
        raise wrong(f"{kind} {'needs a command' if kind in _WITH_COMMAND else 'takes no command'}")
    vehicle = int(found["vehicle"]) if found["vehicle"] else None
    if vehicle is not None and not 1 <= vehicle <= vehicles:
        raise wrong(f"vehicle {vehicle} is not one of {vehicles}")
    options = dict(option.split("=") for option in found["options"].split(",")[1:])
    allowed = {FaultKind.REJECT: {"count", "result"}, FaultKind.IGNORE: {"count"}}.get(kind, set())
    for name in options.keys() - allowed:
        raise wrong(f"{kind} takes no {name!r}")
    count, result = options.get("count"), options.get("result", MavResult.TEMPORARILY_REJECTED.name)
    if count is not None and not (count.isdecimal() and int(count) > 0):
        raise wrong(f"count {count!r} is not a positive number")
    if result not in MavResult.__members__:
        raise wrong(f"result {result!r} is none of {', '.join(MavResult.__members__)}")
    try:
        start_s = float(found["start"] or 0.0)
        length_s = float(found["length"]) if found["length"] else None
    except ValueError:
        raise wrong("a time is not a number") from None
    return Fault(
        kind=kind,
        vehicle=vehicle,
        command=None if found["command"] is None else _command(found["command"], wrong),
        count=None if count is None else int(count),
        result=MavResult[result],
        start_s=start_s,
        length_s=length_s,
    )


class Faults:
    """The faults of one vehicle. Times are seconds since the start."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = tuple(faults)
        self._left = {index: fault.count for index, fault in enumerate(self._faults)}
        self._begun: set[int] = set()

    def active(self, kind: FaultKind, at_s: float) -> bool:
        return any(fault.kind is kind and fault.start_s <= at_s < fault.end_s for fault in self._faults)

    def strikes(self, kind: FaultKind, at_s: float) -> bool:
        """Whether a fault that is a deed is done now: once at its start, or all through its length."""
        for index, fault in enumerate(self._faults):
            if fault.kind is kind and fault.start_s <= at_s < fault.end_s:
                again = fault.length_s is not None or index not in self._begun
                self._begun.add(index)
                if again:
                    return True
        return False

    def meeting(self, command: int, at_s: float) -> Fault | None:
        """Return the fault that meets this command, and count it; None: nothing happens to it."""
        for index, fault in enumerate(self._faults):
            if fault.command == command and fault.start_s <= at_s < fault.end_s and self._left[index] != 0:
                left = self._left[index]
                self._left[index] = None if left is None else left - 1
                return fault
        return None


def _command(text: str, wrong: Callable[[str], BadInput]) -> int:
    name = text.upper().removeprefix("MAV_CMD_")
    if name in MavCmd.__members__:
        return MavCmd[name]
    if text.isdecimal() and int(text) < 2**16:
        return int(text)
    raise wrong(f"command {text!r} is neither a number nor one of {', '.join(MavCmd.__members__)}")
