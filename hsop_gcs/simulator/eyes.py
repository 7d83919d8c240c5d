"""What the cameras of simulated hosts see of true threats: noisy pixels, as a detector would give them. Pure.

A threat is detected where its image is wide enough (Eqs. 3 and 4), within the field of view of the camera as it is
really turned. What noise carries off the sensor is not detected.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np

from hsop_gcs.cameras.rig import PIXEL_NOISE_PX, CameraKind, CameraRig
from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections import Detection, Direction, Lens, Pixel, Pose
from hsop_gcs.detections.ray import image_size_px, sight_of
from hsop_gcs.simulator.truth import TrueState


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewer:
    """A host as it really is: ENU position, attitude and where its gimbal really looks, and its cameras."""

    host: str
    pose: Pose
    rig: CameraRig = field(default_factory=CameraRig)


_CAMERAS = ((CameraKind.PERIPHERAL, Lens.FRONT), (CameraKind.PERIPHERAL, Lens.BACK), (CameraKind.CENTRAL, None))


def look(
    viewers: Iterable[Viewer],
    threats: Sequence[TrueState],
    time_s: float,
    rng: np.random.Generator,
    *,
    noise: float = 1.0,
) -> list[Detection]:
    """Return what all cameras detect at ``time_s``.

    noise: in the standard deviations that detections are stamped with (30 px peripheral, 3 px central).
    """
    found = []
    for viewer in viewers:
        for camera, lens in _CAMERAS:
            for threat in threats:
                pixel = image(viewer.pose, threat, viewer.rig, camera, lens)
                if pixel is None:
                    continue
                sigma_px = PIXEL_NOISE_PX[camera]
                u_px, v_px = (pixel + noise * sigma_px * rng.standard_normal(2)).tolist()
                if _on_sensor(u_px, v_px, viewer.rig, camera):
                    seen = Pixel(u_px=u_px, v_px=v_px, sigma_px=sigma_px)
                    found.append(Detection(host=viewer.host, camera=camera, lens=lens, time_s=time_s, seen=seen))
    return found


def image(pose: Pose, threat: TrueState, rig: CameraRig, camera: CameraKind, lens: Lens | None) -> FloatArray | None:
    """Return where a camera images a threat, (2,), u and v in pixels; None if it does not detect it."""
    if camera is CameraKind.CENTRAL and pose.aim is None:
        return None
    sight = sight_of(camera, lens, pose, rig, noise_px=0.0)
    right, down, ahead = (sight.axes @ (np.array(threat.position_m) - sight.origin_m)).tolist()
    distance_m = math.hypot(right, down, ahead)
    if ahead <= 0:
        return None
    if camera is CameraKind.PERIPHERAL:
        angle_rad = math.atan2(math.hypot(right, down), ahead)
        wide_enough = rig.peripheral.pixel_width(threat.size_m, distance_m, angle_rad) > rig.peripheral.min_pixels
        in_view = True
    else:
        wide_enough = rig.central.pixel_width(threat.size_m, distance_m) > rig.central.min_pixels
        in_view = abs(math.atan2(right, ahead)) <= rig.central.half_fov_rad
    if not (wide_enough and in_view):
        return None
    pixel = sight.image_of(threat.position_m) + sight.lens.camera_matrix[:2, 2]
    return pixel if _on_sensor(float(pixel[0]), float(pixel[1]), rig, camera) else None


def to_json(detection: Detection) -> dict[str, Any]:
    """Return a detection as the service's API takes it."""
    seen: dict[str, Any]
    match detection.seen:
        case Pixel(u_px=u_px, v_px=v_px, sigma_px=sigma_px):
            seen = {"pixel": {"u_px": u_px, "v_px": v_px, "sigma_px": sigma_px}}
        case Direction(azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, sigma_deg=sigma_deg):
            bearing = {"azimuth_deg": azimuth_deg, "elevation_deg": elevation_deg, "sigma_deg": sigma_deg}
            seen = {"bearing": bearing}
    return {
        "host": detection.host,
        "camera": str(detection.camera),
        **({} if detection.lens is None else {"lens": str(detection.lens)}),
        "time": datetime.fromtimestamp(detection.time_s, UTC).isoformat(),
        **seen,
        **({} if detection.threat_id is None else {"threat_id": detection.threat_id}),
    }


def _on_sensor(u_px: float, v_px: float, rig: CameraRig, camera: CameraKind) -> bool:
    columns, rows = image_size_px(rig.central if camera is CameraKind.CENTRAL else rig.peripheral)
    return -0.5 <= u_px <= columns - 0.5 and -0.5 <= v_px <= rows - 0.5
