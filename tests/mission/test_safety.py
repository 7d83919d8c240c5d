"""What must hold whatever is planned: holding, recalling, staying on the ground, going on without a host that fails.

Whole missions in virtual time: the service's own controller and link, simulated vehicles, a planner that always gives
the same answer.
"""

import math
from collections.abc import Callable

import pytest

from hsop_gcs.assignment import HostOrder
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.pipeline import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.problem import Formulation, Objective, Point
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.simulator.faults import Fault, parse_fault
from hsop_gcs.simulator.fleet import Autopilot
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import Flight, Moment, Truth, fly, straight

FAR = straight([TrueState(id="t1", position_m=(0.0, 400.0, 30.0), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)])
EAST = straight([TrueState(id="t2", position_m=(400.0, 0.0, 30.0), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)])
GOALS: list[Point] = [(-30.0, 120.0, 30.0), (60.0, 120.0, 30.0)]
STACKS = pytest.mark.parametrize("autopilot", list(Autopilot))


class Planner:
    """Sends the first two hosts that can be sent to the two points, until one of them cannot any more."""

    def __init__(self) -> None:
        self.chosen: list[str] = []

    def __call__(self, asked: Situation, _rules: PlanningRules) -> Decision:
        placement = Placement(status=Status.FEASIBLE, formulation=Formulation.OPERATIONAL, objective=Objective.LETTER)
        available = [mover.id for mover in asked.movers]
        keeps = asked.flying is not None and set(self.chosen) <= set(available)
        self.chosen = self.chosen if keeps else available[:2]
        ahead = Aim(pan_deg=0.0, tilt_deg=0.0)
        orders = tuple(
            HostOrder(host=host, position_m=goal, heading_deg=0.0, aim=ahead, views=())
            for host, goal in zip(self.chosen, GOALS, strict=False)
        )
        return Decision(
            placement=placement,
            threats=asked.threats,
            window_start_s=asked.now_s + 20.0,
            orders=orders if len(orders) == 2 else (),
            reason="" if len(orders) == 2 else "two hosts are needed",
            keeps=keeps,
        )


def flown(
    watch: Callable[[Moment], None],
    *,
    duration_s: float,
    hosts: int = 2,
    autopilot: Autopilot = Autopilot.PX4,
    faults: tuple[Fault, ...] = (),
    altitude_m: float = 30.0,
    truth: Truth = FAR,
    solve_s: float = 0.5,
    attempts: int = 3,
) -> Mission:
    rules = Rules(autonomy=Autonomy.AUTO, planning=PlanningRules(horizon_s=60.0), attempts=attempts)
    flight = Flight(
        truth=truth,
        hosts=hosts,
        duration_s=duration_s,
        autopilot=autopilot,
        faults=faults,
        altitude_m=altitude_m,
        solve_s=solve_s,
        rules=rules,
        radar_sigma_m=0.5,
        camera_period_s=0.5,
    )
    return fly(flight, watch, Planner())


def places_m(mission: Mission) -> dict[str, Point]:
    return mission.sky.hosts_m()


def kinds(mission: Mission, host: str | None = None) -> list[str]:
    return [type(each.event).__name__ for each in mission.events if host is None or each.host == host]


def moved_m(before: dict[str, Point], after: dict[str, Point]) -> float:
    return max(math.dist(before[host], after[host]) for host in before)


@STACKS
def test_hold_all_stops_everybody_at_once_while_the_planner_works(autopilot: Autopilot) -> None:
    seen: dict[str, dict[str, Point]] = {}

    def second_threat(time_s: float) -> list[TrueState]:
        return FAR(time_s) + ([] if time_s < 12.0 else EAST(time_s))

    def watch(moment: Moment) -> None:
        mission = moment.mission
        if moment.time_s == pytest.approx(12.0, abs=0.01):
            assert {str(each.status) for each in mission.state.progress.values()} == {"accepted"}
        elif moment.time_s == pytest.approx(16.0, abs=0.01):
            assert mission.state.asked is not None, "the planner works"
            seen["flying"] = places_m(mission)
            assert mission.hold() == ["h1", "h2"]
        elif moment.time_s == pytest.approx(20.0, abs=0.01):
            assert mission.state.asked is not None, "the planner still works"
            seen["held"] = places_m(mission)

    mission = flown(watch, duration_s=28.0, autopilot=autopilot, solve_s=8.0, truth=second_threat)
    assert moved_m(seen["flying"], seen["held"]) < 20.0
    assert moved_m(seen["flying"], places_m(mission)) < 20.0
    for host in mission.fleet.hosts:
        assert math.hypot(*(mission.vehicle(host).state.velocity_enu_mps or (math.inf,))) < 1.0
    assert mission.state.autonomy is Autonomy.CONFIRM
    assert mission.state.progress == {}
    assert kinds(mission).count("HostDeparted") == 2


