"""The benchmark itself on a little, and that the global search is not beaten at equal time.

pytest tests/bench --override-ini addopts=
"""

import math

import pytest

from hsop_gcs.bench.contenders import CONTENDERS, by_search
from hsop_gcs.bench.measure import Growth, best_of, compare, exponent_of, seconds_to
from hsop_gcs.bench.scenarios import Case, random_case, shipped

CASES = [*shipped(quick=True), *(random_case(threats, 0) for threats in (2, 3, 5, 10, 20))]
EQUAL = 1.001
"""Costs within the tolerance of the interior-point methods count as equal."""


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_at_equal_time_no_other_method_is_better(case: Case) -> None:
    found = compare(case, CONTENDERS, 1.0)
    costs = {run.contender: run.cost for run in found.runs}
    assert costs["search"] <= EQUAL * min(costs.values())


def test_the_cost_of_the_search_is_reached_again_by_counting_rounds() -> None:
    case = random_case(2, 0)
    assert seconds_to(case, 1.05 * by_search(case, 0.3)) is not None
    assert seconds_to(Case(name="none", problem=case.problem, n_hosts=3), 0.0) is None


def test_the_uncut_letters_method_is_a_run_of_its_own() -> None:
    case = random_case(2, 0)
    contenders = {"letter": lambda _case, seconds: 3.0 if seconds < 5 else 2.0}
    found = compare(case, contenders, 1.0, uncut_s=9.0)
    assert [run.cost for run in found.runs] == [3.0]
    assert found.uncut is not None
    assert found.uncut.cost == best_of(found) == 2.0


def test_the_exponent_is_the_slope_of_the_logarithms() -> None:
    growth = [Growth(threats=n, n_hosts=n, seconds=0.01 * n**2, each_s=(0.01 * n**2,), missed=0) for n in (2, 5, 10)]
    growth.append(Growth(threats=20, n_hosts=20, seconds=math.inf, each_s=(), missed=3))
    assert exponent_of(growth) == pytest.approx(2.0)
