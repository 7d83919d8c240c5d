"""One vehicle: its machines put together, and the orders that the layers above may give it.

presence ─► telemetry ─► subscriptions
                │
                ├─► hover ────┐
                ├─► gimbal ───┼─► commands ─► wire
                └─► take off ─┘
"""

import math
from collections import Counter
from dataclasses import dataclass, field

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
)
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import CommandLong, Message
from hsop_gcs.link.protocol.command import INSISTENT, CommandLimits, CommandSender, Outcome, Request
from hsop_gcs.link.protocol.failsafes import Failsafes
from hsop_gcs.link.protocol.gimbal import Gimbal, GimbalTolerances
from hsop_gcs.link.protocol.heartbeat import Presence
from hsop_gcs.link.protocol.hover import Hover, HoverLimits, HoverOrder, Phase
from hsop_gcs.link.protocol.one_aircraft import OneAircraft
from hsop_gcs.link.protocol.ready import why_not_ready, why_not_stopped
from hsop_gcs.link.protocol.round_trip import RoundTrip
from hsop_gcs.link.protocol.speaker import Speaker, is_foreign, is_taken, what_speaks
from hsop_gcs.link.protocol.subscriptions import Subscriptions
from hsop_gcs.link.protocol.take_off import TakeOff, set_mode
from hsop_gcs.link.protocol.telemetry import Telemetry, VehicleState

_OPERATOR_DEADLINE_S = 5.0
"""An operator's hold or return that cannot be sent for so long is not sent later by surprise."""


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


