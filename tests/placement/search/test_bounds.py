"""Bounds hold for whatever is placed at random."""

import math

import numpy as np
import pytest

from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search.bounds import fewest_hosts, lower_bound
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.solve import search
from tests.placement.examples import random_threats


@pytest.mark.parametrize("seed", range(4))
def test_no_placement_goes_below_the_bound(seed: int) -> None:
    problem = Problem(threats=random_threats(2, np.random.default_rng(seed)), formulation=Formulation.LETTER)
    bound = lower_bound(question_of(problem, frame_of(problem)))
    placement = search(problem, n_hosts=4, seed=seed, deadline=math.inf, now=lambda: 0.0, iterations=2)
    assert placement.cost is not None
    assert 0 < bound <= placement.cost


def test_threats_that_no_host_sees_together_need_two_hosts_each() -> None:
    places = (0.0, 50.0, 400.0, 450.0, 900.0)
    threats = tuple(Threat(id=f"t{k}", position_m=(x, 0.0, 0.0)) for k, x in enumerate(places))
    problem = Problem(threats=threats, formulation=Formulation.LETTER)
    assert fewest_hosts(question_of(problem, frame_of(problem))) == 6


def test_threats_side_by_side_need_no_more_than_two_hosts() -> None:
    threats = tuple(Threat(id=f"t{k}", position_m=(10.0 * k, 0.0, 0.0)) for k in range(4))
    problem = Problem(threats=threats, formulation=Formulation.LETTER)
    assert fewest_hosts(question_of(problem, frame_of(problem))) == 2
