"""A problem as plain arrays, computed once for the solvers."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.placement.objective import threat_points_m, weight
from hsop_gcs.placement.problem import Formulation, Problem

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Instance:
    """Arrays over threats; plane geometry, metres, radians."""

    points_m: FloatArray
    """(threats, 2 points, 2): now and after the horizon."""
    weights: FloatArray
    scale: FloatArray
    """(2 cameras, threats): pixels × metres of a threat on the boresight; cameras: 0 peripheral, 1 central."""
    range_m: FloatArray
    """(2 cameras, threats): where a threat on the boresight is just wide enough to be detected."""
    best_relative_size: float
    """Upper bound of the fisheye's relative pixel size: 1 unless its distortion swells the image off the boresight."""
    fisheye: FisheyeCamera
    half_fov_rad: float
    safety_distance_m: float
    whole_paths: bool
    """The safety distance holds for all hosts and all paths, not only between assigned pairs at the two points."""
    min_separation_m: float
    """0: hosts may stand anywhere relative to each other."""

    @classmethod
    def of(cls, problem: Problem, rig: CameraRig | None = None) -> Self:
        """Return the arrays of a problem whose hosts all carry ``rig``; by default the first of its rigs."""
        rig = rig or problem.rigs[0]
        peripheral, central = rig.peripheral, rig.central
        sizes = np.array([t.size_m for t in problem.threats])
        scale = np.array([peripheral.focal_length_px * sizes, central.focal_length_px * sizes])
        operational = problem.formulation is Formulation.OPERATIONAL
        largest = float(peripheral.relative_pixel_size(np.linspace(0, np.pi / 2, 2049)).max())
        return cls(
            points_m=threat_points_m(problem)[:, :, :2],
            weights=np.array([weight(problem, t) for t in problem.threats]),
            scale=scale,
            range_m=scale / np.array([[peripheral.min_pixels], [central.min_pixels]]),
            best_relative_size=max(1.0, largest * (1 + 1e-6)),
            fisheye=peripheral,
            half_fov_rad=central.half_fov_rad,
            safety_distance_m=problem.safety_distance_m,
            whole_paths=operational,
            min_separation_m=problem.min_separation_m if operational else 0.0,
        )
