"""Poses from which one host sees all the threats it is given: the starts of every solve, and the test of Algorithm 2.

Positions are sampled; for each of them the pan and the heading that serve best follow by themselves.
"""

from functools import lru_cache

import numpy as np

from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL, Screen, members
from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.interior_point import INSIDE, margins, reach_feasibility
from hsop_gcs.placement.terms import Views, folded, relative_size, wrapped

SAMPLES = 4096
KEPT = 512
"""Poses kept of each kind, spread at random over all those found."""
MENDED = 64
"""Best near misses that are moved inside when sampling finds too few poses."""
ENOUGH = 32


class CoveringPoses:
    """Sampled poses that see given sets of threats by given cameras; each set is sampled once."""

    def __init__(self, instance: Instance, screen: Screen, seed: int) -> None:
        self.instance = instance
        self.screen = screen
        self.seed = seed
        self.poses = lru_cache(maxsize=None)(self._poses)
        self._positions = lru_cache(maxsize=64)(self._sample_positions)

    def covers(self, mask: int) -> bool:
        """Return whether a pose was found from which one host sees all threats of a set, by whichever cameras."""
        return len(self.poses(mask, 0)) > 0 or any(
            len(self.poses(mask, central)) for central in self.screen.camera_choices(mask)
        )

    def camera_types(self, mask: int) -> list[int]:
        """Return the letter's choice of cameras (Determine-Camera-Type): all threats by the central camera, else one.

        All that the one could be are returned: the letter takes the closest, and where the host will hover is not known
        yet; the cheapest solution settles it. Each is a bit mask of the threats left to the central camera.
        """
        singles = [1 << threat for threat in members(mask)]
        for options in ([mask], singles, [0]):
            if held := [central for central in options if len(self.poses(mask, central))]:
                return held
        return []

    def _sample_positions(self, mask: int) -> FloatArray:
        """Sample positions within reach of all threats of a set: (n, 2), metres."""
        rng = np.random.default_rng([self.seed, mask])
        threats = members(mask)
        centres = self.instance.points_m[threats].reshape(-1, 2)
        radii = np.repeat(self.screen.reach_m[:, threats].max(axis=0), 2)[:, None]
        low, high = (centres - radii).max(axis=0), (centres + radii).min(axis=0)
        return np.asarray(rng.uniform(low, np.maximum(low, high), size=(SAMPLES, 2)))

    def _poses(self, mask: int, central: int) -> FloatArray:
        """Return poses, (n, 4), each of which sees the set by the cameras given with all margins positive."""
        if not self.screen.may_see(mask, central):
            return np.empty((0, 4))
        rng = np.random.default_rng([self.seed, mask, central])
        threats = np.array(members(mask))
        camera = np.array([CENTRAL if central >> t & 1 else PERIPHERAL for t in threats])
        poses = aimed(self.instance, self._positions(mask), threats, camera)
        views = _alone(threats, camera, len(poses))
        margin = margins(self.instance, poses[:, None], views, with_cost=False).margin
        found = poses[margin >= INSIDE]
        if len(found) < ENOUGH:
            nearest = np.argsort(-margin)[:MENDED]
            mended = reach_feasibility(self.instance, poses[nearest, None], views.rows(nearest))
            inside = margins(self.instance, mended, views.rows(nearest), with_cost=False).margin >= INSIDE
            found = mended[inside, 0]
        return np.asarray(rng.permutation(found)[:KEPT])


def _alone(threats: np.ndarray, camera: np.ndarray, n: int) -> Views:
    """Return the views of a host that sees the threats by itself, for n poses of it."""
    return Views(threats, np.zeros((n, len(threats)), dtype=np.intp), np.tile(camera, (n, 1)))


def aimed(instance: Instance, positions_m: FloatArray, threats: np.ndarray, camera: np.ndarray) -> FloatArray:
    """Give each position, (n, 2), the heading and pan that suit it best: poses (n, 4).

    The pan is the middle of what the central camera is to see. The heading is the middle of those from which every
    fisheye view is wide enough; where there are none, the threat that is hardest to see lies on the axis.
    """
    rays = instance.points_m[threats] - positions_m[:, None, None, :]
    bearing = np.arctan2(rays[..., 0], rays[..., 1])
    by_central = camera == CENTRAL
    headings = _headings(
        instance, np.linalg.norm(rays, axis=3)[:, ~by_central], bearing[:, ~by_central], threats[~by_central]
    )
    pans = _middles(bearing[:, by_central])
    if by_central.all():
        headings = pans
    return np.column_stack([positions_m, headings, pans])


def _middles(bearing: FloatArray) -> FloatArray:
    """Return the middle of the narrowest arc that holds all bearings of a row: (n, threats, 2) to (n,); 0 for none."""
    flat = bearing.reshape(len(bearing), -1)
    if not flat.shape[1]:
        return np.zeros(len(flat))
    ordered = np.sort(flat % (2 * np.pi), axis=1)
    gaps = np.diff(ordered, axis=1, append=ordered[:, :1] + 2 * np.pi)
    widest = gaps.argmax(axis=1)
    row = np.arange(len(flat))
    return wrapped(ordered[row, widest] + gaps[row, widest] / 2 + np.pi)


def _headings(instance: Instance, distance: FloatArray, bearing: FloatArray, threats: np.ndarray) -> FloatArray:
    """Return the middle of the common arc of headings for fisheye views, (n, threats, 2) to (n,); 0 for none.

    A view is wide enough while its bearing is off the axis by no more than some angle, so its headings are an arc that
    repeats every 180°. If arcs have a common part, it begins where one of them begins.
    """
    if not len(threats):
        return np.zeros(len(distance))
    angles = np.linspace(0.0, np.pi / 2, 512)
    sizes, _ = relative_size(instance, angles)
    falling = np.maximum.accumulate(sizes[::-1])
    needed = distance / instance.range_m[PERIPHERAL, threats][:, None]
    width = np.interp(needed, falling, angles[::-1]).reshape(len(distance), -1)
    centre = bearing.reshape(len(bearing), -1)
    best = np.full(len(distance), -np.inf)
    heading = centre[np.arange(len(centre)), width.argmin(axis=1)]
    for k in range(centre.shape[1]):
        begin = centre[:, k] - width[:, k]
        # Angles from this beginning to the end of every arc; an arc that does not hold the beginning has no room.
        ahead = folded(centre - begin[:, None]) + width
        holds = np.abs(folded(centre - begin[:, None])) <= width + 1e-12
        room = np.where(holds, ahead, -np.inf).min(axis=1)
        better = room > best
        best[better], heading[better] = room[better], (begin + room / 2)[better]
    return np.asarray(heading)