@STACKS
def test_recall_brings_everybody_home_and_nothing_sends_them_out_again(autopilot: Autopilot) -> None:
    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(8.0, abs=0.01):
            assert moment.mission.recall() == ["h1", "h2"]

    mission = flown(watch, duration_s=30.0, autopilot=autopilot)
    assert {mission.vehicle(host).state.mode for host in mission.fleet.hosts} <= {"Return", "RTL", "Land"}
    assert all(math.hypot(east, north) < 20.0 for east, north, _ in places_m(mission).values())
    assert mission.state.why_aside("h1", mission.clock()) == "recalled by the operator"
    assert kinds(mission).count("HostDeparted") == 2


def test_nobody_takes_off_unless_an_operator_says_so() -> None:
    def watch(moment: Moment) -> None:
        mission = moment.mission
        states = [mission.vehicle(host).state for host in mission.fleet.hosts]
        if moment.time_s < 15.0:
            assert not any(state.armed or state.in_air for state in states)
        elif moment.time_s == pytest.approx(15.0, abs=0.01):
            assert mission.sky.closings["armed"] == 2
            assert mission.state.plans.flying is None
            mission.take_off(20.0, ["h1"])

    mission = flown(watch, duration_s=32.0, altitude_m=0.0)
    in_air = {host.id: mission.vehicle(host).state.in_air for host in mission.fleet.hosts}
    assert in_air == {"h1": True, "h2": False}


def test_after_a_release_plans_fly_by_themselves_again() -> None:
    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(8.0, abs=0.01):
            moment.mission.hold()
        elif moment.time_s == pytest.approx(16.0, abs=0.01):
            assert moment.mission.state.progress == {}
            moment.mission.release()

    mission = flown(watch, duration_s=20.0)
    assert mission.state.autonomy is Autonomy.AUTO
    assert kinds(mission).count("HostDeparted") == 4


@pytest.mark.parametrize(
    ("fault", "attempts", "event", "reason", "duration_s"),
    [
        ("h1:ignore=DO_REPOSITION", 2, "OrderFailed", "its order failed 2 times", 40.0),
        ("h1:gimbal-taken@8+200", 1, "GimbalControlLost", "its order failed 1 times", 35.0),
    ],
    ids=["it does not fly", "its gimbal is taken"],
)
def test_the_mission_goes_on_without_a_host_that(
    fault: str, attempts: int, event: str, reason: str, duration_s: float
) -> None:
    reasons: set[str | None] = set()

    def watch(moment: Moment) -> None:
        reasons.add(moment.mission.state.why_aside("h1", moment.mission.clock()))

    faults = (parse_fault(fault, 3),)
    mission = flown(watch, duration_s=duration_s, hosts=3, faults=faults, attempts=attempts)
    assert any(each is not None and each.startswith(reason) for each in reasons), reasons
    assert event in kinds(mission, "h1")
    plan = mission.state.plans.flying
    assert plan is not None
    assert [order.host for order in plan.decision.orders] == ["h2", "h3"]


def test_a_host_that_somebody_else_flies_is_not_stopped_and_not_sent() -> None:
    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(12.0, abs=0.01):
            moment.mission.link.return_to_launch(1)

    mission = flown(watch, duration_s=30.0, hosts=3)
    mode = mission.vehicle(mission.fleet.hosts[0]).state.mode
    assert mode in ("Return", "Land")
    assert mission.sky.closings["mode"] == 1
    plan = mission.state.plans.flying
    assert plan is not None
    assert [order.host for order in plan.decision.orders] == ["h2", "h3"]
