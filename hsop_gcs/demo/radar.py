"""The radar of the demonstration: coarse, and of no opinion about velocities."""

import math
from typing import Any

import numpy as np

from hsop_gcs import loopback
from hsop_gcs.demo.scene import true_positions
from hsop_gcs.geometry.frames import LocalFrame
from hsop_gcs.simulator.truth import Truth

SIGMA_M = 15.0
_SEED = 0


class Radar:
    """Reports true threats, each position with a normal error in every axis."""

    def __init__(self, truth: Truth) -> None:
        self._truth = truth
        self._rng = np.random.default_rng(_SEED)
        self._frame = LocalFrame(loopback.ORIGIN)
        self._errors_m: list[float] = []

    @property
    def error_m(self) -> float | None:
        """How far its reports were from the truth, median; None before the first."""
        return float(np.median(self._errors_m)) if self._errors_m else None

    def scan(self, now_s: float) -> list[dict[str, Any]]:
        """Return a report of every threat, as the API takes it. now_s: since the Unix epoch."""
        reports = []
        for threat_id, true_m in true_positions(self._truth, now_s).items():
            seen_m = np.array(true_m) + self._rng.normal(scale=SIGMA_M, size=3)
            self._errors_m.append(math.dist(seen_m, true_m))
            place = self._frame.to_geodetic(seen_m)
            reports.append(loopback.report("demo-radar", threat_id, now_s, place, sigma_m=SIGMA_M))
        return reports
