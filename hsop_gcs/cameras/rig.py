"""The peripheral-central vision rig that every host carries."""

from dataclasses import dataclass, field
from enum import StrEnum

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera


class CameraKind(StrEnum):
    PERIPHERAL = "peripheral"
    CENTRAL = "central"


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRig:
    """Two fisheyes on the host's heading and its opposite, and one pan-tilt camera."""

    peripheral: FisheyeCamera = field(default_factory=FisheyeCamera)
    central: PinholeCamera = field(default_factory=PinholeCamera)
