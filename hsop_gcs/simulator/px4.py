"""A simulated PX4: what v1.16 answers, sends unasked and leaves out.

Its surprises, all on purpose: DO_REPOSITION takes its altitude as AMSL whatever the frame says; its flags must be 1,
else UNSUPPORTED, though the navigator may move all the same; a point outside the fence is ACCEPTED and not flown; x and
y of a COMMAND_INT are scaled by 1e-7 whatever they mean; DO_SET_MODE is acknowledged twice, at first without looking;
told to return or land on the ground it stays in that mode, in which it does not arm; it takes off slowly;
told to stop it flies back to where it had expected to.
Its gimbal manager has a module of its own.

Sources: a recording of v1.16.0; PX4-Autopilot Commander.cpp, navigator_main.cpp.
"""

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np

from hsop_gcs.geometry.frames import wrap_rad
from hsop_gcs.link.enums import (
    MavAutopilot,
    MavBatteryChargeState,
    MavCmd,
    MavComponent,
    MavModeFlag,
    MavResult,
    MavSeverity,
    MavState,
)
from hsop_gcs.link.messages import (
    AutopilotVersion,
    GimbalManagerInformation,
    GimbalManagerSetAttitude,
    GlobalPositionInt,
    Heartbeat,
    Message,
    MessageInterval,
    SetMode,
)
from hsop_gcs.simulator.battery import Thresholds
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.faults import FaultKind
from hsop_gcs.simulator.flight import FlightGoal, Point
from hsop_gcs.simulator.gimbal import GimbalLimits, Identity
from hsop_gcs.simulator.orders import Order, whole
from hsop_gcs.simulator.parameters import INT32, Parameter, Parameters
from hsop_gcs.simulator.px4_gimbal import Px4GimbalManager
from hsop_gcs.simulator.px4_reports import FRESH_LINK_HZ, reports
from hsop_gcs.simulator.vehicle import Vehicle


class Mode(IntEnum):
    """PX4's sub-modes of AUTO (main mode 4), as HEARTBEAT.custom_mode has them: main mode << 16 | sub-mode << 24."""

    TAKEOFF = 0x0204_0000
    HOLD = 0x0304_0000
    RETURN = 0x0504_0000
    LAND = 0x0604_0000


_NOT_TO_ARM_IN = {Mode.RETURN, Mode.LAND}
_HEARD_BY_ALL = {MavCmd.REQUEST_AUTOPILOT_CAPABILITIES, MavCmd.REQUEST_PROTOCOL_VERSION}
_ON_REQUEST = {AutopilotVersion.ID, GimbalManagerInformation.ID}
_INT32_MAX = 2**31 - 1
_DISARM_UNFLOWN_S = 10.0
_RETURN_THEN_LAND = 3
_FORCE_DISARM = 21196
_NOSE_TO_COURSE_BEYOND_M = 2.0


