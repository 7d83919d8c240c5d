"""The localization error of a placement: noise on the images, triangulation, distance from the truth, averaged."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hsop_gcs.cameras.sight import FloatArray, Sight, joined
from hsop_gcs.geometry.rays import Rays, intersection_angle_rad
from hsop_gcs.geometry.triangulation import covariance, triangulate, triangulate_eq5
from hsop_gcs.placement.objective import threat_points_m
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.solution import Placement
from hsop_gcs.study.views import all_sights, origins_of

BATCH = 2500
"""Draws handled together: their arrays stay in the processor's cache."""

BEYOND_REACH = 1.25
"""Fixes are sought no farther than this from each lens, in its detectable ranges: the threat was detected."""


class Estimator(StrEnum):
    EQ5 = "eq5"
    """The letter's Eq. 5 on the threat's two assigned views."""
    ML = "ml"
    """Maximum likelihood on the same two views."""
    ML_ALL_VIEWS = "ml-all-views"
    """Maximum likelihood on every view of the fleet that detects the threat."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointError:
    """What was measured for one threat at one of its points."""

    mean_error_m: dict[Estimator, float]
    rms_error_m: dict[Estimator, float]
    bound_m: float
    """Cramér-Rao bound of the two assigned views, root mean square."""
    angle_rad: float
    """Intersection angle θ of the two assigned views."""


def noisy_rays(sights: tuple[Sight, ...], point_m: FloatArray, draws: int, rng: np.random.Generator) -> Rays:
    """Draw image noise on a point's images and return the rays that result. All sights must image the point."""
    noise = rng.standard_normal((draws, len(sights), 2))
    return joined([s.rays(s.image_of(point_m) + s.noise_px * noise[:, k]) for k, s in enumerate(sights)])


def point_error(
    problem: Problem, placement: Placement, threat: int, point_m: FloatArray, draws: int, rng: np.random.Generator
) -> PointError:
    """Measure the error of all estimators on the same noise."""
    sights = all_sights(problem.rig, problem.threats[threat].size_m, placement, threat, point_m)
    origins = origins_of(sights)
    reach_m = BEYOND_REACH * np.array([sight.reach_m(problem.threats[threat].size_m) for sight in sights])
    total = dict.fromkeys(Estimator, 0.0)
    squares = dict.fromkeys(Estimator, 0.0)
    for first in range(0, draws, BATCH):
        rays = noisy_rays(sights, point_m, min(BATCH, draws - first), rng)
        pair = Rays(rays.directions[:, :2], rays.whiteners[:, :2])
        ml = triangulate(origins[:2], pair, reach_m[:2])
        fixes = {
            Estimator.EQ5: triangulate_eq5(origins[0], pair.directions[:, 0], origins[1], pair.directions[:, 1]),
            Estimator.ML: ml,
            Estimator.ML_ALL_VIEWS: triangulate(origins, rays, reach_m) if len(sights) > 2 else ml,
        }
        for estimator, fix in fixes.items():
            square = np.square(fix - point_m).sum(axis=1)
            total[estimator] += float(np.sqrt(square).sum())
            squares[estimator] += float(square.sum())
    exact = joined([sight.rays(sight.image_of(point_m)) for sight in sights[:2]])
    return PointError(
        mean_error_m={e: total[e] / draws for e in Estimator},
        rms_error_m={e: math.sqrt(squares[e] / draws) for e in Estimator},
        bound_m=math.sqrt(float(np.trace(covariance(origins[:2], exact, point_m)[0]))),
        angle_rad=float(intersection_angle_rad(point_m - origins[0], point_m - origins[1])),
    )


def threat_errors(
    problem: Problem, placement: Placement, draws: int, rng: np.random.Generator
) -> list[tuple[PointError, PointError]]:
    """Measure each threat now and after the horizon, half of ``draws`` at each point."""
    if draws < 2:
        raise ValueError(f"both points of a threat take a draw at least, not {draws}")
    points = threat_points_m(problem)
    return [
        (
            point_error(problem, placement, k, points[k, 0], draws - draws // 2, rng),
            point_error(problem, placement, k, points[k, 1], draws // 2, rng),
        )
        for k in range(len(problem.threats))
    ]
