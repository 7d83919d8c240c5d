"""A threat's position from two or more rays: Eq. 5 as printed, and the maximum-likelihood fix."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel
from hsop_gcs.geometry.rays import FloatArray, Rays, camera_axes

STEPS = 30
"""Steps of a fix at most; three to five are usual."""
CONVERGED = 1e-6
"""A step smaller than this part of the nearest camera's distance is the last."""
COARSE = 16
"""Points tried on each ray, each at three quarters of the last one's distance, when the rays do not cross ahead."""
PARALLEL = 1e-12
"""Smallest determinant of the normalised information at which rays count as crossing."""


class Place(NamedTuple):
    """Where something is believed to be, ENU metres."""

    mean_m: FloatArray
    """(3,)"""
    information: FloatArray
    """(3, 3), inverse of the covariance."""


NOWHERE = Place(np.zeros(3), np.zeros((3, 3)))


def triangulate_eq5(
    origin_p_m: npt.ArrayLike, directions_p: npt.ArrayLike, origin_c_m: npt.ArrayLike, directions_c: npt.ArrayLike
) -> FloatArray:
    """Return the threat's position by the letter's Eq. 5, exactly as printed.

    It lies on the ray of the first camera, the letter's peripheral one (p), however the ray of the second (c) passes
    it by. origins: (3,), directions: (draws, 3), ENU, of any length. Returns (draws, 3), metres; not finite where the
    rays are parallel.
    """
    first = np.ascontiguousarray(directions_p, dtype=np.float64).reshape(-1, 3)
    second = np.ascontiguousarray(directions_c, dtype=np.float64).reshape(-1, 3)
    return np.asarray(
        _eq5(np.asarray(origin_p_m, dtype=np.float64), first, np.asarray(origin_c_m, dtype=np.float64), second)
    )


def triangulate(
    origins_m: npt.ArrayLike, rays: Rays, reach_m: npt.ArrayLike = math.inf, *, believed: Place = NOWHERE
) -> FloatArray:
    """Find the positions of greatest likelihood, given rays with normal errors across them.

    origins_m: (views, 3), ENU, two views or more. reach_m: () or (views,), how far from each camera the object can be;
    almost parallel rays put no other limit to it. Returns (draws, 3), metres; NaN where no point lies ahead of all
    cameras and within reach. Minimises the sum of squared distances from the rays in standard deviations (see ``Rays``)
    by damped Gauss-Newton steps from the point nearest to all rays. At the limit of reach the steps end near the
    limit, not at its likeliest point. ``believed``: where the object is known to be without the rays; the steps begin
    there, and the positions are the likeliest by both.
    """
    origins, directions, whiteners = _contiguous(origins_m, rays)
    reach = np.broadcast_to(np.asarray(reach_m, dtype=np.float64), (len(origins),)).copy()
    return np.asarray(_fixes(origins, directions, whiteners, reach, *believed))


def covariance(origins_m: npt.ArrayLike, rays: Rays, position_m: npt.ArrayLike) -> FloatArray:
    """Return the covariance of a fix, (draws, 3, 3), square metres: the inverse Fisher information at a position.

    position_m: (3,) or (draws, 3): the truth gives the Cramér-Rao bound, a fix gives its own covariance.
    Not finite where all rays are parallel.
    """
    origins, directions, whiteners = _contiguous(origins_m, rays)
    positions = np.broadcast_to(np.asarray(position_m, dtype=np.float64), (len(directions), 3))
    return np.asarray(_covariances(origins, directions, whiteners, positions, np.full(len(origins), np.inf)))


def warm_up() -> None:
    """Compile ``triangulate`` and ``covariance``, or load them from the cache."""
    to_east, to_north = camera_axes(math.pi / 2), camera_axes(0.0)
    rays = Rays(np.array([[to_east[2], to_north[2]]]), np.array([[to_east[:2], to_north[:2]]]))
    origins = np.array([[0.0, 0.0, 0.0], [10.0, -10.0, 0.0]])
    covariance(origins, rays, triangulate(origins, rays))


def _contiguous(origins_m: npt.ArrayLike, rays: Rays) -> tuple[FloatArray, FloatArray, FloatArray]:
    origins = np.ascontiguousarray(origins_m, dtype=np.float64)
    if len(origins) < 2 or rays.directions.shape[1:] != origins.shape:
        raise ValueError(f"two views or more with a ray each, not {origins.shape} and {rays.directions.shape}")
    return origins, np.ascontiguousarray(rays.directions), np.ascontiguousarray(rays.whiteners)


