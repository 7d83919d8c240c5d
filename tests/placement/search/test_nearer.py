"""Nearer placements: sooner reached, hardly dearer, and still plans that keep every rule."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.objective import margins
from hsop_gcs.placement.problem import AvailableHost, Problem, Threat
from hsop_gcs.placement.search import search
from hsop_gcs.placement.search.nearer import nearer
from hsop_gcs.placement.solution import Placement, Status

HOMES = tuple((12.0 * (k % 2), 12.0 * (k // 2), 25.0) for k in range(6))
RULE_TOLERANCE = 1e-6


def problem_of(threats: int, seed: int) -> Problem:
    rng = np.random.default_rng(seed)
    return Problem(
        threats=tuple(
            Threat(
                id=f"t{k}",
                position_m=(float(60 * k - 30 + rng.uniform(-9, 9)), float(rng.uniform(90, 130)), 40.0),
                velocity_mps=(float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)), 0.0),
            )
            for k in range(threats)
        ),
        hosts=tuple(AvailableHost(id=f"h{k}", position_m=home) for k, home in enumerate(HOMES[: 2 * threats])),
        airspace=Airspace(floor_m=20.0, ceiling_m=60.0),
        min_separation_m=10.0,
    )


def searched(problem: Problem, hosts: int) -> Placement:
    return search(problem, n_hosts=hosts, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=4)


def longest_m(placement: Placement, problem: Problem) -> float:
    at = np.array([pose.position_m for pose in placement.hosts])
    ways_m = cdist(at, np.array([host.position_m for host in problem.hosts]))
    points, takers = linear_sum_assignment(ways_m**2)
    return float(ways_m[points, takers].max())


@pytest.mark.parametrize(("threats", "hosts"), [(1, 2), (2, 4), (2, 3), (3, 6)])
def test_hosts_are_sooner_there_for_little_more_cost_and_every_rule_holds(threats: int, hosts: int) -> None:
    gained = 0
    for seed in range(4):
        problem = problem_of(threats, seed)
        before = searched(problem, hosts)
        after = nearer(problem, before, tolerance=0.2, climb=1.0)
        if after is None:
            continue
        gained += 1
        assert before.cost is not None
        assert after.cost is not None
        assert after.cost <= 1.2 * before.cost * (1 + RULE_TOLERANCE)
        assert longest_m(after, problem) < longest_m(before, problem)
        assert (after.status is Status.OPTIMAL) is (after.cost <= 1.001 * after.lower_bound)
        views = {pair.threat: pair.views for pair in after.pairs}
        assert margins(problem, after.hosts, views).smallest >= -RULE_TOLERANCE
    assert gained


def test_where_climbing_takes_long_hosts_keep_their_altitude_where_they_can() -> None:
    for seed in range(4):
        problem = problem_of(2, seed)
        before = searched(problem, 4)
        after = nearer(problem, before, tolerance=0.2, climb=6.0)
        assert after is not None
        climbs_m = [sum(abs(pose.position_m[2] - 25.0) for pose in each.hosts) for each in (before, after)]
        assert climbs_m[1] < climbs_m[0]


def flown_to(problem: Problem, placement: Placement) -> Problem:
    """The problem when its hosts are where a placement wants them."""
    there = tuple(AvailableHost(id=pose.host, position_m=pose.position_m) for pose in placement.hosts)
    return replace(problem, hosts=there)


def test_nothing_is_nearer_for_hosts_that_are_there() -> None:
    problem = problem_of(2, seed=0)
    there = searched(problem, 4)
    assert nearer(flown_to(problem, there), there, tolerance=0.2, climb=1.0) is None


def test_when_threats_have_moved_a_little_hosts_move_less_if_the_flying_placement_is_mended() -> None:
    ways_m: dict[bool, float] = {True: 0.0, False: 0.0}
    for seed in range(8):
        problem = problem_of(2, seed)
        flying = searched(problem, 4)
        moved = tuple(replace(each, position_m=(*each.predicted_m(2.0)[:2], 36.0)) for each in problem.threats)
        now = flown_to(replace(problem, threats=moved), flying)
        before = searched(now, 4)
        for mending in ways_m:
            after = nearer(now, before, tolerance=0.2, climb=1.0, flying=flying if mending else None) or before
            assert before.cost is not None
            assert after.cost is not None
            assert after.cost <= 1.2 * before.cost * (1 + RULE_TOLERANCE)
            views = {pair.threat: pair.views for pair in after.pairs}
            assert margins(now, after.hosts, views).smallest >= -RULE_TOLERANCE
            ways_m[mending] += longest_m(after, now)
    assert ways_m[True] < 0.7 * ways_m[False]
