"""What every simulated vehicle is: a body that flies, a gimbal, message streams, and an ear for orders.

    frames -> receive ──> order ──> personality ──> result ──> COMMAND_ACK ──> what follows the acknowledgement
    clock  -> advance ──> body, gimbal, phase of flight ──> streamed messages

    on the ground ──take-off──> spooling up ──> climbing ──reached, or another order──> in the air
          ^                                                                                 │
          └────────────── on the ground long enough ── landing (any goal below ground) <────┘

The machine is without I/O: ``receive``, ``advance``, ``wake_at``, ``take_outgoing``. ``px4`` and ``ardupilot`` say how
their stack answers; what both share stands here once. An order that is not in the personality's table is UNSUPPORTED.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Frame
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavComponent, MavLandedState, MavResult, MavSeverity, MavType
from hsop_gcs.link.messages import (
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    ExtendedSysState,
    Heartbeat,
    HomePosition,
    Message,
    MessageInterval,
    MissionCount,
    MissionRequestList,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    Ping,
    StatusText,
    Timesync,
)
from hsop_gcs.simulator.flight import STEP_S, FlightGoal, FlightLimits, FlightState, Point, step
from hsop_gcs.simulator.gimbal import Gimbal, GimbalLimits, Identity
from hsop_gcs.simulator.parameters import Parameters
from hsop_gcs.simulator.streams import Streams
from hsop_gcs.simulator.telemetry import SAMPLERS, Situation, e7, mm

_ENDURANCE_S = 25 * 60.0
_REACHED_M = 0.3
_TOUCHDOWN_S = 1.0
_BELOW_GROUND_M = -0.5
_STATUS_TEXT_LENGTH = 50
_SHORTEST_INTERVAL_S = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConfig:
    """One simulated aircraft. ``ready_after_s``: how long after boot its estimator has a position."""

    system: int
    home: GeodeticPoint
    heading_rad: float = 0.0
    airborne_m: float = 0.0
    """Start armed and hovering at this height above home; 0 starts on the ground."""
    ready_after_s: float = 2.0
    wander_m: float = 0.05
    """Bound of the slow wandering about the point where it means to hover."""
    flight: FlightLimits = field(default_factory=FlightLimits)
    gimbal: GimbalLimits = field(default_factory=GimbalLimits)


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A COMMAND_LONG or COMMAND_INT and who sent it. ``x``, ``y`` stand as sent: integers in a COMMAND_INT."""

    command: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float
    frame: int
    integer: bool
    sender: Identity

    @property
    def lat_deg(self) -> float:
        return self.x * 1e-7 if self.integer else self.x

    @property
    def lon_deg(self) -> float:
        return self.y * 1e-7 if self.integer else self.y


Handler = Callable[[Order], MavResult | None]


