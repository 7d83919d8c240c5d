"""The search as a whole: its answers are valid, repeatable, near the best known, and obey the laws of the problem.

Runs are counted in rounds, not in seconds, so that a busy machine changes nothing.
"""

import itertools
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Problem, Threat
from hsop_gcs.placement.scenario import plan_to_json
from hsop_gcs.placement.search import frontier, search
from hsop_gcs.placement.solution import Placement, Status
from tests.oracles.check_plan import check
from tests.placement.examples import NAMES, problem, random_threats, read

BEST_KNOWN: dict[str, dict[str, float]] = read("best-known")
CASES = [(name, int(hosts)) for name in NAMES for hosts in BEST_KNOWN[name]]


def solve(
    question: Problem, hosts: int | None, *, rounds: int, seed: int = 0, start: Placement | None = None
) -> Placement:
    """Search for exactly so many rounds."""
    return search(
        question, n_hosts=hosts, seed=seed, deadline=math.inf, now=lambda: 0.0, iterations=rounds, warm_start=start
    )


def cost_of(placement: Placement) -> float:
    assert placement.cost is not None, placement.reason
    return placement.cost


def scenario_of(question: Problem) -> dict[str, Any]:
    """The scenario file the independent checker reads."""
    threats = [
        {"id": t.id, "position_m": t.position_m, "velocity_mps": t.velocity_mps, "size_m": t.size_m}
        for t in question.threats
    ]
    return {"threats": threats}


def assert_valid(question: Problem, placement: Placement) -> None:
    """Hold a placement against the checker that shares no code with the planner."""
    operational = question.formulation is Formulation.OPERATIONAL
    result = check(scenario_of(question), plan_to_json(placement), segment=operational)
    assert result["ok"], result["problems"]
    if operational:
        for a, b in itertools.combinations(placement.hosts, 2):
            assert math.dist(a.position_m, b.position_m) >= question.min_separation_m


@pytest.mark.parametrize(("name", "hosts"), CASES)
def test_the_letters_problem_is_solved_to_the_best_cost_known(name: str, hosts: int) -> None:
    placement = solve(problem(name), hosts, rounds=12)
    assert_valid(problem(name), placement)
    assert cost_of(placement) <= 1.001 * BEST_KNOWN[name][str(hosts)]


@pytest.mark.parametrize(("name", "hosts"), CASES[::2])
def test_an_operational_placement_keeps_clear_of_whole_paths_and_costs_no_less(name: str, hosts: int) -> None:
    question = problem(name, Formulation.OPERATIONAL)
    placement = solve(question, hosts, rounds=4)
    assert_valid(question, placement)
    assert cost_of(placement) >= (1 - 1e-5) * BEST_KNOWN[name][str(hosts)]


@pytest.mark.parametrize("hosts", [4, 6, 9, 12])
def test_six_threats_are_placed_validly_with_any_number_of_hosts(hosts: int) -> None:
    question = Problem(
        threats=random_threats(6, np.random.default_rng(1), side_m=100.0), formulation=Formulation.OPERATIONAL
    )
    placement = solve(question, hosts, rounds=6)
    assert len(placement.hosts) == hosts
    assert_valid(question, placement)


def test_a_threat_at_rest_is_seen_at_the_safety_distance_and_a_right_angle_which_is_proven_optimal() -> None:
    question = Problem(threats=(Threat(id="a", position_m=(7.0, -3.0, 0.0)),), formulation=Formulation.LETTER)
    placement = solve(question, 2, rounds=2)
    assert cost_of(placement) == pytest.approx(2 * (20.0**2 / 1280) ** 2, rel=1e-5)
    assert placement.status is Status.OPTIMAL


