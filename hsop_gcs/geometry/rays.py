"""Rays: where a camera is, which way it saw something, and how sure it is of that."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Measured directions of ``views`` cameras, ``draws`` times.

    directions: (draws, views, 3), unit vectors, ENU.
    whiteners: (draws, views, 2, 3): two rows across each ray, each a unit vector divided by the standard deviation of
    the direction along it, radians. A row times a vector from the camera to a point, divided by the point's depth on
    the ray, is that point's distance from the ray in standard deviations.
    """

    directions: FloatArray
    whiteners: FloatArray


def camera_axes(pan_rad: float, tilt_rad: float = 0.0) -> FloatArray:
    """Return a level camera's axes in ENU, (3, 3): rows right, down, boresight. Pan is compass, tilt up positive."""
    sin_pan, cos_pan = math.sin(pan_rad), math.cos(pan_rad)
    sin_tilt, cos_tilt = math.sin(tilt_rad), math.cos(tilt_rad)
    return np.array(
        [
            [cos_pan, -sin_pan, 0.0],
            [sin_pan * sin_tilt, cos_pan * sin_tilt, -cos_tilt],
            [sin_pan * cos_tilt, cos_pan * cos_tilt, sin_tilt],
        ]
    )


def intersection_angle_rad(first: npt.ArrayLike, second: npt.ArrayLike) -> FloatArray:
    """Return the angle θ between threat vectors, (..., 3) each, in [0, π] (letter, below Eq. 6).

    From the tangent, which unlike the letter's arc cosine keeps its digits near 0 and π.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
