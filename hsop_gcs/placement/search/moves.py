"""What an anneal tries: new poses, other hosts, cameras and rigs for a view, each taken or not by Metropolis's rule."""

import math

from hsop_gcs.geometry.compiled import lean_kernel
from hsop_gcs.placement.search.areas import back_inside
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import bell, below, uniform
from hsop_gcs.placement.search.model import Floats, Ints, Question, crowding, path_offset
from hsop_gcs.placement.search.state import (
    State,
    left_over,
    pose_of,
    refresh,
    refresh_host,
    refresh_threat,
    set_pose,
    set_view,
    threat_energy,
    totals,
    window_violation,
)


@lean_kernel
def push_out(s: State, host: int, x: float, y: float, z: float, radius: float) -> bool:
    """Push a host that is at (x, y, z) from the middle of a zone out of it; return whether it was inside."""
    d = math.sqrt(x * x + y * y + z * z)
    if d < radius * (1 - 1e-9) and d > 1e-6:
        push = radius / d - 1
        s.positions[host, 0] += push * x
        s.positions[host, 1] += push * y
        s.positions[host, 2] += push * z
        return True
    return False


@lean_kernel
def keep_clear(q: Question, s: State, host: int) -> None:
    """Push a host out of the safety zones that count for it, and to where it may hover."""
    radius = q.safety_m * (1 + 1e-7)
    for _ in range(3):
        moved = False
        if q.whole_path:
            for threat in range(q.paths_m.shape[0]):
                x, y, z = path_offset(
                    q.paths_m, threat, s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
                )
                moved |= push_out(s, host, x, y, z, radius)
        else:
            for n in range(s.degree[host]):
                threat = s.incident[host, n] // 2
                for k in range(2):
                    x = s.positions[host, 0] - q.points_m[threat, k, 0]
                    y = s.positions[host, 1] - q.points_m[threat, k, 1]
                    z = s.positions[host, 2] - q.points_m[threat, k, 2]
                    moved |= push_out(s, host, x, y, z, radius)
        if q.areas.shape[0] > 0:
            x, y, z = s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
            x, y, z = back_inside(q.sides_m, q.areas, x, y, z)
            moved |= x != s.positions[host, 0] or y != s.positions[host, 1] or z != s.positions[host, 2]
            s.positions[host, 0], s.positions[host, 1], s.positions[host, 2] = x, y, z
        s.positions[host, 2] = max(q.floor_m, min(q.ceiling_m, s.positions[host, 2]))
        if not moved:
            break


@lean_kernel
def mend(q: Question, s: State) -> None:
    """Push every host to where it may hover, and recompute everything."""
    for host in range(s.degree.shape[0]):
        keep_clear(q, s, host)
    refresh(q, s)


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
    kept = pose_of(s, host)
    crowd = crowding(q, s.positions, host)
    propose_pose(q, s, host, reach_m, chance)
    window = window_violation(q, s, host)
    more_cost = 0.0
    more_violation = window - s.window[host] + crowding(q, s.positions, host) - crowd
    for n in range(s.degree[host]):
        threat = s.incident[host, n] // 2
        trial[n, 0], trial[n, 1] = threat_energy(q, s, threat)
        more_cost += trial[n, 0] - s.cost[threat]
        more_violation += trial[n, 1] - s.violation[threat]
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        s.window[host] = window
        for n in range(s.degree[host]):
            threat = s.incident[host, n] // 2
            s.cost[threat] = trial[n, 0]
            s.violation[threat] = trial[n, 1]
        return more_cost, more_violation
    set_pose(s, host, kept)
    return 0.0, 0.0


@lean_kernel
def settle(
    q: Question, s: State, first: int, second: int, reach_m: float, penalty: float, chance: Chance, trial: Floats
) -> tuple[float, float]:
    """Take only what is better of a few poses for two hosts in turn. Returns what the whole state has come to."""
    for n in range(12):
        try_pose(q, s, first if n % 2 == 0 else second, reach_m, penalty, 0.0, chance, trial)
    return totals(q, s)


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
    old_pose, new_pose = pose_of(s, old), pose_of(s, new)
    if other_threat >= 0 and uniform(chance) < 0.7:
        jump(q, s, old, other_threat, other_end, chance)
    keep_clear(q, s, old)
    keep_clear(q, s, new)
    refresh_host(q, s, old)
    refresh_host(q, s, new)
    if freed >= 0:
        refresh_host(q, s, freed)
    settled_cost, settled_violation = settle(q, s, new, old, reach_m, penalty, chance, trial)
    more_cost, more_violation = settled_cost - cost, settled_violation - violation
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    if other_threat >= 0:
        set_view(s, other_threat, other_end, freed, saved_other)
    set_view(s, threat, end, old, saved_camera)
    set_pose(s, old, old_pose)
    set_pose(s, new, new_pose)
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
    s.window[host] = window_violation(q, s, host)
    more_cost = s.cost[threat] - cost
    more_violation = s.violation[threat] - violation + s.window[host] - window
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    s.cameras[threat, end] = 1 - s.cameras[threat, end]
    s.cost[threat], s.violation[threat], s.window[host] = cost, violation, window
    return 0.0, 0.0


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
    pose, other_pose = pose_of(s, host), pose_of(s, other)
    s.rigs[other] = old
    s.rigs[host] = new
    refresh_host(q, s, host)
    refresh_host(q, s, other)
    settled_cost, settled_violation = settle(q, s, host, other, reach_m, penalty, chance, trial)
    more_cost, more_violation = settled_cost - cost, settled_violation - violation
    if accepted(more_cost + penalty * more_violation, temperature, chance):
        return more_cost, more_violation
    s.rigs[other] = new
    s.rigs[host] = old
    set_pose(s, other, other_pose)
    set_pose(s, host, pose)
    refresh_host(q, s, host)
    refresh_host(q, s, other)
    return 0.0, 0.0
