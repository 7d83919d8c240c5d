"""One vehicle: its machines put together, and the orders that the layers above may give it.

presence ─► telemetry ─► subscriptions
                │
                ├─► hover ────┐
                ├─► gimbal ───┼─► commands ─► wire
                └─► take off ─┘

A machine that raises costs the vehicle its order and nobody else anything: ``mend`` puts fresh machines in the place of
those that may be in a half state, keeps what is known of the vehicle, and has it wait until a frame goes through.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Protocol

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.adapters import Adapter
from hsop_gcs.link.enums import DoRepositionFlags, MavCmd, MavComponent
from hsop_gcs.link.events import (
    AutopilotRestarted,
    CommandFinished,
    Event,
    LinkLost,
    LinkUp,
    OnStation,
    OrderFailed,
    VehicleFault,
)
from hsop_gcs.link.faults import Illness, describe, trace_of
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import CommandLong, Message, Unknown
from hsop_gcs.link.protocol.command import INSISTENT, REPEATABLE, CommandLimits, CommandSender, Outcome, Request
from hsop_gcs.link.protocol.failsafes import Failsafes
from hsop_gcs.link.protocol.gimbal import Gimbal, GimbalTolerances
from hsop_gcs.link.protocol.heartbeat import Presence
from hsop_gcs.link.protocol.hover import Hover, HoverLimits, HoverOrder, Phase
from hsop_gcs.link.protocol.one_aircraft import OneAircraft
from hsop_gcs.link.protocol.ready import why_not_ready, why_not_stopped
from hsop_gcs.link.protocol.round_trip import RoundTrip
from hsop_gcs.link.protocol.speaker import Speaker, is_foreign, is_taken, what_speaks
from hsop_gcs.link.protocol.stop import Stop
from hsop_gcs.link.protocol.subscriptions import RATES_HZ, Subscriptions
from hsop_gcs.link.protocol.take_off import TakeOff, set_mode
from hsop_gcs.link.protocol.telemetry import Telemetry, VehicleState

_MACHINES = (
    "presence",
    "telemetry",
    "commands",
    "subscriptions",
    "hover",
    "gimbal",
    "take_off",
    "round_trip",
    "failsafes",
)
"""In the order in which they do what is due."""
_EVEN_ILL = ("presence", "telemetry", "commands")
"""The machines that a vehicle keeps while it is not trusted with orders; the others wait."""
_ORDER_KEYS = ("hover", "take off", "gimbal aim")
"""What the commands of orders are submitted under."""
_OPERATOR_DEADLINE_S = 5.0
"""An operator's hold or return that cannot be sent for so long is not sent later by surprise."""
_STAY = "stay where it stopped"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLimits:
    """Every tolerance and patience of one vehicle's link."""

    lost_after_s: float = 3.5
    commands: CommandLimits = field(default_factory=CommandLimits)
    hover: HoverLimits = field(default_factory=HoverLimits)
    gimbal: GimbalTolerances = field(default_factory=GimbalTolerances)


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How the current hover order stands; errors are None where telemetry is missing."""

    order: HoverOrder
    phase: str
    horizontal_error_m: float | None
    vertical_error_m: float | None
    """Positive: too high."""
    heading_error_deg: float | None
    """Positive: too far clockwise."""
    gimbal_error_deg: float | None
    on_station: bool


_KINDS = {kind.ID: kind for kind in RATES_HZ}
"""The messages whose rates are watched, by their ids."""


class Vehicle:
    """One vehicle by its MAVLink system id. Without I/O; frames of this id go in, messages to it come out."""

    def __init__(self, system: int, *, own: Identity = GROUND_STATION, limits: VehicleLimits | None = None) -> None:
        self.system = system
        self._own = own
        self._limits = limits or VehicleLimits()
        self._one_aircraft = OneAircraft(system)
        self._presence = Presence(system, lost_after_s=self._limits.lost_after_s)
        self._telemetry = Telemetry(system)
        self._begin_commands()
        self._gimbal = Gimbal(self._telemetry, self._commands, own=own, tolerances=self._limits.gimbal)
        self._begin_orders()
        self._round_trip = RoundTrip()
        self._failsafes = Failsafes(self._telemetry)
        self._stop = Stop()
        self._on_station = False
        self._events: list[Event] = []
        self._at_once: list[Message] = []
        """Messages that are sent past the machine that should send them, because that machine failed."""
        self._illness = Illness()
        self._works = "vehicle"
        """Which machine is at work, to be named if it fails."""
        self._failed: tuple[str, Exception] | None = None
        """What failed while it was only asked, to be mended when there is a time."""
        self.trace: str | None = None
        """Where the fault that was told last came from, for a log."""
        self.foreign_heartbeats = 0
        """Heartbeats under the autopilot's ids that are not the autopilot's."""
        self._speaker = Speaker()
        self._not_taken_s = -math.inf
        self.not_taken: Counter[str] = Counter()
        """Messages of components that are not listened to, by the kind of component."""

    @property
    def state(self) -> VehicleState:
        """The newest known state."""
        return self._telemetry.state

    @property
    def adapter(self) -> Adapter | None:
        """How its autopilot wants to be spoken to; None before its first heartbeat, or for one we do not know."""
        return self._telemetry.adapter

    @property
    def progress(self) -> Progress | None:
        """How the current hover order stands; None without one."""
        try:
            order, error = self._hover.order, self._hover.error()
        except Exception as fault:
            self._failed = ("hover", fault)
            return None
        if order is None or error is None:
            return None
        return Progress(
            order=order,
            phase=self._hover.phase.value,
            horizontal_error_m=error.horizontal_m,
            vertical_error_m=error.vertical_m,
            heading_error_deg=error.heading_deg,
            gimbal_error_deg=self._gimbal.error_deg,
            on_station=self._on_station,
        )

    def other_autopilots(self, now: float) -> tuple[int, ...]:
        """Components that speak as a second autopilot under the vehicle's id, and are not listened to."""
        return self._speaker.others_lately(now)

    @property
    def take_off_status(self) -> str | None:
        """How its take-off stands, or why the last one failed, for a person; see ``TakeOff.status``."""
        return self._take_off.status

    @property
    def takes_off(self) -> bool:
        """Whether it is taking off as it was ordered, or still in the mode that its take-off put it in."""
        return self._take_off.under_way

    @property
    def failsafes_checked(self) -> bool:
        """Whether the parameters of its failsafes were read; see ``failsafe_problems``."""
        return self._failsafes.checked

    @property
    def failsafe_problems(self) -> tuple[str, ...]:
        """Which of its failsafes will not work, and what to set, for a person."""
        return self._failsafes.problems

    @property
    def faults(self) -> int:
        """How often one of its machines has failed."""
        return self._illness.faults

    @property
    def command_noise(self) -> int:
        """Acknowledgements that no command was waiting for."""
        return self._commands.noise

    @property
    def commands_resent(self) -> int:
        """How often a command was sent again."""
        return self._commands.resent

    @property
    def round_trip_s(self) -> float | None:
        """How long a message takes to the vehicle and back; None while it is not measured."""
        return self._round_trip.seconds

    def why_not_ready(self, now: float) -> str | None:
        """Return why the vehicle cannot take a hover order now, for a person; None if it can."""
        return why_not_ready(self.state, now)

    def hover(self, order: HoverOrder, now: float) -> None:
        """Fly to a hover point and stay there; a hover order or take-off before it is superseded.

        Ends in ``Arrived`` (and ``OnStation``) or ``OrderFailed``. Raises BadInput for numbers that mean no place.
        """
        _check(order)

        def begin() -> None:
            self._works = "hover"
            self._hover.start(order, now)
            if order.aim is not None and self._hover.order is order:
                self._works = "gimbal"
                self._gimbal.start(order.aim, order_id=order.order_id, heading_deg=order.heading_deg, now=now)

        self._order(order.order_id, begin, now)

    def follow(self, aim: Aim, now: float) -> None:
        """Move the camera's aim of the present hover order along; at most five times a second it is sent."""
        with self._mending(now):
            self._works = "gimbal"
            self._gimbal.follow(aim, now)
            self._collect(now)

    def take_off(self, altitude_above_home_m: float, now: float, *, order_id: str = "take off") -> None:
        """Arm and climb to an altitude above home. Ends in ``TookOff`` or ``OrderFailed``."""

        def begin() -> None:
            self._works = "take_off"
            self._take_off.start(altitude_above_home_m, order_id=order_id, now=now)

        self._order(order_id, begin, now)

    def hold(self, now: float) -> None:
        """Stop where it can. Ends in ``CommandFinished``; the hover order, if any, is superseded."""
        adapter = self._telemetry.adapter
        self._operate("hold", _hold(self.state, adapter) if adapter is not None else None, now)
        if adapter is not None and adapter.hold_is_reposition:
            with self._mending(now):
                self._works = "stop"
                self._stop.start(self.state, now)

    def return_to_launch(self, now: float) -> None:
        """Fly home and land. Ends in ``CommandFinished``; the hover order, if any, is superseded."""
        message = CommandLong(
            target_system=self.system,
            target_component=self.state.component,
            command=MavCmd.NAV_RETURN_TO_LAUNCH,
        )
        self._operate("return to launch", message, now)

    def leave_alone(self, now: float) -> None:
        """Send nothing again of what it was ordered: somebody else flies it."""
        with self._mending(now):
            self._set_aside(now)

    @property
    def wake_at(self) -> float | None:
        """When ``advance`` has something to do; None while only a message can change anything."""
        if self._illness.newest is not None:
            return _earliest(*(self._wake_at_of(name) for name in _EVEN_ILL))
        try:
            return _earliest(
                self._presence.wake_at,
                self._telemetry.wake_at,
                self._commands.wake_at,
                self._subscriptions.wake_at,
                self._hover.wake_at,
                self._gimbal.wake_at,
                self._take_off.wake_at,
                self._round_trip.wake_at,
                self._failsafes.wake_at,
            )
        except Exception:
            return _earliest(*(self._wake_at_of(name) for name in _MACHINES))

    def _wake_at_of(self, name: str) -> float | None:
        try:
            return self._machine(name).wake_at
        except Exception as error:
            self._failed = (name, error)
            return None

    def receive(
        self,
        message: Message,
        now: float,
        *,
        component: int = MavComponent.AUTOPILOT1,
        sequence: int | None = None,
        raw: bytes | None = None,
    ) -> None:
        """Take a message that this vehicle's ``component`` sent; a heartbeat that is not the autopilot's is counted.

        sequence: of the frame that it came in. raw: that frame, to be told if it cannot be taken.
        """
        if self._failed is not None:
            with self._mending(now):
                self._raise_what_failed()
        try:
            self._take(message, now, component, sequence)
        except Exception as error:
            self.mend(error, now, frame=raw)
            return
        if self._illness.newest is not None:
            self._recover(now)

    def _take(self, message: Message, now: float, component: int, sequence: int | None) -> None:
        self._works = "speaker"
        if self._speaker.receive(message, now, component=component):
            self._autopilot_changed(now)
        if not self._is_taken(message, component, now):
            return
        if component == self.state.component:
            self._works = "presence"
            self._presence.receive(message, now)
            self._works = "one_aircraft"
            self._one_aircraft.receive(message, now, sequence=sequence)
        if isinstance(message, Unknown):
            self._note_presence(now)  # it says that the vehicle is there, and nothing that a machine reads
            return
        self._works = "telemetry"
        self._telemetry.receive(message, now, component=component)
        self._note_presence(now)
        if isinstance(message, OneAircraft.LOOKS_AT):
            self._note_identity(now)
        self._works = "commands"
        self._commands.receive(message, now, component=component)
        self._works = "gimbal"
        self._gimbal.receive(message, now, component=component)
        if component == self.state.component:
            self._works = "hover"
            self._hover.receive(message, now)
            self._works = "take_off"
            self._take_off.receive(message, now)
            self._works = "round_trip"
            self._round_trip.receive(message, now)
            self._works = "failsafes"
            self._failsafes.receive(message, now)
            self._works = "stop"
            self._stay(now)
        self._works = "subscriptions"
        self._subscriptions.lead(self._gimbal.device, now)
        self._subscriptions.receive(message, now, component=component)
        self._collect(now)

    def pass_over(self, number: int, component: int) -> None:
        """Count a message, by its id, that came and is not read because a newer one of its kind has come."""
        kind = _KINDS.get(number)
        if kind is not None:
            self._subscriptions.count(kind, component=component)

    def is_foreign(self, message: Message, component: int) -> bool:
        """Whether a message is a heartbeat under the autopilot's ids that is not the autopilot's."""
        return is_foreign(message, component, autopilot=self.state.component)

    def hears_others(self, now: float) -> bool:
        """Whether a message of a component that is not listened to came lately: as long as a link takes to be lost."""
        return now - self._not_taken_s < self._limits.lost_after_s

    def note_not_taken(self, component: int, now: float) -> None:
        """Count a message of a component that is not listened to."""
        self._not_taken_s = now
        self.not_taken["another autopilot" if component in self._speaker.others else what_speaks(component)] += 1

    def _is_taken(self, message: Message, component: int, now: float) -> bool:
        """Whether a message is listened to; one that is not is counted."""
        if self.is_foreign(message, component):
            self.foreign_heartbeats += 1
            return False
        if is_taken(message, component, autopilot=self.state.component):
            return True
        self.note_not_taken(component, now)
        return False

    def _autopilot_changed(self, now: float) -> None:
        """Begin anew with an autopilot that speaks as another component."""
        for machine in (self._hover, self._take_off):
            machine.give_up("its autopilot speaks as another component", now)
        self._telemetry.begin_anew(self._speaker.component)
        if self._presence.up:
            self._ask_anew(now)

    def _note_identity(self, now: float) -> None:
        """Give up what was ordered of an autopilot that restarted, or of one that is two."""
        self._works = "one_aircraft"
        self._telemetry.note_conflict(self._one_aircraft.problem(now))
        for event in self._one_aircraft.take_events():
            self._events.append(event)
            restarted = isinstance(event, AutopilotRestarted)
            reason = "the autopilot restarted" if restarted else self._telemetry.state.conflict or ""
            for machine in (self._hover, self._take_off):
                machine.give_up(reason, now)
            if restarted:
                self._telemetry.begin_anew(self.state.component)
                if self._presence.up:
                    self._ask_anew(now)

    def _ask_anew(self, now: float) -> None:
        """Ask for all that a new autopilot, or one that restarted, does not know that it was asked for."""
        self._works = "subscriptions"
        self._subscriptions.link_up(now, autopilot=self.state.component)
        self._works = "gimbal"
        self._gimbal.link_up(now)
        self._works = "round_trip"
        self._round_trip.link_up(now)
        self._works = "failsafes"
        self._failsafes.link_up(now)

    def advance(self, now: float) -> None:
        """Do what is due; what one machine fails at does not keep the others from it."""
        for name in _MACHINES if self._illness.newest is None else _EVEN_ILL:
            with self._mending(now):
                self._raise_what_failed()
                self._works = name
                self._machine(name).advance(now)
                if name == "presence":
                    self._note_presence(now)
                elif name == "commands":
                    self._settle(now)
        with self._mending(now):
            self._collect(now)

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent to the vehicle, once."""
        outgoing, self._at_once = self._at_once, []
        for name in ("commands", "hover", "round_trip", "failsafes"):
            try:
                outgoing += self._machine(name).take_outgoing()
            except Exception as error:
                self._failed = (name, error)
        return outgoing

    def mend(self, error: Exception, now: float, *, works: str | None = None, frame: bytes | None = None) -> None:
        """Go on after a fault: give up what was ordered, and begin anew with machines that are in no half state.

        works: what failed; None: the machine that was at work. frame: the raw frame at which it failed.
        """
        works, self._works = works or self._works, "vehicle"
        problem = describe(error)
        reason = f"the service failed at it ({works}): {problem}"
        if self._illness.note(f"the service failed at its messages ({works}): {problem}", now):
            self.trace = trace_of(error)
            told = None if frame is None else frame.hex()
            self._events.append(VehicleFault(system=self.system, where=works, problem=problem, frame=told))
        for machine in (
            self._telemetry,
            self._take_off,
            self._hover,
            self._gimbal,
            self._subscriptions,
            self._failsafes,
        ):
            with suppress(Exception):
                self._events += machine.take_events()
        order_ids = (self._take_off.order_id, self._hover.order.order_id if self._hover.order is not None else None)
        for order_id in order_ids:
            if order_id is not None:
                self._events.append(OrderFailed(system=self.system, order_id=order_id, reason=reason))
        self._begin_anew(works, reason, now)
        self._telemetry.state = self._telemetry.state.evolve(fault=self._illness.newest)

    @contextmanager
    def _mending(self, now: float) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self.mend(error, now)

    def _begin_anew(self, works: str, reason: str, now: float) -> None:
        """Put fresh machines in the place of the one that failed, those that rest on it, and those with orders."""
        self._on_station = False
        if works == "presence":
            before, self._presence = self._presence, Presence(self.system, lost_after_s=self._limits.lost_after_s)
            self._presence.up, self._presence.last_heard_s = before.up, before.last_heard_s
        elif works == "round_trip":
            self._round_trip = RoundTrip()
        elif works == "subscriptions":
            self._subscriptions = Subscriptions(self.system, self._commands)
        elif works == "failsafes":
            self._failsafes = Failsafes(self._telemetry)
        elif works == "one_aircraft":
            self._one_aircraft = OneAircraft(self.system)
        elif works == "speaker":
            self._speaker = Speaker(self.state.component)
        with suppress(Exception):
            for key in _ORDER_KEYS:
                self._commands.withdraw(key, now)
            if works not in ("commands", "telemetry", "gimbal", "vehicle"):
                self._gimbal.stop(now)
                self._begin_orders()
                return
        if works not in ("telemetry", "gimbal"):
            for name in self._operator.values():
                self._events.append(CommandFinished(system=self.system, command=name, problem=reason))
            noise, resent = self._commands.noise, self._commands.resent
            self._begin_commands()
            self._commands.noise, self._commands.resent = noise, resent
        telemetry, self._telemetry = self._telemetry, Telemetry(self.system)
        self._telemetry.state, self._telemetry.adapter = telemetry.state, telemetry.adapter
        self._failsafes = Failsafes(self._telemetry)
        self._gimbal = Gimbal(self._telemetry, self._commands, own=self._own, tolerances=self._limits.gimbal)
        self._begin_orders()

    def _begin_commands(self) -> None:
        self._commands = CommandSender(own=self._own, limits=self._limits.commands)
        self._operator: dict[int, str] = {}
        self._subscriptions = Subscriptions(self.system, self._commands)

    def _begin_orders(self) -> None:
        self._hover = Hover(self._telemetry, self._commands, limits=self._limits.hover)
        self._take_off = TakeOff(self._telemetry, self._commands)

    def _recover(self, now: float) -> None:
        """Trust the machines again if it is time: they take up what a new link begins with."""
        if not self._illness.recovers(now):
            return
        with self._mending(now):
            self._telemetry.state = self._telemetry.state.evolve(fault=None)
            if self._presence.up:
                self._ask_anew(now)

    def _machine(self, name: str) -> "_Machine":
        machine: _Machine = getattr(self, f"_{name}")
        return machine

    def _raise_what_failed(self) -> None:
        if self._failed is not None:
            (self._works, error), self._failed = self._failed, None
            raise error

    def _order(self, order_id: str, begin: Callable[[], None], now: float) -> None:
        """Begin an order; one that cannot be begun has failed."""
        faults = self.faults
        with self._mending(now):
            self._set_aside(now)
            begin()
            self._collect(now)
        told = any(isinstance(event, OrderFailed) and event.order_id == order_id for event in self._events)
        if self.faults > faults and not told:
            reason = self._illness.newest or "the service failed at it"
            self._events.append(OrderFailed(system=self.system, order_id=order_id, reason=reason))

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    def _operate(self, name: str, message: CommandLong | None, now: float) -> None:
        """Order what stops a flight. It is sent whatever fails meanwhile."""
        with self._mending(now):  # after which nothing is left to be set aside
            self._set_aside(now)
        heard = self.state.link_up or self._illness.newest is not None
        problem = why_not_stopped(self.state, now) if heard else "no link to the vehicle"
        if message is None or problem is not None:
            self._events.append(CommandFinished(system=self.system, command=name, problem=problem))
            return
        request = Request(message=message, key=name, tries=INSISTENT, deadline_s=now + _OPERATOR_DEADLINE_S)
        submitted = False
        with self._mending(now):
            self._works = "commands"
            self._operator[self._commands.submit(request, now)] = name
            submitted = True
            self._at_once += self._commands.take_outgoing()  # before anything else can fail
            self._collect(now)
        if not submitted:
            self._at_once.append(message)
            problem = f"sent once, and no answer is waited for: {self._illness.newest}"
            self._events.append(CommandFinished(system=self.system, command=name, problem=problem))

    def _stay(self, now: float) -> None:
        """Order a stop once more where it has ended, if nobody has taken the vehicle over since."""
        adapter = self._telemetry.adapter
        if adapter is None or not self._stop.ends(self.state, now):
            return
        if self.state.custom_mode == adapter.hold_mode.custom_mode:
            request = Request(
                message=_hold(self.state, adapter), key=_STAY, tries=REPEATABLE, deadline_s=now + _OPERATOR_DEADLINE_S
            )
            self._commands.submit(request, now)

    def _set_aside(self, now: float) -> None:
        """Stop whatever order is under way, before the next one."""
        for name in {*self._operator.values(), _STAY}:
            self._commands.withdraw(name, now)
        self._stop.cancel()
        self._take_off.stop(now)
        self._hover.stop(now)
        self._gimbal.stop(now)
        self._collect(now)

    def _note_presence(self, now: float) -> None:
        self._works = "presence"
        self._telemetry.presence(up=self._presence.up, heard_s=self._presence.last_heard_s)
        for event in self._presence.take_events():
            self._events.append(event)
            if isinstance(event, LinkUp):
                self._ask_anew(now)
            elif isinstance(event, LinkLost):
                self._subscriptions.link_lost()
                self._round_trip.link_lost()
                self._failsafes.link_lost()

    def _settle(self, now: float) -> None:
        # An outcome may make a machine submit again, and that may end at once: until nothing is left.
        while outcomes := self._commands.take_outcomes():
            for outcome in outcomes:
                self._tell_operator(outcome)
            for outcome in outcomes:
                self._works = "subscriptions"
                self._subscriptions.settle(outcome)
                self._works = "hover"
                self._hover.settle(outcome, now)
                self._works = "gimbal"
                self._gimbal.settle(outcome, now)
                self._works = "take_off"
                self._take_off.settle(outcome, now)

    def _tell_operator(self, outcome: Outcome) -> None:
        name = self._operator.pop(outcome.ticket, None)
        if name is not None:
            problem = None if outcome.accepted else outcome.problem
            self._events.append(CommandFinished(system=self.system, command=name, problem=problem))

    def _collect(self, now: float) -> None:
        self._works = "commands"
        self._settle(now)
        self._works = "vehicle"
        telling = (self._telemetry, self._take_off, self._hover, self._gimbal, self._subscriptions, self._failsafes)
        for machine in telling:
            self._events += machine.take_events()
        if self._hover.order is None and self._gimbal.aim is not None:
            self._gimbal.stop(now)
        self._check_station()

    def _check_station(self) -> None:
        order = self._hover.order
        on_station = (
            order is not None
            and self.state.link_up
            and self._hover.phase is Phase.ARRIVED
            and (order.aim is None or self._gimbal.on_target)
        )
        if on_station and not self._on_station and order is not None:
            self._events.append(OnStation(system=self.system, order_id=order.order_id))
        self._on_station = on_station


class _Machine(Protocol):
    """What is asked of every machine at any time."""

    @property
    def wake_at(self) -> float | None: ...

    def advance(self, now: float) -> None: ...

    def take_outgoing(self) -> list[Message]: ...


def _earliest(*times: float | None) -> float | None:
    return min((at for at in times if at is not None), default=None)


def _hold(state: VehicleState, adapter: Adapter) -> CommandLong:
    if not adapter.hold_is_reposition:
        return set_mode(state, adapter.hold_mode)
    here = math.nan
    return CommandLong(
        target_system=state.system,
        target_component=state.component,
        command=MavCmd.DO_REPOSITION,
        param1=-1.0,
        param2=float(DoRepositionFlags.CHANGE_MODE),
        param4=here,
        param5=here,
        param6=here,
        param7=here,
    )


def _check(order: HoverOrder) -> None:
    point = order.point
    if not -90.0 <= point.lat_deg <= 90.0 or not -180.0 <= point.lon_deg <= 180.0:
        raise BadInput("point", f"{point.lat_deg}, {point.lon_deg} is no place on Earth")
    if not -500.0 <= point.altitude_amsl_m <= 9000.0:
        raise BadInput("point.altitude_amsl_m", f"{point.altitude_amsl_m} is no altitude to hover at")
    if not 0.0 <= order.heading_deg <= 360.0:
        raise BadInput("heading_deg", f"{order.heading_deg} is not between 0 and 360")
    if order.aim is not None and not (0.0 <= order.aim.pan_deg <= 360.0 and -90.0 <= order.aim.tilt_deg <= 90.0):
        raise BadInput("aim", f"pan {order.aim.pan_deg}, tilt {order.aim.tilt_deg} is no direction")
    if order.speed_mps is not None and not 0.0 < order.speed_mps <= 50.0:
        raise BadInput("speed_mps", f"{order.speed_mps} is not between 0 and 50")
