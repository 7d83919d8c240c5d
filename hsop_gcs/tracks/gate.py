"""Chi-square gates: whether a measurement can be of a threat, judged by what both are said to be worth."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import chdtri

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks.filter import (
    FloatArray,
    State,
    dimension,
    innovate,
    position_noise,
    predict,
    squared_distance,
    subset,
)
from hsop_gcs.tracks.rules import TrackRules


@lru_cache
def threshold(dimensions: int, miss_probability: float) -> float:
    """Return the squared distance that a threat's own measurement exceeds with ``miss_probability``."""
    return float(chdtri(dimensions, miss_probability))


def gate(measurement: Measurement, rules: TrackRules) -> float:
    """Return the squared distance up to which a measurement without an id belongs to a threat."""
    return threshold(dimension(measurement), 1.0 - rules.gate_probability)


def impossible(measurement: Measurement, rules: TrackRules) -> float:
    """Return the squared distance from which on a measurement is of another threat, whatever id it bears."""
    return threshold(dimension(measurement), rules.impossible_probability)


def predicted(states: Sequence[State], times_s: Sequence[float], rules: TrackRules) -> tuple[FloatArray, FloatArray]:
    """Return the states' means (n, 6) and covariances (n, 6, 6), each at its own time."""
    elapsed_s = np.array([time_s - state.time_s for state, time_s in zip(states, times_s, strict=True)])
    return predict(
        np.array([state.mean for state in states]),
        np.array([state.covariance for state in states]),
        elapsed_s,
        rules.acceleration_psd_m2ps3,
    )


def distances(
    states: Sequence[State], measurements: Sequence[Measurement], rules: TrackRules
) -> tuple[FloatArray, FloatArray]:
    """Return the squared Mahalanobis distance of each measurement from its state, (n,), and log det S, (n,).

    Infinite where a bearing's threat would lie behind the camera.
    """
    squared, log_det = np.full(len(states), np.inf), np.zeros(len(states))
    for alike in by_dimension(measurements):
        chosen = [measurements[index] for index in alike]
        mean, covariance = predicted([states[index] for index in alike], [each.time_s for each in chosen], rules)
        seen = innovate(mean, covariance, chosen, rules)
        ahead = np.isfinite(seen.residual[:, 0])
        where = np.array(alike)[ahead]
        squared[where], log_det[where] = squared_distance(covariance[ahead], subset(seen, ahead))
    return squared, log_det


def within_reach(
    states: Sequence[State], measurements: Sequence[Measurement], rules: TrackRules
) -> npt.NDArray[np.bool_]:
    """Return (measurements, states): False where a pair cannot be inside its gate, found without any matrix algebra.

    A residual r has r' S^-1 r >= r' r / trace S. Bearings are not sorted out.
    """
    possible = np.ones((len(measurements), len(states)), dtype=np.bool_)
    rows = [row for row, each in enumerate(measurements) if isinstance(each, Report)]
    reports = [each for each in measurements if isinstance(each, Report)]
    if not reports:
        return possible
    mean = np.array([state.mean for state in states])
    covariance = np.array([state.covariance for state in states])
    times_s = np.array([each.time_s for each in reports])
    elapsed_s = times_s[:, None] - np.array([state.time_s for state in states])
    residual = np.array([each.position_m for each in reports])[:, None, :] - mean[:, :3]
    residual -= elapsed_s[:, :, None] * mean[:, 3:]
    trace = (
        np.trace(covariance[:, :3, :3], axis1=1, axis2=2)
        + 2 * elapsed_s * np.trace(covariance[:, :3, 3:], axis1=1, axis2=2)
        + elapsed_s**2 * np.trace(covariance[:, 3:, 3:], axis1=1, axis2=2)
        + rules.acceleration_psd_m2ps3 * np.abs(elapsed_s) ** 3
        + np.trace(position_noise(reports, rules), axis1=1, axis2=2)[:, None]
    )
    gates = np.array([gate(each, rules) for each in reports])[:, None]
    possible[rows] = (residual**2).sum(axis=2) <= gates * trace
    return possible


def explained(state: State, measurement: Measurement, rules: TrackRules) -> bool:
    """Return whether a threat in this state explains the measurement: whether it lies in the threat's gate."""
    squared, _ = distances([state], [measurement], rules)
    return bool(squared[0] <= gate(measurement, rules))


def by_dimension(measurements: Sequence[Measurement]) -> list[list[int]]:
    """Return the indices of measurements that can be handled in one batch, in order."""
    groups: dict[int, list[int]] = {}
    for index, each in enumerate(measurements):
        groups.setdefault(dimension(each), []).append(index)
    return list(groups.values())
