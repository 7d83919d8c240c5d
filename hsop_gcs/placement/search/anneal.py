"""Seeded annealing over host poses, pairs and cameras at once, in compiled code.

The state names for every threat its two hosts and cameras, so that a move re-evaluates only the threats it touches.
Broken rules cost a penalty that stiffens as the temperature falls; the best state without any violation is kept.
Temperatures are relative to the cost of an average threat.
"""

import math
from typing import NamedTuple

import numpy as np

from hsop_gcs.placement.search.areas import back_inside
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import bell, below, uniform
from hsop_gcs.placement.search.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.model import (
    Floats,
    Ints,
    Question,
    crowding,
    edge_energy,
    host_violation,
    path_offset,
)


class State(NamedTuple):
    """A placement, valid or not, and the energies of its parts; the arrays are changed in place."""

    positions: Floats
    """(hosts, 3)"""
    axes: Floats
    """(hosts, 2): east and north of the fisheye axis."""
    rigs: Ints
    """(hosts,): what each carries."""
    pairs: Ints
    """(threats, 2): the two hosts of every threat."""
    cameras: Ints
    """(threats, 2): their cameras."""
    incident: Ints
    """(hosts, threats): each host's views as 2 * threat + end; the first ``degree`` count."""
    degree: Ints
    cost: Floats
    violation: Floats
    """(threats,)"""
    window: Floats
    """(hosts,): violations of single hosts."""


def new_state(threats: int, hosts: int) -> State:
    """Return an empty state: nothing is seen yet."""
    axes = np.zeros((hosts, 2))
    axes[:, 1] = 1
    return State(
        np.zeros((hosts, 3)),
        axes,
        np.zeros(hosts, np.int64),
        np.full((threats, 2), -1, np.int64),
        np.zeros((threats, 2), np.int64),
        np.zeros((hosts, threats), np.int64),
        np.zeros(hosts, np.int64),
        np.zeros(threats),
        np.zeros(threats),
        np.zeros(hosts),
    )


@kernel
def copy_state(source: State, target: State) -> None:
    """Copy all arrays."""
    target.positions[:] = source.positions
    target.axes[:] = source.axes
    target.rigs[:] = source.rigs
    target.pairs[:] = source.pairs
    target.cameras[:] = source.cameras
    target.incident[:] = source.incident
    target.degree[:] = source.degree
    target.cost[:] = source.cost
    target.violation[:] = source.violation
    target.window[:] = source.window


@lean_kernel
def set_view(s: State, threat: int, end: int, host: int, camera: int) -> None:
    """Give one end of a threat's pair to a host (-1: to nobody)."""
    view = 2 * threat + end
    old = s.pairs[threat, end]
    if old >= 0:
        last = s.degree[old] - 1
        for n in range(last):
            if s.incident[old, n] == view:
                s.incident[old, n] = s.incident[old, last]
                break
        s.degree[old] = last
    s.pairs[threat, end] = host
    s.cameras[threat, end] = camera
    if host >= 0:
        s.incident[host, s.degree[host]] = view
        s.degree[host] += 1


@lean_kernel
def refresh_threat(q: Question, s: State, threat: int) -> None:
    """Recompute the energy of a threat."""
    s.cost[threat], s.violation[threat] = edge_energy(
        q,
        s.positions,
        s.axes,
        s.rigs,
        threat,
        s.pairs[threat, 0],
        s.pairs[threat, 1],
        s.cameras[threat, 0],
        s.cameras[threat, 1],
    )


