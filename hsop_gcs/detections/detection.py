"""A detection: what one camera of one host saw at one time, as pixels or as a direction."""

from dataclasses import dataclass
from enum import StrEnum

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.errors import BadInput

SIGMA_DEG = 3.0
"""Standard deviation of a direction, across it, each of the two axes, where the detector does not say."""


class Lens(StrEnum):
    """Which of the peripheral camera's two fisheyes."""

    FRONT = "front"
    """The one on the host's heading."""
    BACK = "back"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixel:
    """A place in the image as OpenCV counts: u right, v down, from the centre of the top left pixel."""

    u_px: float
    v_px: float
    sigma_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A direction in the earth's frame: compass azimuth, elevation up from the horizon."""

    azimuth_deg: float
    elevation_deg: float
    sigma_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """``time_s``: when the image was exposed, seconds since the Unix epoch."""

    host: str
    camera: CameraKind
    lens: Lens | None = None
    """Of the peripheral camera; a direction does without."""
    time_s: float
    seen: Pixel | Direction
    threat_id: str | None = None
    """Our own name for the threat, if the host knows which one it looks at."""

    @property
    def source(self) -> str:
        """The camera's own name: each sees a threat at most once in an image."""
        return f"{self.host}/{self.camera}" + (f"/{self.lens}" if self.lens is not None else "")


class Reason(StrEnum):
    """Why a detection was refused."""

    CLOCK = "clock"
    """Its time is too far from ours."""
    DUPLICATE = "duplicate"
    NO_POSE = "no pose"
    """Where the host was, or how it was turned, is not known at that time."""
    NO_AIM = "no aim"
    """Where the central camera looked is not known at that time."""
    IMAGE = "outside the image"


class Unusable(BadInput):
    """A detection from which no ray can be had."""

    def __init__(self, reason: Reason, field: str, problem: str) -> None:
        super().__init__(field, problem)
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """Why a detection was refused, as a value: a ``Reason``, or the tracker's kind of refusal."""

    reason: str
    field: str
    problem: str
