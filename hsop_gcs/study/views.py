"""From a placement to the lenses that look at a threat."""

import math

import numpy as np

from hsop_gcs.cameras.rig import PIXEL_NOISE_PX, CameraKind, CameraRig
from hsop_gcs.cameras.sight import FloatArray, Sight, central_sight, fisheye_sight
from hsop_gcs.placement.objective import (
    Eye,
    angle_from_central_axis,
    angle_from_nearer_boresight,
    pixel_width,
)
from hsop_gcs.placement.solution import HoverPose, Placement

BORDER_PX = 1e-6
"""Optimal placements stand on the borders of the detectable regions."""
BORDER_RAD = 1e-9


def sight_of(rig: CameraRig, pose: HoverPose, camera: CameraKind, point_m: FloatArray) -> Sight:
    """Return the lens through which a host sees a point with one of its cameras."""
    noise = PIXEL_NOISE_PX[camera]
    if camera is CameraKind.PERIPHERAL:
        heading = math.radians(pose.heading_deg)
        return fisheye_sight(rig.peripheral, pose.position_m, heading, towards_m=point_m, noise_px=noise)
    if pose.pan_deg is None:
        raise ValueError(f"the central camera of {pose.host} is not in use")
    pan, tilt = math.radians(pose.pan_deg), math.radians(pose.tilt_deg)
    return central_sight(rig.central, pose.position_m, pan, tilt, noise_px=noise)


def detects(rig: CameraRig, size_m: float, pose: HoverPose, camera: CameraKind, point_m: FloatArray) -> bool:
    """Return whether a camera as it is aimed detects an object at a point (Eqs. 9 and 10)."""
    if math.dist(pose.position_m, point_m) == 0:
        return False
    width = pixel_width(Eye(pose, rig, camera), size_m, point_m)
    if camera is CameraKind.PERIPHERAL:
        return bool(
            width >= rig.peripheral.min_pixels - BORDER_PX and angle_from_nearer_boresight(pose, point_m) < math.pi / 2
        )
    if pose.pan_deg is None or width < rig.central.min_pixels - BORDER_PX:
        return False
    return angle_from_central_axis(pose, point_m) <= rig.central.half_fov_rad + BORDER_RAD


def assigned_sights(rig: CameraRig, placement: Placement, threat: int, point_m: FloatArray) -> tuple[Sight, Sight]:
    """Return the two lenses of a threat's pair; a peripheral one comes first, as the letter's Eq. 5 has it."""
    poses = {pose.host: pose for pose in placement.hosts}
    views = sorted(placement.pairs[threat].views, key=lambda view: view.camera is not CameraKind.PERIPHERAL)
    first, second = (sight_of(rig, poses[view.host], view.camera, point_m) for view in views)
    return first, second


def all_sights(
    rig: CameraRig, size_m: float, placement: Placement, threat: int, point_m: FloatArray
) -> tuple[Sight, ...]:
    """Return the pair's lenses, then every other lens of the fleet that detects the threat at a point."""
    assigned = {(view.host, view.camera) for view in placement.pairs[threat].views}
    others = [
        sight_of(rig, pose, camera, point_m)
        for pose in placement.hosts
        for camera in CameraKind
        if (pose.host, camera) not in assigned and detects(rig, size_m, pose, camera, point_m)
    ]
    return (*assigned_sights(rig, placement, threat, point_m), *others)


def origins_of(sights: tuple[Sight, ...]) -> FloatArray:
    """Return where the lenses are, (views, 3), ENU metres."""
    return np.array([sight.origin_m for sight in sights])
