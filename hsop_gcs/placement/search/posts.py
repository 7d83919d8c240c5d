"""Posts: places from which a host sees threats within every rule, drawn around each threat.

What is seen from a post depends on nothing else, so that a choice among posts is a placement: who may be seen at all,
and by whom together with whom, is then a matter of tables.
"""

import math
from typing import NamedTuple

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.bounds import largest_size
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import bell, below, uniform
from hsop_gcs.placement.search.model import (
    CENTRAL,
    PERIPHERAL,
    Floats,
    Ints,
    Question,
    host_violation,
    place_violation,
    relative_size,
)
from hsop_gcs.placement.search.moves import keep_clear
from hsop_gcs.placement.search.state import State, new_state

HEADINGS = 10
"""Directions of the fisheye axis that are looked at for each place, besides the one to the threat itself."""
NEAR = 0.4
"""Share of the places that are drawn hardly farther than the safety distance."""
OWN_WORTH = 1e6
"""What the threat that a post is drawn for counts when its heading is chosen, beside 1 for each other one."""


class Posts(NamedTuple):
    """Places, headings and rigs, and what is seen from each."""

    positions: Floats
    """(posts, 3)"""
    axes: Floats
    """(posts, 2): east and north of the fisheye axis."""
    rigs: Ints
    seen: Ints
    """(posts, threats): 0 where a threat is not seen, else 1 more than the number of the camera that sees it."""


def posts_around(q: Question, threat: int, tries: int, chance: Chance) -> Posts:
    """Return the posts that come of so many places drawn around a threat; each of them sees it."""
    posts = Posts(
        np.empty((tries, 3)),
        np.empty((tries, 2)),
        np.empty(tries, np.int64),
        np.zeros((tries, len(q.weight)), np.int64),
    )
    count = draw_posts(q, threat, new_state(len(q.weight), 1), posts, chance)
    return Posts(posts.positions[:count], posts.axes[:count], posts.rigs[:count], posts.seen[:count])


def together(posts: list[Posts], threats: int) -> Posts:
    """Return all of these posts in one table."""
    if not posts:
        return Posts(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros((0, threats), np.int64))
    return Posts(*(np.concatenate(columns) for columns in zip(*posts, strict=True)))


@lean_kernel
def in_range(q: Question, x: float, y: float, z: float, rig: int, threat: int) -> bool:
    """Return whether one end of a threat's path is within the range of a fisheye on its axis."""
    ex, ey, ez = q.points_m[threat, 0, 0] - x, q.points_m[threat, 0, 1] - y, q.points_m[threat, 0, 2] - z
    reach = q.range_m[2 * rig + PERIPHERAL, threat] * largest_size(q, 2 * rig + PERIPHERAL)
    return bool(ex * ex + ey * ey + ez * ez <= reach * reach)


@lean_kernel
def by_fisheye(q: Question, x: float, y: float, z: float, ax: float, ay: float, rig: int, threat: int) -> bool:
    """Return whether a fisheye sees both points of a threat."""
    lens = 2 * rig + PERIPHERAL
    for k in range(2):
        ex, ey, ez = q.points_m[threat, k, 0] - x, q.points_m[threat, k, 1] - y, q.points_m[threat, k, 2] - z
        d = math.sqrt(ex * ex + ey * ey + ez * ez) + 1e-12
        if d < q.safety_m or d / q.range_m[lens, threat] > relative_size(abs(ex * ax + ey * ay) / d, q.distortion, rig):
            return False
    return True


