"""Scenario files: what is accepted, and that everything else is refused by name."""

import contextlib
import copy
import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.errors import BadInput
from hsop_gcs.placement import place
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Formulation
from hsop_gcs.placement.scenario import parse_json, plan_to_json, problem_from_json
from tests.placement.examples import NAMES, read

GOOD: dict[str, Any] = {
    "parameters": {
        "horizon_s": 8.0,
        "safety_distance_m": 25,
        "min_separation_m": 0,
        "peripheral": {"focal_length_mm": 1.1, "distortion": [0.01, 0, 0, 0]},
        "central": {"fov_deg": 60, "resolution_px": 1920},
    },
    "threats": [{"id": "t1", "position_m": [12.0, 40.0, 5], "velocity_mps": [1.5, -0.5], "size_m": 0.5, "weight": 2.0}],
    "hosts": [{"id": "h1", "position_m": [0, 0]}, {"id": "h2", "position_m": [0.0, 5.0, 1.0]}],
}


def changed(path: str, value: Any) -> dict[str, Any]:
    """GOOD with the value at a path like ``threats.0.size_m`` replaced or added."""
    scenario: Any = copy.deepcopy(GOOD)
    *way, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    inner = scenario
    for part in way:
        inner = inner[part]
    inner[last] = value
    return dict(scenario)


@pytest.mark.parametrize("name", NAMES)
def test_the_example_scenarios_are_accepted(name: str) -> None:
    assert len(problem_from_json(read(name)).threats) == int(name[0])


def test_every_field_arrives_where_it_belongs() -> None:
    problem = problem_from_json(GOOD, formulation=Formulation.LETTER)
    assert (problem.horizon_s, problem.safety_distance_m, problem.min_separation_m) == (8.0, 25.0, 0.0)
    assert problem.formulation is Formulation.LETTER
    assert problem.rig.peripheral.focal_length_mm == 1.1
    assert problem.rig.peripheral.distortion == (0.01, 0.0, 0.0, 0.0)
    assert (problem.rig.central.fov_deg, problem.rig.central.resolution_px) == (60.0, 1920)
    assert problem.threats[0].position_m == (12.0, 40.0, 5.0)
    assert problem.threats[0].velocity_mps == (1.5, -0.5, 0.0)
    assert (problem.threats[0].size_m, problem.threats[0].weight) == (0.5, 2.0)
    assert [(host.id, host.position_m) for host in problem.hosts] == [("h1", (0.0, 0.0, 0.0)), ("h2", (0.0, 5.0, 1.0))]
    assert problem.max_hosts == 2


def test_a_host_may_carry_cameras_of_its_own_and_the_others_carry_those_of_the_parameters() -> None:
    own = {"id": "h3", "position_m": [1, 1], "central": {"fov_deg": 30}}
    problem = problem_from_json({**GOOD, "hosts": [*GOOD["hosts"], own]})
    assert [host.rig for host in problem.hosts[:2]] == [None, None]
    assert problem.rig_of("h1") == problem.rig
    assert problem.rig_of("h3").central == PinholeCamera(fov_deg=30.0)
    assert problem.rig_of("h3").peripheral == problem.rig.peripheral
    assert problem.rigs == (problem.rig, problem.rig_of("h3"))
    limited = problem_from_json({**GOOD, "hosts": [*GOOD["hosts"], {**own, "tilt_deg": [-90, 20], "pan_deg": [-5, 5]}]})
    assert (limited.rig_of("h3").tilt_deg, limited.rig_of("h3").pan_deg) == ((-90.0, 20.0), (-5.0, 5.0))
    assert limited.rig_of("h3").central.fov_deg == 30.0
    with pytest.raises(BadInput, match=r"parameters\.tilt_deg: must be two numbers from -90 to 90"):
        problem_from_json({**GOOD, "parameters": {"tilt_deg": [-90, 120]}})
    with pytest.raises(BadInput, match=r"hosts\[2\]\.pan_deg: must be two numbers, not 3"):
        problem_from_json({**GOOD, "hosts": [*GOOD["hosts"], {**own, "pan_deg": 3}]})
    with pytest.raises(BadInput, match=r"hosts\[2\]\.central\.fov_deg: must lie between 0 and 180"):
        problem_from_json({**GOOD, "hosts": [*GOOD["hosts"], {**own, "central": {"fov_deg": 200}}]})


def test_where_hosts_may_hover_and_how_well_they_know_their_pose_is_read() -> None:
    given = {
        **GOOD,
        "fence": [[0, 0], [100, 0], [0, 80.5]],
        "keep_outs": [{"polygon": [[1, 1], [2, 1], [2, 2]], "ceiling_m": 30}, {"polygon": [[5, 5], [6, 5], [6, 6]]}],
        "parameters": {"floor_m": 10, "ceiling_m": 90, "host_position_sigma_m": 0.4, "host_attitude_sigma_deg": 2},
    }
    problem = problem_from_json(given)
    assert problem.airspace == Airspace(
        inside=(((0.0, 0.0), (100.0, 0.0), (0.0, 80.5)),),
        keep_outs=(
            KeepOut(polygon=((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)), ceiling_m=30.0),
            KeepOut(polygon=((5.0, 5.0), (6.0, 5.0), (6.0, 6.0))),
        ),
        floor_m=10.0,
        ceiling_m=90.0,
    )
    assert problem.position_sigma_m == 0.4
    assert problem.attitude_sigma_rad == pytest.approx(math.radians(2))


