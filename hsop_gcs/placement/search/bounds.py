"""What no placement can beat: a cost, and a number of hosts."""

import heapq
import itertools
import math
from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.model import (
    CENTRAL,
    Floats,
    Question,
    distance_factor,
    pair_cost,
    path_offset,
    threat_cost,
)
from hsop_gcs.placement.search.parts import question_about

FEW_BOXES, MANY_BOXES = 4_000, 300_000
"""Pairs of boxes looked at per threat, for a first bound (some thousandths of a second) and for a proof."""
BOUNDED = 8
"""Threats between two looks at the clock."""
CELLS = 400
"""Along a threat's path, for a bound in space."""


def lower_bound(q: Question, executor: Executor, *, thorough: bool, late: Callable[[], bool] = lambda: False) -> float:
    """Return a cost that no placement goes below, whatever the number of hosts.

    The sum over threats of the least that a pair of hosts of its own can cost: sharing hosts between threats only adds
    constraints. Threats that are come to when it is late count as nothing.
    """
    total, threats = 0.0, len(q.weight)
    for first in range(0, threats, BOUNDED):
        if late():
            break
        some = question_about(q, list(range(first, min(first + BOUNDED, threats))))
        total += float(own_bounds(some, executor, thorough=thorough).sum())
    return total


def own_bounds(q: Question, executor: Executor, *, thorough: bool) -> Floats:
    """Return (threats,) what each costs at least with any two hosts.

    Proven by branch and bound over boxes for the two hosts where all altitudes are equal, otherwise by their distances
    alone.
    """
    threats = range(len(q.weight))
    if not q.plane:
        return np.array([own_pair_bound_in_space(q, threat, CELLS) for threat in threats])
    most = MANY_BOXES if thorough else FEW_BOXES
    return np.array(list(executor.map(lambda threat: own_pair_bound(q, threat, most), threats)))


@kernel
def own_pair_bound_in_space(q: Question, threat: int, cells: int) -> float:
    """Return a lower bound on a threat's cost with any two hosts in space; infinite if none can see it.

    A host counts only by where it is along the path and how far from it, and all angles as right ones: the least over
    pairs of cells along the path, each at the least distances from both points that safety and altitudes leave.
    """
    length = 0.0
    for n in range(3):
        length += (q.points_m[threat, 1, n] - q.points_m[threat, 0, n]) ** 2
    length = math.sqrt(length)
    lenses = q.range_m.shape[0]
    reach = reach_m(q, threat)
    factors = np.empty((lenses * cells, 2))
    count = 0
    width = (length + 2 * reach) / cells
    for lens in range(lenses):
        size = largest_size(q, lens)
        for cell in range(cells):
            low, high = cell * width - reach, (cell + 1) * width - reach
            beyond = max(0.0, -low, high - length)
            across = max(0.0, q.safety_m * q.safety_m - beyond * beyond)
            for k in range(2):
                along = max(0.0, low - k * length, k * length - high)
                height = q.points_m[threat, k, 2]
                nearest = max(q.safety_m, q.floor_m - height, height - q.ceiling_m, math.sqrt(across + along * along))
                factors[count, k] = distance_factor(q, lens, threat, nearest) / (1.0 if q.rms else size)
                if nearest > q.range_m[lens, threat] * size:
                    factors[count, k] = math.inf
            if factors[count, 0] < math.inf and factors[count, 1] < math.inf:
                count += 1
    best = math.inf
    for i in range(count):
        for j in range(i + 1):
            total = pair_cost(q, factors[i, 0], factors[j, 0], 1.0) + pair_cost(q, factors[i, 1], factors[j, 1], 1.0)
            best = min(best, total)
    return math.inf if best == math.inf else threat_cost(q, threat, best)


@lean_kernel
def factor_bound(q: Question, threat: int, lens: int, x: float, y: float, radius: float, k: int) -> float:
    """Return the least factor of a lens anywhere in a disc, at one point of a threat; infinite out of range."""
    away = math.hypot(q.points_m[threat, k, 0] - x, q.points_m[threat, k, 1] - y)
    nearest = max(q.safety_m, away - radius)
    if nearest > q.range_m[lens, threat] * largest_size(q, lens):
        return math.inf
    scale = 1.0 if q.rms else largest_size(q, lens)
    return float(distance_factor(q, lens, threat, nearest) / scale)


