"""Algorithm 2: which sets of threats one host may be given, and with which cameras (letter, section IV.A).

The screen is conservative: it discards a set only where the detectable regions cannot hold it at any pose. What it lets
through is decided by poses actually found.
"""

import math
from functools import lru_cache
from itertools import combinations

import numpy as np

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
        self.camera_choices = lru_cache(maxsize=None)(self._camera_choices)

    def reach_m(self, camera: int, threat: int) -> float:
        """Return the distance beyond which no pose of a camera detects the threat."""
        best = self.instance.best_relative_size if camera == PERIPHERAL else 1.0
        return float(self.instance.range_m[camera, threat]) * best

    def longest_central_span_m(self, first_reach_m: float, second_reach_m: float) -> float:
        """Return how far apart two points can be that one aim of the central camera holds.

        The span grows with the angle between them, and is convex in either distance: its largest value is at an end.
        """
        nearest = self.instance.safety_distance_m
        cosine = math.cos(2 * self.instance.half_fov_rad)
        return max(
            math.sqrt(a * a + b * b - 2 * a * b * cosine)
            for a in (nearest, first_reach_m)
            for b in (nearest, second_reach_m)
        )

    def _may_see(self, mask: int, central: int) -> bool:
        """Return whether one host may see the threats of ``mask``, those of ``central`` by its central camera."""
        views = [(threat, CENTRAL if central >> threat & 1 else PERIPHERAL) for threat in members(mask)]
        reaches = [self.reach_m(camera, threat) for threat, camera in views]
        if min(reaches) < self.instance.safety_distance_m:
            return False
        centres = np.concatenate([self.instance.points_m[threat] for threat, _ in views])
        if not discs_meet(centres, np.repeat(reaches, 2)):
            return False
        held = [
            (p, reach)
            for (t, cam), reach in zip(views, reaches, strict=True)
            if cam == CENTRAL
            for p in self.instance.points_m[t]
        ]
        return all(
            math.dist(p, q) <= self.longest_central_span_m(a, b) + SLACK_M for (p, a), (q, b) in combinations(held, 2)
        )

    def _camera_choices(self, mask: int) -> tuple[int, ...]:
        """Return the sets of threats within ``mask`` that may be left to the central camera, the fullest first."""
        return tuple(central for central in subsets(mask) if self.may_see(mask, central))

    def feasible(self, pair_set: PairSet) -> bool:
        """Return whether the hosts of the last pair may see all that the pair set gives them (Fig. 7's pruning).

        The other hosts' threats are what they were one level up in the tree.
        """
        masks = observed_threats(pair_set)
        return all(self.camera_choices(masks[host]) for host in pair_set[-1])
