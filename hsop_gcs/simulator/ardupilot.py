"""A simulated ArduPilot Copter: what 4.7 answers, sends unasked and leaves out.

Its surprises, all on purpose: a fresh link carries only HEARTBEAT and TIMESYNC; arming FAILS with a status text until
the estimator has a position; a requested message follows its acknowledgement; DO_REPOSITION ignores yaw and speed,
honours the frame, and does not exist as COMMAND_LONG; an invalid position target stops the vehicle. Its gimbal manager
has a module of its own.

Sources: a recording of 4.7.0-dev; ArduCopter GCS_MAVLink_Copter.cpp and mode_guided.cpp.
"""

import math
from dataclasses import replace

import numpy as np

from hsop_gcs.geometry.frames import wrap_rad
from hsop_gcs.link.enums import (
    MavAutopilot,
    MavBatteryChargeState,
    MavCmd,
    MavFrame,
    MavModeFlag,
    MavResult,
    MavSeverity,
    MavState,
    PositionTargetTypemask,
)
from hsop_gcs.link.messages import (
    AutopilotVersion,
    GimbalManagerSetAttitude,
    GimbalManagerSetPitchyaw,
    GpsGlobalOrigin,
    HomePosition,
    Message,
    MessageInterval,
    PositionTargetGlobalInt,
    RequestDataStream,
    SetMode,
    SetPositionTargetGlobalInt,
)
from hsop_gcs.simulator.ardupilot_gimbal import ArduPilotGimbalManager, rest_pitch_rad
from hsop_gcs.simulator.ardupilot_modes import ARMABLE, POSITION_FREE, Mode, base_mode
from hsop_gcs.simulator.ardupilot_parameters import battery_failsafe, battery_thresholds, fresh_parameters
from hsop_gcs.simulator.ardupilot_reports import FRESH_LINK_HZ, reports, streams_of
from hsop_gcs.simulator.battery import Thresholds
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.faults import FaultKind
from hsop_gcs.simulator.flight import FlightGoal, Point
from hsop_gcs.simulator.gimbal import GimbalLimits, Identity
from hsop_gcs.simulator.orders import Order, whole
from hsop_gcs.simulator.telemetry import e7
from hsop_gcs.simulator.vehicle import Vehicle

_ABSOLUTE = {MavFrame.GLOBAL, MavFrame.GLOBAL_INT}
_RELATIVE = {
    MavFrame.GLOBAL_RELATIVE_ALT,
    MavFrame.GLOBAL_RELATIVE_ALT_INT,
    MavFrame.GLOBAL_TERRAIN_ALT,
    MavFrame.GLOBAL_TERRAIN_ALT_INT,
}
_KNOWN_BUT_ABSENT = {HomePosition.ID, 259}
"""A request is accepted, though there is no home yet, or no camera to send its CAMERA_INFORMATION."""
_X, _V, _A = 0x007, 0x038, 0x1C0
"""The three ignore bits of position, velocity and acceleration; one of them set drops its whole group."""
_FIRST_COMPLAINT_S, _COMPLAINT_EVERY_S = 6.4, 30.0
_DISARM_IDLE_S = 10.0
_YAW_ALIGNED_M = 2.6
_ALT_MAX, _CIRCLE, _POLYGON, _ALT_MIN = 1, 2, 4, 8
"""FENCE_TYPE."""
_FORCE = {2989, 21196}
_NOSE_TO_COURSE_BEYOND_M = 2.0


