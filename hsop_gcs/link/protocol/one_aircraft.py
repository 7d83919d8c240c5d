"""Whether all that comes under a vehicle's id comes from one aircraft, and whether its autopilot restarted.

Two aircraft of the same id behind one address (a factory's default, a router) look like one that leaps. What no single
aircraft does is to leap back and forth:

- its clock (``time_boot_ms``) between two that are seconds apart. A clock that goes back once and stays is a restart;
- its position between two places that it cannot have flown between. One leap is a reset of the estimator's;
- its kind, from heartbeat to heartbeat;
- its place at one time of its own clock: two places, or two sequence numbers seconds apart. That shows two that were
  switched on together and stand side by side; copies of frames, late ones and those out of order do not look like it.
"""

import math
from collections import OrderedDict, deque
from dataclasses import dataclass
from typing import Generic, TypeVar

from hsop_gcs.link.events import AutopilotRestarted, Event, TwoAircraftHeard
from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Heartbeat, Message

_SWITCHES = 6
"""Leaps within the window that are no accident any more: a restart is one, a satellite receiver's bad moment two."""
_WINDOW_S = 10.0
_CLOCKS_APART_S = 5.0
"""No frame is this late: it is of another clock."""
_CLOCK_FOLLOWS = 0.05
"""How much of a message's delay the clock takes over: a simulator short of processor time runs slow."""
_NUMBERED_APART_S = 1.0
"""Two channels of one autopilot may differ by less on their ways."""
_RESTART_STAYS_S = 0.5
_RESTART_FRAMES = 3
_FASTEST_MPS = 40.0
_POSITION_NOISE_M = 25.0
_SAME_TIME_MS = 50
_SAME_PLACE_M = 1.0
_OTHER_SEQUENCE = 32
"""Sequence numbers this far apart were not sent within ``_SAME_TIME_MS`` by one sender."""
_TIMES_KEPT = 256
_METRES_A_DEGREE = 111_320.0

T = TypeVar("T")


class _Switches(Generic[T]):
    """What one kind of evidence shows: the present value, the one before it, and when it leapt."""

    def __init__(self) -> None:
        self.present: T | None = None
        self.other: T | None = None
        self.times: deque[float] = deque(maxlen=_SWITCHES)

    def leap(self, value: T, now: float) -> None:
        """Take a value that does not follow from the present one: a new one, or the one before it."""
        self.present, self.other = value, self.present
        self.times.append(now)

    def too_often(self, now: float) -> bool:
        """Whether it leapt more often of late than one aircraft does."""
        return len(self.times) == _SWITCHES and now - self.times[0] <= _WINDOW_S


@dataclass(frozen=True, slots=True)
class _Place:
    heard_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float
    speed_mps: float
    sequence: int | None

    def distance_m(self, other: "_Place") -> float:
        north_m = (self.lat_deg - other.lat_deg) * _METRES_A_DEGREE
        turned_deg = math.remainder(self.lon_deg - other.lon_deg, 360.0)
        east_m = turned_deg * _METRES_A_DEGREE * math.cos(math.radians(self.lat_deg))
        return math.hypot(north_m, east_m, self.altitude_m - other.altitude_m)

    def follows(self, before: "_Place") -> bool:
        """Whether an aircraft that was there before can be here."""
        return self.distance_m(before) <= _FASTEST_MPS * (self.heard_s - before.heard_s) + _POSITION_NOISE_M


