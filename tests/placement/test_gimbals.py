"""Gimbals that cannot look everywhere: no plan asks for an aim beyond their limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.placement import Method, place
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.holding import held_over
from hsop_gcs.placement.objective import margins
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat
from hsop_gcs.placement.search.elements import AIM, list_elements, poses_of
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of, state_of
from hsop_gcs.placement.solution import Placement
from tests.placement.search.test_kernels import annealed, assert_gradients
from tests.placement.test_operational import assert_flyable, flying, solve, unhurried

DOWNWARD = CameraRig(tilt_deg=(-90.0, -10.0))
AHEAD = CameraRig(pan_deg=(-20.0, 30.0))
ROOM = Airspace(floor_m=5.0, ceiling_m=110.0)


def assert_aims_within_limits(problem: Problem, placement: Placement) -> int:
    """Hold every aim against the limits; return how many central cameras are in use."""
    used = 0
    for pose in placement.hosts:
        if pose.pan_deg is None:
            continue
        rig = problem.rig_of(pose.host)
        assert rig.tilt_deg[0] <= pose.tilt_deg <= rig.tilt_deg[1]
        off = (pose.pan_deg - pose.heading_deg + 180.0) % 360.0 - 180.0
        assert rig.pan_deg[0] <= off <= rig.pan_deg[1]
        used += 1
    views = {pair.threat: pair.views for pair in placement.pairs}
    assert margins(problem, placement.hosts, views).gimbal_deg >= 0
    return used


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("rig", [DOWNWARD, AHEAD, CameraRig(tilt_deg=(-30.0, 0.0), pan_deg=(-40.0, 10.0))])
@pytest.mark.parametrize("seed", range(2))
def test_no_plan_asks_a_gimbal_for_what_it_cannot_give(rig: CameraRig, objective: Objective, seed: int) -> None:
    problem = Problem(threats=flying(3, seed), rig=rig, objective=objective, airspace=ROOM, safety_distance_m=15.0)
    placement = solve(problem, 5)
    assert_flyable(problem, placement)
    assert assert_aims_within_limits(problem, placement) > 0
    unlimited = replace(problem, rig=CameraRig())
    free = place(unlimited, n_hosts=5, warm_start=placement, now=unhurried, iterations=4)
    assert placement.lower_bound <= (placement.cost or 0.0)
    assert (free.cost or math.inf) <= 1.0001 * (placement.cost or 0.0)
    held = held_over(placement, problem)
    assert held is not None
    assert_aims_within_limits(problem, held)


def test_hosts_that_only_look_down_hover_above_their_threat() -> None:
    threat = Threat(id="a", position_m=(0.0, 0.0, 40.0))
    problem = Problem(threats=(threat,), rig=replace(DOWNWARD, tilt_deg=(-90.0, -45.0)), airspace=ROOM)
    placement = solve(problem, 2)
    assert assert_aims_within_limits(problem, placement) == 2
    for pose in placement.hosts:
        down = math.degrees(math.atan2(pose.position_m[2] - 40.0, math.hypot(*pose.position_m[:2])))
        assert down >= 45.0 - 53.0 / 2 - 1e-4


def test_a_host_turns_its_other_side_to_what_its_gimbal_does_not_reach() -> None:
    half = CameraRig(pan_deg=(-100.0, 100.0))
    problem = Problem(threats=flying(3, 4), rig=half, airspace=ROOM)
    free = replace(problem, rig=CameraRig())
    limited, anywhere = solve(problem, 4), solve(free, 4)
    assert limited.cost == anywhere.cost
    assert_aims_within_limits(problem, limited)


def test_the_slopes_of_rules_that_hold_an_aim_are_their_differences() -> None:
    problem = Problem(threats=flying(3, 1), rig=DOWNWARD, airspace=ROOM)
    q, state = annealed(problem, 4, seed=0)
    rows = list_elements(q, state, np.ones(4, dtype=np.int64))
    assert AIM in rows[:, 0]
    assert_gradients(q, rows, poses_of(q, state))


def test_an_earlier_plan_comes_back_with_the_same_aims() -> None:
    problem = Problem(threats=flying(2, 1), rig=AHEAD, airspace=ROOM)
    placement = solve(problem, 3)
    frame = frame_of(problem)
    q = question_of(problem, frame)
    again = placement_of(problem, frame, q, state_of(problem, frame, q, placement, 3))
    for pose in placement.hosts:
        other = min(again.hosts, key=lambda each: math.dist(each.position_m, pose.position_m))
        assert (pose.pan_deg is None) == (other.pan_deg is None)
        if pose.pan_deg is not None and other.pan_deg is not None:
            assert math.cos(math.radians(pose.pan_deg - other.pan_deg)) == pytest.approx(1.0, abs=1e-9)
    assert_aims_within_limits(problem, again)


def test_in_the_letters_plane_only_pans_are_limited_and_tilts_clipped() -> None:
    threats = (Threat(id="a", position_m=(0.0, 0.0, 40.0), velocity_mps=(1.0, 0.0, 0.0)),)
    rig = replace(AHEAD, tilt_deg=(-90.0, -5.0))
    problem = Problem(threats=threats, rig=rig, formulation=Formulation.LETTER)
    placement = solve(problem, 2)
    assert assert_aims_within_limits(problem, placement) == 2
    assert all(pose.tilt_deg == -5.0 for pose in placement.hosts)


def test_the_letters_methods_refuse_gimbals_that_cannot_look_around() -> None:
    with pytest.raises(BadInput, match="tilt_deg: method 'letter' knows no limits"):
        place(Problem(threats=flying(1, 0), rig=DOWNWARD), method=Method.LETTER, now=unhurried)


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"tilt_deg": (-91.0, 0.0)}, "tilt_deg: must be two numbers from -90 to 90"),
        ({"tilt_deg": (10.0, 0.0)}, "tilt_deg: must be two numbers"),
        ({"pan_deg": (10.0, 20.0)}, "pan_deg: must hold 0"),
    ],
)
def test_limits_that_mean_nothing_are_refused(limits: dict[str, tuple[float, float]], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        CameraRig(**limits)  # type: ignore[arg-type]


def test_the_nearest_aim_stops_at_the_limits_on_either_side_of_north() -> None:
    rig = CameraRig(tilt_deg=(-60.0, 20.0), pan_deg=(-30.0, 40.0))
    assert rig.nearest_aim(Aim(pan_deg=5.0, tilt_deg=10.0), 350.0) == Aim(pan_deg=5.0, tilt_deg=10.0)
    assert rig.nearest_aim(Aim(pan_deg=90.0, tilt_deg=30.0), 350.0) == Aim(pan_deg=30.0, tilt_deg=20.0)
    assert rig.nearest_aim(Aim(pan_deg=300.0, tilt_deg=-80.0), 10.0) == Aim(pan_deg=340.0, tilt_deg=-60.0)
    assert rig.gimbal_room_deg(Aim(pan_deg=5.0, tilt_deg=10.0), 350.0) == 10.0
