"""Inputs as the journal holds them: a kind and plain JSON, there and back without losing a bit."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from hsop_gcs.errors import BadInput
from hsop_gcs.journal import SNAPSHOT, Worth, read
from hsop_gcs.link import events
from hsop_gcs.link.events import Event
from hsop_gcs.mission.inputs import (
    ClockStepped,
    DecisionMade,
    EntriesGivenUp,
    HostDeparted,
    HostGaveWay,
    HostRetried,
    HostSetAside,
    HostsHeld,
    HostSpoke,
    HostsRecalled,
    HostsReleased,
    HostStopped,
    HostThreatened,
    Input,
    LegFlown,
    MissionStarted,
    PlanFlew,
    ProposalRefused,
    RaysArrived,
    ReportsArrived,
    SolverAsked,
    ThreatDismissed,
    TimePassed,
    WishLapsed,
)
from hsop_gcs.mission.snapshots import MissionSaved, from_snapshot

_PLAIN = (
    MissionStarted,
    ClockStepped,
    ReportsArrived,
    RaysArrived,
    TimePassed,
    SolverAsked,
    DecisionMade,
    PlanFlew,
    ProposalRefused,
    LegFlown,
    HostDeparted,
    HostStopped,
    HostGaveWay,
    HostThreatened,
    HostRetried,
    HostSetAside,
    HostsHeld,
    HostsRecalled,
    HostsReleased,
    ThreatDismissed,
    WishLapsed,
    EntriesGivenUp,
)
RAW = (ReportsArrived, RaysArrived, TimePassed)
_PROMISED = (MissionStarted, ClockStepped, HostsHeld, HostsRecalled, HostsReleased, ThreatDismissed)
_ADAPTERS: dict[str, TypeAdapter[Any]] = {cls.__name__: TypeAdapter(cls) for cls in _PLAIN}
_EVENTS: dict[str, TypeAdapter[Any]] = {
    name: TypeAdapter(cls)
    for name, cls in vars(events).items()
    if isinstance(cls, type) and issubclass(cls, Event) and cls is not Event
}


def to_record(given: Input) -> tuple[str, Any]:
    """Return what the journal holds of an input: its kind and its data, without its time."""
    kind = type(given).__name__
    if isinstance(given, HostSpoke):
        name = type(given.event).__name__
        return kind, {"host": given.host, "event": name, "details": _EVENTS[name].dump_python(given.event, mode="json")}
    data = _ADAPTERS[kind].dump_python(given, mode="json", exclude_defaults=isinstance(given, RAW))
    del data["time_s"]
    return kind, data


def worth_of(given: Input) -> Worth:
    """Return what an input is worth when not everything can be kept."""
    if isinstance(given, RAW):
        return Worth.RAW
    return Worth.PROMISED if isinstance(given, _PROMISED) else Worth.PLAIN


def from_record(kind: str, data: Any, time_s: float) -> Input:
    """Return the input of a journal's entry. Raises BadInput for a kind that is none, or data that does not fit it."""
    try:
        if kind == HostSpoke.__name__:
            event = _EVENTS[data["event"]].validate_python(data["details"])
            return HostSpoke(time_s=time_s, host=data["host"], event=event)
        if kind == SNAPSHOT:
            return MissionSaved(time_s=time_s, state=from_snapshot(data))
        given: Input = _ADAPTERS[kind].validate_python({**data, "time_s": time_s})
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(kind, f"no entry of a mission's journal: {error}") from error
    return given


def read_inputs(path: Path) -> Iterator[tuple[int, Input]]:
    """Yield the inputs of a mission's journal with their numbers. Raises BadInput for a journal that is none."""
    for entry in read(path):
        yield entry.number, from_record(entry.kind, entry.data, entry.time_s)
