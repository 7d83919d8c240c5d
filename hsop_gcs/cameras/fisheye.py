"""The peripheral vision camera: two 180° fisheyes back to back (letter, section III.A)."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.checks import require_positive
from hsop_gcs.errors import BadInput

FloatArray = npt.NDArray[np.float64]

_ORIGIN = np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class FisheyeCamera:
    """One fisheye lens and its sensor; the defaults are the letter's Table 1 with no distortion.

    Raises BadInput for a size that is not positive and for distortion under which θ_d stops growing before 90°:
    such a lens would see two directions in one pixel.
    """

    focal_length_mm: float = 1.0
    sensor_width_mm: float = 3.3
    resolution_px: int = 1504
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """k1..k4 of OpenCV's fisheye model (Eq. 1)."""
    min_pixels: float = 5.0
    """Smallest width at which the detector finds an object, pixels."""

    def __post_init__(self) -> None:
        for name in ("focal_length_mm", "sensor_width_mm", "resolution_px", "min_pixels"):
            require_positive(name, getattr(self, name))
        if len(self.distortion) != 4 or not all(math.isfinite(k) for k in self.distortion):
            raise BadInput("distortion", f"must be four finite numbers, not {self.distortion!r}")
        if np.any(np.diff(self.distorted_angle(np.linspace(0.0, np.pi / 2, 512))) <= 0):
            raise BadInput("distortion", f"the distorted angle must grow up to 90°, which {self.distortion!r} does not")

    @property
    def focal_length_px(self) -> float:
        """Pixels per radian on the boresight."""
        return self.focal_length_mm * self.resolution_px / self.sensor_width_mm

    @property
    def camera_matrix(self) -> FloatArray:
        """Return OpenCV's camera matrix, (3, 3), pixels.

        Pixel centres have whole coordinates, as OpenCV counts them, so the boresight meets a square sensor at
        (resolution - 1) / 2.
        """
        focal, centre = self.focal_length_px, (self.resolution_px - 1) / 2
        return np.array([[focal, 0.0, centre], [0.0, focal, centre], [0.0, 0.0, 1.0]])

    def distorted_angle(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return θ_d for the angle θ from the boresight, radians (Eq. 1)."""
        theta = np.asarray(angle_rad, dtype=np.float64)
        k1, k2, k3, k4 = self.distortion
        square = theta * theta
        return np.asarray(theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4)))))

    def distorted_angle_slope(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return dθ_d/dθ, no unit."""
        k1, k2, k3, k4 = self.distortion
        square = np.square(np.asarray(angle_rad, dtype=np.float64))
        return np.asarray(1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4))))

    def relative_pixel_size(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return an object's size in the image relative to the boresight: 1 there, 0 from 90° on (Eq. 2, Fig. 2b)."""
        theta = np.abs(np.asarray(angle_rad, dtype=np.float64))
        inside = np.clip(theta, 1e-9, np.pi / 2)
        return np.where(theta < np.pi / 2, self.distorted_angle(inside) / np.tan(inside), 0.0)

    def pixel_width(self, size_m: npt.ArrayLike, distance_m: npt.ArrayLike, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return the width of an object in the image, pixels; ``angle_rad`` is from the nearer boresight (Eq. 3)."""
        return np.asarray(
            self.focal_length_px * np.asarray(size_m) / np.asarray(distance_m) * self.relative_pixel_size(angle_rad)
        )

    def project(self, rays: npt.ArrayLike) -> FloatArray:
        """Return the pixels at which rays arrive, through OpenCV's fisheye model.

        rays: (n, 3), camera frame: x right, y down, z along the boresight; any length but zero.
        Returns (n, 2): u, v in pixels; NaN for rays at 90° from the boresight or behind it.
        """
        directions = np.asarray(rays, dtype=np.float64).reshape(-1, 3)
        pixels = np.full((len(directions), 2), np.nan)
        ahead = directions[:, 2] > 0
        if ahead.any():
            seen, _ = cv2.fisheye.projectPoints(
                directions[ahead][:, None], _ORIGIN, _ORIGIN, self.camera_matrix, np.array(self.distortion)
            )
            pixels[ahead] = seen[:, 0]
        return pixels

    def undistorted_angle(self, distorted_rad: npt.ArrayLike) -> FloatArray:
        """Return θ for θ_d, radians: the inverse of Eq. 1 on [0, 90°]; values beyond either end give that end."""
        target = np.asarray(distorted_rad, dtype=np.float64)
        low, high = np.zeros_like(target), np.full_like(target, np.pi / 2)
        for _ in range(54):
            middle = (low + high) / 2
            too_far = self.distorted_angle(middle) > target
            low, high = np.where(too_far, low, middle), np.where(too_far, middle, high)
        return np.asarray((low + high) / 2)
