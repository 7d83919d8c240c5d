"""A simulated aircraft's body: it takes off, flies legs, lands, and carries a gimbal. It understands no messages.

    on the ground ──take-off──> spooling up ──> climbing ──reached, or another order──> in the air
          ^                                                                                 │
          └────────────── on the ground long enough ── landing (any goal below ground) <────┘

Local ENU of the place where it was started, metres. What a stack does at the turns of a flight hangs on the hooks.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.enums import MavLandedState
from hsop_gcs.simulator.battery import Battery, BatteryConfig, Thresholds
from hsop_gcs.simulator.disturbances import GALE, GpsError, Receiver, Weather, Wind
from hsop_gcs.simulator.faults import Fault, FaultKind, Faults
from hsop_gcs.simulator.flight import STEP_S, FlightGoal, FlightLimits, FlightState, Point, step
from hsop_gcs.simulator.gimbal import Gimbal, GimbalLimits, Identity

_REACHED_M = 0.3
_TOUCHDOWN_S = 1.0
_BELOW_GROUND_M = -0.5
_AT_REST_MPS = 1.0
_PREDICTED_LEAN_S = 0.6
_SOMEBODY_ELSE: Identity = (254, 190)
"""The ground station that takes a gimbal away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AircraftConfig:
    """What the aircraft of a fleet have in common: what they are like, and what happens to them."""

    airborne_m: float = 0.0
    """Start armed and hovering at this height above home; 0 starts on the ground."""
    ready_after_s: float = 2.0
    """How long after boot the estimator has a position."""
    wander_m: float = 0.05
    """Bound of the slow wandering about the point where it means to hover."""
    flight: FlightLimits = field(default_factory=FlightLimits)
    gimbal: GimbalLimits = field(default_factory=GimbalLimits)
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    wind: Wind = field(default_factory=Wind)
    gps: GpsError = field(default_factory=GpsError)
    faults: Sequence[Fault] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConfig(AircraftConfig):
    """One simulated aircraft."""

    system: int
    home: GeodeticPoint
    heading_rad: float = 0.0