@kernel
def _eq5(origin_p: FloatArray, first: FloatArray, origin_c: FloatArray, second: FloatArray) -> FloatArray:
    result = np.empty_like(first)
    bx, by, bz = origin_p[0] - origin_c[0], origin_p[1] - origin_c[1], origin_p[2] - origin_c[2]
    for n in range(len(first)):
        px, py, pz = first[n, 0], first[n, 1], first[n, 2]
        cx, cy, cz = second[n, 0], second[n, 1], second[n, 2]
        over = math.sqrt((cy * bz - cz * by) ** 2 + (cz * bx - cx * bz) ** 2 + (cx * by - cy * bx) ** 2)
        under = math.sqrt((cy * pz - cz * py) ** 2 + (cz * px - cx * pz) ** 2 + (cx * py - cy * px) ** 2)
        along = over / under
        result[n, 0] = origin_p[0] + along * px
        result[n, 1] = origin_p[1] + along * py
        result[n, 2] = origin_p[2] + along * pz
    return result


@kernel
def _solved(m: FloatArray, v: FloatArray, damping: float, result: FloatArray) -> bool:
    """Solve (m + damping · diag m) result = v for a symmetric (3, 3) by cofactors; False if it has no inverse."""
    a, b, c = m[0, 0] * (1 + damping), m[1, 1] * (1 + damping), m[2, 2] * (1 + damping)
    d, e, f = m[0, 1], m[0, 2], m[1, 2]
    aa, dd, ee = b * c - f * f, e * f - d * c, d * f - e * b
    determinant = a * aa + d * dd + e * ee
    scale = (a + b + c) / 3
    if not determinant > PARALLEL * scale * scale * scale:
        return False
    bb, ff, cc = a * c - e * e, d * e - a * f, a * b - d * d
    result[0] = (aa * v[0] + dd * v[1] + ee * v[2]) / determinant
    result[1] = (dd * v[0] + bb * v[1] + ff * v[2]) / determinant
    result[2] = (ee * v[0] + ff * v[1] + cc * v[2]) / determinant
    return True


@kernel
def _nearest_point(origins: FloatArray, u: FloatArray, m: FloatArray, v: FloatArray, result: FloatArray) -> bool:
    """Solve (Σ Pᵢ) x = Σ Pᵢ oᵢ with Pᵢ = I - uᵢ uᵢᵀ: the point nearest to all rays."""
    m[:] = 0.0
    v[:] = 0.0
    for k in range(len(origins)):
        along = u[k, 0] * origins[k, 0] + u[k, 1] * origins[k, 1] + u[k, 2] * origins[k, 2]
        for i in range(3):
            v[i] += origins[k, i] - u[k, i] * along
            m[i, i] += 1.0
            for j in range(3):
                m[i, j] -= u[k, i] * u[k, j]
    return _solved(m, v, 0.0, result)


@kernel
def _normal_equations(
    origins: FloatArray, u: FloatArray, w: FloatArray, reach: FloatArray, x: FloatArray, m: FloatArray, v: FloatArray
) -> float:
    """Fill information m and gradient v at x; return the sum of squares, infinite behind a camera or beyond its reach.

    Residual e = W (x - o) / depth, two numbers; its derivative is (W - e uᵀ) / depth.
    """
    m[:] = 0.0
    v[:] = 0.0
    total = 0.0
    for k in range(len(origins)):
        x0, x1, x2 = x[0] - origins[k, 0], x[1] - origins[k, 1], x[2] - origins[k, 2]
        depth = x0 * u[k, 0] + x1 * u[k, 1] + x2 * u[k, 2]
        if depth > reach[k] or depth <= 1e-3 * math.sqrt(x0 * x0 + x1 * x1 + x2 * x2):
            return math.inf
        for row in range(2):
            e = (w[k, row, 0] * x0 + w[k, row, 1] * x1 + w[k, row, 2] * x2) / depth
            j0 = (w[k, row, 0] - e * u[k, 0]) / depth
            j1 = (w[k, row, 1] - e * u[k, 1]) / depth
            j2 = (w[k, row, 2] - e * u[k, 2]) / depth
            total += e * e
            v[0] -= j0 * e
            v[1] -= j1 * e
            v[2] -= j2 * e
            m[0, 0] += j0 * j0
            m[1, 1] += j1 * j1
            m[2, 2] += j2 * j2
            m[0, 1] += j0 * j1
            m[0, 2] += j0 * j2
            m[1, 2] += j1 * j2
    m[1, 0], m[2, 0], m[2, 1] = m[0, 1], m[0, 2], m[1, 2]
    return total