@pytest.mark.parametrize(
    ("path", "value", "field", "shown"),
    [
        ("fence", [[0, 0], [1, 0]], "fence", "3 corners, not 2"),
        ("fence", [[0, 0], [1, 1], [1, 0], [0, 1]], "fence", "Self-intersection"),
        ("fence", [[0, 0], [1, "x"], [1, 0]], r"fence\[1\]", '"x"'),
        ("fence", [[0, 0, 0], [1, 1, 0], [1, 0, 0]], r"fence\[0\]", "east and north"),
        ("keep_outs", [{"floor_m": 3}], r"keep_outs\[0\]\.polygon", "missing"),
        (
            "keep_outs",
            [{"polygon": [[0, 0], [1, 0], [1, 1]], "floor_m": 9, "ceiling_m": 4}],
            r"keep_outs\[0\]\.floor_m",
            "9 must be below ceiling_m 4",
        ),
        ("parameters.floor_m", "low", r"parameters\.floor_m", '"low"'),
        ("parameters.host_attitude_sigma_deg", -1, r"parameters\.host_attitude_sigma_deg", "-1"),
    ],
)
def test_an_area_or_limit_that_is_none_is_named_with_its_value(path: str, value: Any, field: str, shown: str) -> None:
    with pytest.raises(BadInput, match=rf"^{field}: .*{shown}"):
        problem_from_json(changed(path, value))


def test_a_floor_above_the_ceiling_is_refused() -> None:
    with pytest.raises(BadInput, match=r"parameters\.floor_m: 50 must not be above ceiling_m 40"):
        problem_from_json({**GOOD, "parameters": {"floor_m": 50, "ceiling_m": 40}})


def test_without_hosts_there_is_no_limit_and_an_empty_list_is_no_host() -> None:
    scenario = {"threats": GOOD["threats"]}
    assert problem_from_json(scenario).max_hosts is None
    assert problem_from_json({**scenario, "hosts": []}).max_hosts == 0


@pytest.mark.parametrize(
    ("path", "value", "field", "shown"),
    [
        ("threats", [], "threats", "none"),
        ("threats", {}, "threats", "{}"),
        ("colour", 1, "colour", "unknown"),
        ("threats.0.colour", 1, "threats[0].colour", "unknown"),
        ("hosts.0.velocity_mps", [0, 0], "hosts[0].velocity_mps", "unknown"),
        ("parameters.gamma", 1, "parameters.gamma", "unknown"),
        ("parameters.central.distortion", [0, 0, 0, 0], "parameters.central.distortion", "unknown"),
        ("parameters.peripheral.fov_deg", 180, "parameters.peripheral.fov_deg", "unknown"),
        ("parameters", [], "parameters", "[]"),
        ("parameters.horizon_s", 0, "parameters.horizon_s", "0"),
        ("parameters.horizon_s", -3.5, "parameters.horizon_s", "-3.5"),
        ("parameters.horizon_s", "10", "parameters.horizon_s", '"10"'),
        ("parameters.horizon_s", True, "parameters.horizon_s", "true"),
        ("parameters.horizon_s", None, "parameters.horizon_s", "null"),
        ("parameters.safety_distance_m", 0, "parameters.safety_distance_m", "0"),
        ("parameters.min_separation_m", -1, "parameters.min_separation_m", "-1"),
        ("parameters.central.fov_deg", 180, "parameters.central.fov_deg", "180"),
        ("parameters.central.fov_deg", 0, "parameters.central.fov_deg", "0"),
        ("parameters.central.resolution_px", 0.5, "parameters.central.resolution_px", "0.5"),
        ("parameters.peripheral.distortion", [0, 0], "parameters.peripheral.distortion", "(0.0, 0.0)"),
        ("parameters.peripheral.distortion", [0, 0, 0, math.nan], "parameters.peripheral.distortion", "NaN"),
        ("parameters.peripheral.distortion", [-2, 0, 0, 0], "parameters.peripheral.distortion", "-2"),
        ("parameters.peripheral.focal_length_mm", 0, "parameters.peripheral.focal_length_mm", "0"),
        ("threats.0.position_m", [1], "threats[0].position_m", "[1]"),
        ("threats.0.position_m", [1, 2, 3, 4], "threats[0].position_m", "[1, 2, 3, 4]"),
        ("threats.0.position_m", [1, math.inf], "threats[0].position_m", "Infinity"),
        ("threats.0.position_m", [1, 1e9], "threats[0].position_m", "1000000000.0"),
        ("threats.0.position_m", [1, 10**400], "threats[0].position_m", "1000"),
        ("threats.0.position_m", "1,2", "threats[0].position_m", "1,2"),
        ("threats.0.velocity_mps", [math.nan, 0], "threats[0].velocity_mps", "NaN"),
        ("threats.0.size_m", -1, "threats[0].size_m", "-1"),
        ("threats.0.size_m", 0, "threats[0].size_m", "0"),
        ("threats.0.weight", 0, "threats[0].weight", "0"),
        ("threats.0.id", 7, "threats[0].id", "7"),
        ("threats.0.id", " ", "threats[0].id", '" "'),
        ("threats.0.id", "a\nb", "threats[0].id", '"a\\nb"'),
        ("hosts.0.id", "\ud800", "hosts[0].id", '"\\ud800"'),
        ("threats.0", "t1", "threats[0]", '"t1"'),
        ("hosts.1.id", "h1", "hosts[1].id", "'h1'"),
        ("hosts", None, "hosts", "null"),
    ],
)
def test_what_is_wrong_is_named_with_its_value(path: str, value: Any, field: str, shown: str) -> None:
    with pytest.raises(BadInput) as refusal:
        problem_from_json(changed(path, value))
    assert refusal.value.field == field
    assert shown in refusal.value.problem


