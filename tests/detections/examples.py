"""Hosts, poses and rays that tests of detections share."""

import math
from collections.abc import Sequence

import numpy as np

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.detections import Detection, Direction, Lens, Pixel, Pose, PoseHistory, Ray, to_ray
from hsop_gcs.geometry.frames import aim_at
from hsop_gcs.reports import Report, Vector3
from hsop_gcs.tracks import Picture, TrackRules, update

NOW_S = 1_800_000_000.0
RIG = CameraRig()
METRE = 1.0
RADIAN = 1.0
PIXEL = 1.0
DEGREE = 1.0


def still(pose: Pose, time_s: float = NOW_S) -> PoseHistory:
    """Telemetry of a host that hovers at a pose around a time."""
    history = PoseHistory()
    for offset_s in (-0.2, 0.0, 0.2):
        history = history.with_position(time_s + offset_s, pose.position_m).with_attitude(
            time_s + offset_s, heading_deg=pose.heading_deg, roll_deg=pose.roll_deg, pitch_deg=pose.pitch_deg
        )
        history = history if pose.aim is None else history.with_aim(time_s + offset_s, pose.aim)
    return history


def bearing_ray(
    host: str,
    origin_m: Vector3,
    target_m: Sequence[float],
    *,
    sigma_deg: float = 0.1,
    time_s: float = NOW_S,
    threat_id: str | None = None,
    camera: CameraKind = CameraKind.CENTRAL,
    off_deg: tuple[float, float] = (0.0, 0.0),
) -> Ray:
    """The ray from a host to a point, turned by ``off_deg`` in azimuth and elevation."""
    aim = aim_at(np.array(origin_m), np.array(target_m))
    seen = Direction(azimuth_deg=aim.pan_deg + off_deg[0], elevation_deg=aim.tilt_deg + off_deg[1], sigma_deg=sigma_deg)
    detection = Detection(host=host, camera=camera, time_s=time_s, seen=seen, threat_id=threat_id)
    return to_ray(detection, Pose(position_m=origin_m, heading_deg=0.0), RIG)


def pixel_detection(
    u_px: float,
    v_px: float,
    *,
    camera: CameraKind = CameraKind.CENTRAL,
    lens: Lens | None = None,
    host: str = "h1",
    time_s: float = NOW_S,
) -> Detection:
    sigma_px = 3.0 if camera is CameraKind.CENTRAL else 30.0
    seen = Pixel(u_px=u_px, v_px=v_px, sigma_px=sigma_px)
    return Detection(host=host, camera=camera, lens=lens, time_s=time_s, seen=seen)


def reported(*threats: tuple[str, Vector3], sigma_m: float, time_s: float = NOW_S) -> Picture:
    """A picture of threats at rest, each reported once by a radar."""
    reports = [
        Report(
            source="radar",
            threat_id=name,
            time_s=time_s,
            position_m=position,
            velocity_mps=(0.0, 0.0, 0.0),
            sigma_m=sigma_m,
        )
        for name, position in threats
    ]
    picture, verdicts = update(Picture(), reports, time_s, TrackRules())
    assert verdicts == tuple(name for name, _ in threats)
    return picture


def angle_between_rad(first: Sequence[float], second: Sequence[float]) -> float:
    a, b = np.array(first), np.array(second)
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