class ArduCopter(Vehicle):
    """ArduPilot Copter 4.7 on a quadrotor with one gimbal."""

    AUTOPILOT = MavAutopilot.ARDUPILOTMEGA
    SPOOL_UP_S = 3.2
    BRAKES_AFTER_S = 0.75
    STOPS_WHERE_PREDICTED = False
    GPS_FIX = 6
    FENCE_INSIDE_ALL = True
    UNKNOWN_INTERVAL_US = 0
    UNKNOWN_INTERVAL_RESULT = MavResult.FAILED
    HOME_KNOWN_AFTER = 0.5  # its estimator has an origin some 20 s after power-up, and uses GPS after 40

    def __init__(self, config: VehicleConfig, *, now: float, rng: np.random.Generator) -> None:
        self.mode = Mode.GUIDED if config.airborne_m > 0 else Mode.STABILIZE
        self._speed_mps: float | None = None
        self._paused: FlightGoal | None = None
        self._climb: FlightGoal | None = None
        self._idle_since: float | None = None
        self._yaw_aligned = config.airborne_m > 0
        self._complain_at = now + _FIRST_COMPLAINT_S
        self._gimbal_manager = ArduPilotGimbalManager(self, self._target)
        super().__init__(config, fresh_parameters(config), FRESH_LINK_HZ, rng, now)
        self._samplers |= reports(self) | self._gimbal_manager.samplers
        self._samplers[PositionTargetGlobalInt.ID] = self._position_target
        self._commands |= {
            MavCmd.COMPONENT_ARM_DISARM: self._arm_disarm,
            MavCmd.NAV_TAKEOFF: self._take_off,
            MavCmd.NAV_LAND: lambda _: self._enter(Mode.LAND),
            MavCmd.NAV_RETURN_TO_LAUNCH: lambda _: self._enter(Mode.RTL),
            MavCmd.NAV_LOITER_UNLIM: lambda _: self._enter(Mode.LOITER),
            MavCmd.DO_REPOSITION: self._reposition,
            MavCmd.DO_SET_MODE: self._set_mode,
            MavCmd.DO_CHANGE_SPEED: self._change_speed,
            MavCmd.DO_PAUSE_CONTINUE: self._pause_continue,
            MavCmd.CONDITION_YAW: self._condition_yaw,
            MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: lambda _: self._send_later(AutopilotVersion.ID),
            **self._gimbal_manager.commands,
        }

    # What the shared half asks

    @staticmethod
    def gimbal_rest_pitch_rad(limits: GimbalLimits) -> float:
        return rest_pitch_rad(limits)

    def base_mode(self) -> int:
        return base_mode(self.mode, armed=self.armed)

    def custom_mode(self) -> int:
        return self.mode

    def system_status(self) -> int:
        return MavState.ACTIVE if self.in_air else MavState.STANDBY

    def interval_refused(self, message_id: int) -> MavResult:
        self.say(f"No ap_message for mavlink id ({message_id})")
        return MavResult.DENIED

    def command_addressed(self, system: int, component: int, command: int) -> bool:  # noqa: ARG002
        """A command to a component that it knows no way to, the stack carries out itself."""
        return system in (0, self.config.system)

    def _set_message_interval(self, order: Order) -> MavResult:
        if order.p3 != 0 or order.p2 <= -2:
            return MavResult.DENIED
        return super()._set_message_interval(order)

    def became_ready(self) -> None:
        for unit in range(2):
            self.say(f"EKF3 IMU{unit} is using GPS")

    def position_lost(self) -> None:
        if self.in_air and self.mode not in POSITION_FREE:
            self._enter(Mode.LAND)
            self.say("EKF Failsafe: changed to Land Mode", MavSeverity.CRITICAL)

    def battery_thresholds(self) -> Thresholds:
        return battery_thresholds(self.parameters)

    def battery_fell(self) -> None:
        low = self.battery.level == MavBatteryChargeState.LOW
        self.say(f"Battery 1 is {'low' if low else 'critical'} {self.battery}", MavSeverity.WARNING)
        mode = battery_failsafe(self.parameters, self.battery.level)
        if mode is not None:
            self._enter(mode)

    def touched_down(self) -> None:
        self._stop_motors()

    def each_step(self, now: float) -> None:
        if not self.ready and now >= self._complain_at:
            self._complain_at += _COMPLAINT_EVERY_S
            self.say("PreArm: Need Position Estimate", MavSeverity.CRITICAL)
        if not self._yaw_aligned and self.state.position_m[2] > _YAW_ALIGNED_M:
            self._yaw_aligned = True
            for unit in range(2):
                self.say(f"EKF3 IMU{unit} MAG0 in-flight yaw alignment complete")
        if not self.armed or self.in_air or self._lift_off_at is not None:
            self._idle_since = None
        elif self._idle_since is None:
            self._idle_since = now
        elif now - self._idle_since >= _DISARM_IDLE_S:
            self._stop_motors()

    # Orders

    def _hear(self, message: Message, sender: Identity) -> None:
        match message:
            case SetMode(custom_mode=custom_mode):
                # The stack itself acknowledges this message, with the message's id for a command's.
                self.acknowledge(SetMode.ID, self._change_mode(custom_mode), sender)
            case SetPositionTargetGlobalInt():
                if self.mode == Mode.GUIDED and self.in_air:
                    self._position_order(message)
            case GimbalManagerSetPitchyaw():
                self._gimbal_manager.set_pitch_yaw(message)
            case GimbalManagerSetAttitude():
                self._gimbal_manager.set_attitude(message)
            case RequestDataStream():
                self._request_stream(message)
            case _:
                super()._hear(message, sender)

    def _arm_disarm(self, order: Order) -> MavResult:
        if order.p1 == 1:
            return self._arm(forced=order.p2 in _FORCE)
        if self.in_air and order.p2 not in _FORCE:
            return MavResult.FAILED
        if self.armed:
            self._stop_motors()
        return MavResult.ACCEPTED

    def _arm(self, *, forced: bool) -> MavResult:
        if self.armed:
            return MavResult.ACCEPTED
        if self.mode not in ARMABLE:
            self.say("Arm: Mode not armable", MavSeverity.CRITICAL)
            return MavResult.FAILED
        if not self.ready and self.mode not in POSITION_FREE and not forced:
            self.say("Arm: Need Position Estimate", MavSeverity.CRITICAL)
            return MavResult.FAILED
        if self.suffers(FaultKind.DENY_ARM) and not forced:
            self.say("Arm: Compass not healthy", MavSeverity.CRITICAL)
            return MavResult.FAILED
        self.armed = True
        self.home = self.local.to_geodetic(np.array(self.seen_position_m()))
        self.later(self.sample(GpsGlobalOrigin.ID))
        self.later(self.sample(HomePosition.ID))
        self.say("Arming motors")
        return MavResult.ACCEPTED

    def _stop_motors(self) -> None:
        self.disarm()
        self.say("Disarming motors")

    def _take_off(self, order: Order) -> MavResult:
        """Guided, armed, on the ground, and the altitude is above home: as a COMMAND_INT it must say so."""
        if order.integer and order.frame != MavFrame.GLOBAL_RELATIVE_ALT:
            return MavResult.DENIED
        up_m = self._home_up_m + order.z
        if self.mode != Mode.GUIDED or not self.armed or self.in_air or not up_m > self.state.position_m[2]:
            return MavResult.FAILED
        self.take_off_to(up_m)
        self._climb = self.goal
        return MavResult.ACCEPTED

    def _reposition(self, order: Order) -> MavResult:
        if not order.integer:
            return MavResult.UNSUPPORTED
        change_mode = bool(whole(order.p2) & 1)
        if self.mode != Mode.GUIDED and not change_mode:
            return MavResult.DENIED
        target = self._target(order.frame, order.lat_deg, order.lon_deg, order.z)
        if target is None:
            return MavResult.DENIED
        if self.parameters["FENCE_ENABLE"] and self._fenced(target):
            return MavResult.FAILED
        if self.mode != Mode.GUIDED and self._enter(Mode.GUIDED) != MavResult.ACCEPTED:
            return MavResult.FAILED
        if self.in_air:
            self._paused = None
            self.fly_to(FlightGoal(position_m=target, heading_rad=self._course(target), cruise_mps=self._cruise))
        return MavResult.ACCEPTED

    def _fenced(self, target: Point) -> bool:
        """Whether the fence that is switched on forbids a place, by the kinds of fence that count."""
        kinds, above_home_m = round(self.parameters["FENCE_TYPE"]), target[2] - self._home_up_m
        too_high = bool(kinds & _ALT_MAX) and above_home_m > self.parameters["FENCE_ALT_MAX"]
        too_low = bool(kinds & _ALT_MIN) and above_home_m < self.parameters["FENCE_ALT_MIN"]
        too_far = bool(kinds & _CIRCLE) and self.outside_radius(target, self.parameters["FENCE_RADIUS"])
        return too_high or too_low or too_far or (bool(kinds & _POLYGON) and self.fence.outside(target))

    def _position_order(self, message: SetPositionTargetGlobalInt) -> None:
        """Fly to a position; anything else that is said, or said wrongly, stops the vehicle.

        Velocity and acceleration targets are not flown: the vehicle stops, as it does when their stream ends.
        """
        target = self._target(message.coordinate_frame, message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt)
        if target is None or message.type_mask & _X or not message.type_mask & _V or not message.type_mask & _A:
            self.hold()
            return
        heading_rad = self._course(target)
        if not message.type_mask & PositionTargetTypemask.YAW_IGNORE and math.isfinite(message.yaw):
            heading_rad = wrap_rad(message.yaw)
        self._paused = None
        self.fly_to(FlightGoal(position_m=target, heading_rad=heading_rad, cruise_mps=self._cruise))

    def _target(self, frame: int, lat_deg: float, lon_deg: float, altitude_m: float) -> Point | None:
        """Return local ENU; None for a frame, a place or an altitude that the stack refuses. Terrain is flat here."""
        if frame in _RELATIVE:
            altitude_m += self.home.altitude_amsl_m
        elif frame not in _ABSOLUTE:
            return None
        if not (math.isfinite(altitude_m) and abs(lat_deg) <= 90 and abs(lon_deg) <= 180):
            return None
        return self.place_of(lat_deg, lon_deg, altitude_m)

    def _course(self, target_m: Point) -> float | None:
        """Return where WP_YAW_BEHAVIOR turns the nose on a leg: to the next point, unless that is near or it is 0."""
        east, north = target_m[0] - self.state.position_m[0], target_m[1] - self.state.position_m[1]
        if self.parameters["WP_YAW_BEHAVIOR"] == 0 or math.hypot(east, north) <= _NOSE_TO_COURSE_BEYOND_M:
            return None
        return math.atan2(east, north)

    @property
    def _cruise(self) -> float:
        return self.parameters["WPNAV_SPEED"] / 100 if self._speed_mps is None else self._speed_mps

    @property
    def _home_up_m(self) -> float:
        return float(self.local.to_enu(self.home)[2])

    def _set_mode(self, order: Order) -> MavResult:
        if not whole(order.p1) & MavModeFlag.CUSTOM_MODE_ENABLED:
            return MavResult.DENIED
        return self._change_mode(whole(order.p2))

    def _change_mode(self, custom_mode: int) -> MavResult:
        if custom_mode not in Mode.__members__.values():
            return MavResult.FAILED
        return self._enter(Mode(custom_mode))

    def _enter(self, mode: Mode) -> MavResult:
        """Change the mode, start what it means, and tell it at once in a heartbeat of its own."""
        if self.armed and not self.ready and mode not in POSITION_FREE:
            return MavResult.FAILED
        changed = mode != self.mode
        self.mode = mode
        self._paused = None
        if self.in_air and mode == Mode.LAND:
            self.land()
        elif self.in_air and mode == Mode.RTL:
            self._return()
        elif changed:
            self.hold()
        if changed:
            self._speed_mps = None
            self.later(self._heartbeat())
        return MavResult.ACCEPTED

    def _return(self) -> None:
        """Climb to RTL_ALT if below it, fly home without turning the nose, land."""
        east, north, up = (float(value) for value in self.local.to_enu(self.home))
        up_m = max(self.state.position_m[2], up + self.parameters["RTL_ALT"] / 100)
        here = self.stopping_point_m
        self.land(
            FlightGoal(position_m=(here[0], here[1], up_m)),
            FlightGoal(position_m=(east, north, up_m), cruise_mps=self._cruise),
        )

    def _change_speed(self, order: Order) -> MavResult:
        if not order.p2 > 0 or order.p1 not in (0, 1):
            return MavResult.FAILED
        self._speed_mps = order.p2
        if self.goal is not None:
            self.goal = replace(self.goal, cruise_mps=order.p2)
        return MavResult.ACCEPTED

    def _pause_continue(self, order: Order) -> MavResult:
        if self.mode != Mode.GUIDED or order.p1 not in (0, 1):
            return MavResult.FAILED
        if order.p1 == 0:
            self._paused = self._paused or self.goal
            self.hold()
        elif self._paused is not None:
            self.fly_to(self._paused)
            self._paused = None
        return MavResult.ACCEPTED

    def _condition_yaw(self, order: Order) -> MavResult:
        if not 0 <= order.p1 <= 360 or order.p4 not in (0, 1):
            return MavResult.FAILED
        heading_rad = math.radians(order.p1)
        if order.p4 == 1:
            heading_rad = self.state.heading_rad + math.copysign(heading_rad, order.p3 or 1.0)
        if self.goal is not None:
            self.goal = replace(self.goal, heading_rad=wrap_rad(heading_rad))
        return MavResult.ACCEPTED

    def _request_message(self, order: Order) -> MavResult:
        """The acknowledgement comes first, the message behind it; but an interval is told at once."""
        if whole(order.p1) == MessageInterval.ID:
            return self.tell_interval(whole(order.p2))
        return self._send_later(whole(order.p1))

    def _send_later(self, message_id: int) -> MavResult:
        message = self.sample(message_id)
        if message is None and message_id not in _KNOWN_BUT_ABSENT:
            return MavResult.FAILED
        self.later(message)
        return MavResult.ACCEPTED

    def _request_stream(self, message: RequestDataStream) -> None:
        for message_id in streams_of(message):
            if message.start_stop and message.req_message_rate:
                self._streams.set(message_id, 1.0 / message.req_message_rate, self._now)
            else:
                self._streams.stop(message_id)

    def _position_target(self) -> PositionTargetGlobalInt | None:
        """Only while a position is flown to; a take-off is none, not even when it is over."""
        if self.goal is None or not self.in_air or self.goal is self._climb:
            return None
        place = self.local.to_geodetic(np.array(self.goal.position_m))
        return PositionTargetGlobalInt(
            time_boot_ms=self.boot_ms,
            coordinate_frame=MavFrame.GLOBAL,
            type_mask=0xFDF8,
            lat_int=e7(place.lat_deg),
            lon_int=e7(place.lon_deg),
            alt=place.altitude_amsl_m,
        )
