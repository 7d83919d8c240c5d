"""The bound for hosts that threats have to share: nothing that keeps the rules is below it, and it is worth having."""

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.search import frontier, search
from hsop_gcs.placement.search.bounds import own_bounds
from hsop_gcs.placement.search.chance import seeded
from hsop_gcs.placement.search.known import NO_POSES
from hsop_gcs.placement.search.model import Question
from hsop_gcs.placement.search.neighbourhood import fresh
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.shared import shared_bounds
from hsop_gcs.placement.search.state import State, new_state, refresh, set_view, totals
from hsop_gcs.placement.solution import Status
from tests.placement.examples import problem, random_threats, read
from tests.placement.test_properties import by_brute_force

CELLS = 1_200


def bounds(question: Problem, n_hosts: int, cost: float = 50.0, cells: int = CELLS) -> tuple[float, float]:
    """The bound without and with regard to shared hosts."""
    q = question_of(question, frame_of(question))
    with ThreadPoolExecutor(1) as executor:
        own = own_bounds(q, executor, thorough=False)
        return float(own.sum()), shared_bounds(q, {n_hosts: cost}, own, executor, most_cells=cells)[n_hosts]


def drawn(threats: int, seed: int, side_m: float = 50.0, **settings: object) -> Problem:
    return Problem(
        threats=random_threats(threats, np.random.default_rng(seed), side_m),
        formulation=Formulation.LETTER,
        **settings,  # type: ignore[arg-type]
    )


def scattered(q: Question, n_hosts: int, rng: np.random.Generator) -> Iterator[State]:
    """Hosts at random about the threats, each threat seen by two of them, no host idle."""
    threats = len(q.weight)
    while True:
        ends = np.concatenate([rng.permutation(n_hosts), rng.integers(0, n_hosts, 2 * threats - n_hosts)])
        pairs = rng.permutation(ends).reshape(threats, 2)
        if (pairs[:, 0] == pairs[:, 1]).any():
            continue
        state = new_state(threats, n_hosts)
        middle = q.points_m[:, :, :2].mean(axis=(0, 1))
        state.positions[:, :2] = middle + rng.normal(0, 25, (n_hosts, 2))
        angles = rng.uniform(0, 2 * np.pi, n_hosts)
        state.axes[:, 0], state.axes[:, 1] = np.sin(angles), np.cos(angles)
        for threat in range(threats):
            for end in range(2):
                set_view(state, threat, end, int(pairs[threat, end]), int(rng.integers(2)))
        refresh(q, state)
        yield state


@pytest.mark.parametrize("seed", range(3))
def test_brute_force_over_poses_pairs_and_cameras_is_never_below_it(seed: int) -> None:
    question = drawn(2, seed, side_m=30.0)
    by_trial = by_brute_force(question)
    for n_hosts in (2, 3):
        own, shared = bounds(question, n_hosts)
        assert own <= shared <= by_trial[n_hosts]


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("n_hosts", [2, 3, 4, 5])
def test_no_placement_of_three_threats_is_below_it(n_hosts: int, objective: Objective) -> None:
    question = drawn(3, 5, side_m=40.0, objective=objective)
    q = question_of(question, frame_of(question))
    _, bound = bounds(question, n_hosts)
    rng, valid = np.random.default_rng(n_hosts), 0
    for _, state in zip(range(1_500), scattered(q, n_hosts, rng), strict=False):
        cost, violation = totals(q, state)
        valid += violation <= 0
        assert violation > 0 or cost >= bound
    state, trial = new_state(3, n_hosts), new_state(3, n_hosts)
    for seed in range(20):
        fresh(q, state, trial, 2_000, 25.0, NO_POSES, seeded(seed))
        cost, violation = totals(q, state)
        valid += violation <= 0
        assert violation > 0 or cost >= bound
    assert valid > 5


@pytest.mark.parametrize(
    ("name", "n_hosts", "times_own", "times_best"),
    [
        ("2-threats-102", 3, 1.5, 1.3),
        ("2-threats-103", 3, 1.7, 1.1),
        ("2-threats-104", 2, 1.9, 3.0),
        ("3-threats-105", 5, 1.3, 1.2),
    ],
)
def test_it_is_nearer_to_the_best_known_than_the_sum_of_single_threats(
    name: str, n_hosts: int, times_own: float, times_best: float
) -> None:
    best = read("best-known")[name][str(n_hosts)]
    own, shared = bounds(problem(name), n_hosts, best)
    assert times_own * own <= shared <= best <= times_best * shared


def test_more_cells_never_lower_it_and_it_falls_with_the_number_of_hosts() -> None:
    question = drawn(2, 1, side_m=40.0)
    three = bounds(question, 3)[1]
    assert bounds(question, 3, cells=300)[1] <= three <= bounds(question, 2)[1] * (1 + 1e-9)


def test_a_plan_tells_it() -> None:
    found = search(problem("2-threats-103"), n_hosts=3, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=2)
    assert found.cost is not None
    assert found.status is Status.FEASIBLE
    assert 0.9 * found.cost <= found.lower_bound <= found.cost


def test_a_frontier_tells_it_for_every_number_of_hosts() -> None:
    question = problem("2-threats-103")
    found = frontier(question, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=2)
    bounds_of = {number: placement.lower_bound for number, placement in found.items()}
    assert bounds_of[2] >= bounds_of[3] * (1 - 1e-9) > 1.7 * bounds_of[4]
    assert all(placement.lower_bound <= (placement.cost or 0.0) for placement in found.values())