class Px4(Vehicle):
    """PX4 v1.16 on a quadrotor with a gimbal that it manages itself."""

    AUTOPILOT = MavAutopilot.PX4
    SPOOL_UP_S = 1.9
    BRAKES_AFTER_S = 1.0
    STOPS_WHERE_PREDICTED = True
    GPS_FIX = 3
    FENCE_INSIDE_ALL = False
    HOME_KNOWN_AFTER = 0.0
    UNKNOWN_INTERVAL_US = -1
    UNKNOWN_INTERVAL_RESULT = MavResult.ACCEPTED

    def __init__(self, config: VehicleConfig, *, now: float, rng: np.random.Generator) -> None:
        self.mode = Mode.HOLD
        self._gimbal_manager = Px4GimbalManager(self)
        self._speed_mps: float | None = None
        self._idle_since: float | None = None
        self._landed_itself = False
        parameters = Parameters(
            {
                "MAV_SYS_ID": Parameter(config.system, INT32),
                "MIS_TAKEOFF_ALT": Parameter(2.5),
                "MPC_TKO_SPEED": Parameter(1.5),
                "MPC_XY_CRUISE": Parameter(config.flight.cruise_mps),
                "RTL_RETURN_ALT": Parameter(30.0),
                "GF_MAX_HOR_DIST": Parameter(0.0),
                "GF_MAX_VER_DIST": Parameter(0.0),
                "COM_DISARM_LAND": Parameter(2.0),
                "BAT_LOW_THR": Parameter(0.15),
                "BAT_CRIT_THR": Parameter(0.07),
                "BAT_EMERGEN_THR": Parameter(0.05),
                "COM_LOW_BAT_ACT": Parameter(_RETURN_THEN_LAND, INT32),
                # told as failsafe.params sets them: a simulated vehicle does not mind that the ground station is silent
                "NAV_DLL_ACT": Parameter(2, INT32),
                "COM_DL_LOSS_T": Parameter(10, INT32),
                "COM_DLL_EXCEPT": Parameter(0, INT32),
                "COM_FAIL_ACT_T": Parameter(5.0),
            },
            bytewise=True,
        )
        super().__init__(config, parameters, FRESH_LINK_HZ, rng, now)
        self._samplers |= reports(self) | self._gimbal_manager.samplers
        self._commands |= {
            MavCmd.COMPONENT_ARM_DISARM: self._arm_disarm,
            MavCmd.NAV_TAKEOFF: self._take_off,
            MavCmd.NAV_LAND: lambda _: self._enter(Mode.LAND),
            MavCmd.NAV_RETURN_TO_LAUNCH: lambda _: self._enter(Mode.RETURN),
            MavCmd.DO_REPOSITION: self._reposition,
            MavCmd.DO_SET_MODE: self._set_mode,
            MavCmd.DO_CHANGE_SPEED: self._change_speed,
            MavCmd.REQUEST_AUTOPILOT_CAPABILITIES: lambda _: self._send(AutopilotVersion.ID),
            **self._gimbal_manager.commands,
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

    def command_addressed(self, system: int, component: int, command: int) -> bool:
        """What is addressed to everybody, or to another component, is ignored in silence."""
        if command in _HEARD_BY_ALL:
            return system in (0, self.config.system)
        return system == self.config.system and component in (MavComponent.ALL, MavComponent.AUTOPILOT1)

    def _set_message_interval(self, order: Order) -> MavResult:
        """Neither heartbeats nor what later versions of the command can say."""
        more = any(math.isfinite(value) and round(value) != 0 for value in (order.p3, order.p4, order.z))
        if more or whole(order.p1) == Heartbeat.ID:
            return MavResult.FAILED
        return super()._set_message_interval(order)

    def position_lost(self) -> None:
        if self.in_air:
            self._failsafe(Mode.LAND, "Descend")

    def battery_thresholds(self) -> Thresholds:
        low, critical, emergency = (
            100 * self.parameters[name] for name in ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")
        )
        return Thresholds(low=low, critical=critical, emergency=emergency)

    def battery_fell(self) -> None:
        """Warn; and with COM_LOW_BAT_ACT 3 return when it is critical and land at once in an emergency."""
        acts = self.parameters["COM_LOW_BAT_ACT"] == _RETURN_THEN_LAND
        if self.battery.level == MavBatteryChargeState.LOW:
            self._say("Low battery level, return advised", MavSeverity.WARNING)
        elif not acts:
            self._say("Critical battery level, land now", MavSeverity.CRITICAL)
        elif self.battery.level == MavBatteryChargeState.CRITICAL:
            self._failsafe(Mode.RETURN, "Return")
        else:
            self._failsafe(Mode.LAND, "Land")

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
            case GimbalManagerSetAttitude():
                self._gimbal_manager.set_attitude(message, sender)
            case _:
                super()._hear(message, sender)

    def _arm_disarm(self, order: Order) -> MavResult:
        if order.p1 == 1:
            if not self.ready or self.mode in _NOT_TO_ARM_IN or self.suffers(FaultKind.DENY_ARM):
                self._say("Arming denied: Resolve system health failures first", MavSeverity.CRITICAL)
                return MavResult.TEMPORARILY_REJECTED
            if not self.armed:
                self.armed = True
                self.home = self.local.to_geodetic(np.array(self.seen_position_m()))
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
        up_m = self.place_of(here.lat_deg, here.lon_deg, altitude_amsl_m)[2]
        self.take_off_to(up_m, climb_mps=self.parameters["MPC_TKO_SPEED"])

    def _enter(self, mode: Mode) -> MavResult:
        """Change the mode and start what it means; Hold goes on with a reposition that is flown inside it."""
        if self.mode == mode == Mode.HOLD:
            return MavResult.ACCEPTED
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

    def _failsafe(self, mode: Mode, name: str) -> None:
        self._say(f"Failsafe activated: Autopilot disengaged, switching to {name}", MavSeverity.CRITICAL)
        self._enter(mode)

    def _return(self) -> None:
        """Climb, fly home, land."""
        self._say("Returning to launch")
        self._gimbal_manager.stow_for_return()
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
        if order.p2 == 1 and not self.ready:
            return MavResult.TEMPORARILY_REJECTED
        if order.p2 == 1:
            self.mode = Mode.HOLD
            result = MavResult.ACCEPTED
        if self.armed and self.in_air and self.mode == Mode.HOLD:
            self._navigate(order)
        return result

    def _navigate(self, order: Order) -> None:
        if all(map(_unset, (order.x, order.y))) and math.isnan(order.z) and math.isnan(order.p4):
            self.hold()
            return
        here = self.local.to_geodetic(np.array(self.state.position_m))
        lat_deg = here.lat_deg if _unset(order.x) else order.lat_deg
        lon_deg = here.lon_deg if _unset(order.y) else order.lon_deg
        altitude_amsl_m = here.altitude_amsl_m if math.isnan(order.z) else order.z
        target = self.place_of(lat_deg, lon_deg, altitude_amsl_m)
        ceiling_m = self.parameters["GF_MAX_VER_DIST"]
        too_high = 0 < ceiling_m < target[2] - float(self.local.to_enu(self.home)[2])
        if too_high or self.outside_fence(target, self.parameters["GF_MAX_HOR_DIST"]):
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
        if custom_mode not in Mode.__members__.values() or (self.armed and not self.ready and custom_mode != Mode.LAND):
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
        if whole(order.p1) == MessageInterval.ID:
            return self.tell_interval(whole(order.p2))
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

    def sample(self, message_id: int) -> Message | None:
        """A position that was lost is not published."""
        lost = self.lost_at_m is not None and message_id == GlobalPositionInt.ID
        return None if lost else super().sample(message_id)

    def _say(self, text: str, severity: MavSeverity = MavSeverity.INFO) -> None:
        """Every text ends in a tab: that is how PX4 marks one that an event tells as well."""
        self.say(text + "\t", severity, numbered=True)


def _unset(coordinate: float) -> bool:
    return coordinate == _INT32_MAX or math.isnan(coordinate)
