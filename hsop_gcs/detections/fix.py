"""A fix: the place where rays of one threat meet, with its covariance, though they are not of quite one time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    common_m2: FloatArray
    """(3, 3), the part of it that stays from one fix to the next: hosts err slowly about where they are."""
    ranges_m: FloatArray
    """(rays,), from each ray's origin."""
    misfit: float
    """Sum of squared distances from the rays, in standard deviations."""

    @property
    def sigma_m(self) -> float:
        """Root of the covariance's trace."""
        return math.sqrt(float(np.trace(self.covariance_m2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What is known of a threat before a fix, at the fix's time, ENU."""

    velocity_mps: Vector3
    speed_sigma_mps: float
    """Standard deviation of the velocity, each axis."""
    position_m: Vector3 | None = None
    sigma_m: float = math.inf
    """Root of the trace of the position's covariance."""


def fix_of(rays: Sequence[Ray], time_s: float, belief: Belief, rules: DetectionRules) -> Fix | None:
    """Triangulate a threat at ``time_s``; None if the rays do not meet, or too vaguely to be worth a fix.

    How well the threat's flight between the exposures and the hosts' own positions are known widens each ray by their
    angle at the threat's distance. Where a place is believed in more surely the covariance is that of the likeliest
    place: a fix that noise has put nearer to the cameras would believe itself better than one put farther away.
    """
    velocity_mps, speed_sigma_mps = belief.velocity_mps, belief.speed_sigma_mps
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
    common = _common(widened, origins, position, spread, rules)
    fix = Fix(position, spread, common, np.linalg.norm(reach, axis=1), float(np.square(misses).sum()))
    if fix.misfit > threshold(2 * len(rays) - 3, rules.misfit_probability):
        return None
    if fix.sigma_m > rules.widest_share * fix.ranges_m.min():
        return None
    if belief.position_m is None or belief.sigma_m >= fix.sigma_m:
        return fix
    likeliest = _between(widened, origins, np.array(belief.position_m), belief.sigma_m)
    widened = _rays(rays, blur_m / np.linalg.norm(likeliest - origins, axis=1))
    spread = covariance(origins, widened, likeliest)[0]
    if not np.isfinite(spread).all():
        return fix
    return replace(fix, covariance_m2=spread, common_m2=_common(widened, origins, likeliest, spread, rules))


def _common(rays: Rays, origins: FloatArray, at_m: FloatArray, spread: FloatArray, rules: DetectionRules) -> FloatArray:
    """Return how the hosts' own positions spread a fix of covariance ``spread`` at ``at_m``, (3, 3)."""
    depth = ((at_m - origins) * rays.directions[0]).sum(axis=1)
    rows = (rays.whiteners[0] / depth[:, None, None]).reshape(-1, 3)
    share = rules.host_sigma_m**2 * np.square(rows).sum(axis=1)
    return np.asarray(spread @ (rows.T * share) @ rows @ spread)


def _between(rays: Rays, origins: FloatArray, believed_m: FloatArray, sigma_m: float) -> FloatArray:
    """Return where a threat is likeliest, by the rays and by the place believed in, (3,).

    Seen towards the latter alone, the long axis of a vague fix would lie across the rays.
    """
    depth = ((believed_m - origins) * rays.directions[0]).sum(axis=1)
    rows = rays.whiteners[0] / np.maximum(depth, 1.0)[:, None, None]
    ends = (rows @ origins[:, :, None])[:, :, 0]
    rows, weight = rows.reshape(-1, 3), 3 / sigma_m**2
    information = rows.T @ rows + weight * np.eye(3)
    return np.asarray(np.linalg.solve(information, rows.T @ ends.ravel() + weight * believed_m))


def _rays(rays: Sequence[Ray], blur_rad: FloatArray) -> Rays:
    sigmas = np.hypot(np.array([ray.sigma_rad for ray in rays]), blur_rad[:, None])
    return Rays(
        np.array([[ray.direction for ray in rays]]), np.array([[ray.across for ray in rays]]) / sigmas[None, :, :, None]
    )
