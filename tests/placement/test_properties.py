"""Laws that every placement obeys, held on scenarios that Hypothesis draws, the same ones every time."""

import itertools
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search import frontier, search
from hsop_gcs.placement.solution import Placement
from tests.placement.examples import random_threats
from tests.placement.test_operational import assert_flyable, square

Floats = npt.NDArray[np.float64]

few = settings(derandomize=True, max_examples=2, deadline=None, database=None)
seeds = st.integers(0, 10_000)
CENTRAL_PX, PERIPHERAL_PX = 4.8 / 4.8 * 1280, 1.0 / 3.3 * 1504
"""Focal lengths (letter, Table 1)."""


def solve(problem: Problem, n_hosts: int, rounds: int) -> Placement:
    return search(problem, n_hosts=n_hosts, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=rounds)


def cost_of(placement: Placement) -> float:
    assert placement.cost is not None, placement.reason
    return placement.cost


def drawn(threats: int, seed: int, formulation: Formulation, side_m: float = 50.0) -> Problem:
    return Problem(threats=random_threats(threats, np.random.default_rng(seed), side_m), formulation=formulation)


def looks(problem: Problem) -> tuple[Floats, Floats]:
    """Ways for a host to look at two threats, on rings about their points: the letter's text, worked out by itself.

    Returns (threats, ways, points) distances over pixels, infinite where a rule is broken, and bearings, radians.
    """
    points = np.array([[t.position_m[:2], t.predicted_m(problem.horizon_s)[:2]] for t in problem.threats])
    angles = np.radians(np.arange(0.0, 360.0, 20.0))
    ring = np.stack((np.sin(angles), np.cos(angles)), axis=-1)
    places = (points.reshape(-1, 1, 1, 2) + np.array([20.001, 24.0, 32.0])[:, None, None] * ring).reshape(-1, 2)
    rays = points[:, None] - places[:, None]
    away, bearings = np.hypot(rays[..., 0], rays[..., 1]), np.arctan2(rays[..., 0], rays[..., 1])
    near = (away < problem.safety_distance_m).any(axis=2)
    factors, seen_from = [], []

    def wide(which: list[int]) -> npt.NDArray[np.bool_]:
        offs = bearings[which] - bearings[which[0], :, :1]
        offs = (offs + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(np.ptp(offs, axis=(0, 2)) > math.radians(53))

    def central(threat: int) -> Floats:
        factor = away[threat] ** 2 / CENTRAL_PX
        return np.where((near[threat] | (away[threat] > CENTRAL_PX / 30).any(axis=1))[:, None], np.inf, factor)

    def peripheral(threat: int, heading: Floats) -> Floats:
        off = np.abs((bearings[threat] - heading[:, None] + np.pi / 2) % np.pi - np.pi / 2) + 1e-9
        pixels = PERIPHERAL_PX / away[threat] * off / np.tan(off)
        return np.where((near[threat] | (pixels < 5).any(axis=1))[:, None], np.inf, away[threat] / pixels)

    nothing = np.full(away.shape[1:], np.inf)
    for a, b in ((0, 1), (1, 0)):
        together = wide([a, b])[:, None]
        alone = np.where(wide([a])[:, None], np.inf, central(a))
        at_b, at_a = bearings[b].mean(axis=1), bearings[a].mean(axis=1)
        for first, second in (
            (alone, nothing),
            (np.where(together, np.inf, central(a)), np.where(together, np.inf, central(b))),
            (alone, peripheral(b, bearings[b, :, 0])),
            (alone, peripheral(b, bearings[b, :, 1])),
            (peripheral(a, at_b), peripheral(b, at_b)),
            (peripheral(a, 0.5 * (at_a + at_b)), peripheral(b, 0.5 * (at_a + at_b))),
        ):
            factors.append((first, second) if a == 0 else (second, first))
            seen_from.append(bearings)
    return np.concatenate(factors, axis=1), np.concatenate(seen_from, axis=1)


def by_brute_force(problem: Problem) -> dict[int, float]:
    """The least cost of two threats for 2, 3 and 4 hosts, over all pairs of ways to look."""
    factors, bearings = looks(problem)
    useful = np.isfinite(factors).all(axis=2).any(axis=0)
    factors, bearings = factors[:, useful], bearings[:, useful]
    costs = []
    for factor, bearing in zip(factors, bearings, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            pairs = factor[:, None] * factor[None] / np.abs(np.sin(bearing[:, None] - bearing[None]))
        costs.append(np.where(np.isfinite(pairs), pairs, np.inf).sum(axis=2))
    one, other = costs
    return {
        2: float((one + other).min()),
        3: float((one.min(axis=1) + other.min(axis=1)).min()),
        4: float(one.min() + other.min()),
    }


@few
@given(seeds)
def test_brute_force_over_poses_pairs_and_cameras_finds_nothing_better_and_comes_not_too_far(seed: int) -> None:
    problem = drawn(2, seed, Formulation.LETTER, side_m=30.0)
    for hosts, by_trial in by_brute_force(problem).items():
        placement = solve(problem, hosts, rounds=6)
        assert placement.lower_bound <= cost_of(placement) <= by_trial * (1 + 1e-9)
        assert by_trial <= 4 * cost_of(placement)


@pytest.mark.parametrize("formulation", list(Formulation))
@few
@given(seeds, st.floats(0, 2 * math.pi), st.tuples(*2 * [st.floats(-2000, 2000)]), st.booleans())
def test_turning_moving_and_mirroring_change_nothing(
    formulation: Formulation, seed: int, turn_rad: float, shift_m: tuple[float, float], flip: bool
) -> None:
    problem = drawn(3, seed, formulation)
    c, s, side = math.cos(turn_rad), math.sin(turn_rad), -1 if flip else 1

    def moved(threat: Threat) -> Threat:
        (x, y, z), (u, v, w) = threat.position_m, threat.velocity_mps
        x, u = side * x, side * u
        at = (c * x - s * y + shift_m[0], s * x + c * y + shift_m[1], z)
        return replace(threat, position_m=at, velocity_mps=(c * u - s * v, s * u + c * v, w))

    other = replace(problem, threats=tuple(map(moved, problem.threats)))
    assert cost_of(solve(other, 4, rounds=2)) == pytest.approx(cost_of(solve(problem, 4, rounds=2)), rel=1e-3)


@pytest.mark.parametrize(("formulation", "tolerance"), [(Formulation.LETTER, 1e-6), (Formulation.OPERATIONAL, 0.01)])
@few
@given(seeds)
def test_a_host_more_never_costs_more(formulation: Formulation, tolerance: float, seed: int) -> None:
    """But for the room it takes where hosts keep apart: every host that is placed has to see something."""
    problem = drawn(3, seed, formulation)
    costs = [cost_of(solve(problem, hosts, rounds=8)) for hosts in (3, 4, 5, 6)]
    for fewer, more in itertools.pairwise(costs):
        assert more <= fewer * (1 + tolerance)


@few
@given(seeds)
def test_a_threat_more_never_costs_less(seed: int) -> None:
    problem = drawn(4, seed, Formulation.LETTER)
    costs = [cost_of(solve(replace(problem, threats=problem.threats[:count]), 4, rounds=8)) for count in range(2, 5)]
    for fewer, more in itertools.pairwise(costs):
        assert fewer <= more * (1 + 1e-6)


@few
@given(seeds, st.floats(10, 40), st.floats(10, 40), st.floats(3, 9))
def test_among_fences_and_keep_outs_every_plan_of_the_frontier_is_flyable_and_a_host_more_never_costs_more(
    seed: int, east_m: float, north_m: float, half_m: float
) -> None:
    airspace = Airspace(
        inside=(square(25.0, 25.0, 75.0),), keep_outs=(KeepOut(polygon=square(east_m, north_m, half_m)),)
    )
    problem = replace(drawn(2, seed, Formulation.OPERATIONAL), airspace=airspace)
    found = frontier(problem, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=2)
    assert max(found) == 4
    for placement in found.values():
        assert_flyable(problem, placement)
    for fewer, more in itertools.pairwise(sorted(found)):
        assert cost_of(found[more]) <= cost_of(found[fewer]) * (1 + 1e-9)