@pytest.mark.parametrize("field", ["id", "position_m"])
@pytest.mark.parametrize("group", ["threats", "hosts"])
def test_what_is_missing_is_named(group: str, field: str) -> None:
    scenario = copy.deepcopy(GOOD)
    del scenario[group][0][field]
    with pytest.raises(BadInput, match=rf"{group}\[0\]\.{field}: missing"):
        problem_from_json(scenario)


def test_the_same_threat_twice_is_refused() -> None:
    with pytest.raises(BadInput, match=r"threats\[1\]\.id: 't1' is given twice"):
        problem_from_json({"threats": [GOOD["threats"][0], GOOD["threats"][0]]})


@pytest.mark.parametrize("scenario", [[], None, 3, "x"])
def test_a_scenario_is_an_object(scenario: Any) -> None:
    with pytest.raises(BadInput, match="scenario: must be an object"):
        problem_from_json(scenario)


FIELDS = ["threats", "hosts", "parameters", "id", "position_m", "central", "size_m"]
ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(FIELDS), inner),
)


@given(ANY_JSON)
def test_any_json_value_is_a_problem_or_bad_input_and_nothing_else(scenario: Any) -> None:
    with contextlib.suppress(BadInput):
        assert problem_from_json(scenario).threats


@pytest.mark.parametrize(
    ("text", "where"),
    [('{"threats": [1,}', "line 1 column 16"), ("", "line 1 column 1"), ("{\n 'a': 1}", "line 2 column 2")],
)
def test_broken_json_is_refused_with_its_line_and_column(text: str, where: str) -> None:
    with pytest.raises(BadInput, match=rf"^scene\.json: not JSON.*{where}"):
        parse_json(text, "scene.json")


def test_a_field_given_twice_and_bottomless_nesting_are_refused() -> None:
    with pytest.raises(BadInput, match="threats: given twice"):
        parse_json('{"threats": [], "threats": []}', "scene.json")
    with pytest.raises(BadInput, match=r"scene\.json"):
        parse_json("[" * 200_000, "scene.json")
    with pytest.raises(BadInput, match=r"scene\.json"):
        parse_json("1" * 5000, "scene.json")


def test_a_plan_file_has_the_fields_of_the_design_and_survives_json() -> None:
    placement = place(problem_from_json(read("1-threats-101")), iterations=1, now=lambda: 0.0)
    plan = plan_to_json(placement)
    assert json.loads(json.dumps(plan, allow_nan=False)) == plan
    assert plan.keys() == {
        "status", "formulation", "objective", "method", "n_hosts", "cost", "lower_bound", "solve_time_s", "seed",
        "hosts", "pairs",
    }  # fmt: skip
    assert plan["hosts"][0].keys() == {"id", "position_m", "heading_deg", "pan_deg", "tilt_deg"}
    assert plan["pairs"][0].keys() == {"threat", "cost", "expected_error_m", "views"}
    assert sum(pair["cost"] for pair in plan["pairs"]) == pytest.approx(plan["cost"], rel=1e-12)


def test_an_infeasible_plan_file_says_so_and_why() -> None:
    scenario = {"threats": GOOD["threats"], "hosts": []}
    plan = plan_to_json(place(problem_from_json(scenario), iterations=1, now=lambda: 0.0))
    assert plan["status"] == "infeasible"
    assert plan["reason"] == "no host is available; at least 2 are needed to see every threat"
    assert (plan["cost"], plan["n_hosts"], plan["hosts"], plan["pairs"]) == (None, 0, [], [])
