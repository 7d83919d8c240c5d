"""A fix: the place where rays of one threat meet, with its covariance, though they are not of quite one time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.geometry.rays import Rays
from hsop_gcs.geometry.triangulation import covariance, triangulate
from hsop_gcs.reports import Vector3
from hsop_gcs.tracks.gate import threshold


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """ENU metres."""

    position_m: FloatArray
    """(3,)"""
    covariance_m2: FloatArray
    """(3, 3)"""
    ranges_m: FloatArray
    """(rays,), from each ray's origin."""
    misfit: float
    """Sum of squared distances from the rays, in standard deviations."""

    @property
    def sigma_m(self) -> float:
        """Root of the covariance's trace."""
        return math.sqrt(float(np.trace(self.covariance_m2)))


def fix_of(
    rays: Sequence[Ray], time_s: float, rules: DetectionRules, *, velocity_mps: Vector3, speed_sigma_mps: float
) -> Fix | None:
    """Triangulate a threat at ``time_s``; None if the rays do not meet, or too vaguely to be worth a fix.

    The threat moves with ``velocity_mps``, give or take ``speed_sigma_mps`` on each axis. That, and how well the
    hosts' own positions are known, widens each ray by its angle at the threat's distance.
    """
    elapsed_s = np.array([time_s - ray.time_s for ray in rays])
    origins = np.array([ray.origin_m for ray in rays]) + elapsed_s[:, None] * np.array(velocity_mps)
    blur_m = np.hypot(rules.host_sigma_m, speed_sigma_mps * elapsed_s)
    first = triangulate(origins, _rays(rays, np.zeros(len(rays))))[0]
    if not np.isfinite(first).all():
        return None
    widened = _rays(rays, blur_m / np.linalg.norm(first - origins, axis=1))
    position = triangulate(origins, widened)[0]
    spread = covariance(origins, widened, position)[0]
    if not (np.isfinite(position).all() and np.isfinite(spread).all()):
        return None
    reach = position - origins
    depth = (reach * widened.directions[0]).sum(axis=1)
    misses = (widened.whiteners[0] @ reach[:, :, None])[:, :, 0] / depth[:, None]
    fix = Fix(position, spread, np.linalg.norm(reach, axis=1), float(np.square(misses).sum()))
    if fix.misfit > threshold(2 * len(rays) - 3, rules.misfit_probability):
        return None
    return fix if fix.sigma_m <= rules.widest_share * fix.ranges_m.min() else None


def _rays(rays: Sequence[Ray], blur_rad: FloatArray) -> Rays:
    sigmas = np.hypot(np.array([ray.sigma_rad for ray in rays]), blur_rad[:, None])
    return Rays(
        np.array([[ray.direction for ray in rays]]), np.array([[ray.across for ray in rays]]) / sigmas[None, :, :, None]
    )
