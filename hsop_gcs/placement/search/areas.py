"""The fence and the keep-out areas, compiled: how much room a hover point has, and in which direction it grows.

``sides``: (n, 4), each from (east, north) to (east, north), counterclockwise around their area. ``areas``: (m, 5), each
the index of its first side, one past its last, 1 for a fence and 0 for a keep-out area, floor and ceiling, metres.
"""

import math

import numpy as np

from hsop_gcs.geometry.compiled import lean_kernel
from hsop_gcs.placement.airspace import Airspace, Polygon
from hsop_gcs.placement.search.frame import GRID_M, Floats, Frame

STRICTER_M = 4 * GRID_M
"""The search keeps so much more room than asked, because its points are on a grid."""
PER_METRE = 0.05
"""What a metre beyond a limit counts as a violation."""


def areas_of(airspace: Airspace, frame: Frame) -> tuple[Floats, Floats]:
    """Return ``sides`` and ``areas`` in the frame of the search."""
    sides: list[Floats] = []
    areas: list[tuple[float, ...]] = []
    kinds = [(polygon, 1.0, -math.inf, math.inf) for polygon in airspace.inside]
    kinds += [(area.polygon, 0.0, area.floor_m, area.ceiling_m) for area in airspace.keep_outs]
    for polygon, kind, floor_m, ceiling_m in kinds:
        first = sum(map(len, sides))
        sides.append(_sides(polygon, frame))
        areas.append((first, first + len(sides[-1]), kind, floor_m, ceiling_m))
    if not areas:
        return np.zeros((0, 4)), np.zeros((0, 5))
    return np.concatenate(sides), np.array(areas)


def _sides(polygon: Polygon, frame: Frame) -> Floats:
    corners = frame.inward(np.array([(*corner, 0.0) for corner in polygon]))[:, :2]
    after = np.roll(corners, -1, axis=0)
    if (corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum() < 0:
        corners, after = after[::-1], corners[::-1]
    sides = np.column_stack([corners, after])
    return np.asarray(sides[np.any(corners != after, axis=1)])


@lean_kernel
def depth(sides: Floats, first: int, last: int, x: float, y: float) -> tuple[float, float, float]:
    """Return how deep a point is inside an area, negative outside, and the direction in which that grows."""
    inside = False
    least, gx, gy = math.inf, 0.0, 0.0
    for n in range(first, last):
        ax, ay = sides[n, 0], sides[n, 1]
        dx, dy = sides[n, 2] - ax, sides[n, 3] - ay
        if (ay > y) != (sides[n, 3] > y) and x < ax + dx * (y - ay) / dy:
            inside = not inside
        share = max(0.0, min(1.0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)))
        ox, oy = x - ax - share * dx, y - ay - share * dy
        away = ox * ox + oy * oy
        if away < least:
            least = away
            gx, gy = ox, oy
            if away < 1e-18:
                length = math.sqrt(dx * dx + dy * dy)
                return 0.0, -dy / length, dx / length
    least = math.sqrt(least)
    if inside:
        return least, gx / least, gy / least
    return -least, -gx / least, -gy / least


@lean_kernel
def fence_room(sides: Floats, areas: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Return the depth inside the fence that holds the point best, and its gradient; infinite without a fence."""
    room, gx, gy = -math.inf, 0.0, 0.0
    for n in range(areas.shape[0]):
        if areas[n, 2] > 0:
            inside, ix, iy = depth(sides, int(areas[n, 0]), int(areas[n, 1]), x, y)
            if inside > room:
                room, gx, gy = inside, ix, iy
    return (room, gx, gy) if room > -math.inf else (math.inf, 0.0, 0.0)


@lean_kernel
def keep_out_room(
    sides: Floats, areas: Floats, n: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return how far a point is outside a keep-out area, sideways, under or over it, and the gradient."""
    under, over = areas[n, 3] - z, z - areas[n, 4]
    inside, ix, iy = depth(sides, int(areas[n, 0]), int(areas[n, 1]), x, y)
    if -inside >= under and -inside >= over:
        return -inside, -ix, -iy, 0.0
    if under >= over:
        return under, 0.0, 0.0, -1.0
    return over, 0.0, 0.0, 1.0


@lean_kernel
def trespass(sides: Floats, areas: Floats, x: float, y: float, z: float) -> float:
    """Return the violation of a hover point outside the fence or inside keep-out areas."""
    violation = 0.0
    if areas.shape[0] > 0:
        violation += max(0.0, STRICTER_M - fence_room(sides, areas, x, y)[0])
        for n in range(areas.shape[0]):
            if areas[n, 2] == 0:
                violation += max(0.0, STRICTER_M - keep_out_room(sides, areas, n, x, y, z)[0])
    return PER_METRE * violation


@lean_kernel
def back_inside(sides: Floats, areas: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the point moved the shortest way into the fence and out of each keep-out area it is in."""
    room, gx, gy = fence_room(sides, areas, x, y)
    if room < STRICTER_M:
        x += (1.5 * STRICTER_M - room) * gx
        y += (1.5 * STRICTER_M - room) * gy
    for n in range(areas.shape[0]):
        if areas[n, 2] == 0:
            room, gx, gy, gz = keep_out_room(sides, areas, n, x, y, z)
            if room < STRICTER_M:
                x += (1.5 * STRICTER_M - room) * gx
                y += (1.5 * STRICTER_M - room) * gy
                z += (1.5 * STRICTER_M - room) * gz
    return x, y, z
