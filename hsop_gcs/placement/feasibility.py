"""Algorithm 2: which sets of threats one host may be given, and with which cameras (letter, section IV.A).

The screen is conservative: it discards a set only where the detectable regions cannot hold it at any pose. What it lets
through is decided by poses actually found.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.pair_sets import PairSet, observed_threats

SLACK_M = 1e-9
PERIPHERAL, CENTRAL = 0, 1


def members(mask: int) -> list[int]:
    """Return the threats of a bit mask, in order."""
    return [threat for threat in range(mask.bit_length()) if mask >> threat & 1]


def subsets(mask: int) -> list[int]:
    """Return all bit masks within a mask, the fullest first."""
    within = [0]
    for threat in members(mask):
        within += [other | 1 << threat for other in within]
    return sorted(within, key=lambda other: (-other.bit_count(), other))


def discs_meet(centres_m: FloatArray, radii_m: FloatArray) -> bool:
    """Return whether discs in the plane have a common point: (n, 2) and (n,), metres.

    If they have, one of these lies in all of them: a centre, or a point where two of the circles cross.
    """
    candidates = [centres_m]
    for i, j in combinations(range(len(centres_m)), 2):
        across = centres_m[j] - centres_m[i]
        distance = float(np.hypot(*across))
        if distance > radii_m[i] + radii_m[j] + SLACK_M:
            return False
        if distance <= abs(radii_m[i] - radii_m[j]):
            continue
        along = (distance**2 + radii_m[i] ** 2 - radii_m[j] ** 2) / (2 * distance)
        aside = math.sqrt(max(0.0, radii_m[i] ** 2 - along**2))
        unit = across / distance
        normal = np.array([-unit[1], unit[0]])
        foot = centres_m[i] + along * unit
        candidates.append(np.array([foot + aside * normal, foot - aside * normal]))
    points = np.concatenate(candidates)
    distances = np.linalg.norm(points[:, None] - centres_m, axis=2)
    return bool((distances <= radii_m * (1 + 1e-12) + SLACK_M).all(axis=1).any())


class Screen:
    """The conservative tests for one instance, each set of threats examined once."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.may_see = lru_cache(maxsize=None)(self._may_see)
        self.reach_m = instance.range_m * np.array([[instance.best_relative_size], [1.0]])
        """(2 cameras, threats): beyond this distance no pose of a camera detects the threat."""
        points = instance.points_m.reshape(-1, 2)
        self._apart_m = np.linalg.norm(points[:, None] - points, axis=2)
        central = np.repeat(self.reach_m[CENTRAL], 2)
        self._central_span_m = self.longest_central_span_m(central[:, None], central)

    def longest_central_span_m(self, first_reach_m: npt.ArrayLike, second_reach_m: npt.ArrayLike) -> FloatArray:
        """Return how far apart two points can be that one aim of the central camera holds.

        The span grows with the angle between them, and is convex in either distance: its largest value is at an end.
        """
        nearest = self.instance.safety_distance_m
        cosine = math.cos(2 * self.instance.half_fov_rad)
        spans = [
            np.sqrt(np.square(a) + np.square(b) - 2 * np.multiply(a, b) * cosine)
            for a in (nearest, first_reach_m)
            for b in (nearest, second_reach_m)
        ]
        return np.asarray(np.maximum.reduce(np.broadcast_arrays(*spans)))

    def _may_see(self, mask: int, central: int) -> bool:
        """Return whether one host may see the threats of ``mask``, those of ``central`` by its central camera."""
        threats = np.array(members(mask))
        by_central = np.array([bool(central >> threat & 1) for threat in threats])
        reach = np.where(by_central, self.reach_m[CENTRAL, threats], self.reach_m[PERIPHERAL, threats])
        if reach.min() < self.instance.safety_distance_m:
            return False
        points = np.column_stack([2 * threats, 2 * threats + 1]).ravel()
        reach, held = np.repeat(reach, 2), points[np.repeat(by_central, 2)]
        if (self._apart_m[np.ix_(points, points)] > reach[:, None] + reach + SLACK_M).any():
            return False
        if (self._apart_m[np.ix_(held, held)] > self._central_span_m[np.ix_(held, held)] + SLACK_M).any():
            return False
        return discs_meet(self.instance.points_m[threats].reshape(-1, 2), reach)

    def camera_choices(self, mask: int) -> Iterator[int]:
        """Yield the sets of threats within ``mask`` that may be left to the central camera, the fullest first."""
        return (central for central in subsets(mask) if self.may_see(mask, central))

    def feasible(self, pair_set: PairSet) -> bool:
        """Return whether the hosts of the last pair may see all that the pair set gives them (Fig. 7's pruning).

        The other hosts' threats are what they were one level up in the tree.
        """
        masks = observed_threats(pair_set)
        return all(any(True for _ in self.camera_choices(masks[host])) for host in pair_set[-1])
