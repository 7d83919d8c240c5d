"""The filter's arithmetic for reports, compiled: six numbers a state are too few for array operations to be worth it.

Arrays carry states, or measurements, along their first axis; a measurement has d = 3 (position) or 6 (position and
velocity) numbers, of which the rest are not looked at. Each state is worked on by itself: a batch gives the same bits
as its members one by one.
"""

import math
from collections.abc import Callable
from typing import TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Kernel = TypeVar("Kernel", bound=Callable[..., object])


def _kernel(function: Kernel) -> Kernel:
    return cast(Kernel, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


@_kernel
def _predict(mean: FloatArray, covariance: FloatArray, t: float, psd: float, m: FloatArray, p: FloatArray) -> None:
    """Fill m (6,) and p (6, 6) with the state after ``t`` seconds, which may be negative."""
    span = abs(t)
    for i in range(3):
        m[i] = mean[i] + t * mean[i + 3]
        m[i + 3] = mean[i + 3]
        for j in range(3):
            cross = covariance[i, j + 3] + t * covariance[i + 3, j + 3]
            p[i, j] = covariance[i, j] + t * covariance[i + 3, j] + t * cross
            p[i, j + 3] = cross
            p[j + 3, i] = cross
            p[i + 3, j + 3] = covariance[i + 3, j + 3]
    for i in range(3):
        p[i, i] += psd * span * span * span / 3
        p[i, i + 3] += psd * t * span / 2
        p[i + 3, i] += psd * t * span / 2
        p[i + 3, i + 3] += psd * span


@_kernel
def _factor(p: FloatArray, noise: FloatArray, d: int, scale: float, root: FloatArray) -> float:
    """Fill root with the Cholesky factor of S = scale P + R; return log det S, NaN if S is not positive definite."""
    log_det = 0.0
    for i in range(d):
        for j in range(i + 1):
            total = scale * p[i, j] + noise[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            if i > j:
                root[i, j] = total / root[j, j]
            elif total > 0:
                root[i, i] = math.sqrt(total)
                log_det += math.log(total)
            else:
                return math.nan
    return log_det


@_kernel
def _squared(m: FloatArray, measured: FloatArray, d: int, root: FloatArray, white: FloatArray) -> float:
    """Return r' S^-1 r; white is filled with the residual whitened."""
    squared = 0.0
    for i in range(d):
        total = measured[i] - m[i]
        for k in range(i):
            total -= root[i, k] * white[k]
        white[i] = total / root[i, i]
        squared += white[i] * white[i]
    return squared


@_kernel
def correct(
    means: FloatArray,
    covariances: FloatArray,
    elapsed_s: FloatArray,
    psd: float,
    measured: FloatArray,
    noise: FloatArray,
    d: int,
    gate: float,
) -> tuple[FloatArray, FloatArray]:
    """Return states (n, 6), (n, 6, 6) predicted by ``elapsed_s`` and corrected with measured (n, 6), noise (n, 6, 6).

    Joseph form. As in ``filter.correct``, covariances are doubled until the measurement lies in the gate.
    """
    count = len(means)
    out_m, out_p = np.empty((count, 6)), np.empty((count, 6, 6))
    m, p, root, white = np.empty(6), np.empty((6, 6)), np.zeros((6, 6)), np.empty(6)
    gain, kept, half = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    for n in range(count):
        _predict(means[n], covariances[n], elapsed_s[n], psd, m, p)
        scale = 1.0
        _factor(p, noise[n], d, scale, root)
        while _squared(m, measured[n], d, root, white) > gate:
            scale *= 2.0
            _factor(p, noise[n], d, scale, root)
        for i in range(6):
            for j in range(6):
                p[i, j] *= scale
        for i in range(6):
            # K S = P H': solve with the factor, forwards and back
            for a in range(d):
                total = p[i, a]
                for k in range(a):
                    total -= root[a, k] * gain[i, k]
                gain[i, a] = total / root[a, a]
            for b in range(d):
                a = d - 1 - b
                total = gain[i, a]
                for k in range(a + 1, d):
                    total -= root[k, a] * gain[i, k]
                gain[i, a] = total / root[a, a]
            out_m[n, i] = m[i]
            for a in range(d):
                out_m[n, i] += gain[i, a] * (measured[n, a] - m[a])
            for j in range(6):
                kept[i, j] = (1.0 if i == j else 0.0) - (gain[i, j] if j < d else 0.0)
        for i in range(6):
            for j in range(6):
                total = 0.0
                for k in range(6):
                    total += kept[i, k] * p[k, j]
                half[i, j] = total
        for i in range(6):
            for j in range(i + 1):
                total = 0.0
                for k in range(6):
                    total += half[i, k] * kept[j, k]
                for a in range(d):
                    for b in range(d):
                        total += gain[i, a] * noise[n, a, b] * gain[j, b]
                out_p[n, i, j] = total
                out_p[n, j, i] = total
    return out_m, out_p


@_kernel
def distances(
    means: FloatArray,
    covariances: FloatArray,
    elapsed_s: FloatArray,
    psd: float,
    measured: FloatArray,
    noise: FloatArray,
    d: int,
) -> tuple[FloatArray, FloatArray]:
    """Return the squared distance of each measurement from its own state, (n,), and log det S, (n,)."""
    squared, log_det = np.empty(len(means)), np.empty(len(means))
    m, p, root, white = np.empty(6), np.empty((6, 6)), np.zeros((6, 6)), np.empty(6)
    for n in range(len(means)):
        _predict(means[n], covariances[n], elapsed_s[n], psd, m, p)
        log_det[n] = _factor(p, noise[n], d, 1.0, root)
        squared[n] = _squared(m, measured[n], d, root, white)
    return squared, log_det


@_kernel
def in_gates(
    means: FloatArray,
    covariances: FloatArray,
    times_s: FloatArray,
    psd: float,
    measured: FloatArray,
    noise: FloatArray,
    measured_s: FloatArray,
    dimensions: IntArray,
    gates: FloatArray,
) -> FloatArray:
    """Return (measurements, states): squared distance plus log det S of every pair inside its gate, else infinity."""
    value = np.full((len(measured), len(means)), np.inf)
    m, p, root, white = np.empty(6), np.empty((6, 6)), np.zeros((6, 6)), np.empty(6)
    for row in range(len(measured)):
        noisy = noise[row, 0, 0] + noise[row, 1, 1] + noise[row, 2, 2]
        for column in range(len(means)):
            t = measured_s[row] - times_s[column]
            apart, trace = 0.0, noisy + psd * abs(t) ** 3
            for i in range(3):
                apart += (measured[row, i] - means[column, i] - t * means[column, i + 3]) ** 2
                trace += covariances[column, i, i] + t * t * covariances[column, i + 3, i + 3]
                trace += 2 * t * covariances[column, i, i + 3]
            # r' S^-1 r is at least r' r / trace S: most pairs need no more
            if apart > gates[row] * trace:
                continue
            _predict(means[column], covariances[column], t, psd, m, p)
            log_det = _factor(p, noise[row], dimensions[row], 1.0, root)
            squared = _squared(m, measured[row], dimensions[row], root, white)
            if squared <= gates[row]:
                value[row, column] = squared + log_det
    return value


def warm_up() -> None:
    """Compile everything, or load it from the cache."""
    one, many, unit = np.zeros((1, 6)), np.zeros(1), np.eye(6)[None]
    correct(one, unit, many, 1.0, one, unit, 3, math.inf)
    distances(one, unit, many, 1.0, one, unit, 3)
    in_gates(one, unit, many, 1.0, one, unit, many, np.array([3]), np.ones(1))
