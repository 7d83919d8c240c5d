"""The Kalman filter: constant velocity in ENU, white-noise acceleration, many tracks at a time.

A state is position then velocity, (6,), metres and metres per second, with its full covariance, (6, 6). Arrays carry
the tracks along their first axis. Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, 5.2 (update in Joseph form) and 6.2.2 (continuous white-noise acceleration).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks.rules import TrackRules

FloatArray = npt.NDArray[np.float64]

_AXES = np.arange(3)
_IDENTITY = np.eye(6)
_NEAREST_M = 0.1
"""A threat nearer to a camera than this, along its ray, or behind it, was not what the camera saw."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What is believed of one threat at one time: mean (6,) and covariance (6, 6), ENU."""

    time_s: float
    mean: FloatArray
    covariance: FloatArray

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, State)
            and self.time_s == other.time_s
            and np.array_equal(self.mean, other.mean)
            and np.array_equal(self.covariance, other.covariance)
        )

    __hash__ = None  # type: ignore[assignment]


class Innovation(NamedTuple):
    """Measurements beside what was expected, all of one dimension d."""

    residual: FloatArray
    """(n, d), measured minus expected."""
    matrix: FloatArray
    """(n, d, 6), how the expected measurement changes with the state."""
    noise: FloatArray
    """(n, d, d), covariance of the measurements."""


def dimension(measurement: Measurement) -> int:
    """Return how many numbers it holds: 2 (bearing), 3 (position) or 6 (position and velocity)."""
    if isinstance(measurement, Bearing):
        return 2
    return 3 if measurement.velocity_mps is None else 6


def predict(
    mean: FloatArray, covariance: FloatArray, elapsed_s: FloatArray, acceleration_psd_m2ps3: float
) -> tuple[FloatArray, FloatArray]:
    """Return means (n, 6) and covariances (n, 6, 6) after ``elapsed_s`` (n,) seconds, which may be negative."""
    t = elapsed_s[:, None, None]
    position = covariance[:, :3, :3]
    cross = covariance[:, :3, 3:]
    predicted_mean = mean.copy()
    predicted_mean[:, :3] += elapsed_s[:, None] * mean[:, 3:]
    predicted = covariance.copy()
    predicted_cross = cross + t * covariance[:, 3:, 3:]
    predicted[:, :3, :3] = position + t * (cross + predicted_cross.transpose(0, 2, 1))
    span_s = np.abs(elapsed_s)[:, None]
    predicted_cross[:, _AXES, _AXES] += acceleration_psd_m2ps3 * elapsed_s[:, None] * span_s / 2
    predicted[:, _AXES, _AXES] += acceleration_psd_m2ps3 * span_s**3 / 3
    predicted[:, _AXES + 3, _AXES + 3] += acceleration_psd_m2ps3 * span_s
    predicted[:, :3, 3:] = predicted_cross
    predicted[:, 3:, :3] = predicted_cross.transpose(0, 2, 1)
    return predicted_mean, predicted


def innovate(mean: FloatArray, measurements: Sequence[Measurement], rules: TrackRules) -> Innovation:
    """Compare predicted means (n, 6) with n measurements of one dimension.

    The residual of a bearing is NaN where the threat is expected behind the camera or at it.
    """
    if isinstance(measurements[0], Bearing):
        return _innovate_bearings(mean, [each for each in measurements if isinstance(each, Bearing)])
    return _innovate_reports(mean, [each for each in measurements if isinstance(each, Report)], rules)


def correct(mean: FloatArray, covariance: FloatArray, seen: Innovation) -> tuple[FloatArray, FloatArray]:
    """Return means and covariances after the measurements (Joseph form)."""
    spread = covariance @ seen.matrix.transpose(0, 2, 1)
    gain = np.linalg.solve(seen.matrix @ spread + seen.noise, spread.transpose(0, 2, 1)).transpose(0, 2, 1)
    kept = _IDENTITY - gain @ seen.matrix
    corrected = kept @ covariance @ kept.transpose(0, 2, 1) + gain @ seen.noise @ gain.transpose(0, 2, 1)
    return (
        mean + (gain @ seen.residual[:, :, None])[:, :, 0],
        (corrected + corrected.transpose(0, 2, 1)) / 2,
    )


