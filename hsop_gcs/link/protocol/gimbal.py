"""The gimbal, by MAVLink's gimbal protocol v2: find the manager, take control of it, aim, and look whether it looks.

    unknown ──280 received──► known ──CONFIGURE accepted──► ours ──aim──► aiming ◄──► on target
       ▲                        ▲                            │
       │                        └──281 names somebody else, or PITCHYAW denied──┘
       └─ link lost

The manager is asked for of the autopilot, then of every component that heartbeats as a gimbal (it may be its own
manager), then of all at once; the first one found is led, and what others say of other gimbals changes nothing.

The aim is kept in the earth frame. Where an autopilot counts the yaw from the nose it is sent again as the heading
changes, at most five times a second. Only the reported attitude says that the gimbal is on target.
"""

import math
from dataclasses import dataclass

from hsop_gcs.geometry.frames import Aim, wrap_deg
from hsop_gcs.link.adapters import ARDUPILOT
from hsop_gcs.link.adapters.adapter import Adapter, GimbalLimits
from hsop_gcs.link.enums import GimbalFlags, MavCmd, MavComponent, MavResult
from hsop_gcs.link.events import AimClipped, Event, GimbalControlLost, GimbalFailed, GimbalOffTarget, GimbalOnTarget
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import (
    Attitude,
    CommandLong,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerStatus,
    Message,
)
from hsop_gcs.link.protocol.command import ONCE, REPEATABLE, CommandSender, Outcome, Request, Verdict
from hsop_gcs.link.protocol.gimbal_device import GimbalDevice, is_gimbals
from hsop_gcs.link.protocol.telemetry import Telemetry