@lean_kernel
def by_central(q: Question, s: State, threat: int) -> bool:
    """Return whether the central camera of the only host of ``s`` sees both points of a threat, and nothing else."""
    threats, lens = q.weight.shape[0], 2 * s.rigs[0] + CENTRAL
    for k in range(2):
        ex = q.points_m[threat, k, 0] - s.positions[0, 0]
        ey = q.points_m[threat, k, 1] - s.positions[0, 1]
        ez = q.points_m[threat, k, 2] - s.positions[0, 2]
        d = math.sqrt(ex * ex + ey * ey + ez * ez) + 1e-12
        if d > q.range_m[lens, threat] or d < q.safety_m:
            return False
    # a fisheye that is used as well fixes the nose, and with it what a gimbal with limits can reach
    other = (threat + 1) % threats
    s.incident[0, 0] = 2 * threat
    s.degree[0] = 1
    if other != threat:
        s.incident[0, 1] = 2 * other
        s.degree[0] = 2
        s.cameras[other, 0] = PERIPHERAL
    s.cameras[threat, 0] = CENTRAL
    broken = host_violation(q, s.positions, s.axes, s.rigs, 0, s.incident[0], s.degree[0], s.cameras)
    return bool(broken <= 0)


@kernel
def draw_posts(q: Question, threat: int, s: State, posts: Posts, chance: Chance) -> int:
    """Fill the first posts with those that see a threat, one for each place drawn; return how many.

    s: scratch, for one host
    """
    threats, rigs, tries = q.weight.shape[0], q.hosts_of_rig.shape[0], posts.rigs.shape[0]
    count, near = 0, np.empty(threats, np.int64)
    for n in range(tries):
        rig, k = n % rigs, below(chance, 2)
        reach = max(q.range_m[2 * rig + PERIPHERAL, threat], q.range_m[2 * rig + CENTRAL, threat])
        if reach < q.safety_m or q.hosts_of_rig[rig] == 0:
            continue
        share = uniform(chance)
        distance = q.safety_m * (1.001 + 0.3 * share) if n < NEAR * tries else q.safety_m + share * (reach - q.safety_m)
        angle = 2 * math.pi * uniform(chance)
        s.rigs[0] = rig
        s.positions[0, 0] = q.points_m[threat, k, 0] + distance * math.sin(angle)
        s.positions[0, 1] = q.points_m[threat, k, 1] + distance * math.cos(angle)
        s.positions[0, 2] = q.points_m[threat, k, 2]
        if q.ceiling_m > q.floor_m and uniform(chance) < 0.5:
            s.positions[0, 2] += 0.3 * distance * bell(chance)
        s.positions[0, 2] = max(q.floor_m, min(q.ceiling_m, s.positions[0, 2]))
        s.incident[0, 0] = 2 * threat
        s.degree[0] = 1
        keep_clear(q, s, 0)
        if place_violation(q, s.positions, 0) > 0:
            continue
        x, y, z = s.positions[0, 0], s.positions[0, 1], s.positions[0, 2]
        nearby = 0
        for other in range(threats):
            if in_range(q, x, y, z, rig, other):
                near[nearby] = other
                nearby += 1
        best, ax, ay = -1.0, 0.0, 1.0
        for heading in range(HEADINGS + 1):
            turn = math.pi * heading / HEADINGS
            if heading == HEADINGS:
                turn = math.atan2(q.points_m[threat, k, 0] - x, q.points_m[threat, k, 1] - y)
            east, north = math.sin(turn), math.cos(turn)
            worth = 0.0
            for other in near[:nearby]:
                if by_fisheye(q, x, y, z, east, north, rig, other):
                    worth += OWN_WORTH if other == threat else 1.0
            if worth > best:
                best, ax, ay = worth, east, north
        s.axes[0, 0], s.axes[0, 1] = ax, ay
        narrow = by_central(q, s, threat)
        if not narrow and best < OWN_WORTH:
            continue
        posts.seen[count, :] = 0
        for other in near[:nearby]:
            if by_fisheye(q, x, y, z, ax, ay, rig, other):
                posts.seen[count, other] = 1 + PERIPHERAL
        if narrow:
            posts.seen[count, threat] = 1 + CENTRAL
        posts.positions[count] = s.positions[0]
        posts.axes[count] = s.axes[0]
        posts.rigs[count] = rig
        count += 1
    return count
