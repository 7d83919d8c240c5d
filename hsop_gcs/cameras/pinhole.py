"""The central vision camera: a narrow lens on a pan-tilt head (letter, section III.B)."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, kw_only=True)
class PinholeCamera:
    """A perspective camera without distortion; the defaults are the letter's Tables 1 and 2."""

    focal_length_mm: float = 4.8
    sensor_width_mm: float = 4.8
    resolution_px: int = 1280
    fov_deg: float = 53.0
    min_pixels: float = 30.0
    """Smallest width at which the detector finds an object, pixels."""

    @property
    def focal_length_px(self) -> float:
        """Pixels per unit of tangent."""
        return self.focal_length_mm * self.resolution_px / self.sensor_width_mm

    @property
    def half_fov_rad(self) -> float:
        return math.radians(self.fov_deg) / 2

    def pixel_width(self, size_m: npt.ArrayLike, distance_m: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the width of an object in the image, pixels, anywhere in the field of view (Eq. 4)."""
        return np.asarray(self.focal_length_px * np.asarray(size_m, dtype=np.float64) / np.asarray(distance_m))