def test_no_pair_of_points_on_circles_about_its_path_is_better_for_one_threat() -> None:
    threat = Threat(id="a", position_m=(0.0, 0.0, 0.0), velocity_mps=(1.2, 0.9, 0.0))
    question = Problem(threats=(threat,), formulation=Formulation.LETTER)
    ends = np.array([threat.position_m[:2], threat.predicted_m(10.0)[:2]])
    angles = np.radians(np.arange(0.0, 360.0, 2.0))
    circle = np.stack((np.sin(angles), np.cos(angles)), axis=-1)
    radii = np.array([20.0 + 1e-9, 21.0, 22.0, 24.0, 26.0, 29.0, 33.0, 38.0])
    places = (ends[:, None, None] + radii[:, None, None] * circle).reshape(-1, 1, 2)
    rays = ends - places
    distances = np.hypot(rays[..., 0], rays[..., 1])
    directions = rays / distances[..., None]
    within = (distances >= 20).all(axis=1) & (distances <= 1280 / 30).all(axis=1)
    within &= (directions[:, 0] * directions[:, 1]).sum(axis=1) >= math.cos(math.radians(53))
    factors, directions = distances[within] ** 2 / 1280, directions[within]
    cross = (
        directions[:, None, :, 0] * directions[None, :, :, 1] - directions[:, None, :, 1] * directions[None, :, :, 0]
    )
    with np.errstate(divide="ignore"):
        by_trial = float((factors[:, None] * factors[None, :] / np.abs(cross)).sum(axis=-1).min())
    cost = cost_of(solve(question, 2, rounds=2))
    assert cost <= by_trial <= 1.05 * cost


@pytest.mark.parametrize("name", ["2-threats-102", "3-threats-106"])
def test_without_a_number_the_fewest_hosts_that_see_every_threat_are_placed(name: str) -> None:
    assert len(solve(problem(name), None, rounds=2).hosts) == 2


def test_threats_out_of_each_others_reach_get_hosts_of_their_own() -> None:
    threats = tuple(Threat(id=f"t{k}", position_m=(400.0 * k, 0.0, 0.0)) for k in range(3))
    question = Problem(threats=threats, formulation=Formulation.LETTER)
    placement = solve(question, None, rounds=2)
    assert len(placement.hosts) == 6
    assert_valid(question, placement)


def test_too_few_hosts_is_an_answer_that_says_so() -> None:
    threats = tuple(Threat(id=f"t{k}", position_m=(400.0 * k, 0.0, 0.0)) for k in range(2))
    placement = solve(Problem(threats=threats, formulation=Formulation.LETTER), 3, rounds=2)
    assert placement.status is Status.INFEASIBLE
    assert placement.cost is None
    assert "3 hosts" in placement.reason


def test_given_hosts_are_placed_by_name_near_where_they_are() -> None:
    east = AvailableHost(id="east", position_m=(500.0, 0.0, 30.0))
    west = AvailableHost(id="west", position_m=(-500.0, 0.0, 30.0))
    threat = Threat(id="a", position_m=(0.0, 0.0, 30.0), velocity_mps=(0.0, 1.0, 0.0))
    placement = solve(Problem(threats=(threat,), hosts=(east, west)), None, rounds=1)
    by_name = {pose.host: pose.position_m for pose in placement.hosts}
    assert by_name["east"][0] > by_name["west"][0]
    assert all(position[2] == pytest.approx(30.0) for position in by_name.values())


def test_the_same_seed_gives_the_same_placement_in_another_process() -> None:
    here = solve(problem("3-threats-105"), 4, rounds=3, seed=5)
    script = (
        f"import json, math, sys; sys.path.append({str(Path(__file__).parents[3])!r})\n"
        "from hsop_gcs.placement.problem import Formulation\n"
        "from hsop_gcs.placement.scenario import plan_to_json\n"
        "from hsop_gcs.placement.search import search\n"
        "from tests.placement.examples import problem\n"
        "p = search(problem('3-threats-105'), n_hosts=4, seed=5, deadline=math.inf, now=lambda: 0.0, iterations=3)\n"
        "print(json.dumps(plan_to_json(p)))\n"
    )
    there = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert json.loads(there) == json.loads(json.dumps(plan_to_json(here)))


def test_more_rounds_never_cost_more() -> None:
    question = problem("3-threats-105")
    costs = [cost_of(solve(question, 3, rounds=rounds)) for rounds in (1, 2, 4, 8)]
    assert costs == sorted(costs, reverse=True)


def moved(threat: Threat, *, turn_rad: float, shift_m: tuple[float, float], flip: bool) -> Threat:
    """The threat in a scenario that is mirrored, turned and moved."""

    def turned(x: float, y: float, z: float) -> tuple[float, float, float]:
        x = -x if flip else x
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        return (c * x - s * y, s * x + c * y, z)

    x, y, z = turned(*threat.position_m)
    return replace(threat, position_m=(x + shift_m[0], y + shift_m[1], z), velocity_mps=turned(*threat.velocity_mps))


