"""Whether the rays that were found to be of one threat are surely that threat's, and not another's.

Rays of several hosts tell well where a threat is, and nothing of its name: that is known by where the threats were
believed to be, often to 15 m. So a name is given to all rays of a threat at once, and to all threats together: by the
likelihood of each group of rays for each threat, worked out where the threat would then be.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.tracks.kernels import FORBIDDEN

_ROUNDS = 5
"""Of working out how far away a threat is: what a metre across a ray is worth depends on it."""


def doubtful(
    groups: Mapping[int, Sequence[Ray]], mean: FloatArray, covariance: FloatArray, rules: DetectionRules
) -> set[int]:
    """Return the threats whose rays may as well be another's, or of none that is known.

    groups: the rays found to be of each threat, by its index. mean, covariance: (threats, 3) and (threats, 3, 3), of
    all threats that the rays may be of, ENU metres, at the time of the rays.
    """
    owners = list(groups)
    cost = np.full((len(owners), len(mean) + len(owners)), FORBIDDEN)
    for row, rays in enumerate(groups.values()):
        cost[row, : len(mean)] = _costs(rays, mean, covariance, rules)
        cost[row, len(mean) + row] = -2 * len(rays) * math.log(rules.unexplained_per_sr)
    found = set()
    for row, owner in enumerate(owners):
        as_found, otherwise = cost.copy(), cost.copy()
        as_found[row] = FORBIDDEN
        as_found[row, owner] = cost[row, owner]
        otherwise[row, owner] = FORBIDDEN
        if _least(otherwise) - _least(as_found) < 2 * math.log(rules.sure_odds):
            found.add(owner)
    return found


def _least(cost: FloatArray) -> float:
    return float(cost[linear_sum_assignment(cost)].sum())


def _costs(rays: Sequence[Ray], mean: FloatArray, covariance: FloatArray, rules: DetectionRules) -> FloatArray:
    """Return -2 log likelihood of rays, per steradian each, for every threat, (threats,).

    By Laplace's method: prior times likelihood at its greatest, times its width.
    """
    origins = np.array([ray.origin_m for ray in rays])
    along = np.array([ray.direction for ray in rays])
    across = np.array([ray.across for ray in rays])
    sigma_rad = np.array([ray.sigma_rad for ray in rays])
    prior = np.linalg.inv(covariance)
    at = mean
    for _ in range(_ROUNDS):
        depth = ((at[:, None] - origins) * along).sum(axis=-1)
        ahead = (depth > rules.nearest_m).all(axis=1)
        depth = np.maximum(depth, rules.nearest_m)
        sigma_m = np.hypot(sigma_rad * depth[..., None], rules.host_sigma_m)
        rows = (across / sigma_m[..., None]).reshape(len(mean), -1, 3)
        ends = (rows * np.repeat(origins, 2, axis=0)).sum(axis=-1)
        information = prior + rows.swapaxes(1, 2) @ rows
        known = (prior @ mean[:, :, None])[:, :, 0] + (rows.swapaxes(1, 2) @ ends[:, :, None])[:, :, 0]
        at = np.linalg.solve(information, known[:, :, None])[:, :, 0]
    misses = (rows @ at[:, :, None])[:, :, 0] - ends
    moved = at - mean
    squared = np.square(misses).sum(axis=1) + (moved * (prior @ moved[:, :, None])[:, :, 0]).sum(axis=1)
    widths = np.linalg.slogdet(information)[1] + np.linalg.slogdet(covariance)[1]
    densities = 2 * np.log(sigma_m / depth[..., None]).sum(axis=(1, 2)) + 2 * len(rays) * math.log(2 * math.pi)
    return np.where(ahead, squared + widths + densities, FORBIDDEN)
