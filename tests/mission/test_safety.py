"""What must hold whatever is planned: holding, recalling, staying on the ground, going on without a host that fails.

Whole missions in virtual time: the service's own controller and link, simulated vehicles, a planner that always gives
the same answer.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hsop_gcs.assignment import HostOrder
from hsop_gcs.disk import DiskWatch
from hsop_gcs.errors import Refused
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.journal import Journal
from hsop_gcs.link.events import CommandFinished
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.core import MissionState, Wish
from hsop_gcs.mission.inputs import HostSetAside, HostStopped, Rules, WishLapsed
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Formulation, Objective, Point
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.simulator.battery import BatteryConfig
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
    planning: PlanningRules | None = None,
    battery: BatteryConfig | None = None,
    journal: Journal | None = None,
    recovered: MissionState | None = None,
    disk: DiskWatch | None = None,
) -> Mission:
    planning = planning or PlanningRules(horizon_s=60.0)
    rules = Rules(autonomy=Autonomy.AUTO, planning=planning, attempts=attempts)
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
        battery=battery or BatteryConfig(),
    )
    return fly(flight, watch, Planner(), journal, recovered, disk)


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
    assert {at.reason for at in mission.unavailable().values()} == {"recalled by the operator"}, (
        "nobody else flies them"
    )
    assert kinds(mission).count("HostDeparted") == 2


@STACKS
def test_a_recall_sends_nothing_to_a_host_on_the_ground_and_it_takes_off_when_told(autopilot: Autopilot) -> None:
    modes: set[str | None] = set()

    def watch(moment: Moment) -> None:
        mission = moment.mission
        if moment.time_s == pytest.approx(15.0, abs=0.01):
            assert mission.recall(["h1"]) == ["h1"]
            assert mission.on_the_ground(["h1", "h2"]) == ["h1", "h2"]
        elif 15.0 < moment.time_s < 20.0:
            modes.add(mission.vehicle(mission.fleet.hosts[0]).state.mode)
        elif moment.time_s == pytest.approx(20.0, abs=0.01):
            assert mission.state.pending == {}
            mission.take_off(20.0, ["h1"])

    mission = flown(watch, duration_s=40.0, altitude_m=0.0, autopilot=autopilot)
    assert modes.isdisjoint({"Return", "RTL"})
    assert mission.vehicle(mission.fleet.hosts[0]).state.in_air
    assert "TookOff" in kinds(mission, "h1")


def test_a_recall_gives_up_a_take_off_that_has_not_left_the_ground() -> None:
    def watch(moment: Moment) -> None:
        mission = moment.mission
        if moment.time_s == pytest.approx(15.0, abs=0.01):
            mission.take_off(20.0, ["h1"])
        elif moment.time_s == pytest.approx(17.0, abs=0.01):
            status = mission.vehicle(mission.fleet.hosts[0]).take_off_status
            assert status == "arming: COMPONENT_ARM_DISARM: FAILED (Arm: Compass not healthy)"
            mission.recall(["h1"])

    fault = parse_fault("deny-arm@0+18", 2)
    mission = flown(watch, duration_s=35.0, altitude_m=0.0, autopilot=Autopilot.ARDUPILOT, faults=(fault,))
    assert mission.vehicle(mission.fleet.hosts[0]).state.armed is False
    assert mission.state.pending == {}
    assert "OrderSuperseded" in kinds(mission, "h1")


def test_a_recall_brings_back_what_left_the_ground_as_it_was_ordered() -> None:
    def watch(moment: Moment) -> None:
        mission = moment.mission
        state = mission.vehicle(mission.fleet.hosts[0]).state
        if moment.time_s == pytest.approx(15.0, abs=0.01):
            mission.take_off(20.0, ["h1"])
        elif moment.time_s > 15.0 and state.armed and not mission.state.held and not state.in_air:
            mission.recall(["h1"])

    mission = flown(watch, duration_s=60.0, altitude_m=0.0, autopilot=Autopilot.ARDUPILOT)
    assert not mission.vehicle(mission.fleet.hosts[0]).state.in_air
    assert mission.state.pending == {}


def test_nobody_takes_off_unless_an_operator_says_so() -> None:
    def watch(moment: Moment) -> None:
        mission = moment.mission
        states = [mission.vehicle(host).state for host in mission.fleet.hosts]
        if moment.time_s < 15.0:
            assert not any(state.armed or state.in_air for state in states)
        elif moment.time_s == pytest.approx(15.0, abs=0.01):
            assert {host: at.gate for host, at in mission.unavailable().items()} == {"h1": "armed", "h2": "armed"}
            assert mission.state.plans.flying is None
            mission.take_off(20.0, ["h1"])
        elif states[0].in_air and (altitude_m := states[0].altitude_above_home_m or 0.0) < 18.0:
            assert altitude_m < 18.0
            assert mission.unavailable()["h1"].reason == "it takes off, as it was ordered"

    mission = flown(watch, duration_s=32.0, altitude_m=0.0)
    in_air = {host.id: mission.vehicle(host).state.in_air for host in mission.fleet.hosts}
    assert in_air == {"h1": True, "h2": False}


AWAY = KeepOut(polygon=((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)))
OVERHEAD = straight([TrueState(id="t1", position_m=(8.0, -6.0, 20.0), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)])


@STACKS
@pytest.mark.parametrize(
    ("world", "gate", "reason"),
    [
        ({"battery": BatteryConfig(percent=15.0)}, "battery", "15 % left"),
        ({"faults": (parse_fault("h1:link-cut@6", 2),)}, "link", "no link"),
        ({"faults": (parse_fault("h1:gps-lost@6", 2),)}, "position", ""),
        ({"planning": PlanningRules(airspace=Airspace(inside=(((50, 50), (90, 50), (90, 90)),)))}, "fence", "outside"),
        ({"planning": PlanningRules(airspace=Airspace(keep_outs=(AWAY,)))}, "keep-out", "inside"),
        ({"planning": PlanningRules(airspace=Airspace(keep_outs=(replace(AWAY, floor_m=10),)))}, "climb", "keep-out"),
        ({"planning": PlanningRules(limits=FlightLimits(ceiling_m=15.0))}, "ceiling", "20 m above the origin is over"),
        ({"truth": OVERHEAD}, "climb", "from threat"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_nobody_takes_off_unless_all_pass_their_gates(
    autopilot: Autopilot, world: dict[str, Any], gate: str, reason: str
) -> None:
    refusals: list[str] = []

    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(12.0, abs=0.01):
            with pytest.raises(Refused) as refused:
                moment.mission.take_off(20.0)
            refusals.append(str(refused.value))

    mission = flown(watch, duration_s=16.0, altitude_m=0.0, autopilot=autopilot, **world)
    (told,) = refusals
    assert told.startswith(f"host h1 does not take off, gate {gate}")
    assert reason in told
    assert not any(mission.vehicle(host).state.armed for host in mission.fleet.hosts)


def test_nobody_climbs_past_a_host_in_the_air_and_nobody_takes_off_twice() -> None:
    refusals: list[str] = []

    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(5.0, abs=0.01):
            assert moment.mission.take_off(20.0, ["h1"]) == ["h1"]
        elif moment.time_s == pytest.approx(28.0, abs=0.01):
            for host in ("h1", "h2"):
                with pytest.raises(Refused) as refused:
                    moment.mission.take_off(20.0, [host])
                refusals.append(str(refused.value))

    flown(watch, duration_s=30.0, altitude_m=0.0, planning=PlanningRules(min_separation_m=15.0))
    assert refusals == [
        "host h1 does not take off, gate on the ground: the vehicle is in the air",
        "host h2 does not take off, gate separation: h1 is in the way of its climb",
    ]


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


def test_a_host_that_drifts_away_for_good_is_tried_again_and_then_planned_without() -> None:
    reasons: set[str] = set()
    ordered: list[tuple[str, ...]] = []

    def watch(moment: Moment) -> None:
        mission = moment.mission
        if moment.time_s == pytest.approx(35.0, abs=0.01):
            assert {str(each.status) for each in mission.state.progress.values()} == {"on station"}
        aside, plan = mission.state.why_aside("h2", mission.clock()), mission.state.plans.flying
        reasons.update({aside} if aside else ())
        hosts = () if plan is None else tuple(order.host for order in plan.decision.orders)
        if hosts not in ordered[-1:]:
            ordered.append(hosts)

    mission = flown(watch, duration_s=150.0, hosts=3, faults=(parse_fault("h2:gale@35", 3),), attempts=2)
    telling = {"Drifted", "OrderFailed", "HostRetried", "HostSetAside"}
    happened = [kind for kind in kinds(mission, "h2") if kind in telling]
    assert happened == ["Drifted", "OrderFailed", "HostRetried", "OrderFailed", "HostSetAside"]
    (reason,) = reasons
    assert reason.startswith("its order failed 2 times: not there after")
    assert ordered == [(), ("h1", "h2"), ("h1", "h3")]


def test_a_battery_that_falls_below_its_reserve_in_flight_stops_the_host_there() -> None:
    stopped_m: dict[str, Point] = {}

    def watch(moment: Moment) -> None:
        if "HostStopped" in kinds(moment.mission) and not stopped_m:
            stopped_m.update(places_m(moment.mission))

    battery = BatteryConfig(percent=20.5, endurance_s=1000.0)
    mission = flown(watch, duration_s=24.0, battery=battery)
    stops = [each.event for each in mission.events if isinstance(each.event, HostStopped)]
    assert sorted((stop.host, stop.gate) for stop in stops) == [("h1", "battery"), ("h2", "battery")]
    assert stops[0].reason == "the battery has 19 % left, less than the reserve of 20 %"
    assert moved_m(stopped_m, places_m(mission)) < 20.0
    assert min(math.dist(places_m(mission)[host], goal) for host, goal in zip(("h1", "h2"), GOALS, strict=True)) > 20.0
    assert mission.state.pending == {}
    assert {str(each.status) for each in mission.state.progress.values()} == {"waiting"}
    assert mission.why_waiting(mission.fleet.hosts[0]) == stops[0].reason


@STACKS
def test_a_failsafe_that_the_autopilot_began_is_left_to_it(autopilot: Autopilot) -> None:
    fault = parse_fault("h1:gps-lost@8", 3)
    mission = flown(lambda _moment: None, duration_s=20.0, hosts=3, faults=(fault,), autopilot=autopilot)
    assert mission.vehicle(mission.fleet.hosts[0]).state.mode == "Land"
    of_h1 = [each for each in mission.events if each.host == "h1"]
    left_s = next(each.time_s for each in of_h1 if isinstance(each.event, WishLapsed | HostSetAside))
    told_s = [each.time_s for each in of_h1 if isinstance(each.event, CommandFinished)]
    assert max(told_s, default=left_s) < left_s + 1.0, "it is not commanded any more"
    assert mission.clock() > left_s + 6.0
    assert mission.state.pending == {}
    plan = mission.state.plans.flying
    assert plan is not None
    assert [order.host for order in plan.decision.orders] == ["h2", "h3"]


@STACKS
def test_a_host_that_falls_silent_in_flight_is_stopped_when_it_is_heard_again(autopilot: Autopilot) -> None:
    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(13.0, abs=0.01):
            pending = moment.mission.state.pending["h1"]
            assert (pending.wish, pending.by_operator) == (Wish.HOLD, False)

    mission = flown(watch, duration_s=30.0, hosts=3, autopilot=autopilot, faults=(parse_fault("h1:link-cut@7+6.5", 3),))
    stop = next(each.event for each in mission.events if isinstance(each.event, HostStopped))
    assert (stop.host, stop.gate, stop.reason) == ("h1", "position", "the vehicle's position is not known")
    assert mission.state.pending == {}
    assert math.dist(places_m(mission)["h1"], GOALS[0]) > 15.0
    assert math.hypot(*(mission.vehicle(mission.fleet.hosts[0]).state.velocity_enu_mps or (math.inf,))) < 1.0
    plan = mission.state.plans.flying
    assert plan is not None
    assert [order.host for order in plan.decision.orders] == ["h2", "h3"]


def recalled_unheard(moment: Moment) -> None:
    if moment.time_s == pytest.approx(8.0, abs=0.01):
        assert moment.mission.recall() == ["h1", "h2"]
    elif moment.time_s == pytest.approx(14.0, abs=0.01):
        assert set(moment.mission.state.pending) == {"h1"}


@STACKS
def test_a_recall_that_is_not_heard_is_ordered_when_the_host_is_heard_again(autopilot: Autopilot) -> None:
    mission = flown(
        recalled_unheard, duration_s=24.0, autopilot=autopilot, faults=(parse_fault("h1:link-cut@7+10", 2),)
    )
    assert {mission.vehicle(host).state.mode for host in mission.fleet.hosts} <= {"Return", "RTL", "Land"}
    assert mission.state.pending == {}


def test_a_release_takes_back_a_recall_that_was_not_heard() -> None:
    def watch(moment: Moment) -> None:
        recalled_unheard(moment)
        if moment.time_s == pytest.approx(15.0, abs=0.01):
            moment.mission.release()

    mission = flown(watch, duration_s=24.0, faults=(parse_fault("h1:link-cut@7+10", 2),))
    assert mission.state.pending == {}
    assert mission.vehicle(mission.fleet.hosts[0]).state.mode == "Hold"


def test_a_recall_that_was_not_heard_outlasts_the_service(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    with Journal(path) as journal:
        ended = flown(recalled_unheard, duration_s=15.0, faults=(parse_fault("h1:link-cut@7+10", 2),), journal=journal)
    with resumed(path) as (journal, recovered):
        assert recovered == ended.state
        assert recovered.pending["h1"].wish is Wish.RECALL
        again = flown(lambda _moment: None, duration_s=6.0, recovered=recovered, journal=journal)
    modes = [again.vehicle(host).state.mode for host in again.fleet.hosts]
    assert modes == ["Return", "Hold"], "the one that had confirmed is not ordered again"
    assert again.state.pending == {}
    with resumed(path) as (_, recovered):
        assert recovered == again.state
