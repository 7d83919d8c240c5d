"""Truth files: straight paths, turns and waypoints, and every fault by its field."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.simulator.truth import TrueState, Truth, read_truth, truth_from_json

ORIGIN = GeodeticPoint(lat_deg=47.4, lon_deg=8.5, altitude_amsl_m=430.0)
SCENARIOS = Path(__file__).parent.parent / "data" / "scenarios"
METRE = 1.0
MPS = 1.0


def truth(**threat: Any) -> Truth:
    return truth_from_json({"threats": [{"id": "t1", "position_m": [0.0, 0.0, 30.0], **threat}]}, ORIGIN)


def at(given_truth: Truth, time_s: float) -> TrueState:
    (state,) = given_truth.at(time_s)
    return state


def test_without_more_a_threat_flies_straight_on() -> None:
    straight = truth(velocity_mps=[3.0, -1.0, 0.5], size_m=0.6)
    assert at(straight, 10.0) == TrueState(
        id="t1", position_m=(30.0, -10.0, 35.0), velocity_mps=(3.0, -1.0, 0.5), size_m=0.6
    )


def test_a_threat_is_there_from_its_start_to_its_end() -> None:
    passing = truth(velocity_mps=[2.0, 0.0], start_s=5.0, end_s=8.0)
    assert [len(passing.at(time_s)) for time_s in (0.0, 4.99, 5.0, 8.0, 8.01)] == [0, 0, 1, 1, 0]
    assert at(passing, 7.0).position_m == pytest.approx((4.0, 0.0, 30.0), abs=1e-12 * METRE)


def test_a_quarter_turn_ends_a_quarter_circle_farther() -> None:
    """From north at 4 m/s, clockwise at 10 °/s: 9 s to east, on a circle of 4 / (10 °/s) = 22.9 m."""
    turning = truth(velocity_mps=[0.0, 4.0], turns=[{"at_s": 2.0, "for_s": 9.0, "rate_deg_s": 10.0}])
    radius_m = 4.0 / math.radians(10.0)
    after = at(turning, 11.0)
    assert after.position_m == pytest.approx((radius_m, 8.0 + radius_m, 30.0), abs=1e-9 * METRE)
    assert after.velocity_mps == pytest.approx((4.0, 0.0, 0.0), abs=1e-9 * MPS)
    assert at(turning, 12.0).position_m == pytest.approx((radius_m + 4.0, 8.0 + radius_m, 30.0), abs=1e-9 * METRE)


def test_waypoints_are_passed_in_order_at_the_speed_given_and_the_last_course_is_kept() -> None:
    legs = truth(velocity_mps=[5.0, 0.0], waypoints_m=[[30.0, 0.0, 30.0], [30.0, 40.0, 30.0]])
    assert at(legs, 6.0).position_m == pytest.approx((30.0, 0.0, 30.0), abs=1e-9 * METRE)
    assert at(legs, 10.0).position_m == pytest.approx((30.0, 20.0, 30.0), abs=1e-9 * METRE)
    assert at(legs, 16.0).position_m == pytest.approx((30.0, 50.0, 30.0), abs=1e-9 * METRE)


@given(
    rate=st.floats(-90, 90).filter(lambda rate: rate == 0 or abs(rate) > 1e-3),
    at_s=st.floats(0, 20),
    for_s=st.floats(0, 20),
    time_s=st.floats(0, 60),
)
def test_position_and_velocity_agree_all_the_way(rate: float, at_s: float, for_s: float, time_s: float) -> None:
    turning = truth(velocity_mps=[2.0, 3.0, 0.1], turns=[{"at_s": at_s, "for_s": for_s, "rate_deg_s": rate}])
    step_s = 1e-4
    before, after = at(turning, time_s), at(turning, time_s + step_s)
    moved = np.subtract(after.position_m, before.position_m) / step_s
    # Half a step at the fastest turn changes the velocity by 3e-4 m/s; so much may differ at the turn's ends.
    assert moved == pytest.approx(np.array(before.velocity_mps), abs=1e-3 * MPS)
    assert math.hypot(*before.velocity_mps[:2]) == pytest.approx(math.hypot(2.0, 3.0), abs=1e-9 * MPS)


def test_a_geodetic_start_is_brought_into_the_origins_frame() -> None:
    place = LocalFrame(ORIGIN).to_geodetic(np.array([40.0, -20.0, 35.0]))
    given_truth = truth(
        position_m=None, lat_deg=place.lat_deg, lon_deg=place.lon_deg, altitude_amsl_m=place.altitude_amsl_m
    )
    assert at(given_truth, 0.0).position_m == pytest.approx((40.0, -20.0, 35.0), abs=1e-6 * METRE)


def test_an_epoch_is_a_moment_in_time() -> None:
    dated = truth_from_json({"epoch": "2026-01-31T12:00:00Z", "threats": [{"id": "t", "position_m": [0, 0]}]}, ORIGIN)
    assert dated.epoch_s == 1769860800.0
    assert truth().epoch_s is None


@pytest.mark.parametrize("scenario", sorted(SCENARIOS.glob("*-threats-*.json")), ids=lambda path: path.stem)
def test_a_scenario_file_is_a_truth_file(scenario: Path) -> None:
    states = read_truth(scenario, ORIGIN).at(0.0)
    given_threats = json.loads(scenario.read_text())["threats"]
    assert [state.id for state in states] == [threat["id"] for threat in given_threats]
    for state, threat in zip(states, given_threats, strict=True):
        assert state.position_m[:2] == pytest.approx(threat["position_m"][:2], abs=1e-12 * METRE)


@pytest.mark.parametrize(
    ("change", "field", "shown"),
    [
        ({"position_m": None}, "threats.0", "'t1' needs position_m"),
        ({"lat_deg": 47.0}, "threats.0", "'t1' needs position_m"),
        ({"position_m": [1.0]}, "threats.0.position_m", "at least 2"),
        ({"position_m": ["1", 2.0]}, "threats.0.position_m.0", "'1'"),
        ({"velocity_mps": [1e9, 0.0]}, "threats.0.velocity_mps", "1000000000"),
        ({"size_m": 0.0}, "threats.0.size_m", "0.0"),
        ({"start_s": -1.0}, "threats.0.start_s", "-1.0"),
        ({"start_s": 9.0, "end_s": 3.0}, "threats.0", "ends at 3 s"),
        ({"waypoints_m": [[1.0, 2.0]]}, "threats.0", "no velocity_mps"),
        ({"turns": [{"at_s": 1.0, "for_s": 5.0, "rate_deg_s": 9.0}, {"at_s": 2.0, "for_s": 5.0, "rate_deg_s": 9.0}]},
         "threats.0", "still turning"),
        ({"colour": "red"}, "threats.0.colour", "red"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_field_and_value(change: dict[str, Any], field: str, shown: str) -> None:
    with pytest.raises(BadInput) as caught:
        truth(**change)
    assert caught.value.field.startswith(field)
    assert shown in str(caught.value)


@pytest.mark.parametrize(
    ("content", "shown"),
    [
        ({"threats": []}, "threats"),
        ({}, "threats"),
        ([], "truth"),
        ({"threats": [{"id": "a", "position_m": [0, 0]}, {"id": "a", "position_m": [1, 1]}]}, "'a'"),
        ({"epoch": "2026-01-31T12:00:00", "threats": [{"id": "a", "position_m": [0, 0]}]}, "epoch"),
    ],
)
def test_a_file_that_is_no_truth_is_refused(tmp_path: Path, content: Any, shown: str) -> None:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(content))
    with pytest.raises(BadInput, match=shown):
        read_truth(path, ORIGIN)


def test_a_file_that_is_not_there_or_not_json_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"--truth: cannot read"):
        read_truth(tmp_path / "none.json", ORIGIN)
    (tmp_path / "bad.json").write_text("{")
    with pytest.raises(BadInput, match="not JSON"):
        read_truth(tmp_path / "bad.json", ORIGIN)
