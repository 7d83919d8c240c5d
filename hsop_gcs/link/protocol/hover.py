"""One hover point: ordered by command, followed up where the autopilot needs it, believed only from telemetry.

    idle ──order──► commanding ──accepted──► flying ──rests at the point──► arrived
      ▲                │                      │  ▲                            │ │
      │                │                      │  └──────────drifted───────────┘ │
      └─failed─────────┴──────────────────────┴─────────────────────────────────┘
        refused, no reply, expired | fence text, another mode, another autopilot, disarmed, landed, not there in time

An acknowledgement is no arrival: PX4 accepts a point outside its fence and only writes a text about it. ArduPilot
ignores the yaw of DO_REPOSITION, so its heading goes separately until the nose agrees.
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame, Vector, wrap_deg, wrap_rad
from hsop_gcs.link.adapters import Adapter
from hsop_gcs.link.enums import (
    DoRepositionFlags,
    MavCmd,
    MavFrame,
    PositionTargetTypemask,
)
from hsop_gcs.link.events import Arrived, Drifted, Event, OrderAccepted, OrderFailed, OrderSuperseded
from hsop_gcs.link.messages import (
    Attitude,
    CommandInt,
    CommandLong,
    ExtendedSysState,
    GlobalPositionInt,
    Heartbeat,
    Message,
    SetPositionTargetGlobalInt,
    StatusText,
)
from hsop_gcs.link.protocol.command import INSISTENT, REPEATABLE, CommandSender, Outcome, Request
from hsop_gcs.link.protocol.ready import POSITION_AGE_S, position_fresh, why_not_flown, why_not_ready
from hsop_gcs.link.protocol.telemetry import Telemetry

_POSITION_AND_YAW = (
    PositionTargetTypemask.VX_IGNORE
    | PositionTargetTypemask.VY_IGNORE
    | PositionTargetTypemask.VZ_IGNORE
    | PositionTargetTypemask.AX_IGNORE
    | PositionTargetTypemask.AY_IGNORE
    | PositionTargetTypemask.AZ_IGNORE
    | PositionTargetTypemask.YAW_RATE_IGNORE
)
_KEY = "hover"


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverOrder:
    """Where to hover, where to point the nose and the camera.

    heading_deg: compass. aim: None leaves the gimbal alone. speed_mps: None is the vehicle's own. deadline_s: time on
    the link's clock at which the order is stale and may not be sent any more; one accepted before is flown to its end.
    """

    order_id: str
    point: GeodeticPoint
    heading_deg: float
    aim: Aim | None
    deadline_s: float
    speed_mps: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverLimits:
    """When a vehicle counts as arrived, as drifted, as late."""

    horizontal_m: float = 1.5
    vertical_m: float = 1.0
    heading_deg: float = 3.0
    speed_mps: float = 0.3
    """Measured as the way made during ``hold_s``: PX4 reports up to 0.7 m/s while it rests within decimetres."""
    hold_s: float = 2.0
    drift_horizontal_m: float = 3.0
    drift_vertical_m: float = 2.0
    drift_heading_deg: float = 10.0
    drift_for_s: float = 2.0
    slowest_mps: float = 3.0
    slowest_vertical_mps: float = 1.0
    late_margin_s: float = 25.0
    """A vehicle slower than this allows is late."""
    fence_text_s: float = 2.0
    mode_change_s: float = 5.0
    follow_up_every_s: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverError:
    """How far a vehicle is from its hover point; None where telemetry is missing."""

    horizontal_m: float | None
    vertical_m: float | None
    heading_deg: float | None


class Phase(Enum):
    """Where one order is on its way."""

    IDLE = "no order"
    COMMANDING = "ordered"
    FLYING = "on its way"
    ARRIVED = "arrived"


class Hover:
    """The current hover order of one vehicle. See the module's diagram."""

    def __init__(self, telemetry: Telemetry, commands: CommandSender, *, limits: HoverLimits | None = None) -> None:
        self.limits = limits or HoverLimits()
        self.order: HoverOrder | None = None
        self.phase = Phase.IDLE
        self._telemetry = telemetry
        self._commands = commands
        self._outgoing: list[Message] = []
        self._events: list[Event] = []
        self._frame: LocalFrame | None = None
        self._adapter: Adapter | None = None
        """The adapter of the autopilot which was given the order."""
        self._kind = ""
        self._ticket = 0
        self._accepted_at = 0.0
        self._late_at = 0.0
        self._mode_seen = False
        self._fence_text: tuple[float, str] | None = None
        self._follow_up_at: float | None = None
        self._resting: tuple[float, float, Vector] | None = None
        self._off_since: float | None = None

    def start(self, order: HoverOrder, now: float) -> None:
        """Begin a new order; the one before it, if any, is superseded."""
        self.stop(now)
        problem = why_not_ready(self._telemetry.state, now)
        if problem is not None:
            self._events.append(OrderFailed(system=self._system, order_id=order.order_id, reason=problem))
            return
        self.order, self.phase = order, Phase.COMMANDING
        self._adapter, self._kind = self._telemetry.adapter, self._telemetry.state.kind
        self._frame = LocalFrame(order.point)
        self._fence_text = self._resting = self._off_since = self._follow_up_at = None
        self._mode_seen = False
        message = CommandInt(
            target_system=self._system,
            target_component=self._telemetry.state.component,
            frame=MavFrame.GLOBAL,
            command=MavCmd.DO_REPOSITION,
            param1=-1.0 if order.speed_mps is None else order.speed_mps,
            param2=float(DoRepositionFlags.CHANGE_MODE),
            param4=wrap_rad(math.radians(order.heading_deg)),
            x=round(order.point.lat_deg * 1e7),
            y=round(order.point.lon_deg * 1e7),
            z=order.point.altitude_amsl_m,
        )
        request = Request(message=message, key=_KEY, tries=INSISTENT, deadline_s=order.deadline_s)
        self._ticket = self._commands.submit(request, now)

    def stop(self, now: float) -> None:
        """Forget the current order, if any: something else took its place."""
        self._commands.withdraw(_KEY, now)
        if self.order is not None:
            self._events.append(OrderSuperseded(system=self._system, order_id=self.order.order_id))
        self.order, self.phase = None, Phase.IDLE

    def give_up(self, reason: str, now: float) -> None:
        """End the current order, if any, without success."""
        self._commands.withdraw(_KEY, now)
        if self.order is not None:
            self._fail(reason)

    @property
    def wake_at(self) -> float | None:
        """When the order is late or its heading is to be sent again."""
        if self.phase in (Phase.IDLE, Phase.COMMANDING):
            return None
        times = [] if self.phase is Phase.ARRIVED else [self._late_at]
        if self._follow_up_at is not None:
            times.append(self._follow_up_at)
        return min(times, default=None)

    def settle(self, outcome: Outcome, now: float) -> None:
        """Take the end of a command."""
        if outcome.ticket != self._ticket or self.order is None or self.phase is not Phase.COMMANDING:
            return
        fence = self._fence_text
        if not outcome.accepted:
            self._fail(
                f"the autopilot did not take the hover point: {outcome.problem}" + (f" ({fence[1]})" if fence else "")
            )
            return
        if fence is not None and now - fence[0] <= self.limits.fence_text_s:
            self._fail(f"the autopilot says: {fence[1]}")
            return
        self.phase = Phase.FLYING
        self._accepted_at = now
        self._late_at = now + self._time_allowed_s()
        self._events.append(OrderAccepted(system=self._system, order_id=self.order.order_id))
        adapter = self._adapter
        if adapter is not None and adapter.heading_needs_follow_up:
            self._follow_up_at = now
        if adapter is not None and adapter.speed_needs_own_command and self.order.speed_mps is not None:
            self._send_speed(self.order.speed_mps, now)
        self.advance(now)

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the autopilot; ``Telemetry`` has had it already."""
        if self.order is None:
            return
        if self._telemetry.state.kind != self._kind:
            kind = self._telemetry.state.kind
            self.give_up(f"its autopilot is of another kind than when it was ordered: {kind}", now)
        elif (problem := why_not_flown(self._telemetry.state, now)) is not None:
            self.give_up(problem, now)
        elif isinstance(message, StatusText) and "fence" in message.text.lower():
            self._fence_text = (now, message.text.strip())
            if self.phase is Phase.FLYING and now - self._accepted_at <= self.limits.fence_text_s:
                self._fail(f"the autopilot says: {message.text.strip()}")
        elif self.phase in (Phase.FLYING, Phase.ARRIVED):
            if isinstance(message, Heartbeat | ExtendedSysState):
                self._check_it_still_flies_for_us(now)
            elif isinstance(message, GlobalPositionInt | Attitude):
                self._check_position(now)

    def advance(self, now: float) -> None:
        """Send the heading again, or notice that the vehicle is late."""
        if self.phase not in (Phase.FLYING, Phase.ARRIVED):
            return
        if self.phase is Phase.FLYING and now >= self._late_at:
            self._fail(f"not there after {now - self._accepted_at:.0f} s: {_describe(self.error())}")
        elif self._follow_up_at is not None and now >= self._follow_up_at:
            self._follow_up(now)

    def error(self) -> HoverError | None:
        """Return how far the vehicle is from its order; None without one."""
        if self.order is None or self._frame is None:
            return None
        state = self._telemetry.state
        horizontal_m = vertical_m = heading_deg = None
        if state.position is not None:
            east, north, up = (float(value) for value in self._frame.to_enu(state.position))
            horizontal_m, vertical_m = math.hypot(east, north), up
        if state.heading_deg is not None:
            heading_deg = wrap_deg(state.heading_deg - self.order.heading_deg)
        return HoverError(horizontal_m=horizontal_m, vertical_m=vertical_m, heading_deg=heading_deg)

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent beside the commands, once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    @property
    def _system(self) -> int:
        return self._telemetry.state.system

    def _fail(self, reason: str) -> None:
        assert self.order is not None
        self._events.append(OrderFailed(system=self._system, order_id=self.order.order_id, reason=reason))
        self.order, self.phase = None, Phase.IDLE

    def _time_allowed_s(self) -> float:
        error = self.error()
        assert self.order is not None
        horizontal_m = (error.horizontal_m if error else None) or 0.0
        vertical_m = abs((error.vertical_m if error else None) or 0.0)
        speed_mps = self.order.speed_mps or self.limits.slowest_mps
        return max(horizontal_m / speed_mps, vertical_m / self.limits.slowest_vertical_mps) + self.limits.late_margin_s

    def _send_speed(self, speed_mps: float, now: float) -> None:
        # After the point was accepted: entering position control resets the speed to the vehicle's own.
        message = CommandLong(
            target_system=self._system,
            target_component=self._telemetry.state.component,
            command=MavCmd.DO_CHANGE_SPEED,
            param1=1.0,
            param2=speed_mps,
            param3=-1.0,
        )
        self._commands.submit(Request(message=message, key=_KEY, tries=REPEATABLE, deadline_s=now + 5.0), now)

    def _follow_up(self, now: float) -> None:
        error = self.error()
        assert self.order is not None
        if (
            error is not None
            and error.heading_deg is not None
            and abs(error.heading_deg) <= self.limits.heading_deg / 2
        ):
            self._follow_up_at = None
            return
        self._outgoing.append(
            SetPositionTargetGlobalInt(
                target_system=self._system,
                target_component=self._telemetry.state.component,
                coordinate_frame=MavFrame.GLOBAL_INT,
                type_mask=_POSITION_AND_YAW,
                lat_int=round(self.order.point.lat_deg * 1e7),
                lon_int=round(self.order.point.lon_deg * 1e7),
                alt=self.order.point.altitude_amsl_m,
                yaw=wrap_rad(math.radians(self.order.heading_deg)),
            )
        )
        self._follow_up_at = now + self.limits.follow_up_every_s

    def _check_it_still_flies_for_us(self, now: float) -> None:
        state = self._telemetry.state
        if not state.armed:
            self._fail("the vehicle disarmed")
        elif state.in_air is False:
            self._fail("the vehicle landed")
        elif self._adapter is not None and state.custom_mode == self._adapter.hover_mode.custom_mode:
            self._mode_seen = True
        elif self._mode_seen or now - self._accepted_at > self.limits.mode_change_s:
            self._fail(f"the vehicle is in mode {state.mode}, which is not ours")

    def _check_position(self, now: float) -> None:
        state, error, limits = self._telemetry.state, self.error(), self.limits
        if state.position is None or error is None or self._frame is None or not position_fresh(state, now):
            self._resting = None
            return
        heading_off = error.heading_deg is not None and abs(error.heading_deg) > limits.heading_deg
        follows_up = self._adapter is not None and self._adapter.heading_needs_follow_up
        if heading_off and follows_up and self._follow_up_at is None:
            self._follow_up_at = now
        if self.phase is Phase.ARRIVED:
            self._check_drift(error, now)
            return
        if not _within(error, limits.horizontal_m, limits.vertical_m, limits.heading_deg):
            self._resting = None
            return
        here = self._frame.to_enu(state.position)
        since, last, anchor = self._resting or (now, now, here)
        moved_m = float(np.linalg.norm(here - anchor))
        if moved_m > limits.speed_mps * limits.hold_s or now - last > POSITION_AGE_S:
            since, anchor = now, here
        self._resting = (since, now, anchor)
        if now - since >= limits.hold_s and self.order is not None:
            self.phase, self._resting, self._off_since = Phase.ARRIVED, None, None
            self._events.append(Arrived(system=self._system, order_id=self.order.order_id))

    def _check_drift(self, error: HoverError, now: float) -> None:
        limits = self.limits
        if _within(error, limits.drift_horizontal_m, limits.drift_vertical_m, limits.drift_heading_deg):
            self._off_since = None
            return
        if self._off_since is None:
            self._off_since = now
        if now - self._off_since >= limits.drift_for_s and self.order is not None:
            self.phase = Phase.FLYING
            self._late_at = now + self._time_allowed_s()
            self._events.append(Drifted(system=self._system, order_id=self.order.order_id, problem=_describe(error)))


def _within(error: HoverError, horizontal_m: float, vertical_m: float, heading_deg: float) -> bool:
    if error.horizontal_m is None or error.vertical_m is None or error.heading_deg is None:
        return False
    return (
        error.horizontal_m <= horizontal_m
        and abs(error.vertical_m) <= vertical_m
        and abs(error.heading_deg) <= heading_deg
    )


def _describe(error: HoverError | None) -> str:
    if error is None or error.horizontal_m is None or error.vertical_m is None or error.heading_deg is None:
        return "its position is not known"
    return f"{error.horizontal_m:.1f} m away, {error.vertical_m:+.1f} m high, heading {error.heading_deg:+.0f}° off"
