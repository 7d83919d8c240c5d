"""Algorithm 2: the screen never discards what a pose can see, and does discard what none can."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.placement.covering import CoveringPoses, aimed
from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL, Screen, discs_meet, members, subsets
from hsop_gcs.placement.instance import Instance
from hsop_gcs.placement.interior_point import margins
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.terms import Views
from tests.placement.examples import random_threats


def threat(name: str, east_m: float, north_m: float, speed_mps: float = 0.0, size_m: float = 1.0) -> Threat:
    return Threat(id=name, position_m=(east_m, north_m, 0.0), velocity_mps=(speed_mps, 0.0, 0.0), size_m=size_m)


def screen(*threats: Threat) -> Screen:
    return Screen(Instance.of(Problem(threats=threats, formulation=Formulation.LETTER)))


@given(
    centres=st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=5),
    radii=st.lists(st.floats(5, 60), min_size=5, max_size=5),
)
def test_discs_with_a_common_point_meet(centres: list[tuple[float, float]], radii: list[float]) -> None:
    places, sizes = np.array(centres), np.array(radii[: len(centres)])
    grid = np.stack(np.meshgrid(np.linspace(-110, 110, 56), np.linspace(-110, 110, 56)), axis=-1).reshape(-1, 2)
    distances = np.linalg.norm(grid[:, None] - places, axis=2)
    if (distances <= sizes).all(axis=1).any():
        assert discs_meet(places, sizes)
    # Cells of the grid are 4 m wide: discs grown by half a diagonal that hold no grid point have nothing in common.
    if not (distances <= sizes + 2.9).all(axis=1).any():
        assert not discs_meet(places, sizes)


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_whatever_a_pose_sees_passes_the_screen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    instance = Instance.of(Problem(threats=random_threats(2, rng, side_m=100.0), formulation=Formulation.LETTER))
    examined = Screen(instance)
    n = 3000
    poses = np.concatenate([rng.uniform(-60, 160, (n, 1, 2)), rng.uniform(0, 2 * np.pi, (n, 1, 2))], axis=2)
    for mask in (1, 2, 3):
        threats = np.array(members(mask))
        for central in subsets(mask):
            camera = np.array([CENTRAL if central >> t & 1 else PERIPHERAL for t in threats])
            views = Views(threats, np.zeros((n, len(threats)), dtype=np.intp), np.tile(camera, (n, 1)))
            if (margins(instance, poses, views, with_cost=False).margin >= 0).any():
                assert examined.may_see(mask, central)


def test_two_threats_out_of_reach_of_one_host_are_infeasible_as_in_fig_6a() -> None:
    far_apart = screen(threat("t1", 0, 0), threat("t2", 190, 0))
    assert not far_apart.feasible(((0, 1), (1, 0)))
    assert far_apart.feasible(((0, 1), (2, 3)))


def test_two_threats_within_reach_of_one_host_are_feasible_as_in_fig_6b() -> None:
    assert screen(threat("t1", 0, 0), threat("t2", 150, 0)).feasible(((0, 1), (1, 2)))


@pytest.mark.parametrize(("speed_mps", "seen"), [(3.8, True), (3.9, False)])
def test_the_central_camera_holds_38_metres_of_a_path(speed_mps: float, seen: bool) -> None:
    # 2 × 42.67 m × sin 26.5° = 38.08 m.
    assert screen(threat("t1", 0, 0, speed_mps)).may_see(1, 1) is seen


def test_a_threat_too_small_to_be_seen_from_the_safety_distance_is_discarded() -> None:
    assert not list(screen(threat("t1", 0, 0, size_m=0.1)).camera_choices(1))


def test_the_letter_takes_the_central_camera_for_all_threats_where_it_can_and_else_for_one() -> None:
    near = Instance.of(Problem(threats=(threat("t1", 0, 0), threat("t2", 10, 0)), formulation=Formulation.LETTER))
    apart = Instance.of(Problem(threats=(threat("t1", 0, 0), threat("t2", 70, 0)), formulation=Formulation.LETTER))
    assert CoveringPoses(near, Screen(near), seed=0).camera_types(0b11) == [0b11]
    assert CoveringPoses(apart, Screen(apart), seed=0).camera_types(0b11) == [0b01, 0b10]


@pytest.mark.parametrize("formulation", list(Formulation))
def test_covering_poses_have_positive_margins(formulation: Formulation) -> None:
    rng = np.random.default_rng(3)
    instance = Instance.of(Problem(threats=random_threats(3, rng), formulation=formulation))
    poses = CoveringPoses(instance, Screen(instance), seed=0)
    found = 0
    for mask in range(1, 8):
        threats = np.array(members(mask))
        for central in poses.screen.camera_choices(mask):
            held = poses.poses(mask, central)
            camera = np.array([CENTRAL if central >> t & 1 else PERIPHERAL for t in threats])
            if len(held):
                views = Views(
                    threats, np.zeros((len(held), len(threats)), dtype=np.intp), np.tile(camera, (len(held), 1))
                )
                assert (margins(instance, held[:, None], views, with_cost=False).margin > 0).all()
                found += 1
    assert found >= 7


def test_a_position_from_which_some_heading_serves_is_given_one_that_does() -> None:
    rng = np.random.default_rng(8)
    instance = Instance.of(Problem(threats=random_threats(3, rng), formulation=Formulation.LETTER))
    positions = rng.uniform(-30, 90, (400, 2))
    threats, camera = np.arange(3), np.full(3, PERIPHERAL)
    views = Views(threats, np.zeros((400, 3), dtype=np.intp), np.tile(camera, (400, 1)))

    def best_margin(poses: np.ndarray) -> np.ndarray:
        return margins(instance, poses[:, None], views, with_cost=False).margin

    by_hand = np.max(
        [
            best_margin(np.column_stack([positions, np.full(400, heading), np.zeros(400)]))
            for heading in np.radians(np.arange(0.0, 180.0, 1.0))
        ],
        axis=0,
    )
    given_heading = best_margin(aimed(instance, positions, threats, camera))
    assert (by_hand > 0).sum() > 20
    assert (given_heading[by_hand > 0] > 0).all()
