"""A simulated aircraft's body: it takes off, flies legs, lands, and carries a gimbal. It understands no messages.

    on the ground ──take-off──> spooling up ──> climbing ──reached, or another order──> in the air
          ^                                                                                 │
          └────────────── on the ground long enough ── landing (any goal below ground) <────┘

Local ENU of the place where it was started, metres. What a stack does at the turns of a flight hangs on the hooks.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.enums import MavLandedState
from hsop_gcs.simulator.flight import STEP_S, FlightGoal, FlightLimits, FlightState, Point, step
from hsop_gcs.simulator.gimbal import Gimbal, GimbalLimits

_ENDURANCE_S = 25 * 60.0
_REACHED_M = 0.3
_TOUCHDOWN_S = 1.0
_BELOW_GROUND_M = -0.5


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


class Body:
    """What flies. ``now`` is seconds on any clock that does not run backwards."""

    SPOOL_UP_S: float
    """From the order to take off until the vehicle reports that it does."""

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
        self._boot_at = self._now = self._moved_until = now
        self._lift_off_at: float | None = None
        self._ground_contact_at: float | None = None
        self._airborne_s = 0.0
        self._wander_phases = tuple(float(phase) for phase in rng.uniform(0.0, 2 * math.pi, size=3))

    # What a stack does at the turns of a flight

    @staticmethod
    def gimbal_rest_pitch_rad(limits: GimbalLimits) -> float:
        """Where the gimbal looks before anybody has steered it."""
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

    # What it is told

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

    # What can be asked

    @property
    def in_air(self) -> bool:
        return self.landed != MavLandedState.ON_GROUND

    @property
    def since_boot_s(self) -> float:
        return self._now - self._boot_at

    @property
    def boot_ms(self) -> int:
        return round(self.since_boot_s * 1e3)

    @property
    def battery_percent(self) -> int:
        return max(0, 100 - math.floor(100 * self._airborne_s / _ENDURANCE_S))

    def place_of(self, lat_deg: float, lon_deg: float, altitude_amsl_m: float) -> Point:
        """Return local ENU, metres."""
        point = GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=altitude_amsl_m)
        east, north, up = (float(value) for value in self.local.to_enu(point))
        return east, north, up

    def outside_fence(self, target_m: Point, radius_m: float) -> bool:
        home = self.local.to_enu(self.home)
        return radius_m > 0 and math.hypot(target_m[0] - home[0], target_m[1] - home[1]) > radius_m

    def seen_position_m(self) -> Point:
        """Return the position as the estimator has it: in the air with a slow swing, never longer than the bound."""
        if not self.in_air:
            return self.state.position_m
        east, north, up = (
            value + self.config.wander_m / math.sqrt(3) * math.sin(0.3 * self.since_boot_s + phase)
            for value, phase in zip(self.state.position_m, self._wander_phases, strict=True)
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
