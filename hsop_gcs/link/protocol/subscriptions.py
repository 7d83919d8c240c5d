"""Asking a vehicle for the messages we live on, and watching that they come as often as was asked.

ArduPilot sends only heartbeats until asked; PX4 sends much unasked, at rates of its own. A vehicle that restarted has
forgotten what was asked of it, another ground station may have asked for less, a router may pass on less. Whatever it
was: the rate falls, and is asked for again.

    down ──link up──► asking ──answered──► watching ──a rate is far below what was asked──► asking for that one
      ▲                                        │            again, each time after twice as long a pause,
      └──────────────link lost─────────────────┘            until it has held for a while

Two stations that both insist would undo each other's rates for good: that is what the pauses are for.
"""

from dataclasses import dataclass

from hsop_gcs.link.enums import MavCmd, MavComponent
from hsop_gcs.link.events import Event, StreamRateFell, StreamRateNotKept
from hsop_gcs.link.messages import (
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    CommandLong,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsRawInt,
    HomePosition,
    Message,
    SysStatus,
)
from hsop_gcs.link.protocol.command import REPEATABLE, CommandSender, Outcome, Request, Verdict
from hsop_gcs.link.protocol.gimbal_device import GimbalDevice

RATES_HZ: dict[type[Message], float] = {
    GlobalPositionInt: 10.0,
    Attitude: 20.0,
    ExtendedSysState: 2.0,
    HomePosition: 0.5,
    GimbalDeviceAttitudeStatus: 20.0,
    GimbalManagerStatus: 1.0,
    SysStatus: 1.0,
    GpsRawInt: 1.0,
    BatteryStatus: 0.5,
    EkfStatusReport: 1.0,
    EstimatorStatus: 1.0,
}
"""In the order of asking: what gates an order comes first; of the last two each autopilot knows one. Attitudes come as
often as a camera needs that tells where it looked a tenth of a second ago."""

_ONCE: tuple[type[Message], ...] = (HomePosition, AutopilotVersion)
_WATCH_EVERY_S = 5.0
_WINDOW_PERIODS = 5
"""A rate is that of a window of at least so many periods, and of one look."""
_ENOUGH = 0.4
"""The share of the rate asked for that will do: gimbals tell half as often as they are asked, lossy links lose more."""
_LOW_WINDOWS = 2
"""A rate that is low for so many windows has fallen; one window may have held a moment without a link."""
_NOT_KEPT_AFTER = 3
"""Asked for so often in vain, a rate is told as not kept."""
_LONGEST_PAUSE_S = 320.0
_HOLDS_AFTER_S = 60.0
"""A rate that was asked for again holds when it has held for so long, and for twice the last pause."""
_ASK_FOR_S = 20.0


@dataclass(slots=True)
class _Wanted:
    rate_hz: float
    component: int
    """Who sends it."""
    since_s: float
    """When the present window began."""
    count: int = 0
    """How many came in the present window."""
    low_windows: int = 0
    heard: bool = False
    asks: int = 0
    """How often it was asked for again since it last held."""
    again_at_s: float = 0.0
    held_since_s: float | None = None
    told_not_kept: bool = False
    refused: bool = False

    @property
    def window_s(self) -> float:
        return max(_WATCH_EVERY_S, _WINDOW_PERIODS / self.rate_hz)

    @property
    def pause_s(self) -> float:
        return min(_WATCH_EVERY_S * 2.0**self.asks, _LONGEST_PAUSE_S)


