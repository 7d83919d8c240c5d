"""Placements of one number of hosts as starts for one host more."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search.numbers import Courses, least_acceptable, with_another_host
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.rounds import Course
from hsop_gcs.placement.search.solve import search
from hsop_gcs.placement.search.state import totals
from hsop_gcs.placement.solution import Placement, worst_error_m
from tests.placement.examples import random_threats


def some_courses(formulation: Formulation) -> Courses:
    problem = Problem(threats=random_threats(3, np.random.default_rng(3)), formulation=formulation)
    return Courses(question_of(problem, frame_of(problem)), seed=0)


@pytest.mark.parametrize("formulation", list(Formulation))
def test_a_host_more_is_valid_and_costs_no_more_where_hosts_may_stand_together(formulation: Formulation) -> None:
    courses = some_courses(formulation)
    with ThreadPoolExecutor(2) as executor:
        courses.advance(3, executor)
    best = courses.course(3).pool.best
    assert best is not None
    more = with_another_host(courses.q, best)
    assert more
    assert all(len(state.degree) == 4 and state.degree.min() >= 1 for state in more)
    cost, violation = min((totals(courses.q, state) for state in more), key=lambda worth: (worth[1], worth[0]))
    assert violation <= 0
    if formulation is Formulation.LETTER:
        assert cost <= best.cost.sum() * (1 + 1e-9)


@pytest.mark.parametrize("least", [2, 3, 5])
@pytest.mark.parametrize("first", [None, 2, 4, 6])
def test_the_least_acceptable_number_is_found_from_wherever_it_starts(least: int, first: int | None) -> None:
    courses = some_courses(Formulation.LETTER)

    def accept(course: Course) -> bool:
        return course.pool.best is not None and course.n_hosts >= least

    with ThreadPoolExecutor(2) as executor:
        assert least_acceptable(courses, range(2, 7), accept, executor, first) == least


def test_without_an_acceptable_number_the_largest_is_the_answer_and_without_any_placement_there_is_none() -> None:
    courses = some_courses(Formulation.LETTER)
    with ThreadPoolExecutor(2) as executor:
        assert least_acceptable(courses, range(2, 5), lambda _course: False, executor) == 4
        far = tuple(Threat(id=f"t{k}", position_m=(400.0 * k, 0.0, 0.0)) for k in range(2))
        problem = Problem(threats=far, formulation=Formulation.LETTER)
        apart = Courses(question_of(problem, frame_of(problem)), seed=0)
        assert least_acceptable(apart, range(2, 4), lambda course: course.pool.best is not None, executor) is None


def with_target(problem: Problem, target_m: float) -> Placement:
    return search(
        problem, n_hosts=None, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=4, target_error_m=target_m
    )


def test_a_target_error_is_kept_by_the_placement_that_is_answered() -> None:
    problem = Problem(threats=random_threats(3, np.random.default_rng(3)))
    free = search(problem, n_hosts=5, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=4)
    target_m = 1.2 * worst_error_m(free)
    aimed = with_target(replace(problem, max_hosts=6), target_m)
    assert worst_error_m(aimed) <= target_m
    assert len(aimed.hosts) <= 5


@pytest.mark.parametrize(("seed", "hosts"), [(3, 4), (0, 3)])
def test_a_number_whose_least_cost_misses_the_target_is_taken_if_another_placement_of_it_does_not(
    seed: int, hosts: int
) -> None:
    problem = Problem(threats=random_threats(3, np.random.default_rng(seed)))
    least_costly = search(problem, n_hosts=hosts, seed=0, deadline=math.inf, now=lambda: 0.0, iterations=8)
    target_m = 0.8 * worst_error_m(least_costly)
    aimed = with_target(replace(problem, max_hosts=hosts), target_m)
    assert worst_error_m(aimed) <= target_m
    assert (aimed.cost or 0.0) >= (1 - 1e-6) * (least_costly.cost or math.inf) or len(aimed.hosts) < hosts
