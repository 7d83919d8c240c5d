"""Taking off, on an operator's explicit order.

    idle ──start──► setting mode ──seen──► arming ──accepted, seen armed──► taking off ──accepted──► climbing ──► idle
     ▲                                      │  ▲                             │ ▲                        │    TookOff
     │                                      └──┘ not ready, up to a minute   └─┘ seen still on ground   │
     └──failed: refused for good, too long, disarmed again──────────────────────────────────────────────┘

Nothing is sent before the vehicle is known to stand on the ground and its home is known, which may take as long as
its position.
Arming and take-off are each sent once: a second copy that arrives late could arm a vehicle that has landed. Whether to
order again is decided from telemetry.
"""

import math
from dataclasses import replace
from enum import Enum

from hsop_gcs.link.adapters.adapter import Adapter, Mode
from hsop_gcs.link.enums import MavCmd, MavModeFlag, MavResult
from hsop_gcs.link.events import Event, OrderFailed, OrderSuperseded, TookOff
from hsop_gcs.link.messages import CommandLong, Message
from hsop_gcs.link.protocol.command import ONCE, REPEATABLE, CommandSender, Outcome, Request, Verdict
from hsop_gcs.link.protocol.ready import why_not_flown
from hsop_gcs.link.protocol.telemetry import Telemetry, VehicleState

READY_WITHIN_S = 60.0
"""An ArduPilot needs about 40 s from power-up to a position estimate."""
_AGAIN_AFTER_S = 3.0
_LOOK_AGAIN_AFTER_S = 0.5
_TAKE_OFF_TRIES = 3
_REACHED_WITHIN_M = 1.0
_SLOWEST_CLIMB_MPS = 0.7
_CLIMB_MARGIN_S = 30.0
_SAID_BEFORE_S = 4.0
_WARNING = 4
"""MAV_SEVERITY: what is no worse explains no refusal."""
_KEY = "take off"


class _Step(Enum):
    IDLE = "idle"
    SETTING_MODE = "setting the mode"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    CLIMBING = "climbing"


