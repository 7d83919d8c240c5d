"""What is known of one vehicle, kept from its messages.

Unknown values are None, never zero; MAVLink's "unknown" numbers (and latitude = longitude = 0) are translated.
The machine has no states of its own: every message makes the next ``VehicleState``.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

from hsop_gcs.geometry.frames import Aim, GeodeticPoint
from hsop_gcs.link.adapters import Adapter, adapter_for
from hsop_gcs.link.enums import (
    EstimatorFlags,
    GimbalFlags,
    MavComponent,
    MavLandedState,
    MavModeFlag,
)
from hsop_gcs.link.events import Event, ModeChanged, StatusTextReceived
from hsop_gcs.link.kinds import type_name
from hsop_gcs.link.messages import (
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    Message,
    StatusText,
    SysStatus,
)
from hsop_gcs.link.protocol.batteries import BATTERIES, Batteries
from hsop_gcs.link.protocol.clocks import SenderClock
from hsop_gcs.link.protocol.gimbal_device import GimbalDevice, LedGimbal

Autopilot = Literal["px4", "ardupilot", "other"]

_STATUSTEXT_CHARACTERS = 50
_JOIN_WITHIN_S = 1.0
_TEXTS_KEPT = 5
_UNKNOWN_U16 = 65535
_POSITION_GOOD = EstimatorFlags.POS_HORIZ_ABS | EstimatorFlags.POS_VERT_ABS
_TURNS_ON_S = 0.3
"""How far a vehicle's heading is carried on at its rate, to when its gimbal spoke: at 60°/s it turns 3° in between."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusLine:
    """A line the autopilot wrote, with the time it arrived."""

    time_s: float
    severity: int
    text: str


@dataclass(frozen=True, kw_only=True)
class VehicleState:
    """The newest known state of one vehicle. Times are those of the link's clock."""

    system: int
    component: int = MavComponent.AUTOPILOT1
    """The autopilot's component id: orders are addressed to it."""
    link_up: bool = False
    last_heard_s: float | None = None
    autopilot: Autopilot | None = None
    type: int | None = None
    """MAV_TYPE: what kind of vehicle the autopilot says it is."""
    vtol_state: int | None = None
    """MAV_VTOL_STATE of an aircraft that hovers in one state and flies as a plane in another."""
    firmware: str | None = None
    armed: bool | None = None
    in_air: bool | None = None
    """Taking off and landing count as in the air."""
    custom_mode: int | None = None
    mode: str | None = None
    position: GeodeticPoint | None = None
    position_heard_s: float | None = None
    altitude_above_home_m: float | None = None
    velocity_enu_mps: tuple[float, float, float] | None = None
    heading_deg: float | None = None
    roll_deg: float | None = None
    pitch_deg: float | None = None
    yaw_rate_dps: float = 0.0
    """Clockwise."""
    attitude_heard_s: float | None = None
    gimbal: Aim | None = None
    """Where the led gimbal looks, in the earth frame."""
    gimbal_heard_s: float | None = None
    home: GeodeticPoint | None = None
    battery_percent: float | None = None
    """The charge of the battery that has least, as told lately."""
    gps_fix: int | None = None
    """GPS_FIX_TYPE: 3 and above is a position in three dimensions."""
    satellites: int | None = None
    estimator_healthy: bool | None = None
    """Whether the autopilot's estimator stands by its absolute position and altitude."""
    conflict: str | None = None
    """What shows that two aircraft speak under its id, for a person."""
    fault: str | None = None
    """Why it cannot be trusted with an order though it is heard: a fault of the service's own."""
    texts: tuple[StatusLine, ...] = ()
    """The last few lines, newest last."""

    @property
    def vehicle_type(self) -> str | None:
        """What kind of vehicle it is, for a person."""
        return None if self.type is None else type_name(self.type)

    @property
    def kind(self) -> str:
        """The autopilot and what it flies: an order is for this kind only."""
        return f"{self.autopilot} on a {self.vehicle_type}"

    def heading_at(self, time_s: float) -> float | None:
        """Return the heading at a time near that of the attitude, degrees; None if it is not known."""
        if self.heading_deg is None or self.attitude_heard_s is None:
            return self.heading_deg
        since_s = time_s - self.attitude_heard_s
        turned_deg = self.yaw_rate_dps * since_s if abs(since_s) <= _TURNS_ON_S else 0.0
        return (self.heading_deg + turned_deg) % 360.0

    def evolve(self, **changes: Any) -> "VehicleState":
        """Return the state with fields replaced: twenty times as fast as ``dataclasses.replace``, for every message."""
        after = object.__new__(VehicleState)
        after.__dict__.update(self.__dict__, **changes)
        return after


