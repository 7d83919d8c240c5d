import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.geometry.frames import wrap_rad
from hsop_gcs.simulator.gimbal import NOBODY, Gimbal, GimbalLimits, pitch_yaw, quaternion

DEGREE = math.radians(1)
SERVO = GimbalLimits(
    pitch_min_rad=math.radians(-90),
    pitch_max_rad=math.radians(45),
    yaw_min_rad=math.radians(-170),
    yaw_max_rad=math.radians(170),
)
FULL_CIRCLE = GimbalLimits()


def settle(gimbal: Gimbal, heading_rad: float = 0.0, seconds: float = 4.0) -> Gimbal:
    for _ in range(round(seconds / 0.02)):
        gimbal.step(0.02, heading_rad)
    return gimbal


@given(pitch=st.floats(-1.55, 1.55), yaw=st.floats(-3.1, 3.1))
def test_a_quaternion_gives_its_pitch_and_yaw_back(pitch: float, yaw: float) -> None:
    assert pitch_yaw(quaternion(pitch_rad=pitch, yaw_rad=yaw)) == pytest.approx((pitch, yaw), abs=1e-6)


@given(yaw=st.floats(-math.pi, math.pi), heading=st.floats(-math.pi, math.pi))
def test_a_full_circle_of_pan_can_look_anywhere_whatever_the_heading(yaw: float, heading: float) -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    gimbal.step(0.02, heading)
    gimbal.point(pitch_rad=0.2, yaw_rad=yaw, locked=True)
    settle(gimbal, heading)
    assert wrap_rad(gimbal.earth_yaw_rad - yaw) == pytest.approx(0.0, abs=1e-6)


def test_a_locked_gimbal_keeps_looking_there_while_the_vehicle_turns() -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    gimbal.point(pitch_rad=0.0, yaw_rad=math.radians(40), locked=True)
    settle(gimbal)
    for heading_deg in range(0, 360, 2):
        gimbal.step(0.1, math.radians(heading_deg))
        assert gimbal.earth_yaw_rad == pytest.approx(math.radians(40), abs=1e-6)


def test_a_following_gimbal_turns_with_the_vehicle() -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    gimbal.point(pitch_rad=0.0, yaw_rad=math.radians(40), locked=False)
    settle(gimbal, math.radians(100))
    assert gimbal.yaw_rad == pytest.approx(math.radians(40))
    assert gimbal.earth_yaw_rad == pytest.approx(math.radians(140))


def test_angles_beyond_the_range_are_clamped() -> None:
    gimbal = Gimbal(SERVO)
    gimbal.point(pitch_rad=math.radians(-120), yaw_rad=math.radians(175), locked=False)
    settle(gimbal)
    assert math.degrees(gimbal.pitch_rad) == pytest.approx(-90)
    assert math.degrees(gimbal.yaw_rad) == pytest.approx(170)


def test_a_gimbal_with_end_stops_goes_round_by_the_front() -> None:
    gimbal = Gimbal(SERVO)
    gimbal.point(pitch_rad=0.0, yaw_rad=math.radians(160), locked=False)
    settle(gimbal)
    gimbal.point(pitch_rad=0.0, yaw_rad=math.radians(-160), locked=False)
    passed = []
    for _ in range(200):
        gimbal.step(0.02, 0.0)
        passed.append(gimbal.yaw_rad)
    assert any(abs(yaw) < 3 * DEGREE for yaw in passed)
    assert math.degrees(passed[-1]) == pytest.approx(-160)


def test_it_turns_no_faster_than_its_slew_rate() -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    gimbal.point(pitch_rad=-1.0, yaw_rad=2.0, locked=False)
    gimbal.step(0.1, 0.0)
    assert gimbal.yaw_rad == pytest.approx(0.1 * FULL_CIRCLE.slew_rad_s)
    assert gimbal.pitch_rad == pytest.approx(-0.1 * FULL_CIRCLE.slew_rad_s)


def test_rates_turn_it_until_the_next_order() -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    gimbal.turn(pitch_rad_s=-0.1, yaw_rad_s=0.5, locked=False)
    settle(gimbal, seconds=2.0)
    assert (gimbal.pitch_rad, gimbal.yaw_rad) == pytest.approx((-0.2, 1.0), abs=0.02)
    gimbal.point(locked=False)
    settle(gimbal, seconds=2.0)
    assert (gimbal.pitch_rad, gimbal.yaw_rad) == pytest.approx((-0.2, 1.0), abs=0.02)


def test_control_is_given_kept_and_released_only_by_its_owner() -> None:
    gimbal = Gimbal(FULL_CIRCLE)
    owner, other, autopilot = (255, 190), (245, 190), (1, 1)
    gimbal.configure(owner, (-1, -1), sender=owner, me=autopilot)
    assert gimbal.primary == owner
    gimbal.configure((-3, -3), (-1, -1), sender=other, me=autopilot)
    assert gimbal.primary == owner
    gimbal.configure((-3, -3), (-1, -1), sender=owner, me=autopilot)
    assert gimbal.primary == NOBODY
    gimbal.configure((-2, -2), (-1, -1), sender=owner, me=autopilot)
    assert gimbal.primary == autopilot
