"""A telemetry log retold: what a vehicle was told, what it answered and what it did."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hsop_gcs.errors import BadInput
from hsop_gcs.link.codec import Frame
from hsop_gcs.link.enums import MavCmd, MavResult
from hsop_gcs.link.events import ModeChanged, StatusTextReceived
from hsop_gcs.link.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    SetPositionTargetGlobalInt,
)
from hsop_gcs.link.protocol.speaker import Speaker, begins_link, is_foreign
from hsop_gcs.link.protocol.telemetry import Telemetry
from hsop_gcs.link.tlog import read_tlog


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One thing that was said or happened, ``time_s`` seconds after the log's first frame."""

    time_s: float
    system: int
    kind: str
    """told, answered, text, mode, flight"""
    what: str

    def __str__(self) -> str:
        return f"{self.time_s:8.2f} s  system {self.system:3d}  {self.kind:<9} {self.what}"


def retell(path: Path) -> Iterator[Line]:
    """Yield the story of a .tlog. Raises BadInput if there is no such file."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise BadInput(str(path), error.strerror or "cannot be read") from error
    vehicles: dict[int, _Vehicle] = {}
    first_s: float | None = None
    with file:
        for time_s, frame in read_tlog(file):
            first_s = time_s if first_s is None else first_s
            elapsed_s = time_s - first_s
            told = _told(frame)
            if told is not None:
                system, what = told
                yield Line(time_s=elapsed_s, system=system, kind="told", what=what)
            else:
                if frame.system not in vehicles and begins_link(frame.message, frame.component):
                    vehicles[frame.system] = _Vehicle(frame.system)
                if frame.system in vehicles:
                    yield from vehicles[frame.system].receive(frame, elapsed_s)


def _told(frame: Frame) -> tuple[int, str] | None:
    match frame.message:
        case CommandInt() as order:
            lat, lon = order.x * 1e-7, order.y * 1e-7
            return order.target_system, f"{_name(order.command)} to {lat:.6f}, {lon:.6f}, {order.z:.1f} m" + _numbers(
                order
            )
        case CommandLong() as order:
            return order.target_system, _name(order.command) + _numbers(order)
        case SetPositionTargetGlobalInt() as order:
            lat, lon = order.lat_int * 1e-7, order.lon_int * 1e-7
            return (
                order.target_system,
                f"position target {lat:.6f}, {lon:.6f}, {order.alt:.1f} m, yaw {order.yaw:.2f} rad",
            )
    return None


class _Vehicle:
    """What one vehicle's own frames show of it."""

    def __init__(self, system: int) -> None:
        self._system = system
        self._telemetry = Telemetry(system)
        self._speaker = Speaker()
        self._flight = ""

    def receive(self, frame: Frame, now: float) -> Iterator[Line]:
        if self._speaker.receive(frame.message, now, component=frame.component):
            self._telemetry.begin_anew(self._speaker.component)
        autopilot = self._speaker.component
        if frame.component != autopilot or is_foreign(frame.message, frame.component, autopilot=autopilot):
            return
        self._telemetry.receive(frame.message, now, component=frame.component)
        if isinstance(frame.message, CommandAck):
            result = MavResult(frame.message.result).name if frame.message.result in list(MavResult) else "?"
            yield self._line(now, "answered", f"{_name(frame.message.command)}: {result}")
        for event in self._telemetry.take_events():
            if isinstance(event, StatusTextReceived):
                yield self._line(now, "text", event.text)
            elif isinstance(event, ModeChanged):
                yield self._line(now, "mode", event.after)
        state = self._telemetry.state
        flight = "" if state.armed is None or state.in_air is None else _flight(state.armed, state.in_air)
        if flight and flight != self._flight:
            self._flight = flight
            yield self._line(now, "flight", flight)

    def _line(self, now: float, kind: str, what: str) -> Line:
        return Line(time_s=now, system=self._system, kind=kind, what=what)


def _flight(armed: bool, in_air: bool) -> str:
    return "in the air" if in_air else "armed" if armed else "on the ground, disarmed"


def _place(lat_e7: int, lon_e7: int, altitude_m: float) -> str:
    return f"{lat_e7 * 1e-7:.6f}, {lon_e7 * 1e-7:.6f}, {altitude_m:.1f} m"


def _name(command: int) -> str:
    return MavCmd(command).name if command in list(MavCmd) else f"command {command}"


def _numbers(order: CommandInt | CommandLong) -> str:
    values = [order.param1, order.param2, order.param3, order.param4]
    return " (" + ", ".join(f"{value:g}" for value in values) + ")"
