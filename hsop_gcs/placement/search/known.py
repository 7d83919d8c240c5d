"""Known poses: where hosts of earlier placements of the same search stand and look, which an anneal tries again.

A pose that serves in one placement often serves in another, beside other partners, and is hard to meet by chance.
"""

from collections.abc import Sequence

import numpy as np

from hsop_gcs.placement.search.model import Floats
from hsop_gcs.placement.search.poses import fill_aims
from hsop_gcs.placement.search.state import State

ROOM = 250
ALIKE_M, ALIKE_AXES = 3.0, 0.25
"""Poses in the same cell of such a grid, with the same aims, count as one."""
NO_POSES: Floats = np.zeros((0, 6))


class KnownPoses:
    """The poses that were found last, different ones."""

    def __init__(self) -> None:
        self.rows = NO_POSES
        """(poses, 6): east and north, metres; those of the fisheye axis; the two threats, or one twice, that are aimed
        at."""
        self._rows: dict[tuple[float, ...], list[float]] = {}

    def take(self, found: Sequence[tuple[State, Sequence[int]]]) -> None:
        """Remember the hosts of placements, each given with the numbers of its threats."""
        for state, threats in found:
            aims = np.empty((len(state.degree), 2), np.int64)
            fill_aims(state, aims)
            aims = np.asarray(threats)[aims]
            places, axes = state.positions[:, :2], state.axes
            cells = np.hstack((np.rint(places / ALIKE_M), np.rint(np.abs(axes) / ALIKE_AXES), aims)).tolist()
            for cell, row in zip(map(tuple, cells), np.hstack((places, axes, aims)).tolist(), strict=True):
                self._rows.pop(cell, None)
                self._rows[cell] = row
        for cell in list(self._rows)[:-ROOM]:
            del self._rows[cell]
        self.rows = np.array(list(self._rows.values())).reshape(-1, 6)


def poses_about(known: Floats, threats: Sequence[int]) -> Floats:
    """Return those poses that aim at one of some threats, which are numbered anew, ``threats[0]`` as 0."""
    if not len(known):
        return known
    number = {threat: n for n, threat in enumerate(threats)}
    own = [[*row[:4], *(number[aim] for aim in row[4:] if aim in number)] for row in known.tolist()]
    aiming = [[*row[:5], row[-1]] for row in own if len(row) > 4]
    return np.array(aiming) if aiming else NO_POSES
