"""Poses of earlier placements are remembered, different ones, and told apart by what they aim at."""

import numpy as np

from hsop_gcs.placement.search.known import ROOM, KnownPoses, poses_about
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL
from hsop_gcs.placement.search.state import State, new_state, set_view


def placement(east_m: float = 0.0) -> State:
    """Two hosts, 50 m apart, that see three threats: the first one aims at threat 0, the other one at 1 and 2."""
    state = new_state(3, 2)
    state.positions[:, 0] = east_m, east_m + 50
    for threat, cameras in enumerate([(CENTRAL, PERIPHERAL), (PERIPHERAL, CENTRAL), (PERIPHERAL, CENTRAL)]):
        for host in range(2):
            set_view(state, threat, host, host, cameras[host])
    return state


def test_a_pose_is_a_place_an_axis_and_what_is_aimed_at() -> None:
    known = KnownPoses()
    known.take([(placement(), range(3))])
    np.testing.assert_array_equal(known.rows, [[0, 0, 0, 1, 0, 0], [50, 0, 0, 1, 1, 2]])


def test_threats_have_the_numbers_that_the_placement_gives_them() -> None:
    known = KnownPoses()
    known.take([(placement(), (2, 5, 7))])
    np.testing.assert_array_equal(known.rows[:, 4:], [[2, 2], [5, 7]])


def test_a_host_without_a_central_view_aims_at_what_its_fisheyes_see() -> None:
    state = placement()
    state.cameras[:] = PERIPHERAL
    known = KnownPoses()
    known.take([(state, range(3))])
    np.testing.assert_array_equal(known.rows[:, 4:], [[0, 0], [0, 0]])


def test_of_poses_that_are_alike_the_newest_counts() -> None:
    known = KnownPoses()
    known.take([(placement(), range(3)), (placement(0.5), range(3))])
    assert known.rows[:, 0].tolist() == [0.5, 50.5]


def test_the_oldest_are_forgotten() -> None:
    known = KnownPoses()
    known.take([(placement(1_000.0 * n), range(3)) for n in range(ROOM)])
    assert len(known.rows) == ROOM
    assert known.rows[:, 0].min() == 1_000 * (ROOM // 2)


def test_some_threats_have_the_poses_that_aim_at_one_of_them() -> None:
    known = KnownPoses()
    known.take([(placement(), range(3))])
    np.testing.assert_array_equal(poses_about(known.rows, (2,)), [[50, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(poses_about(known.rows, (0, 1))[:, 4:], [[0, 0], [1, 1]])
    assert len(poses_about(known.rows, (3,))) == 0
