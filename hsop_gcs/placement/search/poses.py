"""Annealing over poses alone: at every step each threat has the two hosts that serve it best, and they the best camera.

Where hosts stand and look decides by itself who sees what: a change of one pose may change all pairs at once, and there
are no barriers between pair sets. For that a host's central camera looks to the middle of one threat, or of two, and
what does not fit in there is seen by its fisheyes. It holds for questions in a plane in which hosts do not stand in
each other's way; every host keeps its rig.
"""

import math
from typing import NamedTuple

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import bell, below, uniform
from hsop_gcs.placement.search.model import (
    CENTRAL,
    PERIPHERAL,
    SMALLEST_RELATIVE_SIZE,
    SMALLEST_SINE,
    Floats,
    Ints,
    Question,
    distance_factor,
    pair_cost,
    relative_size,
    threat_cost,
)
from hsop_gcs.placement.search.moves import accepted, push_out, turn_towards
from hsop_gcs.placement.search.state import State, refresh, set_view

VIEW = 8
"""What is kept of a view: two factors, two directions, the violation, and the camera."""
STRICTER = 1e-4
"""Every rule is kept with so much to spare: an anneal ends with violations a little below."""
SIZES = 512
"""Steps of a table of relative sizes: an error far below ``STRICTER``."""
A_LITTLE = 0.02
"""A central camera is used up to this violation; beyond, whichever of the cameras has less."""
LONG, NEAREST = 0.5, 0.4
"""Share of the jumps to where the central camera may see two threats from afar: this share of its range or more."""
AGAIN = 0.5
"""Share of the other jumps that go to a known pose."""


def shares_nothing(q: Question, s: State) -> bool:
    """Whether there are two hosts for each of several threats, alike and out of each other's way: each is by itself."""
    apart = q.separation_m <= 0 and len(q.hosts_of_rig) == 1
    return bool(apart and len(s.pairs) > 1 and len(s.degree) == 2 * len(s.pairs))


def decided_by_poses(q: Question, s: State) -> bool:
    """Whether ``anneal_poses`` holds for a question, and threats are not each by itself."""
    free = q.separation_m <= 0 and len(q.areas) == 0 and not q.whole_path
    return bool(q.plane and free and not shares_nothing(q, s))


class Sight(NamedTuple):
    """What every look of one anneal takes from the question, computed once."""

    sizes: Floats
    """(rigs, SIZES + 2): relative sizes in a fisheye, by the cosine to its axis, from 0 to 1 in steps of 1 / SIZES."""
    nearness: Floats
    """(lenses, threats): one over the range."""
    inside: Floats
    """(rigs,): the cosine of half the field of view."""
    per_across: Floats
    """One over its sine."""
    per_safety: float


def sight_of(q: Question) -> Sight:
    """Return it for a question."""
    half = 0.5 * q.fov_rad - STRICTER
    sizes = np.empty((len(half), SIZES + 2))
    fill_sizes(q, sizes)
    return Sight(sizes, 1 / q.range_m, np.cos(half), 1 / np.sin(half), 1 / q.safety_m)


@lean_kernel
def fill_sizes(q: Question, sizes: Floats) -> None:
    """Tabulate the relative sizes."""
    for rig in range(sizes.shape[0]):
        for n in range(SIZES + 2):
            sizes[rig, n] = relative_size(min(1.0, n / SIZES), q.distortion, rig)


