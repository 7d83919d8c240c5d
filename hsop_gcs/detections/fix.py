"""A fix: the place where rays of one threat meet, with its covariance, though they are not of quite one time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.geometry.rays import Rays
from hsop_gcs.geometry.triangulation import NOWHERE, Place, covariance, triangulate
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
    """Sum of squared distances of the rays from where they meet, in standard deviations; NaN where no place lies ahead
    of all cameras."""

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
    place: Place = NOWHERE


def fix_of(rays: Sequence[Ray], time_s: float, belief: Belief, rules: DetectionRules) -> Fix | None:
    """Triangulate a threat at ``time_s``; None if the rays do not meet, or too vaguely to be worth a fix.

    How well the threat's flight between the exposures and the hosts' own positions are known widens each ray by their
    angle at the threat's distance.

    Where a place is believed in, the fix is what the rays say near the likeliest place by both: of almost parallel rays
    neither the likeliest place nor how sure it is would do by itself, since one that noise has put nearer to the
    cameras would believe itself better than one put farther away. Such a fix may lie anywhere on its long axis; it
    means something only together with the belief.
    """
    elapsed_s = np.array([time_s - ray.time_s for ray in rays])
    origins = np.array([ray.origin_m for ray in rays]) + elapsed_s[:, None] * np.array(belief.velocity_mps)
    blur_m = np.hypot(rules.host_sigma_m, belief.speed_sigma_mps * elapsed_s)
    first = triangulate(origins, _rays(rays, np.zeros(len(rays))), believed=belief.place)[0]
    if not np.isfinite(first).all():
        return None
    away_m = np.linalg.norm(first - origins, axis=1)
    widened = _rays(rays, blur_m / away_m)
    met = triangulate(origins, widened)[0]
    misfit = float(np.square(_misses(widened, met - origins)[0]).sum())
    if misfit > threshold(2 * len(rays) - 3, rules.misfit_probability):
        return None
    likeliest = met if belief.place is NOWHERE else triangulate(origins, widened, believed=belief.place)[0]
    spread = covariance(origins, widened, likeliest)[0]
    if not (np.isfinite(likeliest).all() and np.isfinite(spread).all()):
        return None
    ranges_m = np.linalg.norm(likeliest - origins, axis=1)
    widest_m = rules.widest_share * ranges_m.min() if belief.place is NOWHERE else rules.farthest_m
    if np.trace(spread) > widest_m**2:
        return None
    _, changes = _misses(widened, likeliest - origins)
    position = likeliest + spread @ belief.place.information @ (likeliest - belief.place.mean_m)
    return Fix(position, spread, _common(widened, changes, spread, rules.host_sigma_m / away_m), ranges_m, misfit)


def _misses(rays: Rays, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far rays pass a place, ``reach`` (views, 3) from the cameras, in standard deviations, (2 views,), and
    how that changes with the place, (2 views, 3)."""
    depth = (reach * rays.directions[0]).sum(axis=1)[:, None]
    misses = (rays.whiteners[0] @ reach[:, :, None])[:, :, 0] / depth
    changes = (rays.whiteners[0] - misses[:, :, None] * rays.directions[0][:, None, :]) / depth[:, :, None]
    return misses.ravel(), changes.reshape(-1, 3)


def _common(rays: Rays, changes: FloatArray, spread: FloatArray, off_rad: FloatArray) -> FloatArray:
    """Return how the hosts' own positions, which turn the rays by ``off_rad`` (views,), spread a fix, (3, 3)."""
    share = np.square(off_rad[:, None] * np.linalg.norm(rays.whiteners[0], axis=2)).ravel()
    gain = spread @ changes.T
    return np.asarray((gain * share) @ gain.T)


def _rays(rays: Sequence[Ray], blur_rad: FloatArray) -> Rays:
    sigmas = np.hypot(np.array([ray.sigma_rad for ray in rays]), blur_rad[:, None])
    return Rays(
        np.array([[ray.direction for ray in rays]]), np.array([[ray.across for ray in rays]]) / sigmas[None, :, :, None]
    )