@kernel
def _start(
    origins: FloatArray, u: FloatArray, w: FloatArray, reach: FloatArray, x: FloatArray, m: FloatArray, v: FloatArray
) -> float:
    """Put x at the point nearest to all rays, or else at the best of some on them; return its sum of squares."""
    if _nearest_point(origins, u, m, v, x):
        total = _normal_equations(origins, u, w, reach, x, m, v)
        if total < math.inf:
            return total
    span = 0.0
    for k in range(1, len(origins)):
        for i in range(3):
            span = max(span, abs(origins[k, i] - origins[0, i]))
    best, best_ray, best_depth = math.inf, 0, 0.0
    for n in range(COARSE * len(origins) + 1):
        ray, depth = n % len(origins), 0.0
        if n < COARSE * len(origins):
            depth = 0.999 * min(reach[ray], 8 * span) * 0.75 ** (n // len(origins))
        else:
            ray, depth = best_ray, best_depth
        for i in range(3):
            x[i] = origins[ray, i] + depth * u[ray, i]
        total = _normal_equations(origins, u, w, reach, x, m, v)
        if total < best:
            best, best_ray, best_depth = total, ray, depth
    return best


@kernel
def _add_belief(mean: FloatArray, information: FloatArray, x: FloatArray, m: FloatArray, v: FloatArray) -> float:
    """Add a place believed in to information m and gradient v at x; return what it adds to the sum of squares."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            m[i, j] += information[i, j]
            v[i] += information[i, j] * (mean[j] - x[j])
            total += (mean[i] - x[i]) * information[i, j] * (mean[j] - x[j])
    return total


@kernel
def _fixes(
    origins: FloatArray,
    directions: FloatArray,
    whiteners: FloatArray,
    reach: FloatArray,
    mean: FloatArray,
    information: FloatArray,
) -> FloatArray:
    draws, views = directions.shape[0], directions.shape[1]
    result = np.full((draws, 3), np.nan)
    m, trial_m = np.empty((3, 3)), np.empty((3, 3))
    v, trial_v = np.empty(3), np.empty(3)
    x, trial, step = np.empty(3), np.empty(3), np.empty(3)
    for n in range(draws):
        u, w = directions[n], whiteners[n]
        total = math.inf
        if information[0, 0] > 0:
            for i in range(3):
                x[i] = mean[i]
            total = _normal_equations(origins, u, w, reach, x, m, v)
        if total == math.inf:
            total = _start(origins, u, w, reach, x, m, v)
        if total == math.inf:
            continue
        total += _add_belief(mean, information, x, m, v)
        nearest = math.inf
        for k in range(views):
            nearest = min(nearest, abs(x[0] - origins[k, 0]) + abs(x[1] - origins[k, 1]) + abs(x[2] - origins[k, 2]))
        damping = 0.0
        for _ in range(STEPS):
            if not _solved(m, v, damping, step):
                damping = max(1e-3, 10 * damping)
                continue
            for i in range(3):
                trial[i] = x[i] + step[i]
            new_total = _normal_equations(origins, u, w, reach, trial, trial_m, trial_v)
            new_total += _add_belief(mean, information, trial, trial_m, trial_v)
            if new_total <= total:
                total = new_total
                x, trial = trial, x
                m, trial_m = trial_m, m
                v, trial_v = trial_v, v
                damping = 0.0 if damping <= 1e-3 else damping / 10
            else:
                damping = max(1e-3, 10 * damping)
            if abs(step[0]) + abs(step[1]) + abs(step[2]) <= CONVERGED * nearest:
                break
        result[n] = x
    return result


@kernel
def _covariances(
    origins: FloatArray, directions: FloatArray, whiteners: FloatArray, positions: FloatArray, reach: FloatArray
) -> FloatArray:
    result = np.full((len(directions), 3, 3), np.inf)
    m, v, unit, column = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for n in range(len(directions)):
        if _normal_equations(origins, directions[n], whiteners[n], reach, positions[n], m, v) == math.inf:
            continue
        for i in range(3):
            unit[:] = 0.0
            unit[i] = 1.0
            if _solved(m, unit, 0.0, column):
                result[n, :, i] = column
    return result