@lean_kernel
def refresh_host(q: Question, s: State, host: int) -> None:
    """Recompute everything a host's pose and views decide, crowding excepted."""
    for n in range(s.degree[host]):
        refresh_threat(q, s, s.incident[host, n] // 2)
    s.window[host] = host_violation(q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras)


@lean_kernel
def refresh(q: Question, s: State) -> None:
    """Recompute everything."""
    for threat in range(s.pairs.shape[0]):
        refresh_threat(q, s, threat)
    for host in range(s.degree.shape[0]):
        s.window[host] = host_violation(
            q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras
        )


@lean_kernel
def totals(q: Question, s: State) -> tuple[float, float]:
    """Return the cost and the violation of the whole state."""
    cost = violation = 0.0
    for threat in range(s.cost.shape[0]):
        cost += s.cost[threat]
        violation += s.violation[threat]
    for host in range(s.window.shape[0]):
        violation += s.window[host]
        if q.separation_m > 0:
            violation += 0.5 * crowding(q, s.positions, host)
    return cost, violation


@lean_kernel
def keep_clear(q: Question, s: State, host: int) -> None:
    """Push a host out of the safety zones that count for it, and to where it may hover."""
    radius = q.safety_m * (1 + 1e-7)
    for _ in range(3):
        moved = False
        if q.whole_path:
            for threat in range(q.points_m.shape[0]):
                x, y, z = path_offset(
                    q.paths_m, threat, s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
                )
                d = math.sqrt(x * x + y * y + z * z)
                if d < radius * (1 - 1e-9) and d > 1e-6:
                    push = radius / d - 1
                    s.positions[host, 0] += push * x
                    s.positions[host, 1] += push * y
                    s.positions[host, 2] += push * z
                    moved = True
        else:
            for n in range(s.degree[host]):
                threat = s.incident[host, n] // 2
                for k in range(2):
                    x = s.positions[host, 0] - q.points_m[threat, k, 0]
                    y = s.positions[host, 1] - q.points_m[threat, k, 1]
                    z = s.positions[host, 2] - q.points_m[threat, k, 2]
                    d = math.sqrt(x * x + y * y + z * z)
                    if d < radius * (1 - 1e-9) and d > 1e-6:
                        push = radius / d - 1
                        s.positions[host, 0] += push * x
                        s.positions[host, 1] += push * y
                        s.positions[host, 2] += push * z
                        moved = True
        if q.areas.shape[0] > 0:
            x, y, z = s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
            x, y, z = back_inside(q.sides_m, q.areas, x, y, z)
            moved |= x != s.positions[host, 0] or y != s.positions[host, 1] or z != s.positions[host, 2]
            s.positions[host, 0], s.positions[host, 1], s.positions[host, 2] = x, y, z
        s.positions[host, 2] = max(q.floor_m, min(q.ceiling_m, s.positions[host, 2]))
        if not moved:
            break


@lean_kernel
def turn_towards(q: Question, s: State, host: int, threat: int, share: float) -> None:
    """Point the fisheye axis at a point of a threat's path."""
    x = q.points_m[threat, 0, 0] * (1 - share) + q.points_m[threat, 1, 0] * share - s.positions[host, 0]
    y = q.points_m[threat, 0, 1] * (1 - share) + q.points_m[threat, 1, 1] * share - s.positions[host, 1]
    d = math.sqrt(x * x + y * y)
    if d > 1e-9:
        s.axes[host, 0] = x / d
        s.axes[host, 1] = y / d


@lean_kernel
def turn_by(s: State, host: int, angle: float) -> None:
    """Turn the fisheye axis clockwise."""
    c, d = math.cos(angle), math.sin(angle)
    east, north = s.axes[host, 0], s.axes[host, 1]
    x, y = east * c + north * d, north * c - east * d
    n = 1 / math.sqrt(x * x + y * y)
    s.axes[host, 0] = x * n
    s.axes[host, 1] = y * n


@lean_kernel
def jump(q: Question, s: State, host: int, threat: int, end: int, chance: Chance) -> None:
    """Put a host near one end of a threat's path, often at a right angle to its partner, and turn it there."""
    k = below(chance, 2)
    distance = q.safety_m * (1 + 0.6 * uniform(chance) ** 3)
    angle = 2 * math.pi * uniform(chance)
    partner = s.pairs[threat, 1 - end]
    if partner >= 0 and partner != host and uniform(chance) < 0.6:
        x = s.positions[partner, 0] - q.points_m[threat, k, 0]
        y = s.positions[partner, 1] - q.points_m[threat, k, 1]
        angle = math.atan2(x, y) + (0.5 * math.pi if uniform(chance) < 0.5 else -0.5 * math.pi) + 0.3 * bell(chance)
    s.positions[host, 0] = q.points_m[threat, k, 0] + distance * math.sin(angle)
    s.positions[host, 1] = q.points_m[threat, k, 1] + distance * math.cos(angle)
    s.positions[host, 2] = q.points_m[threat, k, 2]
    turn_towards(q, s, host, threat, uniform(chance))


@lean_kernel
def mirror(q: Question, s: State, host: int, threat: int, end: int) -> None:
    """Put a host on the other side of a threat's path (of the partner's line of sight, when the threat is at rest)."""
    ax, ay = q.points_m[threat, 0, 0], q.points_m[threat, 0, 1]
    ux, uy = q.points_m[threat, 1, 0] - ax, q.points_m[threat, 1, 1] - ay
    n = math.sqrt(ux * ux + uy * uy)
    if n < 1e-6:
        partner = s.pairs[threat, 1 - end]
        ux, uy = s.positions[partner, 0] - ax, s.positions[partner, 1] - ay
        n = math.sqrt(ux * ux + uy * uy) + 1e-9
    ux /= n
    uy /= n
    x, y = s.positions[host, 0] - ax, s.positions[host, 1] - ay
    along, across = x * ux + y * uy, x * uy - y * ux
    s.positions[host, 0] = ax + along * ux - across * uy
    s.positions[host, 1] = ay + along * uy + across * ux
    turn = s.axes[host, 0] * ux + s.axes[host, 1] * uy
    s.axes[host, 0], s.axes[host, 1] = 2 * turn * ux - s.axes[host, 0], 2 * turn * uy - s.axes[host, 1]


@lean_kernel
def propose_pose(q: Question, s: State, host: int, reach_m: float, chance: Chance) -> None:
    """Change one host's pose: a step of random scale up to ``reach_m``, a turn, a jump or a mirror image."""
    kind = uniform(chance)
    view = s.incident[host, below(chance, s.degree[host])]
    if kind < 0.72:
        scale = math.exp(-7 * uniform(chance))
        sigma = reach_m * scale
        s.positions[host, 0] += sigma * bell(chance)
        s.positions[host, 1] += sigma * bell(chance)
        if q.ceiling_m > q.floor_m:
            s.positions[host, 2] += 0.5 * sigma * bell(chance)
        if uniform(chance) < 0.4:
            turn_by(s, host, 0.05 * sigma * bell(chance))
    elif kind < 0.88:
        if uniform(chance) < 0.3:
            turn_towards(q, s, host, view // 2, uniform(chance))
        else:
            turn_by(s, host, 0.05 * reach_m * math.exp(-7 * uniform(chance)) * bell(chance))
        return
    elif kind < 0.95:
        jump(q, s, host, view // 2, view % 2, chance)
    else:
        mirror(q, s, host, view // 2, view % 2)
    keep_clear(q, s, host)


@lean_kernel
def accepted(more: float, temperature: float, chance: Chance) -> bool:
    """Decide whether to take a change of energy (Metropolis)."""
    if more <= 0:
        return True
    return temperature > 0 and uniform(chance) < math.exp(-more / temperature)


@lean_kernel
def try_pose(
    q: Question, s: State, host: int, reach_m: float, penalty: float, temperature: float, chance: Chance, trial: Floats
) -> tuple[float, float]:
    """Propose a pose and take it or not (Metropolis). Returns the change of cost and of violation."""
    px, py, pz = s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
    ax, ay = s.axes[host, 0], s.axes[host, 1]
    crowd = crowding(q, s.positions, host)
    propose_pose(q, s, host, reach_m, chance)
    window = host_violation(q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras)
    more_cost = 0.0
    more_violation = window - s.window[host] + crowding(q, s.positions, host) - crowd
    for n in range(s.degree[host]):
        threat = s.incident[host, n] // 2
        trial[n, 0], trial[n, 1] = edge_energy(
            q,
            s.positions,
            s.axes,
            s.rigs,
            threat,
            s.pairs[threat, 0],
            s.pairs[threat, 1],
            s.cameras[threat, 0],
            s.cameras[threat, 1],
        )
        more_cost += trial[n, 0] - s.cost[threat]
        more_violation += trial[n, 1] - s.violation[threat]
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        s.window[host] = window
        for n in range(s.degree[host]):
            threat = s.incident[host, n] // 2
            s.cost[threat] = trial[n, 0]
            s.violation[threat] = trial[n, 1]
        return more_cost, more_violation
    s.positions[host, 0], s.positions[host, 1], s.positions[host, 2] = px, py, pz
    s.axes[host, 0], s.axes[host, 1] = ax, ay
    return 0.0, 0.0


@lean_kernel
def try_regroup(
    q: Question,
    s: State,
    hosts: Ints,
    threats: Ints,
    reach_m: float,
    penalty: float,
    temperature: float,
    chance: Chance,
    trial: Floats,
) -> tuple[float, float]:
    """Give a view to another host, let the hosts concerned settle, and take the result or not (Metropolis).

    A host that would be left without a view takes one over elsewhere; when two hosts exchange, both keep their number.
    """
    threat = threats[below(chance, threats.size)]
    end = below(chance, 2)
    old = s.pairs[threat, end]
    new = hosts[below(chance, hosts.size)]
    if new == old or new == s.pairs[threat, 1 - end]:
        return 0.0, 0.0
    other_threat, other_end, freed = -1, 0, -1
    if s.degree[old] == 1 or uniform(chance) < 0.25:
        if uniform(chance) < 0.5:
            view = s.incident[new, below(chance, s.degree[new])]
            other_threat, other_end, freed = view // 2, view % 2, new
        else:
            other_threat, other_end = threats[below(chance, threats.size)], below(chance, 2)
            freed = s.pairs[other_threat, other_end]
            if freed != new and s.degree[freed] == 1:
                return 0.0, 0.0
        if other_threat == threat or freed == old or s.pairs[other_threat, 1 - other_end] == old:
            return 0.0, 0.0
    cost, violation = totals(q, s)
    saved_camera = s.cameras[threat, end]
    saved_other = 0 if other_threat < 0 else s.cameras[other_threat, other_end]
    set_view(s, threat, end, new, below(chance, 2))
    if other_threat >= 0:
        set_view(s, other_threat, other_end, old, below(chance, 2))
    kept = (
        s.positions[old, 0], s.positions[old, 1], s.positions[old, 2], s.axes[old, 0], s.axes[old, 1],
        s.positions[new, 0], s.positions[new, 1], s.positions[new, 2], s.axes[new, 0], s.axes[new, 1],
    )  # fmt: skip
    if other_threat >= 0 and uniform(chance) < 0.7:
        jump(q, s, old, other_threat, other_end, chance)
    keep_clear(q, s, old)
    keep_clear(q, s, new)
    refresh_host(q, s, old)
    refresh_host(q, s, new)
    if freed >= 0:
        refresh_host(q, s, freed)
    for n in range(12):
        try_pose(q, s, new if n % 2 == 0 else old, reach_m, penalty, 0.0, chance, trial)
    new_cost, new_violation = totals(q, s)
    more_cost, more_violation = new_cost - cost, new_violation - violation
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    if other_threat >= 0:
        set_view(s, other_threat, other_end, freed, saved_other)
    set_view(s, threat, end, old, saved_camera)
    s.positions[old, 0], s.positions[old, 1], s.positions[old, 2], s.axes[old, 0], s.axes[old, 1] = kept[:5]
    s.positions[new, 0], s.positions[new, 1], s.positions[new, 2], s.axes[new, 0], s.axes[new, 1] = kept[5:]
    refresh_host(q, s, old)
    refresh_host(q, s, new)
    if freed >= 0:
        refresh_host(q, s, freed)
    return 0.0, 0.0


@lean_kernel
def try_camera(
    q: Question, s: State, threat: int, end: int, penalty: float, temperature: float, chance: Chance
) -> tuple[float, float]:
    """Exchange the camera of one view, or not (Metropolis)."""
    host = s.pairs[threat, end]
    cost, violation, window = s.cost[threat], s.violation[threat], s.window[host]
    s.cameras[threat, end] = 1 - s.cameras[threat, end]
    refresh_threat(q, s, threat)
    s.window[host] = host_violation(q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras)
    more_cost = s.cost[threat] - cost
    more_violation = s.violation[threat] - violation + s.window[host] - window
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    s.cameras[threat, end] = 1 - s.cameras[threat, end]
    s.cost[threat], s.violation[threat], s.window[host] = cost, violation, window
    return 0.0, 0.0


@lean_kernel
def left_over(q: Question, s: State, rig: int) -> int:
    """Return how many hosts with a rig are not placed."""
    count = q.hosts_of_rig[rig]
    for host in range(s.rigs.shape[0]):
        if s.rigs[host] == rig:
            count -= 1
    return int(count)


@lean_kernel
def try_rig(
    q: Question,
    s: State,
    hosts: Ints,
    reach_m: float,
    penalty: float,
    temperature: float,
    chance: Chance,
    trial: Floats,
) -> tuple[float, float]:
    """Exchange two hosts' rigs, or one for a rig left over, let them settle, and take it or not (Metropolis)."""
    host, other = hosts[below(chance, hosts.size)], hosts[below(chance, hosts.size)]
    old, new = s.rigs[host], s.rigs[other]
    if uniform(chance) < 0.5:
        new = below(chance, q.hosts_of_rig.shape[0])
        if left_over(q, s, new) == 0:
            return 0.0, 0.0
        other = host
    if new == old:
        return 0.0, 0.0
    cost, violation = totals(q, s)
    kept = (
        s.positions[host, 0], s.positions[host, 1], s.positions[host, 2], s.axes[host, 0], s.axes[host, 1],
        s.positions[other, 0], s.positions[other, 1], s.positions[other, 2], s.axes[other, 0], s.axes[other, 1],
    )  # fmt: skip
    s.rigs[other] = old
    s.rigs[host] = new
    refresh_host(q, s, host)
    refresh_host(q, s, other)
    for n in range(12):
        try_pose(q, s, host if n % 2 == 0 else other, reach_m, penalty, 0.0, chance, trial)
    new_cost, new_violation = totals(q, s)
    more_cost, more_violation = new_cost - cost, new_violation - violation
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    s.rigs[other] = new
    s.rigs[host] = old
    s.positions[other, 0], s.positions[other, 1], s.positions[other, 2], s.axes[other, 0], s.axes[other, 1] = kept[5:]
    s.positions[host, 0], s.positions[host, 1], s.positions[host, 2], s.axes[host, 0], s.axes[host, 1] = kept[:5]
    refresh_host(q, s, host)
    refresh_host(q, s, other)
    return 0.0, 0.0


@lean_kernel
def draw_rigs(q: Question, s: State, chance: Chance) -> None:
    """Give every host a rig at random, no more of each than there are."""
    if q.hosts_of_rig.shape[0] == 1:
        return
    s.rigs[:] = -1
    for host in range(s.rigs.shape[0]):
        rest = 0
        for rig in range(q.hosts_of_rig.shape[0]):
            rest += left_over(q, s, rig)
        drawn = below(chance, rest)
        for rig in range(q.hosts_of_rig.shape[0]):
            drawn -= left_over(q, s, rig)
            if drawn < 0:
                s.rigs[host] = rig
                break


@lean_kernel
def scatter(q: Question, s: State, chance: Chance) -> None:
    """Fill a state anew at random: hosts near threats, every threat seen by two, every host used."""
    threats, hosts = s.pairs.shape[0], s.degree.shape[0]
    draw_rigs(q, s, chance)
    for threat in range(threats):
        s.pairs[threat, 0] = s.pairs[threat, 1] = -1
    for host in range(hosts):
        s.degree[host] = 0
    for host in range(hosts):
        threat = (host + below(chance, threats)) % threats if host >= threats else host
        jump(q, s, host, threat, 0, chance)
    for threat in range(threats):
        for end in range(2):
            best, choice = math.inf, 0
            for host in range(hosts):
                if end == 1 and s.pairs[threat, 0] == host:
                    continue
                x = s.positions[host, 0] - q.points_m[threat, 0, 0]
                y = s.positions[host, 1] - q.points_m[threat, 0, 1]
                rank = math.sqrt(x * x + y * y) * (0.5 + uniform(chance))
                if s.degree[host] == 0:
                    rank *= 0.5
                if rank < best:
                    best, choice = rank, host
            set_view(s, threat, end, choice, below(chance, 2))
    for host in range(hosts):
        while s.degree[host] == 0:
            threat, end = below(chance, threats), below(chance, 2)
            if s.degree[s.pairs[threat, end]] > 1:
                set_view(s, threat, end, host, below(chance, 2))
                jump(q, s, host, threat, end, chance)
    for host in range(hosts):
        keep_clear(q, s, host)
    refresh(q, s)


@kernel
def anneal(
    q: Question,
    s: State,
    best: State,
    hosts: Ints,
    threats: Ints,
    moves: int,
    hot: float,
    cold: float,
    reach_m: float,
    stiffness: float,
    chance: Chance,
) -> tuple[float, float]:
    """Anneal the given hosts and threats in ``s``; the rest stands still.

    Leaves the best state of the colder half in ``best``: it may be worse than what it began with, and lie elsewhere.

    ``threats`` must be seen by ``hosts`` only. ``hot`` and ``cold`` are the first and last temperature relative to
    the cost of an average threat, ``reach_m`` the longest steps at first, ``stiffness`` the first price of a
    violation of 1, relative to the same. Returns cost and violation of ``best``.
    """
    trial = np.empty((s.pairs.shape[0], 2))
    best_cost = best_violation = math.inf
    recording = False
    chunk = 50 + 10 * hosts.size
    chunks = max(2, moves // chunk)
    for n in range(chunks):
        cost, violation = totals(q, s)
        if not recording and 2 * n >= chunks:
            recording = True
            copy_state(s, best)
            best_cost, best_violation = cost, violation
        progress = n / chunks
        mean = 0.0
        for i in range(threats.size):
            mean += s.cost[threats[i]] / threats.size
        temperature = mean * hot * (cold / hot) ** progress
        penalty = mean * stiffness * 20**progress
        reach = max(0.3, reach_m * (1 - progress) ** 2)
        for _ in range(chunk):
            kind = uniform(chance)
            if kind < 0.86:
                host = hosts[below(chance, hosts.size)]
                more, broken = try_pose(q, s, host, reach, penalty, temperature, chance, trial)
            elif kind < 0.96:
                threat = threats[below(chance, threats.size)]
                more, broken = try_camera(q, s, threat, below(chance, 2), penalty, temperature, chance)
            elif q.hosts_of_rig.shape[0] > 1 and uniform(chance) < 0.4:
                more, broken = try_rig(q, s, hosts, reach, penalty, temperature, chance, trial)
            else:
                more, broken = try_regroup(q, s, hosts, threats, reach, penalty, temperature, chance, trial)
            cost += more
            violation += broken
            if not recording:
                continue
            if violation < 1e-7 and (cost < best_cost * (1 - 1e-5) or best_violation > 0):
                exact_cost, exact_violation = totals(q, s)
                if exact_violation <= 0:
                    copy_state(s, best)
                    best_cost, best_violation = exact_cost, 0.0
            elif best_violation > 0 and violation < best_violation * (1 - 1e-3):
                copy_state(s, best)
                best_cost, best_violation = cost, violation
    return best_cost, best_violation