@lean_kernel
def largest_size(q: Question, lens: int) -> float:
    """Return a bound on the relative size of an image: distortion can make it larger off the axis than on it."""
    if lens % 2 == CENTRAL:
        return 1.0
    size = 1.0
    power = 1.0
    for n in range(4):
        power *= 0.25 * math.pi * math.pi
        size += max(0.0, q.distortion[lens // 2, n]) * power
    return size


@lean_kernel
def reach_m(q: Question, threat: int) -> float:
    """Return a distance from which no lens detects a threat."""
    reach = 0.0
    for lens in range(q.range_m.shape[0]):
        reach = max(reach, q.range_m[lens, threat] * largest_size(q, lens))
    return float(reach)


@lean_kernel
def spread(x: float, y: float, radius: float) -> float:
    """Return by how much the bearing of a point at (x, y) varies when it is seen from anywhere in a disc about 0."""
    away = math.hypot(x, y)
    return math.pi if away <= radius else math.asin(radius / away)


@lean_kernel
def fits_window(q: Question, threat: int, rig: int, x: float, y: float, radius: float) -> bool:
    """Return whether somewhere in a disc both points of a threat may lie within the field of view of a rig."""
    ax, ay = q.points_m[threat, 0, 0] - x, q.points_m[threat, 0, 1] - y
    bx, by = q.points_m[threat, 1, 0] - x, q.points_m[threat, 1, 1] - y
    angle = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
    return bool(angle - spread(ax, ay, radius) - spread(bx, by, radius) <= q.fov_rad[rig])


@lean_kernel
def allowed(q: Question, threat: int, x: float, y: float, radius: float) -> bool:
    """Return whether a disc reaches out of the threat's own safety zone."""
    if q.whole_path:
        ox, oy, _ = path_offset(q.points_m, threat, x, y, q.points_m[threat, 0, 2])
        return math.hypot(ox, oy) + radius >= q.safety_m
    for k in range(2):
        if math.hypot(q.points_m[threat, k, 0] - x, q.points_m[threat, k, 1] - y) + radius < q.safety_m:
            return False
    return True


@lean_kernel
def box_bound(q: Question, threat: int, box: Floats, camera: int) -> float:
    """Return a cost that no two hosts go below, one in each of two squares (centre, centre, half widths).

    camera: that of the first host; -1: either.
    """
    x, y, u, v = box[0], box[1], box[2], box[3]
    r, s = box[4] * math.sqrt(2.0), box[5] * math.sqrt(2.0)
    if not allowed(q, threat, x, y, r) or not allowed(q, threat, u, v, s):
        return math.inf
    first, second = 0.0, 0.0
    sines = (1.0, 1.0)
    for k in range(2):
        px, py = q.points_m[threat, k, 0], q.points_m[threat, k, 1]
        ax, ay, bx, by = px - x, py - y, px - u, py - v
        angle = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
        angle = min(angle, math.pi - angle)
        sine = math.sin(min(0.5 * math.pi, angle + spread(ax, ay, r) + spread(bx, by, s)))
        sines = (sine, sines[1]) if k == 0 else (sines[0], sine)
    best = math.inf
    for lens in range(q.range_m.shape[0]):
        if camera >= 0 and lens % 2 != camera:
            continue
        if lens % 2 == CENTRAL and not fits_window(q, threat, lens // 2, x, y, r):
            continue
        for other in range(q.range_m.shape[0]):
            if other % 2 == CENTRAL and not fits_window(q, threat, other // 2, u, v, s):
                continue
            if lens // 2 == other // 2 and q.hosts_of_rig[lens // 2] < 2:
                continue
            total = 0.0
            for k in range(2):
                first = factor_bound(q, threat, lens, x, y, r, k)
                second = factor_bound(q, threat, other, u, v, s, k)
                if first == math.inf or second == math.inf:
                    total = math.inf
                else:
                    total += pair_cost(q, first, second, sines[k])
            best = min(best, total)
    return math.inf if best == math.inf else threat_cost(q, threat, best)


@lean_kernel
def mirrored(box: Floats, middle_x: float, middle_y: float, along_x: float, along_y: float) -> bool:
    """Return whether everything in the two squares has its equal elsewhere.

    Either host may have either lens, so the first one may be the one farther from the path's middle, along it; and with
    mirror images along and across the path alike, it may be ahead of the middle and on the left.
    """
    skew = abs(along_x) + abs(along_y)
    x, y = box[0] - middle_x, box[1] - middle_y
    ahead = x * along_x + y * along_y
    left = y * along_x - x * along_y
    other = abs((box[2] - middle_x) * along_x + (box[3] - middle_y) * along_y)
    first, second = box[4] * skew, box[5] * skew
    return bool(ahead + first < 0 or left + first < 0 or abs(ahead) + first < other - second)


@kernel
def own_pair_bound(q: Question, threat: int, most_boxes: int) -> float:
    """Return a lower bound on a threat's cost with any two hosts: best-first branch and bound, plane geometry.

    Boxes that hold no allowed position, or see nothing, are infinite; the bound is the least among the boxes left.
    """
    middle_x = 0.5 * (q.points_m[threat, 0, 0] + q.points_m[threat, 1, 0])
    middle_y = 0.5 * (q.points_m[threat, 0, 1] + q.points_m[threat, 1, 1])
    along_x = q.points_m[threat, 1, 0] - q.points_m[threat, 0, 0]
    along_y = q.points_m[threat, 1, 1] - q.points_m[threat, 0, 1]
    length = math.hypot(along_x, along_y)
    along_x, along_y = (along_x / length, along_y / length) if length > 0 else (1.0, 0.0)
    reach = reach_m(q, threat)
    boxes = np.empty((most_boxes + 4, 6))
    boxes[0] = np.array([middle_x, middle_y, middle_x, middle_y, reach, reach])
    count = 1
    queue = [(box_bound(q, threat, boxes[0], -1), 0)]
    while queue and queue[0][0] < math.inf and count + 4 <= most_boxes:
        _, index = heapq.heappop(queue)
        which = 0 if boxes[index, 4] >= boxes[index, 5] else 1
        half = 0.5 * boxes[index, 4 + which]
        for corner in range(4):
            box = boxes[count]
            box[:] = boxes[index]
            box[2 * which] += half if corner % 2 == 0 else -half
            box[2 * which + 1] += half if corner // 2 == 0 else -half
            box[4 + which] = half
            if mirrored(box, middle_x, middle_y, along_x, along_y):
                continue
            bound = box_bound(q, threat, box, -1)
            if bound < math.inf:
                heapq.heappush(queue, (bound, count))
                count += 1
    return queue[0][0] if queue else math.inf


@kernel
def partner_bound(q: Question, threat: int, camera: int, square: Floats, around: Floats, most_boxes: int) -> float:
    """Return a lower bound on a threat's cost with one host, and this camera, in a square: wherever the other one is.

    square, around: centre and half width, metres, of the first host's place and of all places of the other; plane
    geometry.
    """
    boxes = np.empty((most_boxes + 4, 6))
    boxes[0] = np.array([square[0], square[1], around[0], around[1], square[2], around[2]])
    count = 1
    queue = [(box_bound(q, threat, boxes[0], camera), 0)]
    while queue[0][0] < math.inf and count + 4 <= most_boxes:
        _, index = heapq.heappop(queue)
        half = 0.5 * boxes[index, 5]
        for corner in range(4):
            box = boxes[count]
            box[:] = boxes[index]
            box[2] += half if corner % 2 == 0 else -half
            box[3] += half if corner // 2 == 0 else -half
            box[5] = half
            bound = box_bound(q, threat, box, camera)
            if bound < math.inf:
                heapq.heappush(queue, (bound, count))
                count += 1
        if not queue:
            return math.inf
    return queue[0][0]


def fewest_hosts(q: Question) -> int:
    """Return a number of hosts that no placement can do with less.

    Two threats with points farther apart than the sum of their ranges share no host; each of a set of such threats
    needs two of its own. The set is grown greedily from every threat.
    """
    swelling = np.array([largest_size(q, lens) for lens in range(len(q.range_m))])
    reach = (q.range_m * swelling[:, None]).max(axis=0)
    count = len(reach)
    apart = np.zeros((count, count), dtype=bool)
    for i, j in itertools.combinations(range(count), 2):
        widest = max(math.dist(a, b) for a in q.points_m[i] for b in q.points_m[j])
        apart[i, j] = apart[j, i] = widest > reach[i] + reach[j]
    largest = 1
    for first in range(count):
        group = [first]
        for other in np.argsort(-apart.sum(axis=1), kind="stable"):
            if all(apart[other, member] for member in group):
                group.append(int(other))
        largest = max(largest, len(group))
    return 2 * largest