class Telemetry:
    """Keeps ``state`` and ``adapter`` from what a vehicle sends."""

    def __init__(self, system: int) -> None:
        self.state = VehicleState(system=system)
        self.adapter: Adapter | None = None
        self._events: list[Event] = []
        self._part: tuple[float, StatusText] | None = None
        self._batteries = Batteries()
        self._clock, self._gimbal_clock = SenderClock(), SenderClock()
        self.led_gimbal = LedGimbal()

    @property
    def wake_at(self) -> float | None:
        """When a status text whose rest never came is told as it is."""
        return self._part[0] + _JOIN_WITHIN_S if self._part is not None else None

    def receive(self, message: Message, now: float, *, component: int = MavComponent.AUTOPILOT1) -> None:
        """Take a message of the vehicle; only gimbals and batteries report from components of their own."""
        if isinstance(message, GimbalDeviceAttitudeStatus):
            self._gimbal(message, now, component)
        elif isinstance(message, BatteryStatus | SysStatus):
            self._battery(message, now, component)
        elif component == self.state.component:
            self._autopilot(message, now)

    def begin_anew(self, component: int) -> None:
        """Forget what was known of the vehicle: from now on another autopilot speaks, or the same after a restart.

        What the same one is, a restart does not change: it can be held before its next heartbeat.
        """
        before = self.state
        after = VehicleState(
            system=before.system,
            component=component,
            link_up=before.link_up,
            last_heard_s=before.last_heard_s,
            texts=before.texts,
        )
        if component == before.component:
            after = after.evolve(
                autopilot=before.autopilot,
                type=before.type,
                armed=before.armed,
                custom_mode=before.custom_mode,
                mode=before.mode,
            )
        else:
            self.adapter = None
        self.state = after
        self._batteries.forget()
        self._clock = SenderClock()
        self.lead(None)

    def advance(self, now: float) -> None:
        """Tell a status text whose rest did not come in time."""
        if self.wake_at is not None and now >= self.wake_at:
            self._tell_text(now)

    def take_outgoing(self) -> list[Message]:
        """Listening sends nothing."""
        return []

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    def note_conflict(self, problem: str | None) -> None:
        """Take over what shows that two aircraft speak under the vehicle's id."""
        if problem != self.state.conflict:
            self.state = self.state.evolve(conflict=problem)

    def presence(self, *, up: bool, heard_s: float | None) -> None:
        """Take over what is known of the link itself."""
        if (up, heard_s) != (self.state.link_up, self.state.last_heard_s):
            self.state = self.state.evolve(link_up=up, last_heard_s=heard_s)

    def lead(self, device: GimbalDevice | None) -> None:
        """Take only this gimbal's reports for the vehicle's aim from now on; None: it is not known which is led."""
        if device != self.led_gimbal.device:
            self.led_gimbal.device = device
            self._forget_gimbal()

    def _autopilot(self, message: Message, now: float) -> None:
        match message:
            case Heartbeat():
                self._heartbeat(message)
                self._note_charge(now)
            case GlobalPositionInt():
                self._position(message, now)
            case Attitude() if math.isfinite(message.yaw + message.roll + message.pitch):
                self.state = self.state.evolve(
                    heading_deg=math.degrees(message.yaw) % 360.0,
                    roll_deg=math.degrees(message.roll),
                    pitch_deg=math.degrees(message.pitch),
                    yaw_rate_dps=math.degrees(message.yawspeed) if math.isfinite(message.yawspeed) else 0.0,
                    attitude_heard_s=self._clock.sent_at(message.time_boot_ms, now),
                )
            case ExtendedSysState():
                told = message.landed_state != MavLandedState.UNDEFINED
                in_air = message.landed_state != MavLandedState.ON_GROUND if told else self.state.in_air
                self.state = self.state.evolve(in_air=in_air, vtol_state=message.vtol_state)
            case HomePosition():
                home = _place(message.latitude, message.longitude, message.altitude)
                self.state = self.state.evolve(home=home or self.state.home)
            case GpsRawInt():
                satellites = None if message.satellites_visible == 255 else message.satellites_visible
                self.state = self.state.evolve(gps_fix=message.fix_type, satellites=satellites)
            case EkfStatusReport() | EstimatorStatus():
                flags = EstimatorFlags(message.flags)
                # PX4 says so of every vehicle that rests on the ground, too
                adrift = EstimatorFlags.CONST_POS_MODE in flags and self.state.in_air is not False
                healthy = _POSITION_GOOD in flags and not adrift
                self.state = self.state.evolve(estimator_healthy=healthy)
            case AutopilotVersion():
                version = message.flight_sw_version
                self.state = self.state.evolve(firmware=f"{version >> 24}.{version >> 16 & 255}.{version >> 8 & 255}")
            case StatusText():
                self._text(message, now)

    def _heartbeat(self, message: Heartbeat) -> None:
        self.adapter = adapter_for(message.autopilot, message.type)
        names: dict[str, Autopilot] = {"px4": "px4", "ardupilot": "ardupilot"}
        mode = self.adapter.mode_name(message.custom_mode) if self.adapter else f"mode {message.custom_mode}"
        if self.state.mode is not None and self.state.mode != mode:
            self._events.append(ModeChanged(system=self.state.system, before=self.state.mode, after=mode))
        self.state = self.state.evolve(
            autopilot=names[self.adapter.name] if self.adapter else "other",
            type=message.type,
            armed=bool(message.base_mode & MavModeFlag.SAFETY_ARMED),
            custom_mode=message.custom_mode,
            mode=mode,
        )

    def _position(self, message: GlobalPositionInt, now: float) -> None:
        position = _place(message.lat, message.lon, message.alt)
        if position is None:
            self.state = self.state.evolve(position=None, position_heard_s=None, altitude_above_home_m=None)
            return
        heading_deg = self.state.heading_deg
        if heading_deg is None and message.hdg != _UNKNOWN_U16:
            heading_deg = message.hdg / 100 % 360.0
        self.state = self.state.evolve(
            position=position,
            position_heard_s=self._clock.sent_at(message.time_boot_ms, now),
            altitude_above_home_m=message.relative_alt / 1000,
            velocity_enu_mps=(message.vy / 100, message.vx / 100, -message.vz / 100),
            heading_deg=heading_deg,
        )

    def _battery(self, message: SysStatus | BatteryStatus, now: float, component: int) -> None:
        smart = isinstance(message, BatteryStatus) and component in BATTERIES
        if smart or component == self.state.component:
            self._batteries.receive(message, now, component=component)
            self._note_charge(now)

    def _note_charge(self, now: float) -> None:
        percent = self._batteries.lowest_percent(now)
        if percent != self.state.battery_percent:
            self.state = self.state.evolve(battery_percent=percent)

    def _gimbal(self, message: GimbalDeviceAttitudeStatus, now: float, component: int) -> None:
        if not self.led_gimbal.is_reported(component, message.gimbal_device_id, now):
            if self.led_gimbal.device is None:
                self._forget_gimbal()
            return
        heard_s = self._gimbal_clock.sent_at(message.time_boot_ms, now)
        aim = gimbal_aim(message, self.state.heading_at(heard_s))
        if aim is not None:
            self.state = self.state.evolve(gimbal=aim, gimbal_heard_s=heard_s)

    def _forget_gimbal(self) -> None:
        self._gimbal_clock = SenderClock()
        self.state = self.state.evolve(gimbal=None, gimbal_heard_s=None)

    def _text(self, message: StatusText, now: float) -> None:
        if self._part is not None:
            begun = self._part[1]
            if message.id == begun.id and message.chunk_seq == begun.chunk_seq + 1:
                joined = replace(message, text=begun.text + message.text)
                self._part = (now, joined)
            else:
                self._tell_text(now)
                self._part = (now, message)
        else:
            self._part = (now, message)
        if message.id == 0 or len(message.text) < _STATUSTEXT_CHARACTERS:
            self._tell_text(now)

    def _tell_text(self, now: float) -> None:
        if self._part is None:
            return
        message, self._part = self._part[1], None
        text = message.text.strip()
        line = StatusLine(time_s=now, severity=message.severity, text=text)
        self.state = self.state.evolve(texts=(*self.state.texts, line)[-_TEXTS_KEPT:])
        self._events.append(StatusTextReceived(system=self.state.system, severity=message.severity, text=text))


