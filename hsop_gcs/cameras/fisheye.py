"""The peripheral vision camera: two 180° fisheyes back to back (letter, section III.A)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FisheyeCamera:
    """One fisheye lens and its sensor; the defaults are the letter's Table 1 with no distortion."""

    focal_length_mm: float = 1.0
    sensor_width_mm: float = 3.3
    resolution_px: int = 1504
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """k1..k4 of OpenCV's fisheye model (Eq. 1)."""
    min_pixels: float = 5.0
    """Smallest width at which the detector finds an object, pixels."""

    @property
    def focal_length_px(self) -> float:
        """Pixels per radian on the boresight."""
        return self.focal_length_mm * self.resolution_px / self.sensor_width_mm

    def distorted_angle(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return θ_d for the angle θ from the boresight, radians (Eq. 1)."""
        theta = np.asarray(angle_rad, dtype=np.float64)
        k1, k2, k3, k4 = self.distortion
        square = theta * theta
        return theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))

    def relative_pixel_size(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return an object's size in the image relative to the boresight: 1 there, 0 at 90° and beyond (Eq. 2, Fig. 2b)."""
        theta = np.abs(np.asarray(angle_rad, dtype=np.float64))
        inside = np.clip(theta, 1e-9, np.pi / 2)
        return np.where(theta < np.pi / 2, self.distorted_angle(inside) / np.tan(inside), 0.0)

    def pixel_width(self, size_m: npt.ArrayLike, distance_m: npt.ArrayLike, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return the width of an object in the image, pixels; ``angle_rad`` is from the nearer boresight (Eq. 3)."""
        return self.focal_length_px * np.asarray(size_m) / np.asarray(distance_m) * self.relative_pixel_size(angle_rad)
