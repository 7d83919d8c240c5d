"""Detectable regions: where an object of a given size is found by a camera's detector (letter, Fig. 3)."""

import math

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera

FloatArray = npt.NDArray[np.float64]


def peripheral_region(lens: FisheyeCamera, size_m: float, heading_rad: float = 0.0, *, points: int = 361) -> FloatArray:
    """Return the outline of where the two fisheyes detect an object, (points, 2), east and north of the camera, metres.

    heading_rad: compass course of one boresight; the other looks the opposite way. By Eq. 3 the range falls from the
    boresights to zero abeam: the outline is two lobes that meet in the camera. Closed: the last point is the first.
    """
    bearing = np.linspace(0.0, 2 * math.pi, points)
    off = np.abs((bearing + math.pi / 2) % math.pi - math.pi / 2)
    reach = lens.focal_length_px * size_m / lens.min_pixels * lens.relative_pixel_size(off)
    return _outline(reach, bearing + heading_rad)


def central_region(lens: PinholeCamera, size_m: float, pan_rad: float = 0.0, *, points: int = 65) -> FloatArray:
    """Return the outline of where the central camera detects an object, (points + 2, 2), east and north, metres.

    A sector of the field of view around the pan, compass, out to where Eq. 4 gives the least width;
    it begins and ends in the camera.
    """
    bearing = pan_rad + np.linspace(-lens.half_fov_rad, lens.half_fov_rad, points)
    reach = np.full(points, lens.focal_length_px * size_m / lens.min_pixels)
    return np.concatenate([np.zeros((1, 2)), _outline(reach, bearing), np.zeros((1, 2))])


def _outline(reach_m: FloatArray, bearing_rad: FloatArray) -> FloatArray:
    return np.column_stack([reach_m * np.sin(bearing_rad), reach_m * np.cos(bearing_rad)])