def gimbal_aim(message: GimbalDeviceAttitudeStatus, heading_deg: float | None) -> Aim | None:
    """Return where a gimbal looks, in the earth frame; None if it does not say, or says it from an unknown nose.

    The frame bits tell whether the quaternion's yaw counts from north or from the nose; without them the yaw lock does.
    Source: MAVLink developer guide, "Gimbal protocol v2".
    """
    w, x, y, z = message.q
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not math.isfinite(norm) or norm < 0.5:
        return None
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    tilt_deg = math.degrees(math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))))
    yaw_deg = math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    flags = message.flags
    from_nose = bool(flags & GimbalFlags.YAW_IN_VEHICLE_FRAME)
    from_north = bool(flags & GimbalFlags.YAW_IN_EARTH_FRAME)
    if not from_nose and not from_north:
        from_north = bool(flags & GimbalFlags.YAW_LOCK)
    if from_north:
        return Aim(pan_deg=yaw_deg % 360.0, tilt_deg=tilt_deg)
    if heading_deg is None:
        return None
    return Aim(pan_deg=(yaw_deg + heading_deg) % 360.0, tilt_deg=tilt_deg)


def _place(lat_e7: int, lon_e7: int, altitude_mm: int) -> GeodeticPoint | None:
    nowhere = lat_e7 == 0 and lon_e7 == 0
    if nowhere or abs(lat_e7) > 900_000_000 or abs(lon_e7) > 1_800_000_000:
        return None
    return GeodeticPoint(lat_deg=lat_e7 / 1e7, lon_deg=lon_e7 / 1e7, altitude_amsl_m=altitude_mm / 1000)
