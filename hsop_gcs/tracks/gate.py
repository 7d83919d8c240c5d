"""Measurements beside states: chi-square gates, states at another time, and how far bearings are from them."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.special import chdtri

from hsop_gcs.reports import Bearing, Measurement
from hsop_gcs.tracks.filter import FloatArray, State, dimension, innovate, predict, squared_distance, subset
from hsop_gcs.tracks.rules import TrackRules


@lru_cache
def threshold(dimensions: int, miss_probability: float) -> float:
    """Return the squared distance that a threat's own measurement exceeds with ``miss_probability``."""
    return float(chdtri(dimensions, miss_probability))


def gate_of(dimensions: int, rules: TrackRules) -> float:
    """Return the squared distance up to which a measurement without an id belongs to a threat."""
    return threshold(dimensions, 1.0 - rules.gate_probability)


def gate(measurement: Measurement, rules: TrackRules) -> float:
    """Return the gate of a measurement."""
    return gate_of(dimension(measurement), rules)


def impossible_of(dimensions: int, rules: TrackRules) -> float:
    """Return the squared distance from which on a measurement is of another threat, whatever id it bears."""
    return threshold(dimensions, rules.impossible_probability)


def impossible(measurement: Measurement, rules: TrackRules) -> float:
    """Return the limit of a measurement."""
    return impossible_of(dimension(measurement), rules)


def predicted(states: Sequence[State], times_s: Sequence[float], rules: TrackRules) -> tuple[FloatArray, FloatArray]:
    """Return the states' means (n, 6) and covariances (n, 6, 6), each at its own time."""
    elapsed_s = np.array([time_s - state.time_s for state, time_s in zip(states, times_s, strict=True)])
    return predict(
        np.array([state.mean for state in states]),
        np.array([state.covariance for state in states]),
        elapsed_s,
        rules.acceleration_psd_m2ps3,
    )


def distances(states: Sequence[State], bearings: Sequence[Bearing], rules: TrackRules) -> tuple[FloatArray, FloatArray]:
    """Return the squared Mahalanobis distance of each bearing from its state, (n,), and log det S, (n,).

    Infinite where the threat would lie behind the camera.
    """
    squared, log_det = np.full(len(states), np.inf), np.zeros(len(states))
    mean, covariance = predicted(states, [each.time_s for each in bearings], rules)
    seen = innovate(mean, covariance, bearings)
    ahead = np.isfinite(seen.residual[:, 0])
    squared[ahead], log_det[ahead] = squared_distance(covariance[ahead], subset(seen, ahead))
    return squared, log_det