@pytest.mark.parametrize(
    ("turn_rad", "shift_m", "flip"),
    [(0.7, (0.0, 0.0), False), (0.0, (1234.5, -777.0), False), (-2.1, (5.0, 9.0), True)],
)
def test_turning_moving_or_mirroring_a_scenario_does_not_change_the_cost(
    turn_rad: float, shift_m: tuple[float, float], flip: bool
) -> None:
    question = problem("3-threats-105")
    other = replace(
        question, threats=tuple(moved(t, turn_rad=turn_rad, shift_m=shift_m, flip=flip) for t in question.threats)
    )
    placement = solve(other, 3, rounds=2)
    assert_valid(other, placement)
    assert cost_of(placement) == pytest.approx(cost_of(solve(question, 3, rounds=2)), rel=1e-3)


@pytest.mark.parametrize("formulation", list(Formulation))
def test_along_the_frontier_a_host_more_never_costs_more(formulation: Formulation) -> None:
    question = Problem(threats=random_threats(4, np.random.default_rng(3), side_m=80.0), formulation=formulation)
    found = frontier(question, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=3)
    assert max(found) == 8
    costs = [cost_of(found[hosts]) for hosts in sorted(found)]
    assert costs == sorted(costs, reverse=True)
    for hosts, placement in found.items():
        assert len(placement.hosts) == hosts
        assert_valid(question, placement)
        assert placement.lower_bound <= cost_of(placement)


def test_a_threat_more_never_costs_less() -> None:
    threats = random_threats(3, np.random.default_rng(8))
    for hosts in (2, 3, 4):
        fewer = solve(Problem(threats=threats[:2], formulation=Formulation.LETTER), hosts, rounds=8)
        more = solve(Problem(threats=threats, formulation=Formulation.LETTER), hosts, rounds=8)
        assert cost_of(more) >= cost_of(fewer)


def test_a_replan_starts_from_the_flying_plan() -> None:
    question = Problem(threats=random_threats(4, np.random.default_rng(2), side_m=70.0))
    flying = solve(question, 6, rounds=8)
    later = replace(question, threats=tuple(replace(t, position_m=t.predicted_m(1.0)) for t in question.threats))
    warm = solve(later, 6, rounds=3, start=flying)
    assert_valid(later, warm)
    assert cost_of(warm) <= 1.02 * cost_of(solve(later, 6, rounds=8))


@pytest.mark.parametrize(("threats", "hosts"), [(5, 6), (3, 6), (4, 5), (4, 7)])
def test_a_replan_bears_a_threat_or_host_more_or_less(threats: int, hosts: int) -> None:
    everyone = random_threats(5, np.random.default_rng(2), side_m=70.0)
    flying = solve(Problem(threats=everyone[:4]), 6, rounds=2)
    question = Problem(threats=everyone[:threats])
    placement = solve(question, hosts, rounds=1, start=flying)
    assert len(placement.hosts) == hosts
    assert_valid(question, placement)


def test_by_the_other_objective_the_expected_error_is_no_greater() -> None:
    by_cost = solve(problem("3-threats-106"), 4, rounds=6)
    by_error = solve(replace(problem("3-threats-106"), objective=Objective.RMS), 4, rounds=6)
    errors = [sum(pair.expected_error_m or math.inf for pair in plan.pairs) for plan in (by_cost, by_error)]
    assert errors[1] <= errors[0]
    assert cost_of(by_error) == pytest.approx(errors[1], rel=1e-12)


def test_a_heavier_threat_is_seen_better() -> None:
    threats = random_threats(3, np.random.default_rng(12))
    even = solve(Problem(threats=threats), 3, rounds=6)
    heavy = solve(Problem(threats=(replace(threats[0], weight=50.0), *threats[1:])), 3, rounds=6)
    share = {pair.threat: pair.cost for pair in heavy.pairs}["t1"] / 50.0
    assert share <= {pair.threat: pair.cost for pair in even.pairs}["t1"] * (1 + 1e-9)
