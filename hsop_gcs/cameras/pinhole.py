"""The central vision camera: a narrow lens on a pan-tilt head (letter, section III.B)."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.checks import require_positive
from hsop_gcs.errors import BadInput


@dataclass(frozen=True, slots=True, kw_only=True)
class PinholeCamera:
    """A perspective camera without distortion; the defaults are the letter's Tables 1 and 2. Raises BadInput."""

    focal_length_mm: float = 4.8
    sensor_width_mm: float = 4.8
    resolution_px: int = 1280
    fov_deg: float = 53.0
    min_pixels: float = 30.0
    """Smallest width at which the detector finds an object, pixels."""

    def __post_init__(self) -> None:
        for name in ("focal_length_mm", "sensor_width_mm", "resolution_px", "min_pixels"):
            require_positive(name, getattr(self, name))
        if not 0 < self.fov_deg < 180:
            raise BadInput("fov_deg", f"must lie between 0 and 180, not {self.fov_deg!r}")

    @property
    def focal_length_px(self) -> float:
        """Pixels per unit of tangent."""
        return self.focal_length_mm * self.resolution_px / self.sensor_width_mm

    @property
    def height_px(self) -> int:
        """Rows of the image: three for every four columns, as in the letter's Table 1."""
        return round(0.75 * self.resolution_px)

    @property
    def camera_matrix(self) -> npt.NDArray[np.float64]:
        """Return OpenCV's camera matrix, (3, 3), pixels; pixel centres have whole coordinates."""
        focal = self.focal_length_px
        return np.array(
            [[focal, 0.0, (self.resolution_px - 1) / 2], [0.0, focal, (self.height_px - 1) / 2], [0.0, 0.0, 1.0]]
        )

    @property
    def half_fov_rad(self) -> float:
        """From the axis to the left and right edge of what it detects."""
        return math.radians(self.fov_deg) / 2

    @property
    def half_height_rad(self) -> float:
        """From the axis to the upper and lower edge of the image, where the field of view reaches that far."""
        return min(self.half_fov_rad, math.atan(0.5 * self.height_px / self.focal_length_px))

    def pixel_width(self, size_m: npt.ArrayLike, distance_m: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the width of an object in the image, pixels, anywhere in the field of view (Eq. 4)."""
        return np.asarray(self.focal_length_px * np.asarray(size_m, dtype=np.float64) / np.asarray(distance_m))