@lean_kernel
def fill_aims(s: State, aims: Ints) -> None:
    """Fill (hosts, 2): the two threats, or one twice, that each host's central camera looks at, or its fisheyes see."""
    for host in range(s.degree.shape[0]):
        aims[host, 0] = aims[host, 1] = s.incident[host, 0] // 2 if s.degree[host] > 0 else 0
        aimed = False
        for n in range(s.degree[host]):
            view = s.incident[host, n]
            if s.cameras[view // 2, view % 2] == CENTRAL:
                aims[host, 1] = view // 2
                if not aimed:
                    aims[host, 0] = view // 2
                aimed = True


@lean_kernel
def middle_of_aims(aims: Ints, host: int, views: Floats) -> tuple[float, float]:
    """Return the middle between those directions to what a host aims at that are farthest apart."""
    x = y = 0.0
    least = 2.0
    for a in range(2 if aims[host, 0] == aims[host, 1] else 4):
        one = views[aims[host, a // 2]]
        ex, ey = one[2 + 2 * (a % 2)], one[3 + 2 * (a % 2)]
        for b in range(a):
            other = views[aims[host, b // 2]]
            gx, gy = other[2 + 2 * (b % 2)], other[3 + 2 * (b % 2)]
            if ex * gx + ey * gy < least:
                least, x, y = ex * gx + ey * gy, ex + gx, ey + gy
    per = 1 / (math.sqrt(x * x + y * y) + 1e-12)
    return x * per, y * per


@lean_kernel
def size_in(sight: Sight, rig: int, cosine: float) -> float:
    """Look up the relative size in a fisheye."""
    at = int(cosine * SIZES)
    low, high = sight.sizes[rig, at], sight.sizes[rig, at + 1]
    return float(low + (cosine * SIZES - at) * (high - low))


@lean_kernel
def look(q: Question, sight: Sight, s: State, aims: Ints, host: int, views: Floats) -> None:
    """Fill (threats, VIEW) with what a host sees as it stands, by the camera that breaks the rules less."""
    x, y = s.positions[host, 0], s.positions[host, 1]
    ax, ay = s.axes[host, 0], s.axes[host, 1]
    for threat in range(q.weight.shape[0]):
        view = views[threat]
        for k in range(2):
            ex, ey = q.points_m[threat, k, 0] - x, q.points_m[threat, k, 1] - y
            d = math.sqrt(ex * ex + ey * ey) + 1e-12
            view[k], view[2 + 2 * k], view[3 + 2 * k] = d, ex / d, ey / d
    px, py = middle_of_aims(aims, host, views)
    rig = s.rigs[host]
    peripheral, central = 2 * rig + PERIPHERAL, 2 * rig + CENTRAL
    inside, per_across = sight.inside[rig], sight.per_across[rig]
    for threat in range(q.weight.shape[0]):
        view = views[threat]
        near = beyond = outside = 0.0
        for k in range(2):
            cosine = view[2 + 2 * k] * px + view[3 + 2 * k] * py
            near += max(0.0, 1 + STRICTER - view[k] * sight.per_safety)
            beyond += max(0.0, view[k] * sight.nearness[central, threat] - 1 + STRICTER)
            beyond += max(0.0, (inside - cosine) * per_across)
        if beyond >= A_LITTLE:
            for k in range(2):
                away = view[k] * sight.nearness[peripheral, threat]
                size = abs(view[2 + 2 * k] * ax + view[3 + 2 * k] * ay)
                if away < 1:
                    size = size_in(sight, rig, size)
                outside += max(0.0, away - size + STRICTER)
        narrow = beyond < max(A_LITTLE, outside)
        view[6] = near + (beyond if narrow else outside)
        view[7] = CENTRAL if narrow else PERIPHERAL
        for k in range(2):
            if narrow:
                view[k] = distance_factor(q, central, threat, view[k])
            else:
                view[k] = distance_factor(q, peripheral, threat, view[k])
                if not q.rms:
                    size = size_in(sight, rig, abs(view[2 + 2 * k] * ax + view[3 + 2 * k] * ay))
                    view[k] /= max(size, SMALLEST_RELATIVE_SIZE)


@lean_kernel
def pair_energy(q: Question, threat: int, first: Floats, second: Floats, penalty: float, most: float) -> float:
    """Return what a threat costs with two views, and the price of their violations; or any number above ``most``."""
    price = penalty * (first[6] + second[6])
    if price >= most:
        return math.inf
    both = pair_cost(q, first[0], second[0], 1.0) + pair_cost(q, first[1], second[1], 1.0)
    if threat_cost(q, threat, both) + price >= most:  # as it is at right angles, it costs more at others
        return math.inf
    both = 0.0
    for k in range(2):
        sine = abs(first[2 + 2 * k] * second[3 + 2 * k] - first[3 + 2 * k] * second[2 + 2 * k])
        if sine < SMALLEST_SINE:
            sine = SMALLEST_SINE
            price += penalty * 1e-3
        both += pair_cost(q, first[k], second[k], sine)
    return float(threat_cost(q, threat, both) + price)


@lean_kernel
def best_pair(
    q: Question, threat: int, views: Floats, without: int, penalty: float, most: float
) -> tuple[float, int, int]:
    """Return the least energy of a threat with any two hosts but one, below ``most``, and these two; -1: none."""
    best, one, other = most, -1, -1
    for i in range(views.shape[0]):
        if i == without or penalty * views[i, threat, 6] >= best:
            continue
        for j in range(i):
            if j == without:
                continue
            energy = pair_energy(q, threat, views[i, threat], views[j, threat], penalty, best)
            if energy < best:
                best, one, other = energy, i, j
    return best, one, other


@lean_kernel
def apart(q: Question, one: int, other: int) -> float:
    """Return how far two threats are from each other, squared."""
    x = q.points_m[one, 0, 0] - q.points_m[other, 0, 0]
    y = q.points_m[one, 0, 1] - q.points_m[other, 0, 1]
    return float(x * x + y * y)


@lean_kernel
def propose(
    q: Question, s: State, aims: Ints, pairs: Ints, host: int, reach_m: float, known: Floats, chance: Chance
) -> None:
    """Change one host's pose: a step of random scale up to ``reach_m``, a turn, another aim, or a jump to a known pose,
    to a threat, or to where two can be seen from afar."""
    threats = q.weight.shape[0]
    kind = uniform(chance)
    if kind < 0.66:
        scale = reach_m * math.exp(-7 * uniform(chance))
        s.positions[host, 0] += scale * bell(chance)
        s.positions[host, 1] += scale * bell(chance)
    if kind < 0.30 or 0.66 <= kind < 0.76:
        angle = 0.05 * reach_m * math.exp(-7 * uniform(chance)) * bell(chance)
        c, d = math.cos(angle), math.sin(angle)
        east, north = s.axes[host, 0], s.axes[host, 1]
        s.axes[host, 0], s.axes[host, 1] = east * c + north * d, north * c - east * d
    elif 0.76 <= kind < 0.84:
        aims[host, 0] = aims[host, 1] = below(chance, threats)
        if uniform(chance) < 0.4:
            aims[host, 1] = below(chance, threats)
    elif 0.84 <= kind < 0.88:
        turn_towards(q, s, host, below(chance, threats), uniform(chance))
    elif kind >= 0.88 and known.shape[0] > 0 and uniform(chance) < AGAIN:
        n = below(chance, known.shape[0])
        s.positions[host, 0], s.positions[host, 1] = known[n, 0], known[n, 1]
        s.axes[host, 0], s.axes[host, 1] = known[n, 2], known[n, 3]
        aims[host, 0], aims[host, 1] = int(known[n, 4]), int(known[n, 5])
    elif kind >= 0.88 and uniform(chance) < LONG:
        one, other, another = below(chance, threats), below(chance, threats), below(chance, threats)
        if apart(q, one, another) < apart(q, one, other):
            other = another
        x = y = 0.0
        for k in range(2):
            x += 0.25 * (q.points_m[one, k, 0] + q.points_m[other, k, 0])
            y += 0.25 * (q.points_m[one, k, 1] + q.points_m[other, k, 1])
        distance = q.range_m[2 * s.rigs[host] + CENTRAL, one] * (NEAREST + (1 - NEAREST) * uniform(chance))
        angle = 2 * math.pi * uniform(chance)
        s.positions[host, 0], s.positions[host, 1] = x + distance * math.sin(angle), y + distance * math.cos(angle)
        turn_towards(q, s, host, below(chance, threats), uniform(chance))
        aims[host, 0], aims[host, 1] = one, other
    elif kind >= 0.88:
        threat, k = below(chance, threats), below(chance, 2)
        distance = q.safety_m * (1 + 0.6 * uniform(chance) ** 3)
        angle = 2 * math.pi * uniform(chance)
        partner = pairs[threat, below(chance, 2)]
        if partner != host and uniform(chance) < 0.6:
            x = s.positions[partner, 0] - q.points_m[threat, k, 0]
            y = s.positions[partner, 1] - q.points_m[threat, k, 1]
            angle = math.atan2(x, y) + (0.5 if uniform(chance) < 0.5 else -0.5) * math.pi + 0.3 * bell(chance)
        s.positions[host, 0] = q.points_m[threat, k, 0] + distance * math.sin(angle)
        s.positions[host, 1] = q.points_m[threat, k, 1] + distance * math.cos(angle)
        turn_towards(q, s, host, threat if uniform(chance) < 0.5 else below(chance, threats), uniform(chance))
        aims[host, 0] = aims[host, 1] = threat
    radius = q.safety_m * (1 + STRICTER)
    for _ in range(2):
        moved = False
        for threat in range(threats):
            if pairs[threat, 0] == host or pairs[threat, 1] == host:
                for k in range(2):
                    x = s.positions[host, 0] - q.points_m[threat, k, 0]
                    y = s.positions[host, 1] - q.points_m[threat, k, 1]
                    moved |= push_out(s, host, x, y, 0.0, radius)
        if not moved:
            break


@kernel
def anneal_poses(
    q: Question,
    sight: Sight,
    s: State,
    hosts: Ints,
    moves: int,
    hot: float,
    cold: float,
    reach_m: float,
    soft: float,
    stiff: float,
    known: Floats,
    chance: Chance,
) -> None:
    """Anneal the poses of some hosts in ``s``, from where they stand, and leave the pairs and cameras that fit all.

    Temperatures and reach are those of ``anneal``; ``soft`` and ``stiff`` are the first and the last price of a
    violation of 1, relative to the cost of an average threat. known: see ``KnownPoses``; there may be none.
    """
    threats, count = s.pairs.shape[0], s.degree.shape[0]
    aims = np.zeros((count, 2), np.int64)
    views = np.empty((count, threats, VIEW))
    seen = np.empty((threats, VIEW))
    energy, new_energy = np.empty(threats), np.empty(threats)
    pairs, new_pairs = np.empty((threats, 2), np.int64), np.empty((threats, 2), np.int64)
    fill_aims(s, aims)
    for host in range(count):
        look(q, sight, s, aims, host, views[host])
    chunk = 50 + 10 * hosts.size
    chunks = max(2, moves // chunk)
    penalty = soft
    for n in range(chunks):
        mean = 0.0
        for threat in range(threats):
            if n == 0:
                energy[threat], pairs[threat, 0], pairs[threat, 1] = best_pair(q, threat, views, -1, 1e3, math.inf)
            i, j = pairs[threat, 0], pairs[threat, 1]
            mean += pair_energy(q, threat, views[i, threat], views[j, threat], 0.0, math.inf) / threats
        progress = n / chunks
        temperature = mean * hot * (cold / hot) ** progress
        penalty = mean * soft * (stiff / soft) ** progress
        reach = max(0.3, reach_m * (1 - progress) ** 2)
        for threat in range(threats):
            energy[threat], pairs[threat, 0], pairs[threat, 1] = best_pair(q, threat, views, -1, penalty, math.inf)
        for _ in range(chunk):
            host = hosts[below(chance, hosts.size)]
            x, y = s.positions[host, 0], s.positions[host, 1]
            east, north = s.axes[host, 0], s.axes[host, 1]
            first, second = aims[host, 0], aims[host, 1]
            propose(q, s, aims, pairs, host, reach, known, chance)
            look(q, sight, s, aims, host, seen)
            more = 0.0
            for threat in range(threats):
                i, j = pairs[threat, 0], pairs[threat, 1]
                least, one, other = energy[threat], i, j
                if i == host or j == host:
                    partner = j if i == host else i
                    least = pair_energy(q, threat, seen[threat], views[partner, threat], penalty, math.inf)
                    if least > energy[threat]:
                        rest, a, b = best_pair(q, threat, views, host, penalty, least)
                        if a >= 0:
                            least, one, other = rest, a, b
                if penalty * seen[threat, 6] < least:
                    for partner in range(count):
                        if partner != host:
                            tried = pair_energy(q, threat, seen[threat], views[partner, threat], penalty, least)
                            if tried < least:
                                least, one, other = tried, host, partner
                new_energy[threat], new_pairs[threat, 0], new_pairs[threat, 1] = least, one, other
                more += least - energy[threat]
            if accepted(more, temperature, chance):
                views[host] = seen
                energy[:] = new_energy
                pairs[:] = new_pairs
            else:
                s.positions[host, 0], s.positions[host, 1] = x, y
                s.axes[host, 0], s.axes[host, 1] = east, north
                aims[host, 0], aims[host, 1] = first, second
    assign(s, views, pairs)
    refresh(q, s)


@kernel
def assign(s: State, views: Floats, pairs: Ints) -> None:
    """Give every threat the pair found for it; a host that nobody needs stands where one is shared, and relieves it."""
    threats, count = s.pairs.shape[0], s.degree.shape[0]
    for threat in range(threats):
        s.pairs[threat, 0] = s.pairs[threat, 1] = -1
    for host in range(count):
        s.degree[host] = 0
    for threat in range(threats):
        for end in range(2):
            host = pairs[threat, end]
            set_view(s, threat, end, host, int(views[host, threat, 7]))
    for host in range(count):
        if s.degree[host] > 0:
            continue
        for view in range(2 * threats):
            parent = s.pairs[view // 2, view % 2]
            if s.degree[parent] > 1:
                s.positions[host] = s.positions[parent]
                s.axes[host] = s.axes[parent]
                set_view(s, view // 2, view % 2, host, s.cameras[view // 2, view % 2])
                break
