"""A simulated PX4: what v1.16 answers, sends unasked and leaves out.

Its surprises, all on purpose: DO_REPOSITION takes its altitude as AMSL whatever the frame says; its flags must be 1,
else UNSUPPORTED, though the navigator may move all the same; a point outside the fence is ACCEPTED and not flown;
gimbal orders from anybody but the primary controller are DENIED or dropped; gimbal limits are in degrees; x and y of a
COMMAND_INT are scaled by 1e-7 whatever they mean; DO_SET_MODE is acknowledged twice, at first without looking.

Sources: a recording of v1.16.0; PX4-Autopilot Commander.cpp, navigator_main.cpp, gimbal/input_mavlink.cpp.
"""

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np

from hsop_gcs.geometry.frames import wrap_rad
from hsop_gcs.link.enums import (
    GimbalFlags,
    MavAutopilot,
    MavCmd,
    MavModeFlag,
    MavResult,
    MavSeverity,
    MavState,
)
from hsop_gcs.link.messages import (
    Altitude,
    Attitude,
    AttitudeQuaternion,
    AutopilotVersion,
    BatteryStatus,
    CommandLong,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerSetAttitude,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    Message,
    MissionCurrent,
    Ping,
    PositionTargetGlobalInt,
    SetMode,
    SysStatus,
    VfrHud,
)
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.flight import FlightGoal, Point
from hsop_gcs.simulator.gimbal import GimbalLimits, Identity, pitch_yaw, quaternion
from hsop_gcs.simulator.orders import Order, whole
from hsop_gcs.simulator.parameters import INT32, Parameter, Parameters
from hsop_gcs.simulator.telemetry import e7
from hsop_gcs.simulator.vehicle import Vehicle


class Mode(IntEnum):
    """PX4's sub-modes of AUTO (main mode 4), as HEARTBEAT.custom_mode has them: main mode << 16 | sub-mode << 24."""

    TAKEOFF = 0x0204_0000
    HOLD = 0x0304_0000
    RETURN = 0x0504_0000
    LAND = 0x0604_0000


_FRESH_LINK_HZ = {
    Heartbeat.ID: 1.0,
    Attitude.ID: 50.0,
    AttitudeQuaternion.ID: 50.0,
    GlobalPositionInt.ID: 50.0,
    LocalPositionNed.ID: 50.0,
    GpsRawInt.ID: 5.0,
    VfrHud.ID: 4.0,
    Altitude.ID: 1.0,
    ExtendedSysState.ID: 1.0,
    GimbalDeviceAttitudeStatus.ID: 1.0,
    SysStatus.ID: 1.0,
    PositionTargetGlobalInt.ID: 1.0,
    MissionCurrent.ID: 1.0,
    HomePosition.ID: 0.5,
    BatteryStatus.ID: 0.5,
    EstimatorStatus.ID: 0.5,
    GimbalManagerStatus.ID: 0.5,
    Ping.ID: 0.1,
}
_ON_REQUEST = {AutopilotVersion.ID, GimbalManagerInformation.ID}
_LOCK_FLAGS = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_LOCK
_LEVEL = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK
_INT32_MAX = 2**31 - 1
_DISARM_UNFLOWN_S = 10.0
_FORCE_DISARM = 21196
_NOSE_TO_COURSE_BEYOND_M = 2.0


