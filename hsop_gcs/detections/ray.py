"""From a detection to a ray: the lens, where the host was, how it was turned, and how sure all that is."""

import math
from dataclasses import dataclass

import numpy as np

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.cameras.sight import FloatArray, Sight
from hsop_gcs.detections.detection import Detection, Direction, Lens, Pixel, Reason, Unusable
from hsop_gcs.detections.poses import Pose
from hsop_gcs.geometry.rays import camera_axes
from hsop_gcs.reports import Vector3

_RIM_SIGMAS = 4.0
"""Noise may carry an image over the rim of a fisheye's circle; this far out it is no image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ray:
    """A detection as a ray in ENU: from ``origin_m`` in the unit ``direction``."""

    detection: Detection
    origin_m: Vector3
    direction: Vector3
    across: tuple[Vector3, Vector3]
    """Two unit vectors across the ray and each other."""
    sigma_rad: tuple[float, float]
    """Standard deviation of the direction along each of them."""

    @property
    def time_s(self) -> float:
        """When the image was exposed, seconds since the Unix epoch."""
        return self.detection.time_s

    @property
    def look(self) -> tuple[str, float]:
        """The image it is from."""
        return self.detection.source, self.detection.time_s


def to_ray(detection: Detection, pose: Pose, rig: CameraRig) -> Ray:
    """Return the ray of a detection made at ``pose``. Raises Unusable for a pixel that the camera does not have."""
    if isinstance(detection.seen, Direction):
        seen = detection.seen
        axes = camera_axes(math.radians(seen.azimuth_deg), math.radians(seen.elevation_deg))
        sigma_rad = math.radians(seen.sigma_deg)
        return Ray(
            detection=detection,
            origin_m=pose.position_m,
            direction=_vector(axes[2]),
            across=(_vector(axes[0]), _vector(axes[1])),
            sigma_rad=(sigma_rad, sigma_rad),
        )
    sight = sight_of(detection.camera, detection.lens, pose, rig, noise_px=detection.seen.sigma_px)
    offset = _offset(detection.seen, sight.lens)
    rays = sight.rays(offset)
    lengths = np.linalg.norm(rays.whiteners[0, 0], axis=1)
    first, second = rays.whiteners[0, 0] / lengths[:, None]
    moved_rad = pose.aim_sigma_rad if detection.camera is CameraKind.CENTRAL else pose.attitude_sigma_rad
    return Ray(
        detection=detection,
        origin_m=pose.position_m,
        direction=_vector(rays.directions[0, 0]),
        across=(_vector(first), _vector(second)),
        sigma_rad=(math.hypot(1 / float(lengths[0]), moved_rad), math.hypot(1 / float(lengths[1]), moved_rad)),
    )


def sight_of(camera: CameraKind, lens: Lens | None, pose: Pose, rig: CameraRig, *, noise_px: float) -> Sight:
    """Return a lens of a host as it is turned. Raises Unusable if that is not known.

    Fisheyes are fixed to the body; the gimbal keeps the central camera level about its aim in the earth's frame.
    """
    origin = np.array(pose.position_m)
    if camera is CameraKind.CENTRAL:
        if pose.aim is None:
            raise Unusable(Reason.NO_AIM, "time", "where the gimbal looked then is not known")
        axes = camera_axes(math.radians(pose.aim.pan_deg), math.radians(pose.aim.tilt_deg))
        return Sight(origin, axes, rig.central, noise_px)
    right, down, nose = body_axes(
        math.radians(pose.heading_deg), math.radians(pose.roll_deg), math.radians(pose.pitch_deg)
    )
    if lens is Lens.BACK:
        right, nose = -right, -nose
    return Sight(origin, np.array([right, down, nose]), rig.peripheral, noise_px)


def body_axes(heading_rad: float, roll_rad: float, pitch_rad: float) -> FloatArray:
    """Return an aircraft's axes in ENU, (3, 3): rows right wing, belly, nose.

    Turned by heading, then pitch, then roll, as MAVLink's ATTITUDE means them (z-y-x, north-east-down).
    """
    level_right, level_down, nose = camera_axes(heading_rad, pitch_rad)
    cos_roll, sin_roll = math.cos(roll_rad), math.sin(roll_rad)
    return np.array(
        [cos_roll * level_right + sin_roll * level_down, cos_roll * level_down - sin_roll * level_right, nose]
    )


def image_size_px(lens: FisheyeCamera | PinholeCamera) -> tuple[int, int]:
    """Return columns and rows of the image."""
    rows = lens.resolution_px if isinstance(lens, FisheyeCamera) else lens.height_px
    return lens.resolution_px, rows


def _offset(pixel: Pixel, lens: FisheyeCamera | PinholeCamera) -> FloatArray:
    """Return the pixel from where the boresight meets the sensor, (2,)."""
    for name, value, size in zip(("u_px", "v_px"), (pixel.u_px, pixel.v_px), image_size_px(lens), strict=True):
        if not -0.5 <= value <= size - 0.5:
            raise Unusable(Reason.IMAGE, f"pixel.{name}", f"{value:g} is not in an image of {size} pixels")
    offset = np.array([pixel.u_px, pixel.v_px]) - lens.camera_matrix[:2, 2]
    if isinstance(lens, FisheyeCamera):
        radius_px = math.hypot(*offset)
        rim_px = lens.focal_length_px * float(lens.distorted_angle(math.pi / 2))
        if radius_px > rim_px + _RIM_SIGMAS * pixel.sigma_px:
            raise Unusable(
                Reason.IMAGE, "pixel", f"{radius_px:.0f} px from the centre; the image circle has {rim_px:.0f}"
            )
    return offset


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return (x, y, z)
