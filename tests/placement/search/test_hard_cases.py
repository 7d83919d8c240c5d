"""Scenarios with many near-best placements, in which the search once took seconds or stopped short of the best."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hsop_gcs.bench.scenarios import side_of_square_m
from hsop_gcs.placement.problem import Formulation, Problem
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.rounds import LANES, Course
from tests.placement.examples import random_threats

ROUNDS = 40


@pytest.mark.parametrize(
    ("threats", "n_hosts", "scenario", "best_known"),
    [(6, 6, 9602, 4.917973), (7, 3, 8707, 224.1130), (8, 8, 9801, 31.95506)],
    ids=["a chain of pairs", "few hosts with many views", "one part of eight"],
)
def test_the_search_comes_within_two_percent_of_the_best_known(
    threats: int, n_hosts: int, scenario: int, best_known: float
) -> None:
    drawn = random_threats(threats, np.random.default_rng(scenario), side_of_square_m(threats))
    problem = Problem(threats=drawn, formulation=Formulation.LETTER)
    course = Course(question_of(problem, frame_of(problem)), n_hosts, 0)
    with ThreadPoolExecutor(LANES) as executor:
        while course.round < ROUNDS and course.pool.cost > 1.02 * best_known:
            course.advance(executor)
    assert course.pool.cost <= 1.02 * best_known
