"""What the world does to a vehicle: wind that carries it, satellites that misplace it. By chance that is passed in."""

import math
from dataclasses import dataclass

import numpy as np

from hsop_gcs.simulator.flight import CALM, Air, Point

GALE = Air(mean_mps=(18.0, 0.0), gust_mps=(0.0, 0.0))
_GUST_TIME_S = 2.0
_GPS_ERROR_TIME_S = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """``from_deg``: compass, where it blows from. ``gust_mps``: standard deviation of its gusts, each axis."""

    speed_mps: float = 0.0
    from_deg: float = 0.0
    gust_mps: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsError:
    """``offset_m``: ENU, constant. ``noise_m``: standard deviation of a slow error on top of it, each axis."""

    offset_m: Point = (0.0, 0.0, 0.0)
    noise_m: float = 0.0


class Drift:
    """Numbers that wander about zero: a Gauss-Markov process of first order, each axis by itself."""

    def __init__(self, sigma: float, correlation_s: float, axes: int, rng: np.random.Generator) -> None:
        self._sigma = sigma
        self._correlation_s = correlation_s
        self._rng = rng
        self.value = tuple((sigma * rng.standard_normal(axes)).tolist()) if sigma > 0 else (0.0,) * axes

    def step(self, dt_s: float) -> None:
        """Let time pass. Whatever the step, the standard deviation stays."""
        if self._sigma > 0:
            keep = math.exp(-dt_s / self._correlation_s)
            spread = self._sigma * math.sqrt(1.0 - keep * keep)
            fresh = self._rng.standard_normal(len(self.value)).tolist()
            self.value = tuple(keep * old + spread * new for old, new in zip(self.value, fresh, strict=True))


class Weather:
    """The wind at one vehicle."""

    def __init__(self, wind: Wind, rng: np.random.Generator) -> None:
        towards_rad = math.radians(wind.from_deg) + math.pi
        self._mean_mps = (wind.speed_mps * math.sin(towards_rad), wind.speed_mps * math.cos(towards_rad))
        self._calm = wind.speed_mps == 0 and wind.gust_mps == 0
        self._gusts = Drift(wind.gust_mps, _GUST_TIME_S, 2, rng)

    def step(self, dt_s: float) -> Air:
        """Return how the air moves now, and let time pass."""
        if self._calm:
            return CALM
        self._gusts.step(dt_s)
        east, north = self._gusts.value
        return Air(mean_mps=self._mean_mps, gust_mps=(east, north))


class Receiver:
    """A vehicle's satellite receiver: how far its positions are beside the truth, ENU metres."""

    def __init__(self, error: GpsError, rng: np.random.Generator) -> None:
        self._offset_m = error.offset_m
        self._noise = Drift(error.noise_m, _GPS_ERROR_TIME_S, 3, rng)

    @property
    def error_m(self) -> Point:
        """East, north and up, now."""
        east, north, up = (each + noise for each, noise in zip(self._offset_m, self._noise.value, strict=True))
        return east, north, up

    def step(self, dt_s: float) -> None:
        self._noise.step(dt_s)
