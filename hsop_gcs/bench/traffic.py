"""A fleet that costs next to nothing: telemetry at every rate the service asks for, and an answer to every order.

Its vehicles speak like a PX4 in Hold, and are at once where and how they are ordered to be. They run in a process of
their own and tell by a pipe when which command came. How real vehicles move is the simulator's business.
"""

import heapq
import math
import select
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import (
    GimbalFlags,
    MavAutopilot,
    MavCmd,
    MavLandedState,
    MavModeFlag,
    MavResult,
    MavState,
    MavSysStatusSensor,
    MavType,
)
from hsop_gcs.link.messages import (
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    Message,
    SysStatus,
    Timesync,
)
from hsop_gcs.link.protocol.subscriptions import RATES_HZ

RATES: dict[type[Message], float] = {Heartbeat: 1.0, **RATES_HZ}
del RATES[EkfStatusReport]  # ArduPilot's
RATE_HZ = sum(RATES.values())
"""Messages a second of one vehicle: a heartbeat and all that the service asks a PX4 for."""
_HOLD = 0x0304_0000
_SENSORS = MavSysStatusSensor.GPS | MavSysStatusSensor.AHRS | MavSysStatusSensor.PREARM_CHECK
_LEVEL = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK
_TELL_EVERY_S = 0.05

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Heard:
    """A command, or a heartbeat of the service (None), that reached a vehicle. time_s: since the Unix epoch."""

    time_s: float
    system: int
    command: int | None


class Vehicle:
    """One vehicle: the newest message of each kind, changed by orders."""

    def __init__(self, system: int, home: GeodeticPoint, height_m: float) -> None:
        self.system = system
        self._encoder = Encoder(system=system, component=1)
        self._home_mm = round(1e3 * home.altitude_amsl_m)
        lat, lon = round(1e7 * home.lat_deg), round(1e7 * home.lon_deg)
        mode = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.SAFETY_ARMED
        self._messages: dict[type[Message], Message] = {
            Heartbeat: Heartbeat(
                type=MavType.QUADROTOR,
                autopilot=MavAutopilot.PX4,
                base_mode=mode,
                custom_mode=_HOLD,
                system_status=MavState.ACTIVE,
            ),
            GlobalPositionInt: GlobalPositionInt(
                lat=lat, lon=lon, alt=self._home_mm + round(1e3 * height_m), relative_alt=round(1e3 * height_m)
            ),
            Attitude: Attitude(),
            ExtendedSysState: ExtendedSysState(landed_state=MavLandedState.IN_AIR),
            HomePosition: HomePosition(latitude=lat, longitude=lon, altitude=self._home_mm),
            GimbalDeviceAttitudeStatus: GimbalDeviceAttitudeStatus(
                flags=_LEVEL, q=(1.0, 0.0, 0.0, 0.0), gimbal_device_id=1
            ),
            GimbalManagerStatus: GimbalManagerStatus(gimbal_device_id=1),
            SysStatus: SysStatus(
                onboard_control_sensors_present=_SENSORS,
                onboard_control_sensors_enabled=_SENSORS,
                onboard_control_sensors_health=_SENSORS,
                voltage_battery=16000,
                battery_remaining=90,
            ),
            GpsRawInt: GpsRawInt(fix_type=3, lat=lat, lon=lon, alt=self._home_mm, satellites_visible=12),
            BatteryStatus: BatteryStatus(battery_remaining=90, charge_state=1),
            EstimatorStatus: EstimatorStatus(flags=895, pos_horiz_accuracy=0.3, pos_vert_accuracy=0.3),
            AutopilotVersion: AutopilotVersion(flight_sw_version=0x0110_00FF),
            GimbalManagerInformation: GimbalManagerInformation(
                gimbal_device_id=1, pitch_min=-90.0, pitch_max=90.0, yaw_min=-360.0, yaw_max=360.0
            ),
        }

    def frame(self, kind: type[Message], since_start_s: float) -> bytes:
        """Return the newest message of a kind as it goes on the wire now."""
        message = self._messages[kind]
        if isinstance(message, GlobalPositionInt | Attitude | GimbalDeviceAttitudeStatus | GimbalManagerStatus):
            message = replace(message, time_boot_ms=round(1e3 * since_start_s))
        return self._encoder.encode(message)

    def answer(self, frame: Frame, since_start_s: float) -> list[bytes]:
        """Obey what a frame orders and return the answer."""
        match frame.message:
            case Timesync(tc1=0, ts1=theirs):
                return [self._encoder.encode(Timesync(tc1=round(1e9 * since_start_s), ts1=theirs))]
            case CommandLong() | CommandInt() as order:
                answers = self._obey(order, frame)
                ack = CommandAck(
                    command=order.command,
                    result=MavResult.ACCEPTED,
                    target_system=frame.system,
                    target_component=frame.component,
                )
                return [self._encoder.encode(message) for message in (*answers, ack)]
        return []

    def _obey(self, order: CommandLong | CommandInt, frame: Frame) -> list[Message]:
        messages = self._messages
        match order:
            case CommandLong(command=MavCmd.REQUEST_MESSAGE, param1=wanted):
                return [message for message in messages.values() if wanted == message.ID]
            case CommandLong(command=MavCmd.DO_GIMBAL_MANAGER_CONFIGURE):
                messages[GimbalManagerStatus] = GimbalManagerStatus(
                    gimbal_device_id=1, primary_control_sysid=frame.system, primary_control_compid=frame.component
                )
            case CommandLong(command=MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, param1=pitch_deg, param2=yaw_deg):
                pitch, yaw = math.radians(pitch_deg) / 2, math.radians(yaw_deg) / 2
                cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
                messages[GimbalDeviceAttitudeStatus] = GimbalDeviceAttitudeStatus(
                    flags=_LEVEL, q=(cp * cy, -sp * sy, sp * cy, cp * sy), gimbal_device_id=1
                )
            case CommandInt(command=MavCmd.DO_REPOSITION):
                altitude_mm = round(1e3 * order.z)
                messages[GlobalPositionInt] = GlobalPositionInt(
                    lat=order.x, lon=order.y, alt=altitude_mm, relative_alt=altitude_mm - self._home_mm
                )
                messages[Attitude] = Attitude(yaw=order.param4)
        return []


