"""What a study takes for granted: the letter's Table 2, and values for what the letter leaves open."""

import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat


class CoverageCameras(StrEnum):
    PERIPHERAL = "peripheral"
    """Whatever a host is to see, its fisheyes see."""
    DETERMINED = "determined"
    """The letter's Determine-Camera-Type: central where it fits, as its Algorithm 2 has it for HSOP."""


class MeasuredAt(StrEnum):
    BOTH = "both"
    """Of a threat's two points: where it is, and where it is after the horizon."""
    NOW = "now"
    LATER = "later"


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumptions:
    """Frozen, so that a results file can be held against them. Raises BadInput."""

    slowest_mps: float = 0.0
    fastest_mps: float = 5.0
    horizon_s: float = 10.0
    safety_distance_m: float = 20.0
    area_m: float = 40.0
    """Side of the square in which threats start, uniformly. Not in the letter."""
    size_m: float = 1.5
    """Width and height of every threat. Not in the letter."""
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """k1..k4 of the fisheyes. Not in the letter."""
    coverage_start_m: float = 40.0
    """Side of the square in which the hosts of coverage only start. Not in the letter."""
    coverage_cameras: CoverageCameras = CoverageCameras.PERIPHERAL
    """Which cameras coverage only uses. Not in the letter."""
    measured_at: MeasuredAt = MeasuredAt.BOTH
    """Where a threat is when it is localized. Not in the letter."""

    def __post_init__(self) -> None:
        for name in ("horizon_s", "safety_distance_m", "area_m", "size_m", "coverage_start_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise BadInput(name, f"must be a finite number above 0, not {value!r}")
        if not 0 <= self.slowest_mps <= self.fastest_mps < math.inf:
            raise BadInput("fastest_mps", f"speeds must satisfy 0 <= {self.slowest_mps!r} <= {self.fastest_mps!r}")
        FisheyeCamera(distortion=self.distortion)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    def problem(self, n_threats: int, rng: np.random.Generator) -> Problem:
        """Draw a scenario: places uniform in the square, speeds uniform, courses uniform; one altitude."""
        places = rng.uniform(-self.area_m / 2, self.area_m / 2, size=(n_threats, 2))
        speeds = rng.uniform(self.slowest_mps, self.fastest_mps, size=n_threats)
        courses = rng.uniform(0.0, 2 * math.pi, size=n_threats)
        threats = tuple(
            Threat(
                id=f"t{k + 1}",
                position_m=(float(places[k, 0]), float(places[k, 1]), 0.0),
                velocity_mps=(
                    float(speeds[k] * math.sin(courses[k])),
                    float(speeds[k] * math.cos(courses[k])),
                    0.0,
                ),
                size_m=self.size_m,
            )
            for k in range(n_threats)
        )
        return Problem(
            threats=threats,
            rig=CameraRig(peripheral=FisheyeCamera(distortion=self.distortion)),
            horizon_s=self.horizon_s,
            safety_distance_m=self.safety_distance_m,
            formulation=Formulation.LETTER,
            objective=Objective.LETTER,
        )
