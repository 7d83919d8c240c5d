"""Gates let through what they say, and the quick answers never contradict them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.reports import Report
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import State
from hsop_gcs.tracks.gate import distances as bearing_distances
from hsop_gcs.tracks.gate import gate, threshold
from hsop_gcs.tracks.history import Log
from hsop_gcs.tracks.measured import rows_of
from tests.tracks.world import RULES, T0_S, bearing, distances, report


@pytest.mark.parametrize(("dimensions", "expected"), [(2, 13.816), (3, 16.266), (6, 22.458)])
def test_the_gate_is_the_quantile_of_the_tables(dimensions: int, expected: float) -> None:
    assert threshold(dimensions, 0.001) == pytest.approx(expected, abs=0.001)


def test_a_threats_own_reports_lie_in_its_gate_as_often_as_the_rule_says() -> None:
    rng = np.random.default_rng(3)
    state = State(T0_S, np.zeros(6), np.diag([9.0, 9, 9, 1, 1, 1]))
    places = rng.multivariate_normal(np.zeros(3), np.eye(3) * (9.0 + 4.0), 20_000)
    squared = distances([state] * len(places), [report(0, *each, sigma_m=2.0) for each in places])
    assert np.mean(squared > threshold(3, 0.01)) == pytest.approx(0.01, abs=0.003)


def test_what_lies_behind_a_camera_is_not_explained_by_its_bearing() -> None:
    state = State(T0_S, np.array([0.0, 50.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6))
    seen = [bearing(0, (0.0, 0.0, 0.0), (0.0, north, 0.0), 0.01) for north in (1.0, -1.0)]
    squared, _ = bearing_distances([state] * 2, seen, RULES)
    assert squared.tolist() == [pytest.approx(0.0), np.inf]


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
    log, rows = Log(), rows_of([seen], RULES)
    facts = np.zeros((1, kernels.FACTS))
    facts[0, kernels.NEWEST] = log.add(-1, seen, rows[0], state)
    cost, _ = kernels.in_gates(*log.steps[:3], facts, rows, RULES.acceleration_psd_m2ps3, RULES.scan_s)
    assert (cost[0, 0] < kernels.FORBIDDEN) == (distances([state], [seen])[0] <= gate(seen, RULES))
