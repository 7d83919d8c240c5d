"""Poses with long views are what they are said to be, by the cameras themselves; some are longer than others find."""

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.long_views import MOST_DRAWS, MOST_VIOLATION, PER_PAIR, long_views
from hsop_gcs.placement.search.model import Floats
from hsop_gcs.placement.search.poses import sight_of
from hsop_gcs.placement.search.question import frame_of, question_of
from tests.placement.examples import random_threats

RNG_SEED, SIDE_M = 5, 120.0
ROOM = 1 - 2 * MOST_VIOLATION
"""A view may break each of several rules by part of what it may break them in all."""


def problem_of(threats: int) -> Problem:
    return Problem(
        threats=random_threats(threats, np.random.default_rng(RNG_SEED), SIDE_M), formulation=Formulation.LETTER
    )


def drawn(problem: Problem, seed: int = 1) -> tuple[Floats, Floats]:
    """Poses as rows, and the threats' points, (threats, 2, 2), in the frame of the search."""
    q = question_of(problem, frame_of(problem))
    return long_views(q, sight_of(q), seeded(seed)), q.points_m[:, :, :2]


def seen(problem: Problem, points_m: Floats, pose: Floats) -> tuple[set[int], set[int]]:
    """The threats that the central camera sees, aimed at what the pose says, and those that a fisheye does."""
    rays = points_m - pose[:2]
    distance = np.hypot(*rays.T).T
    bearing = np.arctan2(rays[:, :, 0], rays[:, :, 1])
    first = bearing[int(pose[4]), 0]
    from_first = (bearing[pose[4:].astype(int)] - first + np.pi) % (2 * np.pi) - np.pi
    axis = first + (from_first.min() + from_first.max()) / 2
    off_axis = np.abs((bearing - axis + np.pi) % (2 * np.pi) - np.pi)
    central, peripheral = problem.rig.central, problem.rig.peripheral
    in_image = off_axis.max(axis=1) * ROOM < central.half_fov_rad
    large = central.focal_length_px / distance.max(axis=1) > central.min_pixels * ROOM
    off_boresight = np.arccos(np.minimum(1.0, np.abs(rays @ pose[2:4]) / distance))
    pixels = peripheral.focal_length_px * peripheral.relative_pixel_size(off_boresight) / distance
    detected = pixels.min(axis=1) > peripheral.min_pixels * ROOM
    far_enough = distance.min(axis=1) > problem.safety_distance_m * ROOM
    return set(np.flatnonzero(in_image & large & far_enough)), set(np.flatnonzero(detected & far_enough))


def test_every_pose_sees_what_it_aims_at_with_the_central_camera_and_two_threats_at_least() -> None:
    problem = problem_of(8)
    poses, points_m = drawn(problem)
    assert len(poses) > MOST_DRAWS / 10
    for pose in poses:
        central, peripheral = seen(problem, points_m, pose)
        assert set(pose[4:].astype(int)) <= central
        assert len(central | peripheral) >= 2


def test_central_cameras_see_two_threats_in_some_and_a_fisheye_sees_beyond_their_range_in_others() -> None:
    problem = problem_of(8)
    poses, points_m = drawn(problem)
    together = poses[:, 4] != poses[:, 5]
    assert 0.05 < together.mean() < 0.95
    range_m = problem.rig.central.focal_length_px / problem.rig.central.min_pixels
    reached_m = [
        max(np.hypot(*(points_m[t] - pose[:2]).T).max() for t in seen(problem, points_m, pose)[1] | {int(pose[4])})
        for pose in poses[~together]
    ]
    assert max(reached_m) > range_m


@pytest.mark.parametrize("threats", [1, 2, 3])
def test_few_threats_have_few_poses_and_one_has_none(threats: int) -> None:
    poses, _ = drawn(problem_of(threats))
    assert poses.shape == (len(poses), 6)
    assert len(poses) <= PER_PAIR * threats**2
    assert (len(poses) > 0) == (threats > 1)


def test_the_same_seed_draws_the_same_poses() -> None:
    first, again, other = (drawn(problem_of(5), seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first[:5], other[:5])