class Vehicle:
    """One vehicle by its MAVLink system id. Without I/O; frames of this id go in, messages to it come out."""

    def __init__(self, system: int, *, own: Identity = GROUND_STATION, limits: VehicleLimits | None = None) -> None:
        limits = limits or VehicleLimits()
        self.system = system
        self._one_aircraft = OneAircraft(system)
        self._presence = Presence(system, lost_after_s=limits.lost_after_s)
        self._telemetry = Telemetry(system)
        self._commands = CommandSender(own=own, limits=limits.commands)
        self._subscriptions = Subscriptions(system, self._commands)
        self._hover = Hover(self._telemetry, self._commands, limits=limits.hover)
        self._gimbal = Gimbal(self._telemetry, self._commands, own=own, tolerances=limits.gimbal)
        self._take_off = TakeOff(self._telemetry, self._commands)
        self._round_trip = RoundTrip()
        self._failsafes = Failsafes(self._telemetry)
        self._operator: dict[int, str] = {}
        self._on_station = False
        self._events: list[Event] = []
        self.foreign_heartbeats = 0
        """Heartbeats under the autopilot's ids that are not the autopilot's."""
        self._speaker = Speaker()
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
        order, error = self._hover.order, self._hover.error()
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
    def failsafes_checked(self) -> bool:
        """Whether the parameters of its failsafes were read; see ``failsafe_problems``."""
        return self._failsafes.checked

    @property
    def failsafe_problems(self) -> tuple[str, ...]:
        """Which of its failsafes will not work, and what to set, for a person."""
        return self._failsafes.problems

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
        self._set_aside(now)
        self._hover.start(order, now)
        if order.aim is not None and self._hover.order is order:
            self._gimbal.start(order.aim, order_id=order.order_id, heading_deg=order.heading_deg, now=now)
        self._collect(now)

    def follow(self, aim: Aim, now: float) -> None:
        """Move the camera's aim of the present hover order along; at most five times a second it is sent."""
        self._gimbal.follow(aim, now)
        self._collect(now)

    def take_off(self, altitude_above_home_m: float, now: float, *, order_id: str = "take off") -> None:
        """Arm and climb to an altitude above home. Ends in ``TookOff`` or ``OrderFailed``."""
        self._set_aside(now)
        self._take_off.start(altitude_above_home_m, order_id=order_id, now=now)
        self._collect(now)

    def hold(self, now: float) -> None:
        """Stop where it is. Ends in ``CommandFinished``; the hover order, if any, is superseded."""
        adapter = self._telemetry.adapter
        self._operate("hold", _hold(self.state, adapter) if adapter is not None else None, now)

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
        self._set_aside(now)

    @property
    def wake_at(self) -> float | None:
        """When ``advance`` has something to do; None while only a message can change anything."""
        machines = (
            self._presence,
            self._telemetry,
            self._commands,
            self._subscriptions,
            self._hover,
            self._gimbal,
            self._take_off,
            self._round_trip,
            self._failsafes,
        )
        return min((at for at in (machine.wake_at for machine in machines) if at is not None), default=None)

    def receive(
        self,
        message: Message,
        now: float,
        *,
        component: int = MavComponent.AUTOPILOT1,
        sequence: int | None = None,
    ) -> None:
        """Take a message that this vehicle's ``component`` sent; a heartbeat that is not the autopilot's is counted.

        sequence: of the frame that it came in.
        """
        if self._speaker.receive(message, now, component=component):
            self._autopilot_changed(now)
        if not self._is_taken(message, component):
            return
        if component == self.state.component:
            self._presence.receive(message, now)
            self._one_aircraft.receive(message, now, sequence=sequence)
        self._telemetry.receive(message, now, component=component)
        self._note_presence(now)
        self._note_identity(now)
        self._commands.receive(message, now, component=component)
        self._gimbal.receive(message, now, component=component)
        self._subscriptions.lead(self._gimbal.device, now)
        if component == self.state.component:
            self._hover.receive(message, now)
            self._take_off.receive(message, now)
            self._round_trip.receive(message, now)
            self._failsafes.receive(message, now)
        self._subscriptions.receive(message, now, component=component)
        self._collect(now)

    def is_foreign(self, message: Message, component: int) -> bool:
        """Whether a message is a heartbeat under the autopilot's ids that is not the autopilot's."""
        return is_foreign(message, component, autopilot=self.state.component)

    def note_not_taken(self, component: int) -> None:
        """Count a message of a component that is not listened to."""
        self.not_taken["another autopilot" if component in self._speaker.others else what_speaks(component)] += 1

    def _is_taken(self, message: Message, component: int) -> bool:
        """Whether a message is listened to; one that is not is counted."""
        if self.is_foreign(message, component):
            self.foreign_heartbeats += 1
            return False
        if is_taken(message, component, autopilot=self.state.component):
            return True
        self.note_not_taken(component)
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
        self._subscriptions.link_up(now, autopilot=self.state.component)
        self._gimbal.link_up(now)
        self._round_trip.link_up(now)
        self._failsafes.link_up(now)

    def advance(self, now: float) -> None:
        """Do what is due."""
        self._presence.advance(now)
        self._note_presence(now)
        self._telemetry.advance(now)
        self._commands.advance(now)
        self._settle(now)
        self._subscriptions.advance(now)
        self._hover.advance(now)
        self._gimbal.advance(now)
        self._take_off.advance(now)
        self._round_trip.advance(now)
        self._failsafes.advance(now)
        self._collect(now)

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent to the vehicle, once."""
        machines = (self._commands, self._hover, self._round_trip, self._failsafes)
        return [message for machine in machines for message in machine.take_outgoing()]

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    def _operate(self, name: str, message: CommandLong | None, now: float) -> None:
        self._set_aside(now)
        problem = "no link to the vehicle" if not self.state.link_up else why_not_stopped(self.state, now)
        if message is None or problem is not None:
            self._events.append(CommandFinished(system=self.system, command=name, problem=problem))
            return
        request = Request(message=message, key=name, tries=INSISTENT, deadline_s=now + _OPERATOR_DEADLINE_S)
        self._operator[self._commands.submit(request, now)] = name
        self._collect(now)

    def _set_aside(self, now: float) -> None:
        """Stop whatever order is under way, before the next one."""
        for name in set(self._operator.values()):
            self._commands.withdraw(name, now)
        self._take_off.stop(now)
        self._hover.stop(now)
        self._gimbal.stop(now)
        self._collect(now)

    def _note_presence(self, now: float) -> None:
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
                self._subscriptions.settle(outcome)
                self._hover.settle(outcome, now)
                self._gimbal.settle(outcome, now)
                self._take_off.settle(outcome, now)
                self._tell_operator(outcome)

    def _tell_operator(self, outcome: Outcome) -> None:
        name = self._operator.pop(outcome.ticket, None)
        if name is not None:
            problem = None if outcome.accepted else outcome.problem
            self._events.append(CommandFinished(system=self.system, command=name, problem=problem))

    def _collect(self, now: float) -> None:
        self._settle(now)
        telling = (self._telemetry, self._take_off, self._hover, self._gimbal, self._subscriptions, self._failsafes)
        for machine in telling:
            self._events += machine.take_events()
        if self._hover.order is None and self._gimbal.aim is not None:
            self._gimbal.stop(now)
        self._check_station()

    def _check_station(self) -> None:
        order = self._hover.order
        on_station = (
            order is not None and self._hover.phase is Phase.ARRIVED and (order.aim is None or self._gimbal.on_target)
        )
        if on_station and not self._on_station and order is not None:
            self._events.append(OnStation(system=self.system, order_id=order.order_id))
        self._on_station = on_station


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
