import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.simulator.flight import STEP_S, FlightGoal, FlightLimits, FlightState, Point, step

METRE = 1.0
LIMITS = FlightLimits()

near = st.floats(-200, 200)
height = st.floats(1, 80)
places = st.tuples(near, near, height)


def fly(state: FlightState, goal: FlightGoal, seconds: float, limits: FlightLimits = LIMITS) -> list[FlightState]:
    states = [state]
    for _ in range(round(seconds / STEP_S)):
        states.append(step(states[-1], goal, limits))
    return states


def flight_time_s(start: Point, end: Point) -> float:
    """Return a time that is enough: cruise, climb and a generous allowance for speeding up and easing in."""
    return math.dist(start[:2], end[:2]) / LIMITS.cruise_mps + abs(start[2] - end[2]) / LIMITS.descent_mps + 12.0


@given(start=places, end=places)
@settings(max_examples=30, deadline=None)
def test_every_goal_is_reached_within_the_limits_and_never_passed(start: Point, end: Point) -> None:
    states = fly(FlightState(position_m=start), FlightGoal(position_m=end), flight_time_s(start, end))
    assert math.dist(states[-1].position_m, end) < 0.3 * METRE
    distance = math.dist(start[:2], end[:2])
    for before, state in pairwise(states):
        along = sum((s - a) * (b - a) for s, a, b in zip(state.position_m[:2], start[:2], end[:2], strict=True))
        assert along / max(distance, 1e-9) <= distance + 0.1 * METRE
        assert min(start[2], end[2]) - 0.1 <= state.position_m[2] <= max(start[2], end[2]) + 0.1
        assert state.ground_speed_mps <= LIMITS.cruise_mps + 1e-9
        change = math.dist(state.velocity_mps[:2], before.velocity_mps[:2])
        assert change <= LIMITS.acceleration_mps2 * STEP_S + 1e-9


@given(end=places, velocity=st.tuples(st.floats(-8, 8), st.floats(-8, 8)))
@settings(max_examples=20, deadline=None)
def test_a_goal_given_in_full_flight_is_reached_too(end: Point, velocity: tuple[float, float]) -> None:
    start = FlightState(position_m=(0.0, 0.0, 30.0), velocity_mps=(*velocity, 0.0))
    states = fly(start, FlightGoal(position_m=end), flight_time_s(start.position_m, end) + 10)
    assert math.dist(states[-1].position_m, end) < 0.3 * METRE


def test_the_nose_turns_the_short_way_and_no_faster_than_it_can() -> None:
    start = FlightState(position_m=(0.0, 0.0, 20.0), heading_rad=math.radians(170))
    goal = FlightGoal(position_m=start.position_m, heading_rad=math.radians(-170))
    states = fly(start, goal, 0.2)
    assert states[-1].heading_rate_rad_s == pytest.approx(LIMITS.yaw_rate_rad_s)
    assert math.degrees(fly(start, goal, 0.4)[-1].heading_rad) == pytest.approx(-170, abs=1e-6)


def test_a_goal_below_ground_ends_on_the_ground_at_rest() -> None:
    states = fly(FlightState(position_m=(0.0, 0.0, 10.0)), FlightGoal(position_m=(0.0, 0.0, -0.5)), 15)
    assert states[-1].on_ground
    assert states[-1].velocity_mps[2] == 0.0
    assert min(state.position_m[2] for state in states) == 0.0


def test_speeding_up_northwards_with_the_nose_north_tips_the_nose_down() -> None:
    states = fly(FlightState(position_m=(0.0, 0.0, 20.0)), FlightGoal(position_m=(0.0, 100.0, 20.0)), 0.5)
    assert states[-1].pitch_rad == pytest.approx(-math.atan2(LIMITS.acceleration_mps2, 9.80665))
    assert states[-1].roll_rad == pytest.approx(0.0, abs=1e-9)


def test_a_leg_may_have_a_speed_of_its_own_up_to_what_the_airframe_can() -> None:
    start, far = FlightState(position_m=(0.0, 0.0, 20.0)), (400.0, 0.0, 20.0)
    for ordered_mps, flown_mps in ((3.0, 3.0), (12.0, 12.0), (90.0, LIMITS.max_speed_mps), (-4.0, 0.0)):
        states = fly(start, FlightGoal(position_m=far, cruise_mps=ordered_mps), 10)
        assert states[-1].ground_speed_mps == pytest.approx(flown_mps, abs=0.01)
