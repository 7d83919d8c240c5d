"""A whole mission without sockets, processes or wall-clock time: the service's own controller and link, simulated
vehicles and their cameras, threats and a radar, all on a virtual clock. For tests and measurements.

    truth ─▶ radar, 1 Hz ───────────────────▶ reports ─▶ mission ─▶ link ─▶ simulated vehicles
      └────▶ cameras of the vehicles, 5 Hz ─▶ detections ──┘  ▲                    │
                                                              └──── telemetry ─────┘
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hsop_gcs.detections import Detection
from hsop_gcs.disk import DiskWatch
from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.journal import Journal
from hsop_gcs.link.pump import Link
from hsop_gcs.mission.clock import MissionClock
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.core import MissionState
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.solver import Solver
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.reports import Report, Site
from hsop_gcs.simulator.battery import BatteryConfig
from hsop_gcs.simulator.disturbances import GpsError
from hsop_gcs.simulator.eyes import Viewer, look
from hsop_gcs.simulator.faults import Fault
from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid
from hsop_gcs.simulator.lookout import pose_of
from hsop_gcs.simulator.truth import TrueState
from tests.virtual import run, sleep_until

ORIGIN = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)
EPOCH_S = 1_800_000_000.0
PORT = 14550

UTC = Callable[[float], float]
"""What a clock shows at a time after the epoch."""
Truth = Callable[[float], list[TrueState]]
"""The threats at a time, seconds after the epoch."""
Decide = Callable[[Situation, PlanningRules], Decision]


def true_utc(time_s: float) -> float:
    return EPOCH_S + time_s


@dataclass(frozen=True, kw_only=True)
class Flight:
    """What happens, and for how long."""

    truth: Truth
    hosts: int
    duration_s: float
    seed: int = 0
    rules: Rules = field(default_factory=lambda: Rules(autonomy=Autonomy.AUTO))
    altitude_m: float = 30.0
    autopilot: Autopilot = Autopilot.PX4
    radar_sigma_m: float = 15.0
    radar_period_s: float = 1.0
    camera_period_s: float = 0.2
    faults: tuple[Fault, ...] = ()
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    gps: GpsError = field(default_factory=GpsError)
    latency_s: float = 0.1
    """From an exposure to the service."""
    solve_s: float = 0.5
    """What a decision takes of the virtual time."""
    wall: UTC = true_utc
    """The system clock of the service."""
    radar_clock: UTC = true_utc
    cameras_clock: UTC = true_utc


@dataclass(frozen=True, kw_only=True)
class Moment:
    """Once every camera period: who sees what, and the mission after hearing of it."""

    time_s: float
    """After the epoch."""
    truth: Sequence[TrueState]
    seen_by: dict[str, set[str]]
    """The hosts that detect each threat."""
    mission: Mission


def decide_in_rounds(rounds: int) -> Decide:
    """Decide with so many rounds of the search, whatever the machine: the same way each time."""
    return lambda asked, rules: decide(asked, rules, now=lambda: 0.0, iterations=(rounds, rounds))


def fly(
    flight: Flight,
    watch: Callable[[Moment], None],
    solve: Decide,
    journal: Journal | None = None,
    recovered: MissionState | None = None,
    disk: DiskWatch | None = None,
) -> Mission:
    """Fly a mission to its end in virtual time; return it as it then stands. recovered: how an earlier one ended."""
    return run(_fly(flight, watch, solve, journal, recovered, disk))


class _Solver(Solver):
    """Decides at once, and gives the answer when it is due."""

    def __init__(self, solve: Decide, solve_s: float) -> None:
        super().__init__()
        self._solve = solve
        self._solve_s = solve_s

    async def decide(self, situation: Situation, rules: PlanningRules) -> Decision:
        decision = self._solve(situation, rules)
        await asyncio.sleep(self._solve_s)
        return decision

    @property
    def ready(self) -> bool:
        return True


async def _fly(
    flight: Flight,
    watch: Callable[[Moment], None],
    solve: Decide,
    journal: Journal | None,
    recovered: MissionState | None,
    disk: DiskWatch | None,
) -> Mission:
    loop = asyncio.get_running_loop()
    clock = MissionClock(
        lambda: flight.wall(loop.time()), loop.time, before=recovered.timeline if recovered is not None else None
    )
    hosts = [Host(id=f"h{n}", system_id=n, connection=f"udpin:127.0.0.1:{PORT}") for n in range(1, flight.hosts + 1)]
    fleet = SimulatedFleet(
        FleetConfig(
            autopilot=flight.autopilot,
            homes=grid(ORIGIN, flight.hosts, 12.0),
            target=("127.0.0.1", PORT),
            shared_port=True,
            local_port=0,
            airborne_m=flight.altitude_m,
            seed=flight.seed,
            faults=flight.faults,
            battery=flight.battery,
            gps=flight.gps,
        ),
        clock=loop.time,
    )
    site = Site(frame=LocalFrame(ORIGIN))
    async with Link([hosts[0].connection], [host.system_id for host in hosts]) as link:
        mission = Mission(
            fleet=Fleet(hosts=tuple(hosts)),
            site=site,
            link=link,
            solver=_Solver(solve, flight.solve_s),
            clock=clock,
            rules=flight.rules,
            journal=journal,
            recovered=recovered,
            disk=disk,
        )
        await fleet.start()
        tasks = [
            loop.create_task(work)
            for work in (mission.run(), _radar(flight, mission), _cameras(flight, mission, fleet, watch))
        ]
        await asyncio.wait([*tasks, loop.create_task(asyncio.sleep(flight.duration_s))], return_when="FIRST_COMPLETED")
        for task in tasks:
            task.cancel()
        for ended in await asyncio.gather(*tasks, return_exceptions=True):
            if not isinstance(ended, asyncio.CancelledError):
                raise RuntimeError("a part of the mission ended before it") from (
                    ended if isinstance(ended, BaseException) else None
                )
        await fleet.close()
    assert not mission.fault_counts, f"faults are contained, and must not be there: {dict(mission.fault_counts)}"
    return mission


async def _radar(flight: Flight, mission: Mission) -> None:
    rng = np.random.default_rng([flight.seed, 1])
    due_s = 2.0
    while True:
        await sleep_until(due_s)
        reports = []
        for state in flight.truth(due_s):
            x, y, z = (np.array(state.position_m) + flight.radar_sigma_m * rng.standard_normal(3)).tolist()
            reports.append(
                Report(
                    source="radar",
                    threat_id=state.id,
                    time_s=flight.radar_clock(due_s),
                    position_m=(x, y, z),
                    sigma_m=flight.radar_sigma_m,
                )
            )
        if reports:
            mission.submit(reports)
        due_s += flight.radar_period_s


async def _cameras(flight: Flight, mission: Mission, fleet: SimulatedFleet, watch: Callable[[Moment], None]) -> None:
    rng = np.random.default_rng([flight.seed, 2])
    due_s = 2.0
    while True:
        await sleep_until(due_s)
        fleet.advance()
        viewers = [
            Viewer(host=host.id, pose=pose_of(vehicle, mission.site.frame))
            for host, vehicle in zip(mission.fleet.hosts, fleet.vehicles, strict=True)
        ]
        truth = flight.truth(due_s)
        seen: list[Detection] = []
        seen_by: dict[str, set[str]] = {state.id: set() for state in truth}
        for state in truth:
            images = look(viewers, [state], flight.cameras_clock(due_s), rng)
            seen_by[state.id] = {image.host for image in images}
            seen += images
        await sleep_until(due_s + flight.latency_s)
        if seen:
            # as a detector gives them: image by image, in no order of threats
            order = rng.permutation(len(seen))
            mission.detect([seen[index] for index in order])
        due_s += flight.camera_period_s
        watch(Moment(time_s=due_s, truth=flight.truth(due_s), seen_by=seen_by, mission=mission))


def straight(starts: Sequence[TrueState]) -> Truth:
    """Threats that fly straight on."""

    def at(time_s: float) -> list[TrueState]:
        moved = [np.array(each.position_m) + time_s * np.array(each.velocity_mps) for each in starts]
        places = [place.tolist() for place in moved]
        return [replace(each, position_m=(x, y, z)) for each, (x, y, z) in zip(starts, places, strict=True)]

    return at