class OneAircraft:
    """Watches what comes from one vehicle's autopilot."""

    LOOKS_AT = (Heartbeat, Attitude, GlobalPositionInt)
    """The messages that show anything."""

    def __init__(self, system: int) -> None:
        self._system = system
        self._clocks: _Switches[float] = _Switches()
        """By how much our clock is ahead of the autopilot's, seconds."""
        self._places: _Switches[_Place] = _Switches()
        self._kinds: _Switches[tuple[int, int]] = _Switches()
        self._at: OrderedDict[int, tuple[int, _Place]] = OrderedDict()
        """Where it was at the times of its own clock, by steps of ``_SAME_TIME_MS``."""
        self._twice: deque[float] = deque(maxlen=_SWITCHES)
        self._newest_ms = 0
        """The time of its own clock that came last."""
        self._back_since: tuple[float, int] | None = None
        """When its clock went back, and how many frames told so since."""
        self._told = False
        self._events: list[Event] = []
        self._twice_how = ""
        self._apart_m = 0.0

    def receive(self, message: Message, now: float, *, sequence: int | None = None) -> None:
        """Take a message of the autopilot; sequence: of the frame it came in."""
        if not isinstance(message, self.LOOKS_AT):
            return
        match message:
            case Heartbeat():
                self._kind((message.autopilot, message.type), now)
            case Attitude() if message.time_boot_ms:
                self._clock(message.time_boot_ms, now)
            case GlobalPositionInt() if message.lat or message.lon:
                if message.time_boot_ms:
                    self._clock(message.time_boot_ms, now)
                speed_mps = math.hypot(message.vx, message.vy, message.vz) / 100
                place = _Place(now, message.lat / 1e7, message.lon / 1e7, message.alt / 1000, speed_mps, sequence)
                self._place(place, now)
                if message.time_boot_ms:
                    self._same_time(message.time_boot_ms, place)
        problem = self.problem(now)
        if problem is not None and not self._told:
            self._events.append(TwoAircraftHeard(system=self._system, problem=problem))
        self._told = problem is not None

    def problem(self, now: float) -> str | None:
        """Return what shows that there are two aircraft, for a person; None if nothing did of late."""
        shown = self._shown(now)
        return None if shown is None else f"two aircraft speak under its system id: {shown}"

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    def _shown(self, now: float) -> str | None:
        clocks = self._clocks
        if clocks.too_often(now) and clocks.present is not None and clocks.other is not None:
            return f"their clocks are {abs(clocks.present - clocks.other):.0f} s apart"
        if self._places.too_often(now):
            return f"they are {self._apart_m:.0f} m apart"
        if len(self._twice) == _SWITCHES and now - self._twice[0] <= _WINDOW_S:
            return self._twice_how
        return "they are of different kinds" if self._kinds.too_often(now) else None

    def _kind(self, kind: tuple[int, int], now: float) -> None:
        if self._kinds.present is None:
            self._kinds.present = kind
        elif kind != self._kinds.present:
            self._kinds.leap(kind, now)

    def _clock(self, time_boot_ms: int, now: float) -> None:
        ahead_s, clocks = now - time_boot_ms * 1e-3, self._clocks
        if clocks.present is None:
            clocks.present = ahead_s
        elif abs(ahead_s - clocks.present) <= _CLOCKS_APART_S:
            late_s = ahead_s - clocks.present
            clocks.present += late_s if late_s < 0 else _CLOCK_FOLLOWS * late_s
            self._stays(now)
        else:
            returns = clocks.other is not None and abs(ahead_s - clocks.other) <= _CLOCKS_APART_S
            # What only waited was sent after all that came before it.
            back = time_boot_ms < self._newest_ms and ahead_s > clocks.present and not returns
            clocks.leap(ahead_s, now)
            self._back_since = (now, 1) if back else None
        self._newest_ms = time_boot_ms

    def _stays(self, now: float) -> None:
        """Tell a restart when the clock that went back has stayed there."""
        if self._back_since is None:
            return
        since_s, frames = self._back_since
        self._back_since = (since_s, frames + 1)
        if frames + 1 >= _RESTART_FRAMES and now - since_s >= _RESTART_STAYS_S:
            self._back_since = None
            self._at.clear()
            if not self._clocks.too_often(now):
                self._events.append(AutopilotRestarted(system=self._system))

    def _place(self, place: _Place, now: float) -> None:
        places = self._places
        if places.present is None or place.follows(places.present):
            places.present = place
        else:
            self._apart_m = place.distance_m(places.present)
            places.leap(place, now)

    def _same_time(self, time_boot_ms: int, place: _Place) -> None:
        step = time_boot_ms // _SAME_TIME_MS
        for near in (step - 1, step, step + 1):
            known = self._at.get(near)
            if known is None or abs(known[0] - time_boot_ms) > _SAME_TIME_MS:
                continue
            before = known[1]
            if place.heard_s - before.heard_s > _WINDOW_S:
                continue
            apart_m = place.distance_m(before)
            elsewhere = apart_m > _SAME_PLACE_M + place.speed_mps * _SAME_TIME_MS * 1e-3
            if elsewhere or _of_two(place, before):
                self._twice.append(place.heard_s)
                self._twice_how = f"they are {apart_m:.0f} m apart" if elsewhere else "their frames are numbered by two"
                break
        self._at[step] = (time_boot_ms, place)
        self._at.move_to_end(step)
        if len(self._at) > _TIMES_KEPT:
            self._at.popitem(last=False)


def _of_two(place: _Place, before: _Place) -> bool:
    """Whether the frames of one time were numbered by two senders, whose clocks show that time at different times."""
    if place.sequence is None or before.sequence is None or place.heard_s - before.heard_s < _NUMBERED_APART_S:
        return False
    ahead = (place.sequence - before.sequence) % 256
    return _OTHER_SEQUENCE <= ahead <= 256 - _OTHER_SEQUENCE
