"""Poses with long views: from where a central camera sees one threat, and another one far away is seen besides.

Such a pose holds only in a few metres, and only with the right heading. Steps and jumps of an anneal seldom meet it,
least of all while the partners that it needs are elsewhere. Here two threats are drawn, then places until both are seen
within the rules; whether such a pose serves is left to ``recombined``.
"""

import math

import numpy as np
from scipy.spatial.distance import cdist

from hsop_gcs.geometry.compiled import kernel
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL, Floats, Ints, Question
from hsop_gcs.placement.search.moves import turn_towards
from hsop_gcs.placement.search.poses import VIEW, Sight, look
from hsop_gcs.placement.search.state import State, new_state

PER_PAIR, MOST_DRAWS = 4, 400
"""How many times two threats are drawn, for each pair in order, and in all."""
TRIES = 60
"""Places for each two."""
TOGETHER = 1 / 3
"""Share of the draws in which the central camera is to see both."""
ASIDE_RAD = 0.65 * math.pi
"""A place is at most so far aside from the way between the two threats, seen from the nearer one."""
MOST_VIOLATION = 0.03


def long_views(q: Question, sight: Sight, chance: Chance) -> Floats:
    """Return poses as rows, as in ``KnownPoses``. For hosts that are alike."""
    threats = len(q.weight)
    middles_m = q.points_m[:, :, :2].mean(axis=1)
    apart_m, reach_m = cdist(middles_m, middles_m), q.range_m[CENTRAL][:, None]
    across_m = 2 * reach_m * math.sin(q.fov_rad[0] / 2)
    np.fill_diagonal(apart_m, math.inf)
    together = np.argwhere(apart_m < np.maximum(reach_m - q.safety_m, across_m))
    aside = np.argwhere(apart_m < reach_m + q.range_m[PERIPHERAL])
    rows = np.empty((min(PER_PAIR * threats**2, MOST_DRAWS), 6))
    views, aims = np.empty((threats, VIEW)), np.zeros((1, 2), np.int64)
    count = draw(q, sight, middles_m, together, aside, new_state(threats, 1), aims, views, rows, chance)
    return rows[:count]


@kernel
def draw(
    q: Question,
    sight: Sight,
    middles_m: Floats,
    together: Ints,
    aside: Ints,
    s: State,
    aims: Ints,
    views: Floats,
    rows: Floats,
    chance: Chance,
) -> int:
    """Fill the first rows with one pose for each draw of two threats that has one; return how many.

    middles_m: (threats, 2), of the threats' ways
    together, aside: (pairs, 2), threats that may be seen so: both by the central camera, or the second one by a fisheye
    s, aims, views: scratch, for one host
    """
    threats, count = q.weight.shape[0], 0
    for _ in range(rows.shape[0]):
        both = uniform(chance) < TOGETHER
        pairs = together if both else aside
        if pairs.shape[0] == 0:
            continue
        one = below(chance, pairs.shape[0])
        near, far = pairs[one, 0], pairs[one, 1]
        x, y = middles_m[near, 0], middles_m[near, 1]
        to_far_x, to_far_y = middles_m[far, 0] - x, middles_m[far, 1] - y
        reach_m = q.range_m[CENTRAL, near]
        beyond_m = q.range_m[CENTRAL if both else PERIPHERAL, far]
        aims[0, 0], aims[0, 1] = near, far if both else near
        for _ in range(TRIES):
            distance = math.sqrt(q.safety_m**2 + uniform(chance) * (reach_m**2 - q.safety_m**2))
            angle = math.atan2(to_far_x, to_far_y) + ASIDE_RAD * (2 * uniform(chance) - 1)
            dx, dy = distance * math.sin(angle), distance * math.cos(angle)
            far_m = math.hypot(to_far_x - dx, to_far_y - dy)
            if not q.safety_m <= far_m <= beyond_m:
                continue
            cosine = -(dx * (to_far_x - dx) + dy * (to_far_y - dy)) / (distance * far_m)
            if both and cosine < q.fov_cosine[0]:
                continue
            s.positions[0, 0], s.positions[0, 1] = x + dx, y + dy
            turn_towards(q, s, 0, below(chance, threats) if both else far, 0.5)
            look(q, sight, s, aims, 0, views)
            seen = views[near, 7] == CENTRAL and (views[far, 7] == CENTRAL or not both)
            if seen and max(views[near, 6], views[far, 6]) <= MOST_VIOLATION:
                rows[count, 0], rows[count, 1] = s.positions[0, 0], s.positions[0, 1]
                rows[count, 2], rows[count, 3] = s.axes[0, 0], s.axes[0, 1]
                rows[count, 4], rows[count, 5] = aims[0, 0], aims[0, 1]
                count += 1
                break
    return count