_OWNER_NOT_TOLD = (0, 0)
_UNCHANGED = -1.0
_ASK_FOR_S = 5.0
_ROUNDING = 1e-6
_ASK_NEXT_AFTER_S = 0.2
"""One who has no gimbal manager said so: the next one is asked."""
_LOOK_AGAIN_AFTER_S = 30.0
"""While nobody wants to aim, a vehicle that said it has no gimbal is left in peace."""
_SILENT_AFTER_S = 3.5
"""A gimbal that does not say for so long where it looks is not on target any more."""
_MOST_GIMBALS = 8
_OWN_MANAGER_FLAGS = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME
"""What a gimbal that is its own manager is told: the protocol's own words, without an autopilot's peculiarities."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GimbalTolerances:
    """When a gimbal counts as on target, and how often it is spoken to."""

    on_target_deg: float = 2.0
    off_target_deg: float = 4.0
    hold_s: float = 0.5
    least_change_deg: float = 0.5
    least_period_s: float = 0.2
    again_after_s: float = 2.0
    """An aim that is not reached is sent again."""
    give_up_after_s: float = 30.0
    """An aim that is not reached by then is reported as failed, once, and still tried."""
    losses: int = 5
    """Somebody who takes the gimbal more often during one order is not fought any longer: reported as failed, once."""
    status_settles_s: float = 0.5
    """A manager status this soon after our CONFIGURE may be older than it."""


@dataclass(frozen=True, slots=True)
class _Manager:
    device: GimbalDevice
    limits: GimbalLimits | None
    is_autopilot: bool

    def flags(self, adapter: Adapter) -> GimbalFlags:
        return adapter.gimbal_flags if self.is_autopilot else _OWN_MANAGER_FLAGS

    def yaw_from_nose(self, adapter: Adapter) -> bool:
        return adapter.gimbal_yaw_from_nose or not self.is_autopilot


class Gimbal:
    """The gimbal of one vehicle. See the module's diagram."""

    def __init__(
        self,
        telemetry: Telemetry,
        commands: CommandSender,
        *,
        own: Identity = GROUND_STATION,
        tolerances: GimbalTolerances | None = None,
    ) -> None:
        self.tolerances = tolerances or GimbalTolerances()
        self.aim: Aim | None = None
        self.on_target = False
        self._telemetry = telemetry
        self._commands = commands
        self._own = own
        self._events: list[Event] = []
        self._order_id = ""
        self._order_heading_deg = 0.0
        self._manager: _Manager | None = None
        self._gimbals: list[int] = []
        """Components that heartbeat as gimbals."""
        self._asked = 0
        """How many of those who may be the manager were asked in this round."""
        self._ours = False
        self._configured_at = -math.inf
        self._ticket: int | None = None
        self._next_at = 0.0
        self._sent: tuple[float, float] | None = None
        self._sent_at = -math.inf
        self._inside_since: float | None = None
        self._outside_since: float | None = None
        self._give_up_at: float | None = None
        self._looked_at = -math.inf
        """When the gimbal said last where it looks."""
        self._refusal = ""
        self._losses = 0

    def link_up(self, now: float) -> None:
        """Look for the gimbal manager; one found before may have been replaced by a restart."""
        self._manager, self._ours, self._ticket, self._sent = None, False, None, None
        self._asked = 0
        self._next_at = now
        self.advance(now)

    def start(self, aim: Aim, *, order_id: str, heading_deg: float, now: float) -> None:
        """Aim the camera for an order. heading_deg: the heading it will be aimed at, for a check of the limits."""
        self.aim, self._order_id = aim, order_id
        self.on_target = False
        self._inside_since = self._outside_since = self._sent = None
        self._refusal = ""
        self._losses = 0
        self._give_up_at = now + self.tolerances.give_up_after_s
        self._order_heading_deg = heading_deg
        self._next_at = now if self._ticket is None else self._next_at
        self._tell_if_clipped()
        self.advance(now)

    def follow(self, aim: Aim, now: float) -> None:
        """Move the aim of the present order along, as its target moves. Without an order, nothing."""
        if self.aim is None:
            return
        self.aim = aim
        self.advance(now)

    def stop(self, now: float) -> None:
        """Leave the gimbal as it is."""
        self._commands.withdraw(_key("aim"), now)
        self.aim, self.on_target, self._give_up_at = None, False, None

    @property
    def error_deg(self) -> float | None:
        """The angle between where the gimbal looks and where it should; None without an aim or a report."""
        looks = self._telemetry.state.gimbal
        return separation_deg(self.aim, looks) if self.aim is not None and looks is not None else None

    @property
    def wake_at(self) -> float | None:
        """When there is something to send or to give up."""
        if not self._telemetry.state.link_up:
            return None
        idle = self._ticket is not None or not self._has_work()
        times = [] if idle else [self._next_at]
        if self._give_up_at is not None:
            times.append(self._give_up_at)
        if self.on_target:
            times.append(self._looked_at + _SILENT_AFTER_S)
        return min(times, default=None)

    def receive(self, message: Message, now: float, *, component: int = MavComponent.AUTOPILOT1) -> None:
        """Take a message of the vehicle; ``Telemetry`` has had it already."""
        match message:
            case GimbalManagerInformation():
                self._found(message, component, now)
            case GimbalManagerStatus():
                self._status(message, component, now)
            case GimbalDeviceAttitudeStatus():
                if self._telemetry.led_gimbal.is_reported(component, message.gimbal_device_id, now):
                    self._check_target(now)
            case Attitude() if component == self._autopilot:
                pass
            case _ if is_gimbals(message, component):
                self._note_gimbal(component, now)
            case _:
                return
        self.advance(now)

    def settle(self, outcome: Outcome, now: float) -> None:
        """Take the end of a command."""
        if outcome.ticket != self._ticket:
            return
        self._ticket = None
        command = outcome.request.message.command
        if command == MavCmd.DO_GIMBAL_MANAGER_CONFIGURE and outcome.accepted:
            self._ours, self._configured_at, self._next_at = True, now, now
        elif command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW and outcome.accepted:
            self._next_at = self._next_beat(now)
        elif command == MavCmd.REQUEST_MESSAGE and not outcome.accepted and self._asked < len(self._candidates):
            self._refusal = f"{MavCmd(command).name}: {outcome.problem}"
            self._next_at = now + _ASK_NEXT_AFTER_S
        elif outcome.verdict is not Verdict.SUPERSEDED:
            patient = self.aim is None and not outcome.accepted
            self._next_at = now + (_LOOK_AGAIN_AFTER_S if patient else self.tolerances.again_after_s)
            if not outcome.accepted:
                self._refusal = f"{MavCmd(command).name}: {outcome.problem}"
                self._sent = None
            if command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW and outcome.verdict is Verdict.NO_REPLY:
                self._next_at = now
            if outcome.result == MavResult.DENIED and command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW:
                self._lose_control(_OWNER_NOT_TOLD)
                self._next_at = now
        self.advance(now)

    def advance(self, now: float) -> None:
        """Do the next thing that is due."""
        if self._give_up_at is not None and now >= self._give_up_at:
            self._give_up_at = None
            self._events.append(GimbalFailed(system=self._system, order_id=self._order_id, reason=self._why_not()))
        if self.on_target and now >= self._looked_at + _SILENT_AFTER_S:
            self._leave_target(now)
        if self._ticket is not None or now < self._next_at or not self._has_work():
            return
        if self._manager is None:
            self._ask(now)
        elif not self._ours:
            self._take_control(self._manager, now)
        else:
            self._send_aim(self._manager, now)

    def take_outgoing(self) -> list[Message]:
        """Everything goes through the command sender."""
        return []

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    @property
    def device(self) -> GimbalDevice | None:
        """The gimbal that is led; None before its manager is found."""
        return self._manager.device if self._manager is not None else None

    @property
    def _system(self) -> int:
        return self._telemetry.state.system

    @property
    def _autopilot(self) -> int:
        return self._telemetry.state.component

    @property
    def _candidates(self) -> tuple[int, ...]:
        """Who may be the gimbal's manager, in the order of asking."""
        return (self._autopilot, *self._gimbals, MavComponent.ALL)

    def _found(self, message: GimbalManagerInformation, component: int, now: float) -> None:
        device, adapter = GimbalDevice(component, message.gimbal_device_id), self._telemetry.adapter
        if self._manager is not None and self._manager.device != device:
            return
        is_autopilot = component == self._autopilot
        words = adapter if is_autopilot else ARDUPILOT
        limits = words.gimbal_limits(message) if words is not None else None
        self._manager = _Manager(device, _usable(limits), is_autopilot)
        self._telemetry.lead(device)
        self._next_at = now
        self._tell_if_clipped()

    def _note_gimbal(self, component: int, now: float) -> None:
        if component in self._gimbals or component == self._autopilot or len(self._gimbals) >= _MOST_GIMBALS:
            return
        self._gimbals.append(component)
        if self._manager is None:
            self._asked = min(self._asked, len(self._gimbals))
            self._next_at = now

    def _has_work(self) -> bool:
        """Whether anything is to be sent as soon as ``_next_at`` allows."""
        state = self._telemetry.state
        if not state.link_up or self._telemetry.adapter is None:
            return False
        if self._manager is None:
            return True
        return self.aim is not None and state.heading_deg is not None

    def _ask(self, now: float) -> None:
        self._next_at = now + self.tolerances.again_after_s
        if self._asked >= len(self._candidates):
            self._asked = 0
        component = self._candidates[self._asked]
        self._asked += 1
        parameters = (float(GimbalManagerInformation.ID),)
        self._ticket = self._command(MavCmd.REQUEST_MESSAGE, component, parameters, "find", now)

    def _take_control(self, manager: _Manager, now: float) -> None:
        # Our own ids, spelled out: "me" means the sender to ArduPilot and the autopilot itself to PX4.
        ids = (float(self._own.system), float(self._own.component), _UNCHANGED, _UNCHANGED)
        parameters = (*ids, 0.0, 0.0, float(manager.device.id))
        command = MavCmd.DO_GIMBAL_MANAGER_CONFIGURE
        self._ticket = self._command(command, manager.device.manager, parameters, "control", now)

    def _send_aim(self, manager: _Manager, now: float) -> None:
        adapter, heading_deg = self._telemetry.adapter, self._telemetry.state.heading_deg
        if self.aim is None or adapter is None or heading_deg is None:
            return
        given = self._clipped(self.aim, heading_deg)
        yaw_deg = wrap_deg(given.pan_deg - heading_deg) if manager.yaw_from_nose(adapter) else wrap_deg(given.pan_deg)
        wanted = (given.tilt_deg, yaw_deg)
        overdue = not self.on_target and now >= self._sent_at + self.tolerances.again_after_s
        if self._sent is not None and not overdue and _close(wanted, self._sent, self.tolerances.least_change_deg):
            self._next_at = self._next_beat(now)
            return
        self._sent, self._sent_at = wanted, now
        parameters = (*wanted, math.nan, math.nan, float(manager.flags(adapter)), 0.0, float(manager.device.id))
        command = MavCmd.DO_GIMBAL_MANAGER_PITCHYAW
        self._ticket = self._command(command, manager.device.manager, parameters, "aim", now)

    def _next_beat(self, now: float) -> float:
        """When an aim may go out again: whole periods after the last, so that a camera is led along evenly."""
        period_s = self.tolerances.least_period_s
        return self._sent_at + period_s * (math.floor((now - self._sent_at) / period_s + _ROUNDING) + 1)

    def _command(self, command: MavCmd, component: int, parameters: tuple[float, ...], purpose: str, now: float) -> int:
        # COMMAND_LONG: PX4 before mid-2026 divides the flags of a COMMAND_INT by 1e7.
        message = CommandLong(
            target_system=self._system,
            target_component=component,
            command=command,
            **{f"param{number}": value for number, value in enumerate(parameters, start=1)},  # type: ignore[arg-type]
        )
        # A lost aim is not repeated as it was but overtaken by the next one, which knows the newer heading.
        once = command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW or component == MavComponent.ALL
        tries = ONCE if once else REPEATABLE
        request = Request(message=message, key=_key(purpose), tries=tries, deadline_s=now + _ASK_FOR_S)
        return self._commands.submit(request, now)

    def _status(self, message: GimbalManagerStatus, component: int, now: float) -> None:
        manager = self._manager
        if manager is None or GimbalDevice(component, message.gimbal_device_id) != manager.device:
            return
        owner = (message.primary_control_sysid, message.primary_control_compid)
        mine = owner == (self._own.system, self._own.component)
        if self._ours and not mine and now >= self._configured_at + self.tolerances.status_settles_s:
            self._lose_control(owner)
            self._next_at = now

    def _lose_control(self, owner: tuple[int, int]) -> None:
        was_ours, self._ours = self._ours, False
        if self.aim is None or not was_ours:
            return
        system, component = owner
        name, order_id = self._system, self._order_id
        lost = GimbalControlLost(system=name, order_id=order_id, owner_system=system, owner_component=component)
        self._events.append(lost)
        self._losses += 1
        if self._losses == self.tolerances.losses + 1:
            reason = f"somebody else ({system}/{component}) took the gimbal {self._losses} times"
            self._events.append(GimbalFailed(system=name, order_id=order_id, reason=reason))

    def _check_target(self, now: float) -> None:
        error_deg = self.error_deg
        if error_deg is None:
            return
        self._looked_at = now
        inside = error_deg <= self.tolerances.on_target_deg
        outside = error_deg > self.tolerances.off_target_deg
        self._inside_since = (now if self._inside_since is None else self._inside_since) if inside else None
        self._outside_since = (now if self._outside_since is None else self._outside_since) if outside else None
        if not self.on_target and self._inside_since is not None and now - self._inside_since >= self.tolerances.hold_s:
            self.on_target, self._give_up_at = True, None
            self._events.append(GimbalOnTarget(system=self._system, order_id=self._order_id))
        elif self.on_target and self._outside_since is not None and now - self._outside_since >= self.tolerances.hold_s:
            self._leave_target(now)

    def _leave_target(self, now: float) -> None:
        self.on_target, self._inside_since = False, None
        self._give_up_at = now + self.tolerances.give_up_after_s
        self._events.append(GimbalOffTarget(system=self._system, order_id=self._order_id))

    def _clipped(self, aim: Aim, heading_deg: float) -> Aim:
        limits = self._manager.limits if self._manager is not None else None
        if limits is None:
            return aim
        from_nose_deg = min(max(wrap_deg(aim.pan_deg - heading_deg), limits.pan_min_deg), limits.pan_max_deg)
        tilt_deg = min(max(aim.tilt_deg, limits.tilt_min_deg), limits.tilt_max_deg)
        return Aim(pan_deg=(from_nose_deg + heading_deg) % 360.0, tilt_deg=tilt_deg)

    def _tell_if_clipped(self) -> None:
        if self.aim is None:
            return
        given = self._clipped(self.aim, self._order_heading_deg)
        if separation_deg(self.aim, given) > self.tolerances.least_change_deg:
            self._events.append(AimClipped(system=self._system, order_id=self._order_id, wanted=self.aim, given=given))

    def _why_not(self) -> str:
        if self._manager is None:
            return "no gimbal manager answers" + (f" ({self._refusal})" if self._refusal else "")
        if not self._ours:
            return "the gimbal manager does not give us control" + (f" ({self._refusal})" if self._refusal else "")
        error_deg = self.error_deg
        return (
            "the gimbal does not report where it looks" if error_deg is None else f"{error_deg:.0f}° beside its target"
        )


def separation_deg(one: Aim, other: Aim) -> float:
    """Return the angle between two lines of sight, degrees."""
    tilt_1, tilt_2 = math.radians(one.tilt_deg), math.radians(other.tilt_deg)
    across = math.radians(one.pan_deg - other.pan_deg)
    # The haversine: unlike the scalar product it keeps its digits for small angles.
    half = math.sin((tilt_1 - tilt_2) / 2) ** 2 + math.cos(tilt_1) * math.cos(tilt_2) * math.sin(across / 2) ** 2
    return math.degrees(2 * math.asin(min(1.0, math.sqrt(half))))


def _usable(limits: GimbalLimits | None) -> GimbalLimits | None:
    """Limits that leave no room, or are no numbers, are no limits anybody meant."""
    if limits is None:
        return None
    room = limits.tilt_min_deg < limits.tilt_max_deg and limits.pan_min_deg < limits.pan_max_deg
    return limits if room else None


def _close(one: tuple[float, float], other: tuple[float, float], within_deg: float) -> bool:
    return abs(one[0] - other[0]) <= within_deg and abs(wrap_deg(one[1] - other[1])) <= within_deg


def _key(purpose: str) -> str:
    return f"gimbal {purpose}"