def squared_distance(covariance: FloatArray, seen: Innovation) -> tuple[FloatArray, FloatArray]:
    """Return the squared Mahalanobis distances of the residuals, (n,), and the logarithms of det S, (n,)."""
    expected = seen.matrix @ covariance @ seen.matrix.transpose(0, 2, 1) + seen.noise
    whitened = np.linalg.solve(expected, seen.residual[:, :, None])[:, :, 0]
    return (seen.residual * whitened).sum(axis=1), np.linalg.slogdet(expected)[1]


def first_state(report: Report, rules: TrackRules) -> State:
    """Return what one report alone says; a velocity it does not give is zero, give or take how fast threats fly."""
    noise = np.zeros((6, 6))
    noise[:3, :3] = position_noise(report, rules)
    velocity_sigma = rules.first_velocity_sigma_mps
    if report.velocity_mps is not None:
        velocity_sigma = _velocity_sigma(report, rules)
    noise[_AXES + 3, _AXES + 3] = velocity_sigma**2
    return State(report.time_s, np.array([*report.position_m, *(report.velocity_mps or (0.0, 0.0, 0.0))]), noise)


def position_noise(report: Report, rules: TrackRules) -> FloatArray:
    """Return the covariance of a reported position, (3, 3), square metres."""
    if report.covariance_m2 is not None:
        return np.array(report.covariance_m2)
    sigma_m = rules.default_sigma_m if report.sigma_m is None else max(report.sigma_m, rules.min_sigma_m)
    return sigma_m**2 * _IDENTITY[:3, :3]


def _innovate_reports(mean: FloatArray, reports: list[Report], rules: TrackRules) -> Innovation:
    count, size = len(reports), dimension(reports[0])
    noise = np.zeros((count, size, size))
    noise[:, :3, :3] = [position_noise(each, rules) for each in reports]
    measured = np.array([each.position_m for each in reports])
    if size == 6:
        noise[:, _AXES + 3, _AXES + 3] = np.array([_velocity_sigma(each, rules) ** 2 for each in reports])[:, None]
        measured = np.hstack([measured, np.array([each.velocity_mps for each in reports], dtype=np.float64)])
    matrix = np.broadcast_to(_IDENTITY[:size], (count, size, 6))
    return Innovation(measured - mean[:, :size], matrix, noise)


def _innovate_bearings(mean: FloatArray, bearings: list[Bearing]) -> Innovation:
    """The two tangents of the angles across the measured ray, as far as the state is concerned; both measured as 0."""
    along = np.array([each.direction for each in bearings])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.empty((len(bearings), 2, 3))
    across[:, 0] = np.cross(along, _IDENTITY[:3, :3][np.argmin(np.abs(along), axis=1)])
    across[:, 0] /= np.linalg.norm(across[:, 0], axis=1, keepdims=True)
    across[:, 1] = np.cross(along, across[:, 0])
    reach = mean[:, :3] - np.array([each.origin_m for each in bearings])
    depth_m = (along * reach).sum(axis=1)
    depth_m = np.where(depth_m > _NEAREST_M, depth_m, np.nan)
    tangents = (across @ reach[:, :, None])[:, :, 0] / depth_m[:, None]
    matrix = np.zeros((len(bearings), 2, 6))
    matrix[:, :, :3] = (across - tangents[:, :, None] * along[:, None, :]) / depth_m[:, None, None]
    variances = np.array([each.sigma_rad**2 for each in bearings])
    return Innovation(-tangents, matrix, variances[:, None, None] * np.eye(2))


def _velocity_sigma(report: Report, rules: TrackRules) -> float:
    return rules.velocity_sigma_mps if report.velocity_sigma_mps is None else report.velocity_sigma_mps
