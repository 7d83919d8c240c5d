"""Missions in virtual time: what only time shows."""

import pytest

from hsop_gcs.assignment import HostOrder
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.detections import Detection, Direction, Fate
from hsop_gcs.errors import Refused
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import EPOCH_S, Flight, Moment, fly, straight

ONE = straight([TrueState(id="t1", position_m=(0.0, 80.0, 35.0), velocity_mps=(0.5, -0.5, 0.0), size_m=1.0)])
CONFIRM = Rules(autonomy=Autonomy.CONFIRM)


def never(asked: Situation, rules: PlanningRules) -> Decision:
    raise AssertionError(f"nothing to decide, and asked: {asked}, {rules}")


def test_an_approval_comes_too_late_once_the_plan_has_run_out() -> None:
    refusals: list[str] = []

    def solve_once(asked: Situation, rules: PlanningRules) -> Decision:
        if asked.now_s > EPOCH_S + 6.0:
            raise RuntimeError("the solver is broken")
        orders = tuple(
            HostOrder(host=mover.id, position_m=mover.position_m, heading_deg=0.0, aim=None, views=())
            for mover in asked.movers
        )
        placement = Placement(status=Status.FEASIBLE, formulation=rules.formulation, objective=rules.objective)
        return Decision(placement=placement, threats=asked.threats, window_start_s=asked.now_s, orders=orders)

    def approve_late(moment: Moment) -> None:
        plan = moment.mission.state.plans.proposed
        if plan is not None and moment.mission.clock() > plan.expires_at_s and not refusals:
            with pytest.raises(Refused, match=f"plan {plan.id} ran out") as refused:
                moment.mission.approve(plan.id)
            refusals.append(str(refused.value))

    fly(Flight(truth=ONE, hosts=2, duration_s=20.0, rules=CONFIRM), approve_late, solve_once)
    assert len(refusals) == 1


def test_a_planner_that_does_not_answer_is_told_as_awaited_until_it_does() -> None:
    told: list[tuple[bool, str | None]] = []

    def watch(moment: Moment) -> None:
        mission = moment.mission
        told.append((mission.state.plans.newest is not None, mission.awaited.get("planner")))

    def solve(asked: Situation, rules: PlanningRules) -> Decision:
        placement = Placement(status=Status.INFEASIBLE, formulation=rules.formulation, objective=rules.objective)
        return Decision(placement=placement, threats=asked.threats, window_start_s=asked.now_s)

    rules = Rules(planning=PlanningRules(time_limit_s=1.0))
    fly(Flight(truth=ONE, hosts=2, duration_s=14.0, rules=rules, solve_s=9.0), watch, solve)
    late = [index for index, (_, reason) in enumerate(told) if reason is not None]
    assert told[late[0]][1] == "the planner has not answered for 6 s; planning.time_limit_s is 1"
    assert late[-1] < len(told) - 1, "it has answered"
    assert len(late) == late[-1] - late[0] + 1 in range(12, 18)


def test_a_ray_nothing_explains_is_let_go_though_no_other_detection_comes() -> None:
    held: list[float] = []

    def watch(moment: Moment) -> None:
        mission, now_s = moment.mission, moment.mission.clock()
        if not held:
            up = Direction(azimuth_deg=0.0, elevation_deg=80.0, sigma_deg=3.0)
            seen = Detection(host="h1", camera=CameraKind.CENTRAL, time_s=now_s - 0.1, seen=up)
            (verdict,) = mission.detect([seen])
            assert verdict.fate is Fate.HELD
            held.append(now_s)
        elif now_s > held[0] + 1.5:
            assert mission.state.watch.held == ()
            assert mission.state.watch.counts.unexplained == 1
            held.append(now_s)

    fly(Flight(truth=straight([]), hosts=2, duration_s=6.0, rules=CONFIRM), watch, never)
    assert len(held) > 1
    assert held[0] > EPOCH_S
