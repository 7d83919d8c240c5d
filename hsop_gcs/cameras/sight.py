"""One lens in the world: where it images a point, and which ray a noisy pixel stands for.

Image coordinates are pixels right of and below the place where the boresight meets the sensor. Beyond 90° from its
boresight a fisheye sees nothing, but noise may push a pixel over the rim of its image circle; there θ_d goes on growing
as steeply as at the rim. A pinhole camera images nothing at 90° or beyond.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.geometry.rays import Rays, camera_axes

FloatArray = npt.NDArray[np.float64]

_RIM = math.pi / 2


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A lens at a place, turned some way; images carry normal noise of ``noise_px`` on each axis."""

    origin_m: FloatArray
    """(3,), ENU."""
    axes: FloatArray
    """(3, 3): rows right, down, boresight, ENU."""
    lens: FisheyeCamera | PinholeCamera
    noise_px: float

    def reach_m(self, size_m: float) -> float:
        """Return how far away, on the boresight, the lens just detects an object of a size, metres (Eqs. 3 and 4).

        Distortion that swells the image off the boresight carries a fisheye's detection farther by at most that much.
        """
        reach = self.lens.focal_length_px * size_m / self.lens.min_pixels
        if isinstance(self.lens, FisheyeCamera) and any(self.lens.distortion):
            reach *= max(1.0, float(self.lens.relative_pixel_size(np.linspace(0.0, _RIM, 257)).max()))
        return reach

    def image_of(self, point_m: npt.ArrayLike) -> FloatArray:
        """Return where a point is imaged, (2,), pixels. ValueError if the lens cannot image it."""
        right, down, ahead = self.axes @ (np.asarray(point_m, dtype=np.float64) - self.origin_m)
        across = math.hypot(right, down)
        angle = math.atan2(across, ahead)
        if isinstance(self.lens, FisheyeCamera):
            if angle > _RIM + 1e-9:
                raise ValueError(f"a point {math.degrees(angle):.3f}° off a fisheye's boresight has no image")
            radius = float(self.lens.distorted_angle(angle))
        else:
            if angle >= _RIM:
                raise ValueError(f"a point {math.degrees(angle):.3f}° off a pinhole camera's boresight has no image")
            radius = math.tan(angle)
        scale = self.lens.focal_length_px * radius / across if across > 0 else 0.0
        return np.array([right * scale, down * scale])

    def rays(self, image_px: npt.ArrayLike) -> Rays:
        """Return the rays of image points, (draws, 2), pixels: one view, with the noise carried over to directions."""
        image = np.asarray(image_px, dtype=np.float64).reshape(-1, 2) / self.lens.focal_length_px
        noise = self.noise_px / self.lens.focal_length_px
        radius = np.hypot(image[:, 0], image[:, 1])
        centred = radius < 1e-12
        safe = np.where(centred, 1.0, radius)
        x, y = np.where(centred, 1.0, image[:, 0] / safe), np.where(centred, 0.0, image[:, 1] / safe)
        if isinstance(self.lens, FisheyeCamera):
            angle, slope = _angle_and_slope(self.lens, radius)
            sine, cosine = np.sin(angle), np.cos(angle)
        else:
            cosine = 1 / np.sqrt(1 + radius * radius)
            sine = radius * cosine
            slope = 1 / (cosine * cosine)
        # Circles of the image are shorter or longer on the unit sphere by sin θ / radius; both are 1 at the centre.
        around = np.where(centred, 1.0, sine / safe)
        right, down, boresight = self.axes
        directions = _combined(sine * x, sine * y, cosine, right, down, boresight)
        outward = _combined(cosine * x, cosine * y, -sine, right, down, boresight)
        sideways = _combined(-y, x, np.zeros_like(x), right, down, boresight)
        whiteners = np.stack([outward * (slope / noise)[:, None], sideways / (around * noise)[:, None]], axis=1)
        return Rays(directions[:, None], whiteners[:, None])


def _combined(
    a: FloatArray, b: FloatArray, c: FloatArray, right: FloatArray, down: FloatArray, boresight: FloatArray
) -> FloatArray:
    result = np.empty((len(a), 3))
    for k in range(3):
        result[:, k] = a * right[k] + b * down[k] + c * boresight[k]
    return result


def _angle_and_slope(lens: FisheyeCamera, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return θ and dθ_d/dθ at θ_d = radius; beyond the rim of the image the slope stays what it is there."""
    if not any(lens.distortion):
        return np.minimum(radius, math.pi), np.ones_like(radius)
    rim, rim_slope = float(lens.distorted_angle(_RIM)), float(lens.distorted_angle_slope(_RIM))
    angle = lens.undistorted_angle(np.minimum(radius, rim)) + np.maximum(radius - rim, 0.0) / rim_slope
    return np.minimum(angle, math.pi), lens.distorted_angle_slope(np.minimum(angle, _RIM))


def fisheye_sight(
    lens: FisheyeCamera, origin_m: npt.ArrayLike, heading_rad: float, *, towards_m: npt.ArrayLike, noise_px: float
) -> Sight:
    """Return the sight of whichever of the two fisheyes, on the heading and against it, is turned towards a point.

    heading_rad: compass. A point abeam belongs to both; the one on the heading gets it.
    """
    origin = np.asarray(origin_m, dtype=np.float64)
    axes = camera_axes(heading_rad)
    if float(axes[2] @ (np.asarray(towards_m, dtype=np.float64) - origin)) < 0:
        axes = camera_axes(heading_rad + math.pi)
    return Sight(origin, axes, lens, noise_px)


def central_sight(
    lens: PinholeCamera, origin_m: npt.ArrayLike, pan_rad: float, tilt_rad: float = 0.0, *, noise_px: float
) -> Sight:
    """Return the sight of the central camera at its aim; pan is compass, tilt up positive."""
    return Sight(np.asarray(origin_m, dtype=np.float64), camera_axes(pan_rad, tilt_rad), lens, noise_px)


def joined(rays: list[Rays]) -> Rays:
    """Return the rays of several lenses, draw by draw, as views of one fix."""
    return Rays(
        np.concatenate([r.directions for r in rays], axis=1), np.concatenate([r.whiteners for r in rays], axis=1)
    )
