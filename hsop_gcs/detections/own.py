"""What cameras see of our own aircraft: rays that lead to where another host was."""

import numpy as np

from hsop_gcs.detections.ray import Ray
from hsop_gcs.tracks import Track, TrackRules
from hsop_gcs.tracks.gate import predicted, threshold
from hsop_gcs.tracks.history import state_before
from hsop_gcs.tracks.own import HOST_SIGMA_M, OwnAircraft, position_at

_MISS_PROBABILITY = 1e-3


def seen_host(ray: Ray, own: OwnAircraft) -> tuple[str, float] | None:
    """Return which other host lies where a ray leads, and its squared distance across the ray in standard deviations;
    None if none does.
    """
    nearest: tuple[str, float] | None = None
    for host, path in own.paths.items():
        if host == ray.detection.host:
            continue
        squared = _squared(ray, np.array(position_at(path, ray.time_s)), HOST_SIGMA_M**2 * np.eye(3))
        if squared <= threshold(2, _MISS_PROBABILITY) and (nearest is None or squared < nearest[1]):
            nearest = host, squared
    return nearest


def squared_of(ray: Ray, track: Track, rules: TrackRules) -> float:
    """Return the squared distance of a threat across a ray in standard deviations; infinite behind the camera."""
    mean, covariance = predicted([state_before(track.steps, ray.time_s)], [ray.time_s], rules)
    return _squared(ray, mean[0, :3], covariance[0, :3, :3])


def _squared(ray: Ray, place_m: np.typing.NDArray[np.float64], covariance: np.typing.NDArray[np.float64]) -> float:
    reach_m = place_m - np.array(ray.origin_m)
    depth_m = float(reach_m @ np.array(ray.direction))
    if depth_m <= 0:
        return float("inf")
    across = np.array(ray.across)
    spread = across @ covariance @ across.T + np.diag(np.square(np.array(ray.sigma_rad) * depth_m))
    miss_m = across @ reach_m
    return float(miss_m @ np.linalg.solve(spread, miss_m))
