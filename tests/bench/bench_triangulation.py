"""Triangulations per second and core, noise and rays included: python -m tests.bench.bench_triangulation."""

import sys
import time
from collections.abc import Callable

import numpy as np

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.sight import central_sight, fisheye_sight
from hsop_gcs.geometry.rays import Rays
from hsop_gcs.geometry.triangulation import triangulate, triangulate_eq5
from hsop_gcs.study.localization import BATCH, noisy_rays

TARGET = np.array([0.0, 40.0, 0.0])
SIGHTS = (
    fisheye_sight(FisheyeCamera(), [-30.0, 10.0, 0.0], 0.4, towards_m=TARGET, noise_px=30.0),
    central_sight(PinholeCamera(), [30.0, 10.0, 0.0], -0.8, noise_px=3.0),
)
ORIGINS = np.array([sight.origin_m for sight in SIGHTS])
DRAWS = 400_000


def printed(rays: Rays) -> np.ndarray:
    return triangulate_eq5(ORIGINS[0], rays.directions[:, 0], ORIGINS[1], rays.directions[:, 1])


def likeliest(rays: Rays) -> np.ndarray:
    return triangulate(ORIGINS, rays)


def per_second(fix: Callable[[Rays], np.ndarray]) -> float:
    """Return triangulations per second of this process's time."""
    rng = np.random.default_rng(0)
    fix(noisy_rays(SIGHTS, TARGET, BATCH, rng))
    began = time.process_time()
    for _ in range(DRAWS // BATCH):
        fix(noisy_rays(SIGHTS, TARGET, BATCH, rng))
    return DRAWS / (time.process_time() - began)


if __name__ == "__main__":
    for name, fix in (("Eq. 5", printed), ("maximum likelihood", likeliest)):
        sys.stdout.write(f"{name}: {per_second(fix):,.0f} per second and core\n")