class Body:
    """What flies. ``now`` is seconds on any clock that does not run backwards."""

    SPOOL_UP_S: float
    """From the order to take off until the vehicle reports that it does."""
    BRAKES_AFTER_S: float
    """From the order to stop until it has leant back; so long it flies on as before."""
    STOPS_WHERE_PREDICTED: bool
    """Whether it returns to where it expected to stop when the order came; else it stays where it comes to rest."""

    def __init__(self, config: VehicleConfig, rng: np.random.Generator, now: float) -> None:
        self.config = config
        self.home = config.home
        self.local = LocalFrame(config.home)
        self.armed = config.airborne_m > 0
        self.landed = MavLandedState.IN_AIR if self.armed else MavLandedState.ON_GROUND
        self.state = FlightState(position_m=(0.0, 0.0, config.airborne_m), heading_rad=config.heading_rad)
        self.goal: FlightGoal | None = FlightGoal(position_m=self.state.position_m) if self.armed else None
        self.gimbal = Gimbal(config.gimbal, pitch_rad=self.gimbal_rest_pitch_rad(config.gimbal))
        self.roi: Point | None = None
        """Where the gimbal is to look wherever the vehicle goes."""
        self.ready = self.armed
        """Whether the estimator has a position."""
        self._legs: deque[FlightGoal] = deque()
        self.boot_at = self._now = self._moved_until = now
        self._lift_off_at: float | None = None
        self._ground_contact_at: float | None = None
        self._brake_at: float | None = None
        self._stop_at_m: Point | None = None
        self._wander_phases = tuple(float(phase) for phase in rng.uniform(0.0, 2 * math.pi, size=3))
        self._weather = Weather(config.wind, rng)
        self._receiver = Receiver(config.gps, rng)
        self.battery = Battery(config.battery)
        self.faults = Faults(config.faults)
        self.lost_at_m: Point | None = None
        """The last position there was, while there is none."""

    # What a stack does at the turns of a flight

    @staticmethod
    def gimbal_rest_pitch_rad(limits: GimbalLimits) -> float:
        """Where the gimbal looks before anybody has steered it."""
        raise NotImplementedError

    def became_ready(self) -> None:
        """The estimator has just found its position."""

    def position_lost(self) -> None:
        """The satellites are gone, and the estimator's position with them."""

    def battery_thresholds(self) -> Thresholds:
        """When this stack calls its battery low."""
        return Thresholds()

    def battery_fell(self) -> None:
        """The battery has come to a worse level."""

    def lifted_off(self) -> None:
        """The motors have spooled up."""

    def take_off_done(self) -> None:
        """The take-off altitude is reached."""

    def touched_down(self) -> None:
        """The vehicle has stood on the ground long enough to believe it."""

    def each_step(self, now: float) -> None:
        """Called after every step of the flight."""

    # What it is told

    def fly_to(self, *legs: FlightGoal) -> None:
        """Leave whatever was being done and fly these legs, one after the other."""
        self._brake_at = None
        self.goal = legs[0]
        self._legs = deque(legs[1:])
        if self.landed != MavLandedState.ON_GROUND:
            self.landed = MavLandedState.IN_AIR

    def hold(self) -> None:
        """Stop and hover: at once if it hardly moves, else after leaning back."""
        if not self.in_air:
            return
        if self.state.ground_speed_mps < _AT_REST_MPS:
            self.fly_to(FlightGoal(position_m=self.stopping_point_m))
        elif self._brake_at is None:
            self._legs.clear()
            self._brake_at = self._now + self.BRAKES_AFTER_S
            self._stop_at_m = self.predicted_stop_m if self.STOPS_WHERE_PREDICTED else None

    @property
    def predicted_stop_m(self) -> Point:
        """Where an autopilot expects to come to rest that is told to stop now, by its speed alone."""
        seconds = self.state.ground_speed_mps / (2 * self.config.flight.acceleration_mps2) + _PREDICTED_LEAN_S
        east, north, up = self.state.position_m
        ve, vn, _ = self.state.velocity_mps
        return east + ve * seconds, north + vn * seconds, up

    @property
    def stopping_point_m(self) -> Point:
        """Where full braking along the present course ends."""
        speed_mps = self.state.ground_speed_mps
        seconds = speed_mps / (2 * self.config.flight.acceleration_mps2)
        east, north, up = self.state.position_m
        ve, vn, _ = self.state.velocity_mps
        return east + ve * seconds, north + vn * seconds, up

    def take_off_to(self, up_m: float, *, climb_mps: float | None = None) -> None:
        """Spool up, then climb to ``up_m`` above the local origin, at a speed of its own or the airframe's."""
        self.goal = FlightGoal(position_m=(*self.state.position_m[:2], up_m), climb_mps=climb_mps)
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

    # What can be asked

    @property
    def in_air(self) -> bool:
        return self.landed != MavLandedState.ON_GROUND

    @property
    def since_boot_s(self) -> float:
        return self._now - self.boot_at

    @property
    def boot_ms(self) -> int:
        return round(self.since_boot_s * 1e3)

    def suffers(self, kind: FaultKind) -> bool:
        """Whether a fault of this kind is there now."""
        return self.faults.active(kind, self.since_boot_s)

    def place_of(self, lat_deg: float, lon_deg: float, altitude_amsl_m: float) -> Point:
        """Return local ENU, metres."""
        point = GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=altitude_amsl_m)
        east, north, up = (float(value) for value in self.local.to_enu(point))
        return east, north, up

    def outside_radius(self, target_m: Point, radius_m: float) -> bool:
        """Whether a point, local ENU, is farther from home than a radius; 0 fences nothing."""
        home = self.local.to_enu(self.home)
        return radius_m > 0 and math.hypot(target_m[0] - home[0], target_m[1] - home[1]) > radius_m

    def seen_position_m(self) -> Point:
        """Return the position as the estimator has it.

        Beside the truth by the receiver's error, and in the air with a slow swing, never longer than the bound.
        """
        if self.lost_at_m is not None:
            return self.lost_at_m
        swing_m = self.config.wander_m / math.sqrt(3) if self.in_air else 0.0
        east, north, up = (
            value + error + swing_m * math.sin(0.3 * self.since_boot_s + phase)
            for value, error, phase in zip(
                self.state.position_m, self._receiver.error_m, self._wander_phases, strict=True
            )
        )
        return east, north, up

    # How it moves

    def fly_until(self, now: float) -> None:
        """Let time pass until ``now`` in steps of a fixed length, so that a flight does not depend on who asks when."""
        while self._moved_until + STEP_S <= now + 1e-9:
            self._moved_until += STEP_S
            self._now = max(self._now, self._moved_until)
            self._step()
        self._now = max(self._now, now)

    def _step(self) -> None:
        self._find_position()
        if self._brake_at is not None and self._now >= self._brake_at:
            self.fly_to(FlightGoal(position_m=self._stop_at_m or self.stopping_point_m))
        if self._lift_off_at is not None and self.armed and self._now >= self._lift_off_at:
            self._lift_off_at = None
            self.landed = MavLandedState.TAKEOFF
            self.lifted_off()
        if self.in_air and self.goal is not None:
            goal = self._really(self.goal)
            air = self._weather.step(STEP_S)
            self.state = step(self.state, goal, self.config.flight, air=GALE if self.suffers(FaultKind.GALE) else air)
            self._mind_the_goal(goal)
            if self.battery.drain(STEP_S, self.battery_thresholds()):
                self.battery_fell()
            if self.battery.percent <= 0 and self.armed:
                self.disarm()
        else:
            self.state = self.state.halted()
        self._turn_gimbal()
        self.each_step(self._now)

    def _find_position(self) -> None:
        self._receiver.step(STEP_S)
        without = self.suffers(FaultKind.GPS_LOST)
        if self.ready and without:
            self.lost_at_m = self.seen_position_m()
            self.ready = False
            self.position_lost()
        elif not self.ready and not without and self.since_boot_s >= self.config.ready_after_s:
            self.lost_at_m = None
            self.ready = True
            self.became_ready()

    def _really(self, goal: FlightGoal) -> FlightGoal:
        """Return where a vehicle goes that believes its receiver."""
        error_m = self._receiver.error_m
        if not any(error_m):
            return goal
        east, north, up = (wanted - error for wanted, error in zip(goal.position_m, error_m, strict=True))
        # The ground is where it is: a landing ends on it whatever the receiver says.
        return replace(goal, position_m=(east, north, up if goal.position_m[2] >= 0 else goal.position_m[2]))

    def _turn_gimbal(self) -> None:
        if self.faults.strikes(FaultKind.GIMBAL_TAKEN, self.since_boot_s):
            self.roi = None
            self.gimbal.primary = _SOMEBODY_ELSE
            self.gimbal.point(pitch_rad=math.radians(-90.0), yaw_rad=0.0, locked=False)
        if self.roi is not None:
            self._look_at(self.roi)
        self.gimbal.step(STEP_S, self.state.heading_rad, stuck=self.suffers(FaultKind.GIMBAL_STUCK))

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
