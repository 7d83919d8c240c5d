"""Where a host was and how it was turned, at the time of a detection."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.detections import PoseHistory
from hsop_gcs.detections.detection import Reason, Unusable
from hsop_gcs.detections.poses import MEMORY_S
from hsop_gcs.geometry.frames import Aim, wrap_deg
from tests.detections.examples import DEGREE, METRE

LIMIT_S = 0.5


def history(*samples: tuple[float, float, float], pans_deg: tuple[float, ...] = ()) -> PoseHistory:
    """A host at (east, 0, 30) m: samples of time, east and heading; gimbal samples at the same times."""
    made = PoseHistory()
    for number, (time_s, east_m, heading_deg) in enumerate(samples):
        made = made.with_position(time_s, (east_m, 0.0, 30.0))
        made = made.with_attitude(time_s, heading_deg=heading_deg, roll_deg=0.0, pitch_deg=0.0)
        if pans_deg:
            made = made.with_aim(time_s, Aim(pan_deg=pans_deg[number], tilt_deg=-5.0))
    return made


def test_between_samples_position_and_heading_are_interpolated_by_time() -> None:
    pose = history((10.0, 0.0, 20.0), (10.2, 2.0, 30.0)).at(10.05, LIMIT_S)
    assert pose.position_m == pytest.approx((0.5, 0.0, 30.0), abs=1e-9 * METRE)
    assert pose.heading_deg == pytest.approx(22.5, abs=1e-9 * DEGREE)


@given(
    heading_deg=st.floats(0, 359.99), turn_deg=st.floats(-179, 179), share=st.floats(0, 1), seam_deg=st.floats(-3, 3)
)
def test_angles_go_the_short_way_around(heading_deg: float, turn_deg: float, share: float, seam_deg: float) -> None:
    first = (heading_deg + seam_deg) % 360.0
    pose = history((10.0, 0.0, first), (10.2, 0.0, (first + turn_deg) % 360.0)).at(10.0 + 0.2 * share, LIMIT_S)
    assert 0.0 <= pose.heading_deg < 360.0
    assert wrap_deg(pose.heading_deg - first - share * turn_deg) == pytest.approx(0.0, abs=1e-6 * DEGREE)


def test_a_moving_host_goes_on_beyond_its_newest_sample_and_its_angles_stay() -> None:
    pose = history((10.0, 0.0, 20.0), (10.1, 0.8, 20.5)).at(10.2, LIMIT_S)
    assert pose.position_m[0] == pytest.approx(1.6, abs=1e-9 * METRE)
    assert pose.heading_deg == pytest.approx(20.5, abs=1e-9 * DEGREE)


@pytest.mark.parametrize(("time_s", "side"), [(9.4, "oldest"), (11.7, "newest")])
def test_a_time_too_far_outside_is_refused_with_how_far(time_s: float, side: str) -> None:
    with pytest.raises(Unusable, match=rf"0\.[67]0 s from the {side} position") as caught:
        history((10.0, 0.0, 0.0), (11.0, 0.0, 0.0)).at(time_s, LIMIT_S)
    assert (caught.value.reason, caught.value.field) == (Reason.NO_POSE, "time")


def test_the_middle_of_a_gap_in_telemetry_is_refused() -> None:
    gap = history((10.0, 0.0, 0.0), (13.0, 24.0, 0.0))
    assert gap.at(10.4, LIMIT_S).position_m[0] == pytest.approx(3.2, abs=1e-9 * METRE)
    with pytest.raises(Unusable, match="nearest position"):
        gap.at(11.5, LIMIT_S)


def test_a_host_never_heard_is_refused() -> None:
    with pytest.raises(Unusable, match="position was never heard"):
        PoseHistory().at(10.0, LIMIT_S)
    with pytest.raises(Unusable, match="attitude was never heard"):
        PoseHistory().with_position(10.0, (0.0, 0.0, 0.0)).at(10.0, LIMIT_S)


def test_without_a_gimbal_there_is_a_pose_and_no_aim() -> None:
    assert history((10.0, 0.0, 0.0)).at(10.0, LIMIT_S).aim is None
    stale = history((10.0, 0.0, 0.0), pans_deg=(5.0,))
    stale = stale.with_position(12.0, (0.0, 0.0, 30.0)).with_attitude(
        12.0, heading_deg=0.0, roll_deg=0.0, pitch_deg=0.0
    )
    assert stale.at(12.0, LIMIT_S).aim is None


def test_a_gimbal_that_stepped_between_two_samples_is_anywhere_between_them() -> None:
    pose = history((10.0, 0.0, 0.0), (10.2, 0.0, 0.0), pans_deg=(358.0, 2.0)).at(10.1, LIMIT_S)
    assert pose.aim is not None
    assert wrap_deg(pose.aim.pan_deg) == pytest.approx(0.0, abs=1e-9 * DEGREE)
    assert math.degrees(pose.aim_sigma_rad) == pytest.approx(
        math.hypot(2.0, 20.0 * 0.02) / math.sqrt(2), abs=1e-9 * DEGREE
    )
    assert pose.attitude_sigma_rad == 0.0


def test_while_a_gimbal_rests_nothing_is_left_open() -> None:
    samples = tuple((10.0 + 0.2 * number, 0.0, 0.0) for number in range(5))
    moved = history(*samples, pans_deg=(0.0, 4.0, 4.0, 4.0, 4.0))
    assert moved.at(10.7, LIMIT_S).aim_sigma_rad == 0.0
    assert moved.at(10.05, LIMIT_S).aim_sigma_rad > math.radians(1.0)


def test_a_gimbal_that_rests_between_two_steps_leaves_only_open_when_it_took_them() -> None:
    samples = tuple((10.0 + 0.2 * number, 0.0, 0.0) for number in range(4))
    rested = history(*samples, pans_deg=(0.0, 1.0, 1.0, 2.0))
    assert rested.at(10.3, LIMIT_S).aim_sigma_rad == 0.0
    assert 0.0 < math.degrees(rested.at(10.39, LIMIT_S).aim_sigma_rad) < 0.1 * DEGREE


def test_a_gimbal_that_turns_back_between_two_samples_is_not_at_rest_there() -> None:
    samples = tuple((10.0 + 0.05 * number, 0.0, 0.0) for number in range(4))
    pose = history(*samples, pans_deg=(0.0, 3.6, 3.6, 0.0)).at(10.075, LIMIT_S)
    assert math.degrees(pose.aim_sigma_rad) > 1.8 / math.sqrt(2) * DEGREE


def test_samples_that_come_late_change_nothing_and_old_ones_are_forgotten() -> None:
    made = history((10.0, 0.0, 0.0), (10.2, 1.0, 0.0))
    assert made.with_position(10.1, (99.0, 0.0, 0.0)) == made
    for tick in range(1000):
        made = made.with_position(10.3 + 0.1 * tick, (0.0, 0.0, 0.0))
    assert len(made.positions) <= MEMORY_S / 0.1 + 2
    assert made.positions[-1][1] == (0.0, 0.0, 0.0)
