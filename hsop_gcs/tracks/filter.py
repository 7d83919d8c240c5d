"""The Kalman filter: constant velocity in ENU, white-noise acceleration, many tracks at a time.

A state is position then velocity, (6,), metres and metres per second, with its full covariance, (6, 6). Arrays carry
the tracks along their first axis. Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, 5.2 (update in Joseph form) and 6.2.2 (continuous white-noise acceleration). Reports, which are linear and
many, go through ``kernels``; what is here is for bearings, and for looking at a state at another time.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.reports import Bearing, Measurement

FloatArray = npt.NDArray[np.float64]

_AXES = np.arange(2)
_IDENTITY = np.eye(6)
_DRIFT = np.eye(6, k=3)
_POSITION = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
_VELOCITY = np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
_CROSS = np.eye(6, k=3) + np.eye(6, k=-3)
_BEARING_ITERATIONS = 5
_NEAREST_M = 0.1
"""A threat nearer to a camera than this, along its ray, or behind it, was not what the camera saw."""


class State(NamedTuple):
    """What is believed of one threat at one time: mean (6,) and covariance (6, 6), ENU."""

    time_s: float
    mean: FloatArray
    covariance: FloatArray

    @property
    def position_variance_m2(self) -> float:
        """Of each axis, mean over the axes."""
        return _trace(self.covariance, 0) / 3

    @property
    def velocity_variance_m2ps2(self) -> float:
        """Of each axis, mean over the axes."""
        return _trace(self.covariance, 3) / 3

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, State)
            and self.time_s == other.time_s
            and np.array_equal(self.mean, other.mean)
            and np.array_equal(self.covariance, other.covariance)
        )


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
    span_s = np.abs(t)
    transition = _IDENTITY + t * _DRIFT
    noise = acceleration_psd_m2ps3 * (span_s**3 / 3 * _POSITION + t * span_s / 2 * _CROSS + span_s * _VELOCITY)
    predicted_mean = (transition @ mean[:, :, None])[:, :, 0]
    return predicted_mean, transition @ covariance @ transition.transpose(0, 2, 1) + noise


def update(
    mean: FloatArray, covariance: FloatArray, bearings: Sequence[Bearing], gate: float
) -> tuple[FloatArray, FloatArray]:
    """Return predicted means and covariances after n bearings; see ``correct`` for ``gate``.

    Bearings are taken up again and again, linearised half way to the corrected state: linearised at a position known
    to 15 m at 70 m they would leave errors many times what the covariance says, and at the corrected one they would
    pull a threat that one camera sees alone towards it. A bearing towards a threat that is expected behind the camera
    changes nothing.
    """
    corrected_mean, corrected_covariance = mean, covariance
    for _ in range(_BEARING_ITERATIONS):
        midway = mean + 0.5 * (corrected_mean - mean)
        seen = innovate(midway, covariance, bearings)
        moved = (seen.matrix @ (midway - mean)[:, :, None])[:, :, 0]
        ahead = np.isfinite(seen.residual[:, 0])
        if not ahead.any():
            break
        seen = subset(Innovation(seen.residual + moved, seen.matrix, seen.noise), ahead)
        corrected_mean, corrected_covariance = corrected_mean.copy(), corrected_covariance.copy()
        corrected_mean[ahead], corrected_covariance[ahead] = correct(mean[ahead], covariance[ahead], seen, gate)
    return corrected_mean, corrected_covariance


def correct(
    mean: FloatArray, covariance: FloatArray, seen: Innovation, gate: float = np.inf
) -> tuple[FloatArray, FloatArray]:
    """Return means and covariances after the measurements (Joseph form).

    A measurement outside its gate, a squared distance, says that the threat manoeuvred, since its id or the lack of any
    other explanation brought it here: what was believed of the threat is worth less, and its covariance is doubled
    until the measurement lies in the gate. Inside nothing is changed.
    """
    spread = covariance @ seen.matrix.transpose(0, 2, 1)
    asked = np.concatenate([spread.transpose(0, 2, 1), seen.residual[:, :, None]], axis=2)
    solved = np.linalg.solve(seen.matrix @ spread + seen.noise, asked)
    outside = (seen.residual * solved[:, :, 6]).sum(axis=1) > gate
    if outside.any():
        return correct(mean, np.where(outside[:, None, None], 2.0 * covariance, covariance), seen, gate)
    gain = solved[:, :, :6].transpose(0, 2, 1)
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


def subset(seen: Innovation, chosen: npt.NDArray[np.bool_]) -> Innovation:
    """Return those of n residuals that are chosen, (n,)."""
    return Innovation(seen.residual[chosen], seen.matrix[chosen], seen.noise[chosen])


def innovate(mean: FloatArray, covariance: FloatArray, bearings: Sequence[Bearing]) -> Innovation:
    """Compare predicted means (n, 6) with n bearings: NaN where the threat is expected behind the camera or at it.

    What is compared are the tangents of the angles across the measured ray, both measured as 0: a threat's range
    changes none of them.
    """
    along = np.array([each.direction for each in bearings])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.empty((len(bearings), 2, 3))
    across[:, 0] = np.cross(along, _IDENTITY[:3, :3][np.argmin(np.abs(along), axis=1)])
    across[:, 0] /= np.linalg.norm(across[:, 0], axis=1, keepdims=True)
    across[:, 1] = np.cross(along, across[:, 0])
    reach_m = mean[:, :3] - np.array([each.origin_m for each in bearings])
    depth_m = (along * reach_m).sum(axis=1)
    depth_m[depth_m < _NEAREST_M] = np.nan
    tangents = (across @ reach_m[:, :, None])[:, :, 0] / depth_m[:, None]
    matrix = np.zeros((len(bearings), 2, 6))
    matrix[:, :, :3] = (across - tangents[:, :, None] * along[:, None, :]) / depth_m[:, None, None]
    frame = np.concatenate([across, along[:, None, :]], axis=1)
    spread = frame @ covariance[:, :3, :3] @ frame.transpose(0, 2, 1)
    mixed = spread[:, :2, 2:]
    curvature = spread[:, :2, :2] * spread[:, 2:, 2:] + mixed @ mixed.transpose(0, 2, 1)
    noise = curvature / depth_m[:, None, None] ** 4
    noise[:, _AXES, _AXES] += np.array([each.sigma_rad**2 for each in bearings])[:, None]
    return Innovation(-tangents, matrix, noise)


def _trace(covariance: FloatArray, first: int) -> float:
    """Of three rows; for so few numbers this is several times as fast as numpy's."""
    return covariance.item(7 * first) + covariance.item(7 * first + 7) + covariance.item(7 * first + 14)
