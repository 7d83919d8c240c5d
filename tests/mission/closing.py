"""Threats that come near to hosts, and how near: seeded missions flown headless, each beside a host that flees at its
limit from the moment the track shows the threat coming.

A planner that always gives the same answer sends hosts to hover points, so that a threat's way can be laid past them.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsop_gcs.assignment import HostOrder
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.inputs import HostDeparted, HostStopped, Rules
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.problem import Formulation, Objective, Point
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.simulator.fleet import Autopilot
from hsop_gcs.simulator.truth import TrueState, truth_from_json
from tests.mission.headless import EPOCH_S, ORIGIN, Decide, Flight, Moment, Truth, fly

SAFETY_M = 20.0
TICK_S = 0.2
LIMIT_MPS, LIMIT_MPS2 = 8.0, 3.0
"""What a host can do at most, for the one that flees at its limit."""
SHOWN_S = 6.0
"""A track shows a threat coming when, straight on, it comes within the safety distance within this."""
OWN_MPS = 0.5
"""Faster than this towards a threat a host moves by its own motion; slower, it wanders."""


def circle(centre_m: Point, radius_m: float, speed_mps: float, *, phase_deg: float = 0.0, name: str = "t1") -> Truth:
    """A threat on a level circle, clockwise; phase 0 is north of its middle."""

    def at(time_s: float) -> list[TrueState]:
        angle = math.radians(phase_deg) + speed_mps / radius_m * time_s
        east, north, up = centre_m
        place = (east + radius_m * math.sin(angle), north + radius_m * math.cos(angle), up)
        velocity = (speed_mps * math.cos(angle), -speed_mps * math.sin(angle), 0.0)
        return [TrueState(id=name, position_m=place, velocity_mps=velocity, size_m=1.0)]

    return at


def flown_ways(*threats: dict[str, Any]) -> Truth:
    """Threats as truth files have them."""
    truth = truth_from_json({"threats": [{"id": f"t{n}", **each} for n, each in enumerate(threats, 1)]}, ORIGIN)
    return truth.at


def planner(goals_m: list[Point]) -> Decide:
    """Send each host to a hover point of its own, and keep it there."""

    def decide(asked: Situation, _: PlanningRules) -> Decision:
        placement = Placement(status=Status.FEASIBLE, formulation=Formulation.OPERATIONAL, objective=Objective.LETTER)
        ahead = Aim(pan_deg=0.0, tilt_deg=0.0)
        orders = tuple(
            HostOrder(host=f"h{n}", position_m=goal, heading_deg=0.0, aim=ahead, views=())
            for n, goal in enumerate(goals_m, 1)
            if f"h{n}" in {mover.id for mover in asked.movers}
        )
        return Decision(
            placement=placement,
            threats=asked.threats,
            window_start_s=asked.now_s + 20.0,
            orders=orders,
            keeps=asked.flying is not None,
        )

    return decide


@dataclass(kw_only=True)
class Encounter:
    """What one host and one threat did, a value for every moment."""

    times_s: list[float] = field(default_factory=list)
    host_m: list[Point] = field(default_factory=list)
    host_mps: list[Point] = field(default_factory=list)
    threat_m: list[Point] = field(default_factory=list)
    tracked: list[tuple[Point, Point] | None] = field(default_factory=list)
    """Where the track has the threat, and its velocity."""

    def apart_m(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.asarray(np.linalg.norm(np.array(self.host_m) - np.array(self.threat_m), axis=1))

    def nearest_m(self) -> float:
        return float(self.apart_m().min())

    def closing(self, *, margin_m: float = 0.0) -> list[tuple[float, float, float]]:
        """Moments in which the host, within the safety distance of the threat and of its track, moves towards both by
        its own motion: time, distance, speed.
        """
        found = []
        for time_s, host, velocity, threat, track in zip(
            self.times_s, self.host_m, self.host_mps, self.threat_m, self.tracked, strict=True
        ):
            if track is None:
                continue
            apart_m = max(math.dist(host, threat), math.dist(host, track[0]))
            speed_mps = min(_towards(host, velocity, threat), _towards(host, velocity, track[0]))
            if apart_m < SAFETY_M - margin_m and speed_mps > OWN_MPS:
                found.append((time_s, apart_m, speed_mps))
        return found

    def at_the_limit_m(self) -> float:
        """How near the threat comes to a host that flees straight from it, at its limit, from each first moment at
        which the track shows it coming.
        """
        least_m, number = math.inf, 0
        while number < len(self.times_s):
            if not self._shown(number):
                number += 1
                continue
            nearest_m, number = self._flees_from(number)
            least_m = min(least_m, nearest_m)
        return least_m

    def _shown(self, number: int) -> bool:
        track = self.tracked[number]
        if track is None:
            return False
        (place, velocity), host = track, np.array(self.host_m[number])
        ways = np.array(place) + np.linspace(0, SHOWN_S, 31)[:, None] * np.array(velocity)
        return bool(np.linalg.norm(ways - host, axis=1).min() < SAFETY_M)

    def _flees_from(self, number: int) -> tuple[float, int]:
        """The least distance of the flight that begins then, and when the next one may begin: it has got away."""
        place, velocity, nearest_m = np.array(self.host_m[number]), np.array(self.host_mps[number]), math.inf
        while number < len(self.times_s):
            away = place - np.array(self.threat_m[number])
            apart_m = float(np.linalg.norm(away))
            nearest_m = min(nearest_m, apart_m)
            if apart_m > SAFETY_M + 5.0:
                break
            change = LIMIT_MPS * away / max(apart_m, 1e-9) - velocity
            size = float(np.linalg.norm(change))
            velocity = velocity + change * min(1.0, LIMIT_MPS2 * TICK_S / max(size, 1e-9))
            place = place + velocity * TICK_S
            number += 1
        return nearest_m, number + 1


def _towards(host: Point, velocity: Point, threat: Point) -> float:
    way = np.array(threat) - np.array(host)
    return float(way @ np.array(velocity) / max(float(np.linalg.norm(way)), 1e-9))


@dataclass(kw_only=True)
class Outcome:
    """What a mission's hosts did."""

    encounters: dict[tuple[str, str], Encounter] = field(default_factory=dict)
    moves: Counter[str] = field(default_factory=Counter)
    told: list[str] = field(default_factory=list)
    """What health said of threatened hosts."""
    on_station: int = 0
    watched: int = 0
    between_m: float = math.inf
    """How near two hosts came to each other."""
    flown_m: float = 0.0

    def watch(self, moment: Moment) -> None:
        mission = moment.mission
        at_s = EPOCH_S + moment.time_s
        places: list[Point] = []
        for host in mission.fleet.hosts:
            state = mission.vehicle(host).state
            place, velocity = mission.sky.hosts_m().get(host.id), state.velocity_enu_mps
            if place is None or velocity is None:
                continue
            self.between_m = min([self.between_m, *(math.dist(place, other) for other in places)])
            places.append(place)
            self.flown_m += math.hypot(*velocity) * TICK_S
            progress = mission.state.progress.get(host.id)
            self.watched += 1
            self.on_station += progress is not None and progress.status is OrderStatus.ON_STATION
            for true in moment.truth:
                track = mission.state.picture.tracks.get(true.id)
                seen = self.encounters.setdefault((host.id, true.id), Encounter())
                seen.times_s.append(moment.time_s)
                seen.host_m.append(place)
                seen.host_mps.append(velocity)
                seen.threat_m.append(true.position_m)
                seen.tracked.append(None if track is None else (track.position_at(at_s), track.velocity_mps))
        told = getattr(mission, "threatened", None)
        self.told += [] if told is None else told.problems(mission.clock())
        self.moves = Counter(type(each.event).__name__ for each in mission.events)

    def nearest_m(self) -> float:
        return min(each.nearest_m() for each in self.encounters.values())

    def closing(self, *, margin_m: float = 0.0) -> list[tuple[float, float, float]]:
        return [each for one in self.encounters.values() for each in one.closing(margin_m=margin_m)]

    def short_of_the_limit_m(self) -> float:
        """By how much threats came nearer than at the limit, or than the safety distance: at worst."""
        return max(min(SAFETY_M, each.at_the_limit_m()) - each.nearest_m() for each in self.encounters.values())

    def stops(self) -> int:
        return self.moves[HostStopped.__name__]

    def departures(self) -> int:
        return self.moves[HostDeparted.__name__]


def flown(
    truth: Truth,
    goals_m: list[Point],
    *,
    duration_s: float = 40.0,
    autopilot: Autopilot = Autopilot.PX4,
    seed: int = 0,
    planning: PlanningRules | None = None,
    solve: Decide | None = None,
    and_watch: Callable[[Moment], None] = lambda _: None,
    **changes: Any,
) -> Outcome:
    """Fly a mission with a host for every hover point."""
    outcome = Outcome()

    def watch(moment: Moment) -> None:
        outcome.watch(moment)
        and_watch(moment)

    flight = Flight(
        truth=truth,
        hosts=len(goals_m),
        duration_s=duration_s,
        autopilot=autopilot,
        seed=seed,
        rules=Rules(autonomy=Autonomy.AUTO, planning=planning or PlanningRules()),
        **{"radar_sigma_m": 0.5, "radar_period_s": 0.5, **changes},
    )
    fly(flight, watch, solve or planner(goals_m))
    return outcome