class Subscriptions:
    """Keeps the wanted messages coming; the commands go through the vehicle's ``CommandSender``."""

    def __init__(self, system: int, commands: CommandSender) -> None:
        self._system = system
        self._commands = commands
        self._wanted: dict[type[Message], _Wanted] = {}
        self._tickets: dict[int, type[Message]] = {}
        self._watch_at: float | None = None
        self._autopilot: int = MavComponent.AUTOPILOT1
        self._events: list[Event] = []

    @property
    def wake_at(self) -> float | None:
        """When the arrivals are looked over next."""
        return self._watch_at

    def link_up(self, now: float, *, autopilot: int = MavComponent.AUTOPILOT1) -> None:
        """Ask the autopilot's component for everything."""
        self._autopilot = autopilot
        self._wanted = {kind: _Wanted(rate_hz, autopilot, since_s=now) for kind, rate_hz in RATES_HZ.items()}
        for kind in RATES_HZ:
            self._ask(kind, now)
        for kind in _ONCE:
            self._command(MavCmd.REQUEST_MESSAGE, kind, autopilot, 0.0, now)
        self._watch_at = now + _WATCH_EVERY_S

    def link_lost(self) -> None:
        """Stop watching."""
        self._watch_at = None

    def lead(self, gimbal: GimbalDevice | None, now: float) -> None:
        """Ask those for the reports of the led gimbal who send them; None: the autopilot, while no other is known."""
        autopilot = self._autopilot
        of_device, of_manager = (autopilot, autopilot) if gimbal is None else (gimbal.component, gimbal.manager)
        for kind, component in ((GimbalDeviceAttitudeStatus, of_device), (GimbalManagerStatus, of_manager)):
            wanted = self._wanted.get(kind)
            if wanted is not None and wanted.component != component:
                self._wanted[kind] = _Wanted(wanted.rate_hz, component, since_s=now)
                self._ask(kind, now)

    def receive(self, message: Message, now: float, *, component: int = MavComponent.AUTOPILOT1) -> None:
        """Count a message that came from whom it is wanted."""
        del now
        self.count(type(message), component=component)

    def count(self, kind: type[Message], *, component: int) -> None:
        """Count a message that came, also one that nobody read because a newer one had come."""
        wanted = self._wanted.get(kind)
        if wanted is not None and wanted.component == component:
            wanted.count += 1
            wanted.heard = True

    def settle(self, outcome: Outcome) -> None:
        """Take the end of a command; a refused rate is not asked for again until the link is new."""
        kind = self._tickets.pop(outcome.ticket, None)
        if kind is None or outcome.verdict is not Verdict.REFUSED:
            return
        wanted = self._wanted[kind]
        wanted.refused = wanted.refused or outcome.request.message.target_component == wanted.component

    def advance(self, now: float) -> None:
        """Look at the rates; ask again for those that are far too low."""
        if self._watch_at is None or now < self._watch_at:
            return
        self._watch_at = now + _WATCH_EVERY_S
        fallen, not_kept = [], []
        for kind, wanted in self._wanted.items():
            elapsed_s = now - wanted.since_s
            if elapsed_s < wanted.window_s:
                continue
            rate_hz, silent = wanted.count / elapsed_s, wanted.count == 0
            wanted.since_s, wanted.count = now, 0
            if rate_hz >= _ENOUGH * wanted.rate_hz:
                self._note_held(wanted, now)
                continue
            wanted.held_since_s = None
            wanted.low_windows += 1
            if wanted.refused or (not silent and wanted.low_windows < _LOW_WINDOWS):
                continue
            words = f"{kind.NAME}: {rate_hz:.1f} of {wanted.rate_hz:g} Hz"
            if wanted.heard and wanted.asks == 0:
                fallen.append(words)
            if wanted.heard and wanted.asks == _NOT_KEPT_AFTER and not wanted.told_not_kept:
                wanted.told_not_kept = True
                not_kept.append(words)
            if now >= wanted.again_at_s and kind not in self._tickets.values():
                wanted.asks += 1
                wanted.again_at_s = now + wanted.pause_s
                self._ask(kind, now)
        if fallen:
            self._events.append(StreamRateFell(system=self._system, rates=tuple(fallen)))
        if not_kept:
            self._events.append(StreamRateNotKept(system=self._system, rates=tuple(not_kept)))

    def take_outgoing(self) -> list[Message]:
        """Everything goes through the command sender."""
        return []

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    def _note_held(self, wanted: _Wanted, now: float) -> None:
        wanted.low_windows = 0
        wanted.held_since_s = now if wanted.held_since_s is None else wanted.held_since_s
        if wanted.asks and now - wanted.held_since_s >= max(_HOLDS_AFTER_S, 2 * wanted.pause_s):
            wanted.asks, wanted.told_not_kept = 0, False

    def _ask(self, kind: type[Message], now: float) -> None:
        wanted = self._wanted[kind]
        ticket = self._command(MavCmd.SET_MESSAGE_INTERVAL, kind, wanted.component, 1e6 / wanted.rate_hz, now)
        self._tickets[ticket] = kind

    def _command(self, command: MavCmd, kind: type[Message], component: int, param2: float, now: float) -> int:
        message = CommandLong(
            target_system=self._system,
            target_component=component,
            command=command,
            param1=float(kind.ID),
            param2=param2,
        )
        request = Request(message=message, key=f"ask {kind.NAME}", tries=REPEATABLE, deadline_s=now + _ASK_FOR_S)
        return self._commands.submit(request, now)
