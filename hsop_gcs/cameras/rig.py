"""The peripheral-central vision rig that a host carries."""

import math
from dataclasses import dataclass, field
from enum import StrEnum

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim, wrap_deg

ANY_TILT = (-90.0, 90.0)
ANY_PAN = (-180.0, 180.0)


class CameraKind(StrEnum):
    """The two kinds of camera that a host carries."""

    PERIPHERAL = "peripheral"
    """A fisheye, fixed to the body."""
    CENTRAL = "central"
    """A narrow lens on a gimbal."""


PIXEL_NOISE_PX = {CameraKind.PERIPHERAL: 30.0, CameraKind.CENTRAL: 3.0}
"""Standard deviation of an image point, each axis, where the detector does not say (letter, section V)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRig:
    """Two fisheyes on the host's heading and its opposite, and one pan-tilt camera. Raises BadInput for its limits."""

    peripheral: FisheyeCamera = field(default_factory=FisheyeCamera)
    central: PinholeCamera = field(default_factory=PinholeCamera)
    tilt_deg: tuple[float, float] = ANY_TILT
    """How far the central camera's gimbal tilts: least and largest, up positive."""
    pan_deg: tuple[float, float] = ANY_PAN
    """How far it pans from the host's heading, clockwise positive."""

    def __post_init__(self) -> None:
        for name, (low, high), (least, most) in (
            ("tilt_deg", self.tilt_deg, ANY_TILT),
            ("pan_deg", self.pan_deg, ANY_PAN),
        ):
            if not least <= low <= high <= most:
                raise BadInput(name, f"must be two numbers from {least:g} to {most:g}, the least first: {[low, high]}")
        if not self.pan_deg[0] <= 0 <= self.pan_deg[1]:
            raise BadInput("pan_deg", f"must hold 0, straight ahead: {list(self.pan_deg)}")

    def gimbal_room_deg(self, aim: Aim, heading_deg: float) -> float:
        """Return how far an aim is from the gimbal's nearest limit; negative beyond it, infinite without limits."""
        room = math.inf
        if self.tilt_deg != ANY_TILT:
            room = min(aim.tilt_deg - self.tilt_deg[0], self.tilt_deg[1] - aim.tilt_deg)
        if self.pan_deg != ANY_PAN:
            off = wrap_deg(aim.pan_deg - heading_deg)
            room = min(room, off - self.pan_deg[0], self.pan_deg[1] - off)
        return room

    def nearest_aim(self, aim: Aim, heading_deg: float) -> Aim:
        """Return the nearest aim, pan by pan and tilt by tilt, that the gimbal of a host on a heading can give."""
        if self.gimbal_room_deg(aim, heading_deg) >= 0:
            return aim
        off = wrap_deg(aim.pan_deg - heading_deg)
        pan_deg = heading_deg + min(max(off, self.pan_deg[0]), self.pan_deg[1])
        return Aim(pan_deg=pan_deg % 360.0, tilt_deg=min(max(aim.tilt_deg, self.tilt_deg[0]), self.tilt_deg[1]))
