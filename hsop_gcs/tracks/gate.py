"""Measurements beside states: chi-square gates, distances, and states moved on by what was measured."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from scipy.special import chdtri

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import (
    FloatArray,
    State,
    dimension,
    innovate,
    predict,
    squared_distance,
    stacked,
    subset,
    update,
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
        mean, covariance, elapsed_s = _stacked([states[index] for index in alike], [measurements[i] for i in alike])
        bearings = [each for index in alike if isinstance(each := measurements[index], Bearing)]
        if bearings:
            mean, covariance = predict(mean, covariance, elapsed_s, rules.acceleration_psd_m2ps3)
            seen = innovate(mean, covariance, bearings)
            ahead = np.isfinite(seen.residual[:, 0])
            where = np.array(alike)[ahead]
            squared[where], log_det[where] = squared_distance(covariance[ahead], subset(seen, ahead))
        else:
            reports = [each for index in alike if isinstance(each := measurements[index], Report)]
            measured, noise = stacked(reports, rules)
            squared[alike], log_det[alike] = kernels.distances(
                mean, covariance, elapsed_s, rules.acceleration_psd_m2ps3, measured, noise, dimension(reports[0])
            )
    return squared, log_det


def advance(states: Sequence[State], measurements: Sequence[Measurement], rules: TrackRules) -> list[State]:
    """Return each state after its measurement, at the measurement's time."""
    after: list[State] = list(states)
    for alike in by_dimension(measurements):
        chosen = [measurements[index] for index in alike]
        mean, covariance, elapsed_s = _stacked([states[index] for index in alike], chosen)
        bearings = [each for each in chosen if isinstance(each, Bearing)]
        if bearings:
            mean, covariance = predict(mean, covariance, elapsed_s, rules.acceleration_psd_m2ps3)
            mean, covariance = update(mean, covariance, bearings, gate(bearings[0], rules))
        else:
            reports = [each for each in chosen if isinstance(each, Report)]
            measured, noise = stacked(reports, rules)
            mean, covariance = kernels.correct(
                mean,
                covariance,
                elapsed_s,
                rules.acceleration_psd_m2ps3,
                measured,
                noise,
                dimension(reports[0]),
                gate(reports[0], rules),
            )
        for row, index in enumerate(alike):
            after[index] = State(measurements[index].time_s, mean[row], covariance[row])
    return after


class Stack:
    """The newest states of all tracks side by side, kept up to date track by track."""

    def __init__(self, states: Mapping[str, State]) -> None:
        self.ids = list(states)
        self._rows = {track_id: row for row, track_id in enumerate(self.ids)}
        self._times_s = np.array([state.time_s for state in states.values()])
        self._means = np.array([state.mean for state in states.values()]).reshape(-1, 6)
        self._covariances = np.array([state.covariance for state in states.values()]).reshape(-1, 6, 6)

    def copy(self) -> "Stack":
        other = Stack.__new__(Stack)
        other.ids, other._rows = self.ids.copy(), self._rows.copy()
        other._times_s, other._means = self._times_s.copy(), self._means.copy()
        other._covariances = self._covariances.copy()
        return other

    def put(self, track_id: str, state: State) -> None:
        """Take in a track's newest state, of a new track too."""
        row = self._rows.get(track_id)
        if row is None:
            row = self._rows[track_id] = len(self.ids)
            self.ids.append(track_id)
            self._times_s = np.append(self._times_s, 0.0)
            self._means = np.concatenate([self._means, np.empty((1, 6))])
            self._covariances = np.concatenate([self._covariances, np.empty((1, 6, 6))])
        self._times_s[row], self._means[row], self._covariances[row] = state.time_s, state.mean, state.covariance

    def in_gates(self, reports: Sequence[Report], rules: TrackRules) -> FloatArray:
        """Return (reports, tracks): squared distance plus log det S of every pair inside its gate, else infinity.

        A late report is held against what is believed now, taken back to its time.
        """
        measured, noise = stacked(reports, rules)
        return kernels.in_gates(
            self._means,
            self._covariances,
            self._times_s,
            rules.acceleration_psd_m2ps3,
            measured,
            noise,
            np.array([each.time_s for each in reports]),
            np.array([dimension(each) for each in reports]),
            np.array([gate(each, rules) for each in reports]),
        )


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


def _stacked(states: Sequence[State], measurements: Sequence[Measurement]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return means, covariances and the time from each state to its measurement."""
    return (
        np.array([state.mean for state in states]),
        np.array([state.covariance for state in states]),
        np.array([each.time_s - state.time_s for state, each in zip(states, measurements, strict=True)]),
    )
