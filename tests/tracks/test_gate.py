"""Gates let through what they say, and the quick answers never contradict them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.reports import Report
from hsop_gcs.tracks.filter import State, surely_within
from hsop_gcs.tracks.gate import Stack, distances, explained, gate, threshold
from tests.tracks.world import RULES, T0_S, bearing, report


@pytest.mark.parametrize(("dimensions", "expected"), [(2, 13.816), (3, 16.266), (6, 22.458)])
def test_the_gate_is_the_quantile_of_the_tables(dimensions: int, expected: float) -> None:
    assert threshold(dimensions, 0.001) == pytest.approx(expected, abs=0.001)


def test_a_threats_own_reports_lie_in_its_gate_as_often_as_the_rule_says() -> None:
    rng = np.random.default_rng(3)
    state = State(T0_S, np.zeros(6), np.diag([9.0, 9, 9, 1, 1, 1]))
    places = rng.multivariate_normal(np.zeros(3), np.eye(3) * (9.0 + 4.0), 20_000)
    squared, _ = distances([state] * len(places), [report(0, *each, sigma_m=2.0) for each in places], RULES)
    assert np.mean(squared > threshold(3, 0.01)) == pytest.approx(0.01, abs=0.003)


def test_what_lies_behind_a_camera_is_not_explained_by_its_bearing() -> None:
    state = State(T0_S, np.array([0.0, 50.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6))
    assert explained(state, bearing(0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.01), RULES)
    assert not explained(state, bearing(0, (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 0.01), RULES)


@st.composite
def pairs(draw: st.DrawFn) -> tuple[State, Report]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(6, 6)) * rng.uniform(0.1, 5.0, 6)
    state = State(T0_S, rng.normal(size=6) * 10, root @ root.T + 0.01 * np.eye(6))
    place = state.mean[:3] + rng.normal(size=3) * rng.uniform(0, 30)
    velocity = (0.0, 1.0, 0.0) if rng.uniform() < 0.5 else None
    sigma_m = float(rng.uniform(0.1, 10.0))
    return state, report(float(rng.uniform(-3, 3)), *place, sigma_m=sigma_m, velocity_mps=velocity)


@given(pairs())
def test_quick_answers_agree_with_the_gate(pair: tuple[State, Report]) -> None:
    state, seen = pair
    inside = explained(state, seen, RULES)
    assert np.isfinite(Stack({"t1": state}).in_gates([seen], RULES)[0, 0]) == inside
    if surely_within(state, seen, gate(seen, RULES), RULES):
        assert inside