def run(homes: Sequence[GeodeticPoint], height_m: float, peers: Sequence[Address], tell: Connection) -> None:
    """Fly vehicles, the first of system id 1, until something comes over ``tell``.

    Each sends its telemetry to its peer, all spread evenly over time. What they hear is told in lists of ``Heard``.
    """
    vehicles = [Vehicle(system, home, height_m) for system, home in enumerate(homes, start=1)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.setblocking(False)
        by_address = dict(zip(peers, vehicles, strict=True))
        started = time.monotonic()
        due: list[tuple[float, int, int, float, type[Message]]] = []
        for index in range(len(vehicles)):
            for number, (kind, rate_hz) in enumerate(RATES.items()):
                phase = (index / len(vehicles) + number / len(RATES)) % 1.0
                heapq.heappush(due, (phase / rate_hz, index, number, 1.0 / rate_hz, kind))
        heard: list[Heard] = []
        tell_at = 0.0
        decoder = Decoder()
        while True:
            now = time.monotonic() - started
            while due[0][0] <= now:
                at, index, number, period_s, kind = due[0]
                heapq.heapreplace(due, (at + period_s, index, number, period_s, kind))
                _send(udp, vehicles[index].frame(kind, now), peers[index])
            if now >= tell_at:
                tell_at = now + _TELL_EVERY_S
                if heard:
                    tell.send(heard)
                    heard = []
                if tell.poll():
                    return
            readable, _, _ = select.select([udp], [], [], max(0.0, due[0][0] - (time.monotonic() - started)))
            if readable:
                _listen(udp, decoder, by_address, heard, now)


def _listen(
    udp: socket.socket, decoder: Decoder, by_address: dict[Address, Vehicle], heard: list[Heard], now: float
) -> None:
    while True:
        try:
            data, address = udp.recvfrom(2048)
        except BlockingIOError:
            return
        except ConnectionError:
            continue  # the service does not listen yet, or not any more
        time_s = time.time()
        vehicle = by_address.get(address)
        for frame in decoder.feed_datagram(data) if vehicle is not None else ():
            assert vehicle is not None
            if isinstance(frame.message, CommandLong | CommandInt):
                heard.append(Heard(time_s, vehicle.system, frame.message.command))
            elif isinstance(frame.message, Heartbeat):
                heard.append(Heard(time_s, vehicle.system, None))
            for answer in vehicle.answer(frame, now):
                _send(udp, answer, address)


def _send(udp: socket.socket, data: bytes, address: Address) -> None:
    try:
        udp.sendto(data, address)
    except (BlockingIOError, ConnectionError):
        return  # lost on the way: telemetry is repeated, and orders are sent again
