"""The filter: equal to Stone Soup's, consistent with what it says of its own errors."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from hsop_gcs.reports import Bearing, Matrix3, Measurement, Report
from hsop_gcs.tracks.filter import FloatArray, State, innovate, predict
from tests.tracks.world import RULES, T0_S, advance, after, bearing, first_state, off_by, report, vector, wandering

GOLDEN = Path(__file__).parents[1] / "data" / "tracks" / "kalman.json"
METRE = 1.0
NOISE_M = 0.1
COMMON_M2 = 0.1**2 * np.diag([1.0, 2.0, 3.0])
CAMERAS_M = np.array([[-60.0, 0.0, 40.0], [60.0, -20.0, 45.0]])


def test_states_are_those_of_stone_soup_to_rounding() -> None:
    golden = json.loads(GOLDEN.read_text())
    alike = replace(RULES, first_climb_sigma_mps=RULES.first_velocity_sigma_mps)
    state: State | None = None
    for given, expected in zip(golden["reports"], golden["states"], strict=True):
        velocity, covariance = given.get("velocity_mps"), given.get("covariance_m2")
        measured = Report(
            source="oracle",
            threat_id=None,
            time_s=given["time_s"],
            position_m=vector(given["position_m"]),
            velocity_mps=None if velocity is None else vector(velocity),
            sigma_m=given["sigma_m"],
            covariance_m2=None if covariance is None else matrix(covariance),
        )
        state = first_state(measured, alike) if state is None else advance([state], [measured], alike)[0]
        assert state.mean == pytest.approx(expected["mean"], rel=1e-9, abs=1e-9 * METRE)
        assert state.covariance == pytest.approx(np.array(expected["covariance"]), rel=1e-9, abs=1e-9)


def test_a_batch_is_each_of_its_tracks_alone() -> None:
    rng = np.random.default_rng(1)
    states = [State(T0_S, rng.normal(size=6) * 50, np.diag(rng.uniform(1, 30, 6))) for _ in range(20)]
    measured: list[Measurement] = [
        bearing(0.1 * n, (0.0, 0.0, 0.0), vector(state.mean[:3] + 1.0), 0.01)
        if n % 3 == 2
        else report(0.1 * n, *(state.mean[:3] + 2.0), velocity_mps=(1.0, 2.0, 0.0) if n % 3 else None)
        for n, state in enumerate(states)
    ]
    together = advance(states, measured)
    for state, each, expected in zip(states, measured, together, strict=True):
        alone = advance([state], [each])[0]
        assert alone.mean == pytest.approx(expected.mean, rel=1e-12)
        assert alone.covariance == pytest.approx(expected.covariance, rel=1e-9, abs=1e-12)


def test_without_noise_a_prediction_and_one_back_is_where_it_was() -> None:
    mean, covariance = np.arange(6.0)[None], np.diag(np.arange(1.0, 7.0))[None]
    there = predict(mean, covariance, np.array([4.0]), 0.0)
    back = predict(*there, np.array([-4.0]), 0.0)
    assert back[0] == pytest.approx(mean)
    assert back[1] == pytest.approx(covariance)


def test_what_is_predicted_grows_less_certain_in_both_directions_of_time() -> None:
    covariance = np.eye(6)[None]
    for elapsed_s in (3.0, -3.0):
        _, predicted = predict(np.zeros((1, 6)), covariance, np.array([elapsed_s]), 1.0)
        assert np.linalg.eigvalsh(predicted[0] - covariance[0] * 0.09).min() > 0
        assert np.trace(predicted[0, :3, :3]) > 30


def test_a_bearing_is_known_better_across_its_ray_and_not_along_it() -> None:
    state = State(T0_S, np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0]), np.diag([25.0, 25, 25, 1, 1, 1]))
    after = advance([state], [bearing(0, (0.0, 0.0, 0.0), (0.0, 100.0, 0.0), 0.001)])[0]
    east, north, up = np.sqrt(np.diag(after.covariance)[:3])
    assert north == pytest.approx(5.0, abs=0.01 * METRE)
    assert max(east, up) < 0.5 * METRE


def test_two_bearings_bring_a_coarse_threat_to_where_they_cross() -> None:
    truth = (10.0, 80.0, 45.0)
    state = first_state(report(0, truth[0] + 12, truth[1] - 14, truth[2] + 9, sigma_m=15.0))
    for _ in range(3):
        for origin_m in CAMERAS_M:
            state = advance([state], [bearing(0, vector(origin_m), truth, 0.001)])[0]
    assert state.mean[:3] == pytest.approx(truth, abs=0.1 * METRE)


def test_a_bearing_away_from_the_threat_changes_nothing() -> None:
    state = State(T0_S, np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0]), np.diag([25.0, 25, 25, 1, 1, 1]))
    after = advance([state], [bearing(0, (0.0, 0.0, 0.0), (0.0, -100.0, 0.0), 0.001)])[0]
    assert after == state


def test_a_bearing_straight_up_is_as_good_as_any() -> None:
    seen = innovate(np.array([[3.0, 0.0, 50.0, 0, 0, 0]]), np.eye(6)[None], [bearing(0, (0, 0, 0), (0, 0, 1), 0.01)])
    assert np.linalg.norm(seen.residual) == pytest.approx(3.0 / 50.0)


def test_a_threat_that_speeds_up_is_followed() -> None:
    """From rest to 6 m/s in two seconds, then on."""
    state = first_state(report(0, 0, velocity_mps=(0.0, 0.0, 0.0), sigma_m=0.5))
    for number in range(1, 81):
        time_s = 0.1 * number
        east = 0.0 if time_s < 4 else 1.5 * (time_s - 4) ** 2 if time_s < 6 else 6.0 + 6.0 * (time_s - 6)
        state = advance([state], [report(time_s, east, sigma_m=0.5)])[0]
        assert state.mean[0] == pytest.approx(east, abs=1.5 * METRE)
    assert state.mean[0] == pytest.approx(18.0, abs=0.3 * METRE)
    assert state.mean[3] == pytest.approx(6.0, abs=0.5)


def test_a_jump_that_its_id_vouches_for_is_believed_more_than_the_prediction() -> None:
    still = first_state(report(0, 0, velocity_mps=(0.0, 0.0, 0.0)))
    jumped = advance([still], [report(1.0, 0.0, 25.0, velocity_mps=(0.0, 0.0, 0.0))])[0]
    assert jumped.mean[1] > 18.0 * METRE
    assert np.sqrt(jumped.covariance[1, 1]) < RULES.default_sigma_m


Source = Callable[[np.random.Generator, float, FloatArray], list[Measurement]]


def coarse_positions(rng: np.random.Generator, time_s: float, truth: FloatArray) -> list[Measurement]:
    return [report(time_s, *(truth[:3] + rng.normal(0, 15.0, 3)), sigma_m=15.0)]


def positions_and_velocities(rng: np.random.Generator, time_s: float, truth: FloatArray) -> list[Measurement]:
    velocity = vector(truth[3:] + rng.normal(0, RULES.velocity_sigma_mps, 3))
    return [report(time_s, *(truth[:3] + rng.normal(0, 5.0, 3)), sigma_m=5.0, velocity_mps=velocity)]


def fixes(rng: np.random.Generator, time_s: float, truth: FloatArray) -> list[Measurement]:
    root = rng.normal(size=(3, 3))
    covariance = root @ root.T * 0.3 + 0.01 * np.eye(3)
    position = rng.multivariate_normal(truth[:3], covariance)
    return [report(time_s, *position, covariance_m2=matrix(covariance))]


def bearings_of_two_cameras(rng: np.random.Generator, time_s: float, truth: FloatArray) -> list[Measurement]:
    return [
        Bearing(
            source=f"h{number}",
            time_s=T0_S + time_s,
            origin_m=vector(origin_m),
            direction=off_by(rng, truth[:3] - origin_m, 0.003),
            sigma_rad=0.003,
        )
        for number, origin_m in enumerate(CAMERAS_M)
    ]


@pytest.mark.parametrize("source", [coarse_positions, positions_and_velocities, fixes, bearings_of_two_cameras])
def test_errors_are_as_large_as_the_covariance_says(source: Source) -> None:
    """NEES of 60 runs of 40 steps of 0.5 s: its mean over the runs lies in its 95 % bounds, but for a few steps."""
    rng = np.random.default_rng(7)
    runs, steps, step_s = 60, 40, 0.5
    squared = np.zeros((runs, steps))
    for run in range(runs):
        start = np.hstack([rng.uniform([-30, 30, 10], [30, 90, 70]), rng.normal(0, 4.0, 3)])
        first = report(
            0,
            *(start[:3] + rng.normal(0, 15.0, 3)),
            sigma_m=15.0,
            velocity_mps=vector(start[3:] + rng.normal(0, 0.5, 3)),
        )
        state = first_state(first)
        truth = wandering(rng, start, steps, step_s, RULES.acceleration_psd_m2ps3)
        for step in range(steps):
            for each in source(rng, step * step_s, truth[step]):
                state = advance([state], [each])[0]
            error = truth[step] - state.mean
            squared[run, step] = error @ np.linalg.solve(state.covariance, error)
    low, high = (float(chi2.ppf(tail, 6 * runs)) / runs for tail in (0.025, 0.975))
    mean = squared[:, 5:].mean(axis=0)
    assert np.mean((mean > low) & (mean < high)) >= 0.85
    assert mean.mean() == pytest.approx(6.0, abs=0.4)


def misplaced_fixes(
    truth: FloatArray, common_m2: FloatArray, rng: np.random.Generator, *, said: bool = True
) -> list[Report]:
    """Fixes five times a second that are all off by the same, of covariance ``common_m2``, and by some noise each."""
    covariance_m2 = matrix(common_m2 + NOISE_M**2 * np.eye(3))
    return [
        report(0.2 * step, *place_m, covariance_m2=covariance_m2, common_m2=matrix(common_m2) if said else None)
        for step, place_m in enumerate(
            truth[:, :3] + rng.multivariate_normal(np.zeros(3), common_m2) + rng.normal(0.0, NOISE_M, (len(truth), 3))
        )
    ]


def matrix(values: FloatArray) -> Matrix3:
    first, second, third = (vector(row) for row in values)
    return (first, second, third)


@pytest.mark.parametrize("said", [True, False])
def test_an_error_that_fixes_have_in_common_is_in_the_covariance_if_it_is_said(said: bool) -> None:
    rng = np.random.default_rng(5)
    rules = replace(RULES, acceleration_psd_m2ps3=0.05)
    squared = []
    for _ in range(60):
        truth = wandering(rng, np.array([0.0, 50.0, 40.0, 2.0, 0.0, 0.0]), 50, 0.2, rules.acceleration_psd_m2ps3)
        seen = misplaced_fixes(truth, COMMON_M2, rng, said=said)
        track = after(*seen, rules=rules).tracks["t1"]
        error = truth[-1] - track.state.mean
        squared.append(error @ np.linalg.solve(track.covariance, error))
    low, high = (float(chi2.ppf(tail, 6 * len(squared))) / len(squared) for tail in (0.025, 0.975))
    assert bool(low < np.mean(squared) < high) is said


def test_neither_a_bearing_nor_another_source_betters_what_fixes_have_in_common() -> None:
    truth = np.tile([0.0, 50.0, 40.0, 0.0, 0.0, 0.0], (50, 1))
    seen: list[Measurement] = [*misplaced_fixes(truth, COMMON_M2, np.random.default_rng(6))]
    for number in range(50):
        time_s = 10.0 + 0.1 * number
        seen += [
            bearing(time_s, (0.0, 0.0, 40.0), (0.0, 50.0, 40.0), 1e-4, track_id="t1"),
            report(time_s + 0.05, 0.0, 50.0, sigma_m=RULES.min_sigma_m),
        ]
    covariance = after(*seen).tracks["t1"].covariance
    assert np.linalg.eigvalsh(covariance[:3, :3] - COMMON_M2).min() > 0
