"""The frame of a search, fixed to the threats: moving, turning or mirroring a scenario changes nothing."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

GRID_M = 1e-6
"""Points are rounded to this, so that the rounding errors of a turned scenario do not send a search elsewhere."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A rigid motion of the plane, mirror images included; altitudes stay."""

    origin_m: Floats
    """(2,): the threats' centroid, east and north."""
    turn: Floats
    """(2, 2), orthogonal: local vector = turn @ (east, north)."""

    @classmethod
    def of(cls, points_m: Floats) -> Self:
        """Return the frame of points (n, 2 or 3): centred, the farthest on the first axis, the widest on its left."""
        plane = points_m[:, :2]
        origin = plane.mean(axis=0)
        offsets = plane - origin
        reach = np.hypot(offsets[:, 0], offsets[:, 1])
        if reach.max() < GRID_M:
            return cls(origin, np.eye(2))
        x, y = offsets[int(reach.argmax())] / reach.max()
        turn = np.array([[x, y], [-y, x]])
        across = offsets @ turn[1]
        if across[int(np.abs(across).argmax())] < 0:
            turn[1] = -turn[1]
        return cls(origin, turn)

    def inward(self, points_m: Floats) -> Floats:
        """Bring points (..., 3) into the frame, on the grid."""
        result = points_m.copy()
        result[..., :2] = turned(points_m[..., :2] - self.origin_m, self.turn.T)
        return np.round(result / GRID_M) * GRID_M

    def outward(self, points_m: Floats) -> Floats:
        """Take points (..., 3) back to east, north, up."""
        result = points_m.copy()
        result[..., :2] = turned(points_m[..., :2], self.turn) + self.origin_m
        return result

    def vectors_inward(self, vectors: Floats) -> Floats:
        """Bring plane directions (..., 2) into the frame."""
        return turned(vectors, self.turn.T)

    def vectors_outward(self, vectors: Floats) -> Floats:
        """Take plane directions (..., 2) back to east, north."""
        return turned(vectors, self.turn)


def turned(vectors: Floats, turn: Floats) -> Floats:
    """Return plane vectors, (..., 2), times a matrix: to the same bits whatever else is turned with them, which a
    product of matrices does not promise."""
    return np.asarray(vectors[..., :1] * turn[0] + vectors[..., 1:] * turn[1])