class TakeOff:
    """The take-off of one vehicle. See the module's diagram."""

    def __init__(self, telemetry: Telemetry, commands: CommandSender) -> None:
        self.order_id: str | None = None
        self._telemetry = telemetry
        self._commands = commands
        self._events: list[Event] = []
        self._step = _Step.IDLE
        self._altitude_m = 0.0
        self._ticket: int | None = None
        self._next_at = 0.0
        self._give_up_at = 0.0
        self._tries = 0
        self._refusal = ""
        self._refused_s = -math.inf
        self._seen_armed = False
        self._climbs = False
        self._adapter: Adapter | None = None
        """The adapter of the autopilot which was given the order."""
        self._kind = ""
        self._failed: str | None = None

    @property
    def status(self) -> str | None:
        """How the take-off stands, for a person, or why the last one failed.

        None: no take-off was ordered, it ended well, or another order took its place.
        """
        if self._step is _Step.IDLE:
            return None if self._failed is None else f"failed: {self._failed}"
        return f"{self._step.value}: {self._why}" if self._refusal else str(self._step.value)

    def start(self, altitude_above_home_m: float, *, order_id: str, now: float) -> None:
        """Take off to an altitude above home."""
        self.stop(now)
        problem = self._why_not(altitude_above_home_m, now)
        if problem is not None:
            self._failed = problem
            self._events.append(OrderFailed(system=self._system, order_id=order_id, reason=problem))
            return
        self.order_id, self._climbs = order_id, True
        self._altitude_m = altitude_above_home_m
        self._ticket, self._tries, self._refusal, self._seen_armed = None, 0, "", False
        self._adapter = self._telemetry.adapter
        self._kind = self._telemetry.state.kind
        self._step = _Step.ARMING if self._in_take_off_mode() else _Step.SETTING_MODE
        self._next_at, self._give_up_at = now, now + READY_WITHIN_S
        self.advance(now)

    def stop(self, now: float) -> None:
        """Give up a take-off under way: something else took its place. What was already obeyed is not undone."""
        self._commands.withdraw(_KEY, now)
        if self.order_id is not None:
            self._events.append(OrderSuperseded(system=self._system, order_id=self.order_id))
        self.order_id, self._step, self._failed = None, _Step.IDLE, None

    @property
    def under_way(self) -> bool:
        """Whether the vehicle takes off as it was ordered, or is still in the mode that this has put it in."""
        return self.order_id is not None or self._climbs

    def give_up(self, reason: str, now: float) -> None:
        """End a take-off under way, if any, without success."""
        self._commands.withdraw(_KEY, now)
        if self.order_id is not None:
            self._fail(reason)

    @property
    def wake_at(self) -> float | None:
        """When to order again or to give up."""
        if self._step is _Step.IDLE:
            return None
        waiting = self._ticket is not None or self._step is _Step.CLIMBING
        return self._give_up_at if waiting else min(self._next_at, self._give_up_at)

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the autopilot; ``Telemetry`` has had it already."""
        del message  # what counts is the state it made
        if self._step is _Step.IDLE:
            self._climbs = self._climbs and self._in_climb_mode()
            return
        if self._telemetry.state.kind != self._kind:
            kind = self._telemetry.state.kind
            self.give_up(f"its autopilot is of another kind than when it was ordered: {kind}", now)
        elif (problem := why_not_flown(self._telemetry.state, now)) is not None:
            self.give_up(problem, now)
        else:
            self._look(now)
            self.advance(now)

    def settle(self, outcome: Outcome, now: float) -> None:
        """Take the end of a command."""
        if outcome.ticket != self._ticket:
            return
        self._ticket = None
        if self._step is _Step.IDLE:
            return
        if outcome.accepted and self._step is _Step.SETTING_MODE:
            # PX4 acknowledges a mode before it has looked whether it can be in it: telemetry tells, or we ask again.
            self._refusal, self._refused_s = "the mode is not the one asked for", now
            self._next_at = now + _AGAIN_AFTER_S
        elif outcome.accepted:
            self._next_step(now)
        else:
            self._refused(outcome, now)
        self.advance(now)

    def advance(self, now: float) -> None:
        """Order the next thing, or give up."""
        if self._step is _Step.IDLE:
            return
        if now >= self._give_up_at:
            self._fail(f"{self._step.value} took too long" + (f": {self._why}" if self._refusal else ""))
        elif self._ticket is None and now >= self._next_at and self._step is not _Step.CLIMBING:
            unknown = self._unknown()
            if unknown is None:
                self._command(now)
            else:
                self._refusal, self._refused_s, self._next_at = unknown, -math.inf, now + _LOOK_AGAIN_AFTER_S

    def take_outgoing(self) -> list[Message]:
        """Everything goes through the command sender."""
        return []

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    @property
    def _system(self) -> int:
        return self._telemetry.state.system

    def _why_not(self, altitude_above_home_m: float, now: float) -> str | None:
        state = self._telemetry.state
        if not state.link_up:
            return "no link to the vehicle"
        if (problem := why_not_flown(state, now)) is not None:
            return problem
        if not altitude_above_home_m > 0 or not math.isfinite(altitude_above_home_m):
            return f"{altitude_above_home_m} m is no altitude to take off to"
        return "the vehicle is in the air" if state.in_air else None

    def _unknown(self) -> str | None:
        """Return what must be known before anything is sent and is not."""
        state = self._telemetry.state
        if state.in_air is None:
            return "the vehicle is not known to be on the ground"
        return "the vehicle's home is not known" if state.home is None else None

    def _look(self, now: float) -> None:
        """Believe telemetry more than lost acknowledgements."""
        state = self._telemetry.state
        if state.in_air is None:
            return
        if state.in_air and self._step in (_Step.SETTING_MODE, _Step.ARMING):
            self._fail("the vehicle is in the air")
            return
        achieved = {
            _Step.SETTING_MODE: self._in_take_off_mode(),
            _Step.ARMING: bool(state.armed),
            _Step.TAKING_OFF: bool(state.in_air),
        }
        if achieved.get(self._step):
            self._next_step(now)
        disarmed = self._seen_armed and not state.armed
        self._seen_armed = bool(state.armed)
        if disarmed:
            self._fail("the vehicle disarmed")
        elif self._step is _Step.CLIMBING:
            altitude_m = state.altitude_above_home_m
            if state.in_air and altitude_m is not None and abs(altitude_m - self._altitude_m) <= _REACHED_WITHIN_M:
                self._events.append(TookOff(system=self._system, order_id=self.order_id or ""))
                self.order_id, self._step = None, _Step.IDLE

    def _next_step(self, now: float) -> None:
        following = {
            _Step.SETTING_MODE: _Step.ARMING,
            _Step.ARMING: _Step.TAKING_OFF,
            _Step.TAKING_OFF: _Step.CLIMBING,
        }
        self._step = following[self._step]
        self._ticket, self._next_at, self._refusal = None, now, ""
        if self._step is _Step.CLIMBING:
            self._give_up_at = now + self._altitude_m / _SLOWEST_CLIMB_MPS + _CLIMB_MARGIN_S

    def _in_take_off_mode(self) -> bool:
        adapter = self._adapter
        return adapter is not None and self._telemetry.state.custom_mode == adapter.take_off_mode.custom_mode

    def _in_climb_mode(self) -> bool:
        """Whether it is in the mode in which it climbs, and which is none for anything else."""
        adapter, mode = self._adapter, self._telemetry.state.custom_mode
        return adapter is not None and mode == adapter.climb_mode.custom_mode != adapter.hover_mode.custom_mode

    @property
    def _why(self) -> str:
        """Why it does not go on, with what the autopilot said of it: its text comes after the refusal, or before."""
        since_s = self._refused_s - _SAID_BEFORE_S
        said = [
            line.text for line in self._telemetry.state.texts if line.severity <= _WARNING and line.time_s >= since_s
        ]
        return f"{self._refusal} ({said[-1]})" if said and self._refused_s > -math.inf else self._refusal

    def _refused(self, outcome: Outcome, now: float) -> None:
        self._refusal, self._refused_s = f"{MavCmd(outcome.request.message.command).name}: {outcome.problem}", now
        self._next_at = now + _AGAIN_AFTER_S
        self._tries += self._step is _Step.TAKING_OFF
        final = outcome.verdict is Verdict.REFUSED and outcome.result == MavResult.UNSUPPORTED
        if final or self._tries >= _TAKE_OFF_TRIES:
            self._fail(self._why)

    def _fail(self, reason: str) -> None:
        self._events.append(OrderFailed(system=self._system, order_id=self.order_id or "", reason=reason))
        self.order_id, self._step, self._failed = None, _Step.IDLE, reason

    def _command(self, now: float) -> None:
        adapter, home = self._adapter, self._telemetry.state.home
        if adapter is None or home is None:
            return
        target = CommandLong(target_system=self._system, target_component=self._telemetry.state.component)
        tries = ONCE
        if self._step is _Step.SETTING_MODE:
            message, tries = set_mode(self._telemetry.state, adapter.take_off_mode), REPEATABLE
        elif self._step is _Step.ARMING:
            message = replace(target, command=MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
        elif adapter.take_off_altitude_is_amsl:
            here = replace(target, param4=math.nan, param5=math.nan, param6=math.nan)
            altitude_amsl_m = home.altitude_amsl_m + self._altitude_m
            message = replace(here, command=MavCmd.NAV_TAKEOFF, param7=altitude_amsl_m)
        else:
            message = replace(target, command=MavCmd.NAV_TAKEOFF, param7=self._altitude_m)
        request = Request(message=message, key=_KEY, tries=tries, deadline_s=self._give_up_at)
        self._ticket = self._commands.submit(request, now)


def set_mode(state: VehicleState, mode: Mode) -> CommandLong:
    """Return the command that changes a vehicle's flight mode."""
    return CommandLong(
        target_system=state.system,
        target_component=state.component,
        command=MavCmd.DO_SET_MODE,
        param1=float(MavModeFlag.CUSTOM_MODE_ENABLED),
        param2=float(mode.main),
        param3=float(mode.sub),
    )
