"""Asking a vehicle for the messages we live on.

ArduPilot sends only heartbeats until asked; PX4 sends much unasked, at rates of its own. A vehicle that restarted has
forgotten what was asked of it, perhaps within one lost link's time, so silence of a single message asks again too.

    down ──link up──► asking ──answered──► watching ──a message is missing──► asking (those that are missing)
      ▲                                        │
      └──────────────link lost─────────────────┘
"""

from dataclasses import dataclass

from hsop_gcs.link.enums import MavCmd, MavComponent
from hsop_gcs.link.events import Event
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
_PERIODS_MISSED = 5
_WATCH_EVERY_S = 5.0
_ASK_FOR_S = 20.0


@dataclass(slots=True)
class _Wanted:
    rate_hz: float
    component: int = MavComponent.AUTOPILOT1
    """Who sends it."""
    heard_s: float | None = None
    refused: bool = False


class Subscriptions:
    """Keeps the wanted messages coming; the commands go through the vehicle's ``CommandSender``."""

    def __init__(self, system: int, commands: CommandSender) -> None:
        self._system = system
        self._commands = commands
        self._wanted: dict[type[Message], _Wanted] = {}
        self._tickets: dict[int, type[Message]] = {}
        self._watch_at: float | None = None

    @property
    def wake_at(self) -> float | None:
        """When the arrivals are looked over next."""
        return self._watch_at

    def link_up(self, now: float) -> None:
        """Ask for everything."""
        self._wanted = {kind: _Wanted(rate_hz=rate_hz) for kind, rate_hz in RATES_HZ.items()}
        for kind in RATES_HZ:
            self._ask(kind, now)
        for kind in _ONCE:
            self._command(MavCmd.REQUEST_MESSAGE, kind, MavComponent.AUTOPILOT1, 0.0, now)
        self._watch_at = now + _WATCH_EVERY_S

    def link_lost(self) -> None:
        """Stop watching."""
        self._watch_at = None

    def lead(self, gimbal: GimbalDevice | None, now: float) -> None:
        """Ask those for the reports of the led gimbal who send them; None: the autopilot, while no other is known."""
        autopilot = int(MavComponent.AUTOPILOT1)
        of_device, of_manager = (autopilot, autopilot) if gimbal is None else (gimbal.component, gimbal.manager)
        for kind, component in ((GimbalDeviceAttitudeStatus, of_device), (GimbalManagerStatus, of_manager)):
            wanted = self._wanted.get(kind)
            if wanted is not None and wanted.component != component:
                self._wanted[kind] = _Wanted(rate_hz=wanted.rate_hz, component=component)
                self._ask(kind, now)

    def receive(self, message: Message, now: float, *, component: int = MavComponent.AUTOPILOT1) -> None:
        """Note that a message came from whom it is wanted."""
        wanted = self._wanted.get(type(message))
        if wanted is not None and wanted.component == component:
            wanted.heard_s = now

    def settle(self, outcome: Outcome) -> None:
        """Take the end of a command; a refused rate is not asked for again until the link is new."""
        kind = self._tickets.pop(outcome.ticket, None)
        if kind is None or outcome.verdict is not Verdict.REFUSED:
            return
        wanted = self._wanted[kind]
        wanted.refused = wanted.refused or outcome.request.message.target_component == wanted.component

    def advance(self, now: float) -> None:
        """Ask again for what is missing."""
        if self._watch_at is None or now < self._watch_at:
            return
        self._watch_at = now + _WATCH_EVERY_S
        under_way = set(self._tickets.values())
        for kind, wanted in self._wanted.items():
            patience_s = max(_PERIODS_MISSED / wanted.rate_hz, _WATCH_EVERY_S)
            missing = wanted.heard_s is None or now - wanted.heard_s > patience_s
            if missing and not wanted.refused and kind not in under_way:
                self._ask(kind, now)

    def take_outgoing(self) -> list[Message]:
        """Everything goes through the command sender."""
        return []

    def take_events(self) -> list[Event]:
        """Nothing here is news to anybody above."""
        return []

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
