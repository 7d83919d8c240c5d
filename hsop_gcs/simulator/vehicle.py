"""What every simulated vehicle is: a body that flies and a gimbal, with message streams and an ear for orders.

    frames -> receive ──> order ──> personality ──> result ──> COMMAND_ACK ──> what follows the acknowledgement
    clock  -> advance ──> body, gimbal, phase of flight ──> streamed messages

The machine is without I/O: ``receive``, ``advance``, ``wake_at``, ``take_outgoing``. ``px4`` and ``ardupilot`` say how
their stack answers; what both share stands here once. An order that is not in the personality's table is UNSUPPORTED.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from hsop_gcs.link.codec import Frame
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavComponent, MavMissionType, MavResult, MavSeverity, MavType
from hsop_gcs.link.messages import (
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    ExtendedSysState,
    FileTransferProtocol,
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
from hsop_gcs.simulator.body import Body, VehicleConfig
from hsop_gcs.simulator.faults import FaultKind
from hsop_gcs.simulator.fence import Fence
from hsop_gcs.simulator.files import answer
from hsop_gcs.simulator.flight import Point
from hsop_gcs.simulator.gimbal import Identity
from hsop_gcs.simulator.orders import Order, read_order, whole
from hsop_gcs.simulator.parameters import Parameters
from hsop_gcs.simulator.streams import Streams
from hsop_gcs.simulator.telemetry import SAMPLERS, Situation, e7, mm

_STATUS_TEXT_LENGTH = 50
_SHORTEST_INTERVAL_S = 0.01
_UINT16_MAX = 0xFFFF
_NO_FIX = 1

Handler = Callable[[Order], MavResult | None]
Sampler = Callable[[], Message | None]


class Vehicle(Body):
    """The shared half of both personalities."""

    AUTOPILOT: MavAutopilot
    GPS_FIX: int
    FENCE_INSIDE_ALL: bool
    """Whether it must be inside of all the inclusions of its fence, or of one."""
    HOME_KNOWN_AFTER: float
    """When home is told, as a share of the time until the vehicle is ready to fly."""
    UNKNOWN_INTERVAL_US: int
    """What is told as the interval of a message that the stack does not know."""
    UNKNOWN_INTERVAL_RESULT: MavResult
    """And the answer to the question."""

    def __init__(
        self,
        config: VehicleConfig,
        parameters: Parameters,
        streams_hz: Mapping[int, float],
        rng: np.random.Generator,
        now: float,
    ) -> None:
        super().__init__(config, rng, now)
        self.parameters = parameters
        self.fence = Fence(lambda lat, lon: self.place_of(lat, lon, config.home.altitude_amsl_m), self.FENCE_INSIDE_ALL)
        self.unheard = 0
        """Messages addressed to somebody else, or of a kind this vehicle does not listen to."""
        self._streams = Streams({message: 1.0 / hz for message, hz in streams_hz.items()}, now)
        self._outgoing: list[Message] = []
        self._after_ack: list[Message] = []
        self._text_count = 0
        self._commands: dict[int, Handler] = {
            MavCmd.SET_MESSAGE_INTERVAL: self._set_message_interval,
            MavCmd.GET_MESSAGE_INTERVAL: self._get_message_interval,
            MavCmd.REQUEST_MESSAGE: self._request_message,
            MavCmd.GET_HOME_POSITION: lambda _: self._send_home(),
        }
        self._samplers: dict[int, Sampler] = {
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
                self._command(read_order(message, sender))
            case _:
                self._hear(message, sender)
        self._flush()

    def advance(self, now: float) -> None:
        """Fly until ``now`` and send what falls due on the way."""
        while self._streams.next_due <= now:
            self._pass(self._streams.next_due)
            for message_id in self._streams.take_due(self._now):
                self._queue(self.sample(message_id))
        self._pass(now)

    def _pass(self, now: float) -> None:
        self.fly_until(now)
        self._flush()

    def take_outgoing(self) -> list[Message]:
        """Hand over what is to be sent, oldest first."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    # What a personality must say

    def base_mode(self) -> int:
        """HEARTBEAT's MAV_MODE_FLAG bits."""
        raise NotImplementedError

    def custom_mode(self) -> int:
        """HEARTBEAT's custom_mode: the stack's own number of its mode."""
        raise NotImplementedError

    def system_status(self) -> int:
        """HEARTBEAT's MAV_STATE."""
        raise NotImplementedError

    def interval_refused(self, message_id: int) -> MavResult:
        """What to answer when somebody wants a message streamed that this stack does not know."""
        raise NotImplementedError

    # Orders both understand alike

    def _command(self, order: Order) -> None:
        fault = self.faults.meeting(order.command, self.since_boot_s)
        if fault is not None:
            if fault.kind is FaultKind.REJECT:
                self.acknowledge(order.command, fault.result, order.sender)
            return
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
            case MissionRequestList(mission_type=kind) if kind != MavMissionType.FENCE:
                nothing = MissionCount(target_system=sender[0], target_component=sender[1], mission_type=kind)
                self._outgoing.append(nothing)
            case FileTransferProtocol():
                self._outgoing.append(answer(message, {"parameters.txt": self.parameters.text()}, sender))
            case Timesync(tc1=0, ts1=theirs):
                self._outgoing.append(Timesync(tc1=round(self.since_boot_s * 1e9), ts1=theirs))
            case Ping(target_system=0, target_component=0):
                self._outgoing.append(replace(message, target_system=sender[0], target_component=sender[1]))
            case _:
                said = self.fence.hear(message, sender)
                self.unheard += said is None
                self._queue(said)

    def outside_fence(self, target_m: Point, radius_m: float) -> bool:
        """Whether the uploaded fence or the radius about home forbids a place."""
        return self.fence.outside(target_m) or self.outside_radius(target_m, radius_m)

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
        return self.tell_interval(whole(order.p1))

    def tell_interval(self, message_id: int) -> MavResult:
        """Send a message's interval, before the acknowledgement; return what the acknowledgement says."""
        known = message_id in self.streamable
        interval_s = self._streams.interval_s(message_id) if known else None
        interval_us = -1 if interval_s is None else round(interval_s * 1e6)
        if not known:
            interval_us = self.UNKNOWN_INTERVAL_US
        self._queue(MessageInterval(message_id=message_id & _UINT16_MAX, interval_us=interval_us))
        return MavResult.ACCEPTED if known else self.UNKNOWN_INTERVAL_RESULT

    def _request_message(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _send_home(self) -> MavResult:
        self._queue(self.sample(HomePosition.ID))
        return MavResult.ACCEPTED

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
        state = self.state
        east, north, up = state.velocity_mps
        velocity_mps = (east + state.push_mps[0], north + state.push_mps[1], up)
        seen = replace(state, position_m=self.seen_position_m(), velocity_mps=velocity_mps)
        return Situation(
            since_boot_s=self.since_boot_s,
            flight=seen,
            place=self.local.to_geodetic(np.array(seen.position_m)),
            home=self.home,
            origin=self.local.origin,
            gps_fix=self.GPS_FIX if self.lost_at_m is None else _NO_FIX,
        )

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

    def command_addressed(self, system: int, component: int, command: int) -> bool:
        """Whether a stack takes a command with these targets for its own."""
        raise NotImplementedError

    def _addressed(self, message: Message) -> bool:
        """Whether a message is for this autopilot: exactly, to all of the system, or to everybody."""
        if isinstance(message, CommandLong | CommandInt):
            return self.command_addressed(message.target_system, message.target_component, message.command)
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
        if not self.ready and self.since_boot_s < self.HOME_KNOWN_AFTER * self.config.ready_after_s:
            return None
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

    def _battery(self) -> BatteryStatus:
        return BatteryStatus(
            battery_function=1,
            type=1,
            temperature=32767,
            voltages=(self.battery.voltage_mv, *(65535,) * 9),
            current_battery=-1,
            current_consumed=round(self.battery.used_mah),
            energy_consumed=-1,
            battery_remaining=self.battery_percent,
            charge_state=self.battery.level,
        )

    @property
    def battery_percent(self) -> int:
        """What is left, as it is reported: rounded up, so that 0 means empty."""
        return math.ceil(self.battery.percent)

    def _extended_sys_state(self) -> ExtendedSysState:
        return ExtendedSysState(landed_state=self.landed)
