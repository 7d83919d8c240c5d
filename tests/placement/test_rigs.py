"""Fleets whose hosts do not all carry the same rig."""

import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.placement import Method, place
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Problem, Threat
from hsop_gcs.placement.search import frontier
from hsop_gcs.placement.search.anneal import anneal, scatter
from hsop_gcs.placement.search.bounds import lower_bound, own_pair_bound, own_pair_bound_in_space
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.question import frame_of, placement_of, question_of
from hsop_gcs.placement.search.state import new_state, refresh, set_view, totals
from hsop_gcs.placement.solution import Status
from tests.placement.examples import random_threats
from tests.placement.test_operational import assert_flyable, flying, solve, unhurried

COMMON = CameraRig()
SHARP = CameraRig(
    peripheral=FisheyeCamera(resolution_px=3008, distortion=(0.03, 0.0, 0.0, 0.0)),
    central=PinholeCamera(resolution_px=1920, fov_deg=40.0),
)
MOVING = Threat(id="a", position_m=(0.0, 0.0, 0.0), velocity_mps=(1.2, 0.9, 0.0))


def fleet(*rigs: CameraRig | None) -> tuple[AvailableHost, ...]:
    """Hosts h1, h2, ... in a row to the south."""
    return tuple(
        AvailableHost(id=f"h{k + 1}", position_m=(15.0 * k, -80.0, 40.0), rig=rig) for k, rig in enumerate(rigs)
    )


def by_trial(rigs: tuple[CameraRig, CameraRig]) -> float:
    """The least cost for ``MOVING`` of two central cameras on circles about the ends of its path."""
    ends = np.array([MOVING.position_m[:2], MOVING.predicted_m(10.0)[:2]])
    angles = np.radians(np.arange(0.0, 360.0, 2.0))
    circle = np.stack((np.sin(angles), np.cos(angles)), axis=-1)
    radii = np.array([20.0 + 1e-9, 21.0, 22.0, 24.0, 26.0, 29.0, 33.0, 38.0, 45.0])
    places = (ends[:, None, None] + radii[:, None, None] * circle).reshape(-1, 1, 2)
    rays = ends - places
    distances = np.hypot(rays[..., 0], rays[..., 1])
    directions = rays / distances[..., None]
    seen = []
    for rig in rigs:
        lens = rig.central
        within = (distances >= 20).all(axis=1) & (distances <= lens.focal_length_px / lens.min_pixels).all(axis=1)
        within &= (directions[:, 0] * directions[:, 1]).sum(axis=1) >= math.cos(math.radians(lens.fov_deg))
        seen.append((distances[within] ** 2 / lens.focal_length_px, directions[within]))
    (f, u), (g, v) = seen
    cross = u[:, None, :, 0] * v[None, :, :, 1] - u[:, None, :, 1] * v[None, :, :, 0]
    with np.errstate(divide="ignore"):
        return float((f[:, None] * g[None, :] / np.abs(cross)).sum(axis=-1).min())


@pytest.mark.parametrize("rigs", [(COMMON, SHARP), (SHARP, COMMON, COMMON), (COMMON, SHARP, SHARP)])
def test_the_best_two_of_different_hosts_are_those_that_trying_all_finds(rigs: tuple[CameraRig, ...]) -> None:
    problem = Problem(threats=(MOVING,), hosts=fleet(*rigs), formulation=Formulation.LETTER)
    placement = solve(problem, 2)
    trials = {pair: by_trial((rigs[pair[0]], rigs[pair[1]])) for pair in itertools.combinations(range(len(rigs)), 2)}
    best = min(trials, key=lambda pair: trials[pair])
    assert placement.cost is not None
    assert placement.cost <= trials[best] <= 1.05 * placement.cost
    assert placement.lower_bound <= placement.cost
    chosen = [problem.rig_of(pose.host) for pose in placement.hosts]
    assert chosen.count(SHARP) == sum(rigs[k] is SHARP for k in best)


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("seed", range(3))
def test_a_mixed_fleet_breaks_no_margin_of_any_hosts_own_cameras(seed: int, objective: Objective) -> None:
    problem = Problem(
        threats=flying(3, seed),
        hosts=fleet(SHARP, None, COMMON, SHARP, None, None),
        airspace=Airspace(floor_m=5.0, ceiling_m=100.0),
        objective=objective,
        safety_distance_m=15.0,
    )
    for count in (3, 5):
        assert_flyable(problem, solve(problem, count))


@pytest.mark.parametrize("formulation", list(Formulation))
def test_a_mixed_states_cost_is_that_of_the_reference_and_takes_no_host_twice(formulation: Formulation) -> None:
    threats = random_threats(3, np.random.default_rng(4))
    problem = Problem(threats=threats, hosts=fleet(SHARP, None, SHARP, None, None), formulation=formulation)
    q = question_of(problem, frame_of(problem))
    valid = 0
    for seed in range(4):
        state, best, chance = new_state(3, 4), new_state(3, 4), seeded(seed)
        scatter(q, state, chance)
        anneal(q, state, best, np.arange(4), np.arange(3), 30_000, 0.5, 1e-3, 25.0, 15.0, chance)
        assert (np.bincount(best.rigs, minlength=2) <= q.hosts_of_rig).all()
        cost, violation = totals(q, best)
        refresh(q, best)
        assert totals(q, best) == pytest.approx((cost, violation), rel=1e-9, abs=1e-12)
        placement = placement_of(problem, frame_of(problem), q, best)
        assert len({pose.host for pose in placement.hosts}) == 4
        if violation == 0:
            assert placement.cost == pytest.approx(cost, rel=1e-6)
            valid += 1
    assert valid > 0