class Vehicle:
    """The shared half of both personalities. ``now`` is seconds on any clock that does not run backwards."""

    AUTOPILOT: MavAutopilot
    SPOOL_UP_S: float
    GPS_FIX: int

    def __init__(
        self,
        config: VehicleConfig,
        parameters: Parameters,
        streams: dict[int, float],
        rng: np.random.Generator,
        now: float,
    ) -> None:
        self.config = config
        self.parameters = parameters
        self.home = config.home
        self.local = LocalFrame(config.home)
        self.armed = config.airborne_m > 0
        self.landed = MavLandedState.IN_AIR if self.armed else MavLandedState.ON_GROUND
        self.state = FlightState(position_m=(0.0, 0.0, config.airborne_m), heading_rad=config.heading_rad)
        self.goal: FlightGoal | None = FlightGoal(position_m=self.state.position_m) if self.armed else None
        self.gimbal = Gimbal(config.gimbal, pitch_rad=self.gimbal_rest_pitch_rad(config.gimbal))
        self.roi: Point | None = None
        self.ready = self.armed
        self.unheard = 0
        """Messages addressed to somebody else, or of a kind this vehicle does not listen to."""
        self._legs: deque[FlightGoal] = deque()
        self._streams = Streams(streams, now)
        self._outgoing: list[Message] = []
        self._after_ack: list[Message] = []
        self._boot_at = self._now = self._moved_until = now
        self._lift_off_at: float | None = None
        self._ground_contact_at: float | None = None
        self._airborne_s = 0.0
        self._text_count = 0
        self._wander_phases = tuple(float(phase) for phase in rng.uniform(0.0, 2 * math.pi, size=3))
        self._commands: dict[int, Handler] = {
            MavCmd.SET_MESSAGE_INTERVAL: self._set_message_interval,
            MavCmd.GET_MESSAGE_INTERVAL: self._get_message_interval,
            MavCmd.REQUEST_MESSAGE: self._request_message,
            MavCmd.GET_HOME_POSITION: lambda _: self._send_home(),
        }
        self._samplers: dict[int, Callable[[], Message | None]] = {
            Heartbeat.ID: self._heartbeat,
            HomePosition.ID: self._home_position,
            BatteryStatus.ID: self._battery,
            ExtendedSysState.ID: self._extended_sys_state,
        }

    # The five words

    @property
    def wake_at(self) -> float:
        """When ``advance`` has something to do again."""
        return self._streams.next_due

    def receive(self, frame: Frame, now: float) -> None:
        """Hear one frame. What is addressed to another system or component is not for us."""
        self.advance(now)
        message, sender = frame.message, (frame.system, frame.component)
        if not self._addressed(message):
            self.unheard += 1
            return
        match message:
            case CommandLong() | CommandInt():
                self._command(_order(message, sender))
            case _:
                self._hear(message, sender)
        self._flush()

    def advance(self, now: float) -> None:
        """Fly until ``now`` and send what falls due on the way."""
        while self._streams.next_due <= now:
            self._fly_until(self._streams.next_due)
            for message_id in self._streams.take_due(self._now):
                self._queue(self.sample(message_id))
        self._fly_until(now)

    def take_outgoing(self) -> list[Message]:
        """Hand over what is to be sent, oldest first."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    # What a personality must say

    @staticmethod
    def gimbal_rest_pitch_rad(limits: GimbalLimits) -> float:
        """Where the gimbal looks before anybody has steered it."""
        raise NotImplementedError

    def base_mode(self) -> int:
        raise NotImplementedError

    def custom_mode(self) -> int:
        raise NotImplementedError

    def system_status(self) -> int:
        raise NotImplementedError

    def interval_refused(self, message_id: int) -> MavResult:
        """What to answer when somebody wants a message streamed that this stack does not know."""
        raise NotImplementedError

    def became_ready(self) -> None:
        """The estimator has just found its position."""

    def lifted_off(self) -> None:
        """The motors have spooled up."""

    def take_off_done(self) -> None:
        """The take-off altitude is reached."""

    def touched_down(self) -> None:
        """The vehicle has stood on the ground long enough to believe it."""

    def each_step(self, now: float) -> None:
        """Called after every step of the flight."""

    # Orders both understand alike

    def _command(self, order: Order) -> None:
        handler = self._commands.get(order.command)
        result = MavResult.UNSUPPORTED if handler is None else handler(order)
        if result is not None:
            self.acknowledge(order.command, result, order.sender)

    def acknowledge(self, command: int, result: MavResult, to: Identity) -> None:
        self._outgoing.append(CommandAck(command=command, result=result, target_system=to[0], target_component=to[1]))

    def _hear(self, message: Message, sender: Identity) -> None:
        """Hear what is no command; a personality listens for more."""
        match message:
            case ParamRequestList():
                self._outgoing.extend(self.parameters.listing())
            case ParamRequestRead(param_id=name, param_index=index):
                wanted = name if index < 0 else self.parameters.name_at(index)
                if wanted is not None and wanted in self.parameters:
                    self._outgoing.append(self.parameters.report(wanted))
            case ParamSet(param_id=name, param_value=value):
                if name in self.parameters:
                    self.parameters.set(name, value)
                    self._outgoing.append(self.parameters.report(name))
            case MissionRequestList(mission_type=mission_type):
                self._outgoing.append(
                    MissionCount(
                        target_system=sender[0], target_component=sender[1], count=0, mission_type=mission_type
                    )
                )
            case Timesync(tc1=0, ts1=theirs):
                self._outgoing.append(Timesync(tc1=round(self.since_boot_s * 1e9), ts1=theirs))
            case Ping(target_system=0, target_component=0):
                self._outgoing.append(replace(message, target_system=sender[0], target_component=sender[1]))
            case _:
                self.unheard += 1

    def _set_message_interval(self, order: Order) -> MavResult:
        message_id, interval_us = whole(order.p1), order.p2
        if message_id not in self.streamable:
            return self.interval_refused(message_id)
        if interval_us > 0:
            self._streams.set(message_id, max(interval_us * 1e-6, _SHORTEST_INTERVAL_S), self._now)
        elif interval_us == 0:
            self._streams.reset(message_id, self._now)
        else:
            self._streams.stop(message_id)
        return MavResult.ACCEPTED

    def _get_message_interval(self, order: Order) -> MavResult:
        message_id = whole(order.p1)
        if message_id not in self.streamable:
            return MavResult.FAILED
        interval_s = self._streams.interval_s(message_id)
        interval_us = -1 if interval_s is None else round(interval_s * 1e6)
        self._after_ack.append(MessageInterval(message_id=message_id, interval_us=interval_us))
        return MavResult.ACCEPTED

    def _request_message(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _send_home(self) -> MavResult:
        self._queue(self.sample(HomePosition.ID))
        return MavResult.ACCEPTED

    # Flying

    @property
    def in_air(self) -> bool:
        return self.landed != MavLandedState.ON_GROUND

    def fly_to(self, *legs: FlightGoal) -> None:
        """Leave whatever was being done and fly these legs, one after the other."""
        self.goal = legs[0]
        self._legs = deque(legs[1:])
        if self.landed != MavLandedState.ON_GROUND:
            self.landed = MavLandedState.IN_AIR

    def hold(self) -> None:
        """Stop and hover here."""
        if self.in_air:
            self.fly_to(FlightGoal(position_m=self.stopping_point_m))

    @property
    def stopping_point_m(self) -> Point:
        """Where full braking along the present course ends."""
        speed_mps = self.state.ground_speed_mps
        seconds = speed_mps / (2 * self.config.flight.acceleration_mps2)
        east, north, up = self.state.position_m
        ve, vn, _ = self.state.velocity_mps
        return east + ve * seconds, north + vn * seconds, up

    def take_off_to(self, up_m: float) -> None:
        """Spool up, then climb to ``up_m`` above the local origin."""
        self.goal = FlightGoal(position_m=(*self.state.position_m[:2], up_m))
        self._legs.clear()
        self._lift_off_at = self._now + self.SPOOL_UP_S

    def land(self, *before: FlightGoal) -> None:
        """Fly ``before`` leg by leg, then descend where that ends until the ground stops it."""
        where = before[-1].position_m if before else self.stopping_point_m
        descent = FlightGoal(position_m=(where[0], where[1], _BELOW_GROUND_M))
        self.fly_to(*before, descent)
        if not before and self.in_air:
            self.landed = MavLandedState.LANDING

    def disarm(self) -> None:
        """Stop the motors; in the air that ends on the ground."""
        self.armed = False
        self._lift_off_at = None
        if self.in_air:
            self.fly_to(FlightGoal(position_m=(*self.state.position_m[:2], 10 * _BELOW_GROUND_M), descent_mps=15.0))
        else:
            self.goal = None

    def place_of(self, lat_deg: float, lon_deg: float, altitude_amsl_m: float) -> Point:
        """Return local ENU, metres."""
        point = GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=altitude_amsl_m)
        east, north, up = (float(value) for value in self.local.to_enu(point))
        return east, north, up

    def outside_fence(self, target_m: Point, radius_m: float) -> bool:
        home = self.local.to_enu(self.home)
        return radius_m > 0 and math.hypot(target_m[0] - home[0], target_m[1] - home[1]) > radius_m

    @property
    def since_boot_s(self) -> float:
        return self._now - self._boot_at

    def _fly_until(self, now: float) -> None:
        while self._moved_until + STEP_S <= now + 1e-9:
            self._moved_until += STEP_S
            self._now = max(self._now, self._moved_until)
            self._step()
        self._now = max(self._now, now)
        self._flush()

    def _step(self) -> None:
        if not self.ready and self.since_boot_s >= self.config.ready_after_s:
            self.ready = True
            self.became_ready()
        if self._lift_off_at is not None and self.armed and self._now >= self._lift_off_at:
            self._lift_off_at = None
            self.landed = MavLandedState.TAKEOFF
            self.lifted_off()
        if self.in_air and self.goal is not None:
            self._airborne_s += STEP_S
            self.state = step(self.state, self.goal, self.config.flight)
            self._mind_the_goal(self.goal)
        else:
            self.state = self.state.halted()
        if self.roi is not None:
            self._look_at(self.roi)
        self.gimbal.step(STEP_S, self.state.heading_rad)
        self.each_step(self._now)

    def _mind_the_goal(self, goal: FlightGoal) -> None:
        off_m = math.dist(self.state.position_m, goal.position_m)
        if off_m < _REACHED_M and math.hypot(*self.state.velocity_mps) < _REACHED_M:
            if self.landed == MavLandedState.TAKEOFF:
                self.landed = MavLandedState.IN_AIR
                self.take_off_done()
            elif self._legs:
                self.goal = self._legs.popleft()
        if self.goal is not None and self.goal.position_m[2] < 0 and not self._legs:
            self.landed = MavLandedState.LANDING
        if not self.state.on_ground or self.landed == MavLandedState.TAKEOFF:
            self._ground_contact_at = None
        elif self._ground_contact_at is None:
            self._ground_contact_at = self._now
        elif self._now - self._ground_contact_at >= _TOUCHDOWN_S:
            self._ground_contact_at = None
            self.landed = MavLandedState.ON_GROUND
            self.goal = None
            self._legs.clear()
            self.touched_down()

    def _look_at(self, target_m: Point) -> None:
        east, north, up = (there - here for there, here in zip(target_m, self.state.position_m, strict=True))
        self.gimbal.point(
            pitch_rad=math.atan2(up, math.hypot(east, north)), yaw_rad=math.atan2(east, north), locked=True
        )

    # Reporting

    @property
    def streamable(self) -> set[int]:
        """Message ids this vehicle can send at a rate."""
        return {*SAMPLERS, *self._samplers}

    def sample(self, message_id: int) -> Message | None:
        """Return the message as it would be sent now; None if this vehicle has none such."""
        own = self._samplers.get(message_id)
        if own is not None:
            return own()
        shared = SAMPLERS.get(message_id)
        return None if shared is None else shared(self.situation())

    def situation(self) -> Situation:
        """Return how the vehicle sees itself now."""
        seen = self.state
        if self.in_air and self.config.wander_m > 0:
            seen = replace(seen, position_m=self._wandered(seen.position_m))
        return Situation(
            since_boot_s=self.since_boot_s,
            flight=seen,
            place=self.local.to_geodetic(np.array(seen.position_m)),
            home=self.home,
            origin=self.local.origin,
            gps_fix=self.GPS_FIX,
        )

    def _wandered(self, position_m: Point) -> Point:
        """Return the position with a slow swing added whose length never exceeds the configured bound."""
        east, north, up = (
            value + self.config.wander_m / math.sqrt(3) * math.sin(0.3 * self.since_boot_s + phase)
            for value, phase in zip(position_m, self._wander_phases, strict=True)
        )
        return east, north, up

    def say(self, text: str, severity: MavSeverity = MavSeverity.INFO, *, numbered: bool = False) -> None:
        """Send a status text, after the acknowledgement if an order is being answered; long ones in numbered chunks."""
        text_id = 0
        if numbered:
            text_id, self._text_count = self._text_count, self._text_count + 1
        for chunk, at in enumerate(range(0, len(text), _STATUS_TEXT_LENGTH)):
            piece = text[at : at + _STATUS_TEXT_LENGTH]
            self._after_ack.append(StatusText(severity=severity, text=piece, id=text_id, chunk_seq=chunk))

    def later(self, message: Message | None) -> None:
        """Send a message, after the acknowledgement if an order is being answered."""
        if message is not None:
            self._after_ack.append(message)

    def _queue(self, message: Message | None) -> None:
        if message is not None:
            self._outgoing.append(message)

    def _flush(self) -> None:
        self._outgoing.extend(self._after_ack)
        self._after_ack.clear()

    def _addressed(self, message: Message) -> bool:
        """Whether a message is for this autopilot: exactly, to all of the system, or to everybody."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.config.system) and component in (MavComponent.ALL, MavComponent.AUTOPILOT1)

    def _heartbeat(self) -> Heartbeat:
        return Heartbeat(
            type=MavType.QUADROTOR,
            autopilot=self.AUTOPILOT,
            base_mode=self.base_mode(),
            custom_mode=self.custom_mode(),
            system_status=self.system_status(),
        )

    def _home_position(self) -> HomePosition | None:
        east, north, up = (float(value) for value in self.local.to_enu(self.home))
        return HomePosition(
            latitude=e7(self.home.lat_deg),
            longitude=e7(self.home.lon_deg),
            altitude=mm(self.home.altitude_amsl_m),
            x=north,
            y=east,
            z=-up,
            q=(math.nan,) * 4,
            time_usec=round(self.since_boot_s * 1e6),
        )

    @property
    def battery_percent(self) -> int:
        return max(0, 100 - math.floor(100 * self._airborne_s / _ENDURANCE_S))

    def _battery(self) -> BatteryStatus:
        return BatteryStatus(
            battery_function=1,
            type=1,
            temperature=32767,
            voltages=(self.battery_mv, *(65535,) * 9),
            current_battery=-1,
            current_consumed=-1,
            energy_consumed=-1,
            battery_remaining=self.battery_percent,
            charge_state=1,
        )

    @property
    def battery_mv(self) -> int:
        return 14000 + 28 * self.battery_percent

    def _extended_sys_state(self) -> ExtendedSysState:
        return ExtendedSysState(landed_state=self.landed)


def whole(value: float) -> int:
    """Return a parameter that means a whole number; what is no number at all means none, like 0."""
    return round(value) if math.isfinite(value) else 0


def _order(message: CommandLong | CommandInt, sender: Identity) -> Order:
    x: float
    y: float
    if isinstance(message, CommandInt):
        x, y, z, frame = message.x, message.y, message.z, message.frame
    else:
        x, y, z, frame = message.param5, message.param6, message.param7, 0
    return Order(
        command=message.command,
        p1=message.param1,
        p2=message.param2,
        p3=message.param3,
        p4=message.param4,
        x=x,
        y=y,
        z=z,
        frame=frame,
        integer=isinstance(message, CommandInt),
        sender=sender,
    )
