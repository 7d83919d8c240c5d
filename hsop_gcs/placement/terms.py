"""Cost and constraint margins of many placements at once, with their gradients (Eqs. 8-11).

A *batch* is (B, H, 4): hosts' east, north (metres), heading of the fisheye axis and pan of the central camera (radians,
compass). Margins are relative: 0 on the boundary, 1 at twice what is asked for. Plane geometry.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from hsop_gcs.placement.feasibility import CENTRAL
from hsop_gcs.placement.instance import FloatArray, Instance

IntArray = npt.NDArray[np.intp]
Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""What a margin is turned into before margins are summed (a barrier, a penalty): values and their derivatives."""

_SMALLEST_ANGLE_RAD = 1e-6
_SMALLEST_SIZE = 1e-9
_SMALLEST_LENGTH_M = 1e-9


@dataclass(frozen=True, slots=True)
class Views:
    """Who looks at what, for each placement of a batch. Views 2k and 2k + 1 are a pair where a cost is asked for."""

    threat: IntArray
    """(V,): the same for all placements."""
    host: IntArray
    """(B, V)"""
    camera: IntArray
    """(B, V): PERIPHERAL or CENTRAL."""

    def rows(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> "Views":
        """Return the views of some placements of the batch."""
        return Views(self.threat, self.host[index], self.camera[index])


@dataclass(frozen=True, slots=True)
class Terms:
    """One evaluation of a batch."""

    log_cost: FloatArray
    """(B,): logarithm of Eq. 8; 0 where no cost was asked for."""
    log_cost_slope: FloatArray
    """(B, H, 4)"""
    pair_cost: FloatArray
    """(B, pairs): each pair's share of Eq. 8, weight included; empty where no cost was asked for."""
    margin: FloatArray
    """(B,): smallest relative margin."""
    shaped: FloatArray
    """(B,): sum of the shaped margins."""
    shaped_slope: FloatArray
    """(B, H, 4)"""


def folded(angle_rad: FloatArray) -> FloatArray:
    """Return the angle from the nearer of two opposite boresights, signed, in [-π/2, π/2)."""
    return np.asarray((angle_rad + np.pi / 2) % np.pi - np.pi / 2)


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Return the same direction in [-π, π)."""
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)


def relative_size(instance: Instance, off_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the fisheye's relative pixel size at an angle in [-π/2, π/2], and its slope per radian."""
    theta = np.maximum(np.abs(off_rad), _SMALLEST_ANGLE_RAD)
    tangent, sine = np.tan(theta), np.sin(theta)
    distorted = instance.fisheye.distorted_angle(theta)
    slope = instance.fisheye.distorted_angle_slope(theta) / tangent - distorted / (sine * sine)
    return np.maximum(distorted / tangent, _SMALLEST_SIZE), np.sign(off_rad) * slope


def evaluate(instance: Instance, batch: FloatArray, views: Views, shape: Shape, *, with_cost: bool = True) -> Terms:
    """Evaluate cost and margins of every placement of a batch.

    The cost is finite everywhere, also where margins are negative, except on a line through both hosts of a pair.
    """
    b, hosts, _ = batch.shape
    at = np.arange(b)[:, None]
    pose = batch[at, views.host]
    points = instance.points_m[views.threat]
    east = points[:, :, 0] - pose[:, :, None, 0]
    north = points[:, :, 1] - pose[:, :, None, 1]
    distance = np.maximum(np.hypot(east, north), _SMALLEST_LENGTH_M)
    bearing = np.arctan2(east, north)
    central = (views.camera == CENTRAL)[:, :, None]
    off_axis, off_pan = folded(bearing - pose[:, :, None, 2]), wrapped(bearing - pose[:, :, None, 3])
    size, size_slope = relative_size(instance, off_axis)
    size, size_slope = np.where(central, 1.0, size), np.where(central, 0.0, size_slope)

    # Pixels (Eq. 9) and distance (Eq. 11) of every view at both points.
    reach = instance.range_m[views.camera, views.threat][:, :, None]
    pixels = reach * size / distance
    to_pixels, by_pixels = shape(pixels - 1)
    to_distance, by_distance = shape(distance / instance.safety_distance_m - 1)
    margin = np.minimum((pixels - 1).min(axis=(1, 2)), (distance / instance.safety_distance_m - 1).min(axis=(1, 2)))
    shaped = (to_pixels + to_distance).sum(axis=(1, 2))
    by_length = by_distance / instance.safety_distance_m - by_pixels * pixels / distance
    by_off_axis = by_pixels * reach * size_slope / distance

    # Field of view (Eq. 10): a margin on either side of the pan.
    by_off_pan = np.zeros_like(off_pan)
    if central.any():
        beyond_any_field = np.broadcast_to(~central, off_pan.shape)
        for side in (1.0, -1.0):
            room = np.where(beyond_any_field, 1.0, 1 - side * off_pan / instance.half_fov_rad)
            value, slope = shape(room)
            margin = np.minimum(margin, np.where(beyond_any_field, np.inf, room).min(axis=(1, 2)))
            shaped = shaped + np.where(beyond_any_field, 0.0, value).sum(axis=(1, 2))
            by_off_pan -= np.where(beyond_any_field, 0.0, slope * side / instance.half_fov_rad)

    shaped_slope = _gather(hosts, views, east, north, distance, by_length, by_off_axis, by_off_pan)
    log_cost, log_cost_slope, pair_cost = np.zeros(b), np.zeros_like(batch), np.empty((b, 0))
    if with_cost:
        log_cost, log_cost_slope, pair_cost = _log_cost(instance, hosts, views, east, north, distance, size, size_slope)
    if instance.whole_paths:
        value, smallest, slope = _path_margins(instance, batch, shape)
        shaped, margin = shaped + value, np.minimum(margin, smallest)
        shaped_slope[:, :, :2] += slope
    if instance.min_separation_m > 0 and hosts > 1:
        value, smallest, slope = _separation_margins(instance, batch, shape)
        shaped, margin = shaped + value, np.minimum(margin, smallest)
        shaped_slope[:, :, :2] += slope
    return Terms(log_cost, log_cost_slope, pair_cost, margin, shaped, shaped_slope)


def _gather(
    hosts: int,
    views: Views,
    east: FloatArray,
    north: FloatArray,
    distance: FloatArray,
    by_length: FloatArray,
    by_off_axis: FloatArray,
    by_off_pan: FloatArray,
) -> FloatArray:
    """Turn derivatives by distance and by the angles off axis and pan, (B, V, 2), into (B, H, 4) by the poses."""
    turn = (by_off_axis + by_off_pan) / distance
    across, along = east / distance, north / distance
    per_view = np.stack(
        [
            (-by_length * across - turn * along).sum(axis=2),
            (-by_length * along + turn * across).sum(axis=2),
            -by_off_axis.sum(axis=2),
            -by_off_pan.sum(axis=2),
        ],
        axis=2,
    )
    return _sum_by_host(hosts, views, per_view)


def _sum_by_host(hosts: int, views: Views, per_view: FloatArray) -> FloatArray:
    of_host = (views.host[:, None, :] == np.arange(hosts)[None, :, None]).astype(np.float64)
    return np.asarray(of_host @ per_view)


def _log_cost(
    instance: Instance,
    hosts: int,
    views: Views,
    east: FloatArray,
    north: FloatArray,
    distance: FloatArray,
    size: FloatArray,
    size_slope: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return log of Eq. 8, (B,), its slope, (B, H, 4), and the cost of each pair, (B, pairs).

    With d/α = d² / (scale · size) and sin θ = |cross| / (d₁ d₂), a pair's cost at a point is
    d₁³ d₂³ / (scale₁ size₁ scale₂ size₂ |cross|), cross being the cross product of the two rays.
    """
    e1, e2, n1, n2 = east[:, ::2], east[:, 1::2], north[:, ::2], north[:, 1::2]
    cross = e1 * n2 - n1 * e2
    cross = np.where(np.abs(cross) < _SMALLEST_LENGTH_M, _SMALLEST_LENGTH_M, cross)
    scale = instance.scale[views.camera, views.threat][:, :, None]
    log_factor = 3 * np.log(distance) - np.log(scale * size)
    log_terms = log_factor[:, ::2] + log_factor[:, 1::2] - np.log(np.abs(cross))
    log_terms = log_terms + np.log(instance.weights[views.threat[::2]])[:, None]
    largest = log_terms.max(axis=(1, 2), keepdims=True)
    shares = np.exp(log_terms - largest)
    total = shares.sum(axis=(1, 2), keepdims=True)
    pair_cost = shares.sum(axis=2) * np.exp(largest[:, :, 0])
    shares = shares / total
    of_view = np.repeat(shares, 2, axis=1)
    slope = _gather(
        hosts,
        views,
        east,
        north,
        distance,
        of_view * 3 / distance,
        -of_view * size_slope / size,
        np.zeros_like(distance),
    )
    by_cross = shares / cross
    per_view = np.zeros((*views.host.shape, 4))
    per_view[:, ::2, 0] = (by_cross * n2).sum(axis=2)
    per_view[:, ::2, 1] = -(by_cross * e2).sum(axis=2)
    per_view[:, 1::2, 0] = -(by_cross * n1).sum(axis=2)
    per_view[:, 1::2, 1] = (by_cross * e1).sum(axis=2)
    return (largest + np.log(total))[:, 0, 0], slope + _sum_by_host(hosts, views, per_view), pair_cost


def _path_margins(instance: Instance, batch: FloatArray, shape: Shape) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Keep every host the safety distance from every threat's path: shaped sum, smallest margin, slope by position."""
    start, end = instance.points_m[:, 0], instance.points_m[:, 1]
    path = end - start
    length_squared = np.maximum((path**2).sum(axis=1), _SMALLEST_LENGTH_M)
    from_start = batch[:, :, None, :2] - start
    fraction = np.clip((from_start * path).sum(axis=3) / length_squared, 0.0, 1.0)
    away = from_start - fraction[..., None] * path
    distance = np.maximum(np.hypot(away[..., 0], away[..., 1]), _SMALLEST_LENGTH_M)
    room = distance / instance.safety_distance_m - 1
    value, slope = shape(room)
    by_position = ((slope / (distance * instance.safety_distance_m))[..., None] * away).sum(axis=2)
    return value.sum(axis=(1, 2)), room.min(axis=(1, 2)), by_position


def _separation_margins(
    instance: Instance, batch: FloatArray, shape: Shape
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Keep hosts apart from each other: shaped sum, smallest margin, slope by position."""
    first, second = np.array(list(combinations(range(batch.shape[1]), 2))).T
    away = batch[:, first, :2] - batch[:, second, :2]
    distance = np.maximum(np.hypot(away[..., 0], away[..., 1]), _SMALLEST_LENGTH_M)
    room = distance / instance.min_separation_m - 1
    value, slope = shape(room)
    push = (slope / (distance * instance.min_separation_m))[..., None] * away
    by_position = np.zeros_like(batch[:, :, :2])
    for k, (i, j) in enumerate(zip(first, second, strict=True)):
        by_position[:, i] += push[:, k]
        by_position[:, j] -= push[:, k]
    return value.sum(axis=1), room.min(axis=1), by_position