class Px4(Vehicle):
    """PX4 v1.16 on a quadrotor with a gimbal that it manages itself."""

    AUTOPILOT = MavAutopilot.PX4
    SPOOL_UP_S = 1.9
    GPS_FIX = 3

    def __init__(self, config: VehicleConfig, *, now: float, rng: np.random.Generator) -> None:
        self.mode = Mode.HOLD
        self._gimbal_flags = _LEVEL
        self._speed_mps: float | None = None
        self._idle_since: float | None = None
        self._landed_itself = False
        self._ping_count = 0
        parameters = Parameters(
            {
                "MAV_SYS_ID": Parameter(config.system, INT32),
                "MIS_TAKEOFF_ALT": Parameter(2.5),
                "MPC_XY_CRUISE": Parameter(config.flight.cruise_mps),
                "RTL_RETURN_ALT": Parameter(30.0),
                "GF_MAX_HOR_DIST": Parameter(0.0),
                "COM_DISARM_LAND": Parameter(2.0),
            },
            bytewise=True,
        )
        super().__init__(config, parameters, {message: 1.0 / hz for message, hz in _FRESH_LINK_HZ.items()}, rng, now)
        self._samplers |= {
            SysStatus.ID: self._sys_status,
            EstimatorStatus.ID: self._estimator_status,
            PositionTargetGlobalInt.ID: self._position_target,
            MissionCurrent.ID: lambda: MissionCurrent(seq=0, total=65535),
            Ping.ID: self._ping,
            GimbalDeviceAttitudeStatus.ID: self._gimbal_attitude,
            GimbalManagerStatus.ID: self._gimbal_status,
            GimbalManagerInformation.ID: self._gimbal_information,
            AutopilotVersion.ID: self._autopilot_version,
        }
        self._commands |= {
            MavCmd.COMPONENT_ARM_DISARM: self._arm_disarm,
            MavCmd.NAV_TAKEOFF: self._take_off,
            MavCmd.NAV_LAND: lambda _: self._enter(Mode.LAND),
            MavCmd.NAV_RETURN_TO_LAUNCH: lambda _: self._enter(Mode.RETURN),
            MavCmd.DO_REPOSITION: self._reposition,
            MavCmd.DO_SET_MODE: self._set_mode,
            MavCmd.DO_CHANGE_SPEED: self._change_speed,
            MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: lambda _: self._send(AutopilotVersion.ID),
            MavCmd.DO_GIMBAL_MANAGER_PITCHYAW: self._gimbal_pitch_yaw,
            MavCmd.DO_GIMBAL_MANAGER_CONFIGURE: self._gimbal_configure,
            MavCmd.DO_SET_ROI_LOCATION: self._set_roi,
            MavCmd.DO_SET_ROI_NONE: self._clear_roi,
        }

    # What the shared half asks

    @staticmethod
    def gimbal_rest_pitch_rad(limits: GimbalLimits) -> float:  # noqa: ARG004
        return 0.0

    def base_mode(self) -> int:
        mode = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.AUTO_ENABLED
        mode |= MavModeFlag.GUIDED_ENABLED | MavModeFlag.STABILIZE_ENABLED
        return mode | MavModeFlag.SAFETY_ARMED if self.armed else mode

    def custom_mode(self) -> int:
        return self.mode

    def system_status(self) -> int:
        return MavState.ACTIVE if self.armed else MavState.STANDBY

    def interval_refused(self, message_id: int) -> MavResult:  # noqa: ARG002
        return MavResult.FAILED

    def lifted_off(self) -> None:
        self._say("Takeoff detected")

    def take_off_done(self) -> None:
        self.mode = Mode.HOLD

    def touched_down(self) -> None:
        self._say("Landing detected")
        self._landed_itself = True

    def each_step(self, now: float) -> None:
        """Disarm what stands armed on the ground: soon after a landing, later if it never left."""
        if not self.armed or self.in_air or self._lift_off_at is not None:
            self._idle_since = None
            return
        if self._idle_since is None:
            self._idle_since = now
        patience_s = self.parameters["COM_DISARM_LAND"] if self._landed_itself else _DISARM_UNFLOWN_S
        if now - self._idle_since >= patience_s:
            self.disarm()
            self._say("Disarmed by landing" if self._landed_itself else "Disarmed by auto preflight disarming")
            self._landed_itself = False
            self.mode = Mode.HOLD

    # Orders

    def _hear(self, message: Message, sender: Identity) -> None:
        match message:
            case SetMode(custom_mode=custom_mode):
                self._change_mode(custom_mode)
            case GimbalManagerSetAttitude(flags=flags, q=q):
                if sender == self.gimbal.primary:
                    rates = (message.angular_velocity_y, message.angular_velocity_z)
                    self._point(flags, *pitch_yaw(q), *rates)
            case _:
                super()._hear(message, sender)

    def _arm_disarm(self, order: Order) -> MavResult:
        if order.p1 == 1:
            if not self.ready:
                self._say("Arming denied: Resolve system health failures first", MavSeverity.CRITICAL)
                return MavResult.TEMPORARILY_REJECTED
            if not self.armed:
                self.armed = True
                self.home = self.local.to_geodetic(np.array(self.state.position_m))
                self._say("Armed by external command")
                if self.mode == Mode.TAKEOFF:
                    self._begin_take_off(math.nan)
            return MavResult.ACCEPTED
        if self.in_air and order.p2 != _FORCE_DISARM:
            self._say("Disarming denied: not landed", MavSeverity.CRITICAL)
            return MavResult.TEMPORARILY_REJECTED
        if self.armed:
            self.disarm()
            self._say("Disarmed by external command")
        return MavResult.ACCEPTED

    def _take_off(self, order: Order) -> MavResult:
        self.mode = Mode.TAKEOFF
        if self.armed and not self.in_air:
            self._begin_take_off(order.z)
        return MavResult.ACCEPTED

    def _begin_take_off(self, altitude_amsl_m: float) -> None:
        if not math.isfinite(altitude_amsl_m):
            altitude_amsl_m = self.home.altitude_amsl_m + self.parameters["MIS_TAKEOFF_ALT"]
        here = self.local.to_geodetic(np.array(self.state.position_m))
        self.take_off_to(self.place_of(here.lat_deg, here.lon_deg, altitude_amsl_m)[2])

    def _enter(self, mode: Mode) -> MavResult:
        """Change the mode and start what it means."""
        self.mode = mode
        match mode:
            case Mode.HOLD:
                self.hold()
            case Mode.LAND:
                self._say("Landing at current position")
                if self.in_air:
                    self.land()
            case Mode.RETURN:
                self._return()
            case Mode.TAKEOFF:
                if self.armed and not self.in_air:
                    self._begin_take_off(math.nan)
        return MavResult.ACCEPTED

    def _return(self) -> None:
        """Climb, fly home, land; the navigator takes the gimbal, levels it and lets go of it."""
        self._say("Returning to launch")
        me = (self.config.system, 1)
        for command, p1, p2, p5 in (
            (MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, *me, 0.0),
            (MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, math.nan, math.nan, GimbalFlags.NEUTRAL),
            (MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, -3, -3, 0.0),
        ):
            rest = math.nan if command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW else -1.0
            self.later(
                CommandLong(
                    target_system=me[0], command=command, param1=p1, param2=p2, param3=rest, param4=rest, param5=p5
                )
            )
        self.gimbal.configure(me, (-1, -1), sender=me, me=me)
        self._point(GimbalFlags.NEUTRAL, math.nan, math.nan, math.nan, math.nan)
        self.gimbal.configure((-3, -3), (-1, -1), sender=me, me=me)
        if not self.in_air:
            return
        east, north, up = (float(value) for value in self.local.to_enu(self.home))
        rise_m = self.parameters["RTL_RETURN_ALT"]
        up_m = max(self.state.position_m[2], up + rise_m)
        altitude_m = math.ceil(self.home.altitude_amsl_m + up_m - up)
        self._say(f"RTL: start return at {altitude_m} m ({round(up_m - up)} m above destination)")
        here = self.stopping_point_m
        self.land(
            FlightGoal(position_m=(here[0], here[1], up_m)),
            FlightGoal(position_m=(east, north, up_m), cruise_mps=self._cruise),
        )

    def _reposition(self, order: Order) -> MavResult:
        """Commander answers by the flags alone; Navigator moves an armed vehicle in Hold whatever was answered."""
        if any(math.isinf(value) for value in (order.x, order.y, order.z)):
            return MavResult.DENIED
        result = MavResult.UNSUPPORTED
        if order.p2 == 1:
            self.mode = Mode.HOLD
            result = MavResult.ACCEPTED
        if self.armed and self.in_air and self.mode == Mode.HOLD:
            self._navigate(order)
        return result

    def _navigate(self, order: Order) -> None:
        here = self.local.to_geodetic(np.array(self.state.position_m))
        lat_deg = here.lat_deg if _unset(order.x) else order.lat_deg
        lon_deg = here.lon_deg if _unset(order.y) else order.lon_deg
        altitude_amsl_m = here.altitude_amsl_m if math.isnan(order.z) else order.z
        target = self.place_of(lat_deg, lon_deg, altitude_amsl_m)
        if self.outside_fence(target, self.parameters["GF_MAX_HOR_DIST"]):
            self._say("Reposition is outside geofence", MavSeverity.CRITICAL)
            self.hold()
            return
        heading_rad = wrap_rad(order.p4) if math.isfinite(order.p4) else self._course(target)
        cruise_mps = order.p1 if order.p1 > 0 else self._cruise
        self.fly_to(FlightGoal(position_m=target, heading_rad=heading_rad, cruise_mps=cruise_mps))

    def _course(self, target_m: Point) -> float | None:
        east, north = target_m[0] - self.state.position_m[0], target_m[1] - self.state.position_m[1]
        return math.atan2(east, north) if math.hypot(east, north) > _NOSE_TO_COURSE_BEYOND_M else None

    @property
    def _cruise(self) -> float:
        return self.parameters["MPC_XY_CRUISE"] if self._speed_mps is None else self._speed_mps

    def _set_mode(self, order: Order) -> MavResult:
        self.acknowledge(order.command, MavResult.ACCEPTED, order.sender)
        return self._change_mode(whole(order.p2) << 16 | whole(order.p3) << 24)

    def _change_mode(self, custom_mode: int) -> MavResult:
        """Hold, take-off, return and land are simulated; what needs a stick, a mission or set-points is refused."""
        if custom_mode not in Mode.__members__.values():
            return MavResult.TEMPORARILY_REJECTED
        return self._enter(Mode(custom_mode))

    def _change_speed(self, order: Order) -> MavResult:
        if order.p1 in (0, 1) and order.p2 > 0:
            self._speed_mps = order.p2
            if self.goal is not None:
                self.goal = replace(self.goal, cruise_mps=order.p2)
        return MavResult.ACCEPTED

    def _request_message(self, order: Order) -> MavResult:
        """The message comes before its acknowledgement; what is not streamed is DENIED."""
        return self._send(whole(order.p1))

    def _send(self, message_id: int) -> MavResult:
        message = self.sample(message_id)
        if message is None:
            return MavResult.DENIED
        self._outgoing.append(message)
        return MavResult.ACCEPTED

    @property
    def streamable(self) -> set[int]:
        return super().streamable - _ON_REQUEST

    # Gimbal

    def _gimbal_pitch_yaw(self, order: Order) -> MavResult:
        if order.sender != self.gimbal.primary:
            return MavResult.DENIED
        flags = whole(order.lat_deg)
        self._point(flags, math.radians(order.p1), math.radians(order.p2), order.p3, order.p4)
        return MavResult.ACCEPTED

    def _point(self, flags: int, pitch_rad: float, yaw_rad: float, pitch_rad_s: float, yaw_rad_s: float) -> None:
        """Aim as the lock flags say. Retract is not implemented, neither here nor there."""
        if flags & GimbalFlags.RETRACT:
            return
        self.roi = None
        if flags & GimbalFlags.NEUTRAL:
            self._gimbal_flags = _LEVEL
            self.gimbal.point(pitch_rad=0.0, yaw_rad=0.0, locked=False)
            return
        self._gimbal_flags = GimbalFlags(flags & _LOCK_FLAGS)
        locked = bool(flags & GimbalFlags.YAW_LOCK)
        if math.isfinite(pitch_rad_s) or math.isfinite(yaw_rad_s):
            rates = [rate if math.isfinite(rate) else 0.0 for rate in (pitch_rad_s, yaw_rad_s)]
            self.gimbal.turn(pitch_rad_s=rates[0], yaw_rad_s=rates[1], locked=locked)
        else:
            self.gimbal.point(pitch_rad=_finite(pitch_rad), yaw_rad=_finite(yaw_rad), locked=locked)

    def _gimbal_configure(self, order: Order) -> MavResult:
        """Primary control only; "-2" means this autopilot, not the sender."""
        self.gimbal.configure((order.p1, order.p2), (-1, -1), sender=order.sender, me=(self.config.system, 1))
        return MavResult.ACCEPTED

    def _set_roi(self, order: Order) -> MavResult:
        """Look at a place whoever is in control; the altitude is AMSL whatever the frame says."""
        place = (order.lat_deg, order.lon_deg, order.z)
        if not all(map(math.isfinite, place)):
            return MavResult.DENIED
        self.roi = self.place_of(*place)
        self._gimbal_flags = _LEVEL | GimbalFlags.YAW_LOCK
        return MavResult.ACCEPTED

    def _clear_roi(self, order: Order) -> MavResult:  # noqa: ARG002
        self._point(GimbalFlags.NEUTRAL, math.nan, math.nan, math.nan, math.nan)
        return MavResult.ACCEPTED

    # Reports

    def _say(self, text: str, severity: MavSeverity = MavSeverity.INFO) -> None:
        """Every text ends in a tab: that is how PX4 marks one that an event tells as well."""
        self.say(text + "\t", severity, numbered=True)

    def _sys_status(self) -> SysStatus:
        return SysStatus(
            onboard_control_sensors_present=50348079,
            onboard_control_sensors_enabled=50413615,
            onboard_control_sensors_health=320915519 if self.ready else 320915519 & ~0x1000_0000,
            load=200,
            voltage_battery=self.battery_mv,
            current_battery=-100,
            battery_remaining=self.battery_percent,
        )

    def _estimator_status(self) -> EstimatorStatus:
        flags = 895 if self.in_air else 1023
        return EstimatorStatus(
            time_usec=round(self.since_boot_s * 1e6),
            flags=flags if self.ready else 0x0A7,
            vel_ratio=0.05,
            pos_horiz_ratio=0.05,
            pos_vert_ratio=0.02,
            mag_ratio=0.07,
            tas_ratio=math.nan,
            pos_horiz_accuracy=0.3,
            pos_vert_accuracy=0.3,
        )

    def _position_target(self) -> PositionTargetGlobalInt | None:
        if self.goal is None or not self.armed:
            return None
        place = self.local.to_geodetic(np.array(self.goal.position_m))
        return PositionTargetGlobalInt(
            time_boot_ms=round(self.since_boot_s * 1e3),
            coordinate_frame=5,
            lat_int=e7(place.lat_deg),
            lon_int=e7(place.lon_deg),
            alt=place.altitude_amsl_m,
            vx=math.nan,
            vy=math.nan,
            vz=math.nan,
            yaw=self.state.heading_rad if self.goal.heading_rad is None else self.goal.heading_rad,
        )

    def _ping(self) -> Ping:
        self._ping_count += 1
        return Ping(time_usec=round(self.since_boot_s * 1e6), seq=self._ping_count - 1)

    def _autopilot_version(self) -> AutopilotVersion:
        return AutopilotVersion(
            capabilities=321791,
            flight_sw_version=17826047,
            middleware_sw_version=17826047,
            board_version=1,
            uid=self.config.system,
            uid2=(self.config.system, *(0,) * 17),
        )

    def _gimbal_information(self) -> GimbalManagerInformation:
        """Degrees, where the message's definition wants radians. An endless yaw is told as one turn either way."""
        limits = self.config.gimbal
        yaw_min, yaw_max = math.degrees(limits.yaw_min_rad), math.degrees(limits.yaw_max_rad)
        return GimbalManagerInformation(
            time_boot_ms=round(self.since_boot_s * 1e3),
            cap_flags=132530,
            gimbal_device_id=1,
            pitch_min=math.degrees(limits.pitch_min_rad),
            pitch_max=math.degrees(limits.pitch_max_rad),
            yaw_min=-360.0 if limits.full_circle else yaw_min,
            yaw_max=360.0 if limits.full_circle else yaw_max,
        )

    def _gimbal_status(self) -> GimbalManagerStatus:
        return GimbalManagerStatus(
            time_boot_ms=round(self.since_boot_s * 1e3),
            flags=self._gimbal_flags,
            gimbal_device_id=1,
            primary_control_sysid=self.gimbal.primary[0],
            primary_control_compid=self.gimbal.primary[1],
        )

    def _gimbal_attitude(self) -> GimbalDeviceAttitudeStatus:
        """Yaw is against north when locked, else against the nose; neither frame bit says so."""
        yaw_rad = self.gimbal.earth_yaw_rad if self.gimbal.locked else self.gimbal.yaw_rad
        return GimbalDeviceAttitudeStatus(
            time_boot_ms=round(self.since_boot_s * 1e3),
            flags=self._gimbal_flags,
            q=quaternion(pitch_rad=self.gimbal.pitch_rad, yaw_rad=yaw_rad),
            gimbal_device_id=1,
        )


def _unset(coordinate: float) -> bool:
    return coordinate == _INT32_MAX or math.isnan(coordinate)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