@pytest.mark.parametrize("space", [False, True])
def test_no_two_hosts_of_a_mixed_fleet_go_below_the_bound(space: bool) -> None:
    threat = replace(MOVING, velocity_mps=(1.2, 0.9, 0.3)) if space else MOVING
    airspace = Airspace(floor_m=-30.0, ceiling_m=30.0) if space else Airspace()
    problem = Problem(threats=(threat,), hosts=fleet(SHARP, COMMON, COMMON), airspace=airspace)
    q = question_of(problem, frame_of(problem))
    bound = own_pair_bound_in_space(q, 0, 400) if space else own_pair_bound(q, 0, 50_000)
    alike = question_of(replace(problem, hosts=fleet(COMMON, COMMON)), frame_of(problem))
    assert bound < (own_pair_bound_in_space(alike, 0, 400) if space else own_pair_bound(alike, 0, 50_000))
    rng = np.random.default_rng(0)
    state, valid = new_state(1, 2), 0
    for end in range(2):
        set_view(state, 0, end, end, 0)
    for _ in range(20_000):
        state.positions[:, :2] = rng.uniform(-50, 50, (2, 2))
        state.positions[:, 2] = rng.uniform(-30, 30, 2) if space else 0.0
        state.axes[:] = -state.positions[:, :2] / np.linalg.norm(state.positions[:, :2], axis=1, keepdims=True)
        state.cameras[0], state.rigs[:] = rng.integers(0, 2, 2), [(0, 1), (1, 0), (1, 1)][rng.integers(3)]
        refresh(q, state)
        cost, violation = totals(q, state)
        valid += violation == 0
        assert violation > 0 or cost >= bound
    assert valid > 10


def test_hosts_stay_what_they_are_when_a_plan_is_made_again() -> None:
    threats = random_threats(3, np.random.default_rng(2), side_m=70.0)
    problem = Problem(threats=threats, hosts=fleet(SHARP, None, None, SHARP, None, None))
    flying_now = solve(problem, 4, rounds=3)
    later = replace(problem, threats=tuple(replace(t, position_m=t.predicted_m(1.0)) for t in threats))
    for count in (3, 4, 5):
        again = place(later, n_hosts=count, warm_start=flying_now, now=unhurried, iterations=1)
        assert_flyable(later, again)
    lost = replace(later, hosts=tuple(h for h in later.hosts if h.id != flying_now.hosts[0].host))
    assert_flyable(lost, place(lost, n_hosts=4, warm_start=flying_now, now=unhurried, iterations=1))


def test_along_the_frontier_every_number_of_mixed_hosts_gets_a_valid_plan_over_the_bound() -> None:
    problem = Problem(threats=flying(2, 1), hosts=fleet(None, SHARP, None, SHARP))
    found = frontier(problem, seed=0, deadline=math.inf, now=unhurried, iterations=2)
    assert set(found) == {2, 3, 4}
    for placement in found.values():
        assert_flyable(problem, placement)
        assert placement.lower_bound <= (placement.cost or 0.0)


def test_a_better_rig_never_costs_more_and_worse_hosts_stay_on_the_ground() -> None:
    threats = random_threats(2, np.random.default_rng(6))
    better = replace(COMMON, central=PinholeCamera(resolution_px=2560))
    alike = Problem(threats=threats, hosts=fleet(*[None] * 6))
    mixed = replace(alike, hosts=fleet(better, None, better, None, better, None))
    plain, sharp = solve(alike, 3, rounds=6), solve(mixed, 3, rounds=6)
    assert (sharp.cost or math.inf) < (plain.cost or 0.0)
    assert {pose.host for pose in sharp.hosts} == {"h1", "h3", "h5"}


def test_the_bound_of_a_rig_that_every_host_has_is_that_of_the_same_rig_for_all() -> None:
    threats = random_threats(2, np.random.default_rng(6))
    own = Problem(threats=threats, hosts=fleet(SHARP, SHARP, SHARP))
    common = replace(own, hosts=fleet(None, None, None), rig=SHARP)
    with ThreadPoolExecutor(1) as executor:
        bounds = [lower_bound(question_of(p, frame_of(p)), executor, thorough=False) for p in (own, common)]
    assert bounds[0] == bounds[1]
    assert solve(own, 3).cost == solve(common, 3).cost


def test_the_letters_methods_refuse_different_rigs() -> None:
    problem = Problem(threats=(MOVING,), hosts=fleet(None, SHARP), formulation=Formulation.LETTER)
    for method in (Method.LETTER, Method.COVERAGE_ONLY):
        with pytest.raises(BadInput, match="hosts: carry 2 different rigs"):
            place(problem, method=method, now=unhurried)


@pytest.mark.parametrize("formulation", list(Formulation))
def test_too_weak_rigs_are_named_as_the_reason(formulation: Formulation) -> None:
    blind = CameraRig(
        peripheral=FisheyeCamera(resolution_px=150), central=PinholeCamera(resolution_px=200, min_pixels=30.0)
    )
    problem = Problem(threats=(MOVING,), hosts=fleet(blind, None, blind), formulation=formulation)
    placement = place(problem, now=unhurried, iterations=3)
    assert placement.status is Status.INFEASIBLE
    assert placement.reason.endswith("cannot see every threat with their rigs; with the best of these rigs they could")
