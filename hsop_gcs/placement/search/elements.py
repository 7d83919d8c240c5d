"""The elements of a local solve: every threat's cost and every rule's margin, with their gradients, compiled."""

import math

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.areas import STRICTER_M, fence_room, keep_out_room
from hsop_gcs.placement.search.model import (
    CENTRAL,
    Floats,
    Ints,
    Question,
    central_aim,
    central_cone,
    distance_factor,
    path_offset,
    threat_cost,
    wrapped,
)
from hsop_gcs.placement.search.state import State

COST, PIXELS, END_POINT, PATH, PAN, CONE, SEPARATION, FLOOR, CEILING, FENCE, KEEP_OUT, AIM = range(12)
NEAR_M = 40.0
"""Rules that are farther than this from being broken are left out of a local solve."""
NEAR_A_LIMIT_RAD = 0.1
"""A central camera's aim so near to its gimbal's limits stays where it is during a local solve."""


@lean_kernel
def relative_size_slope(cosine: float, k: Floats, rig: int) -> tuple[float, float]:
    """Return θ_d / tan θ and its derivative with respect to the cosine."""
    theta = math.acos(min(1.0, cosine))
    square = theta * theta
    lens = 1 + square * (k[rig, 0] + square * (k[rig, 1] + square * (k[rig, 2] + square * k[rig, 3])))
    if theta < 1e-3:
        return lens * (1 - square / 3), 2.0 / 3.0 - 2 * k[rig, 0]
    stretch = 1 + square * (
        3 * k[rig, 0] + square * (5 * k[rig, 1] + square * (7 * k[rig, 2] + square * 9 * k[rig, 3]))
    )
    sine = math.sqrt(1 - cosine * cosine)
    slope = stretch * cosine / sine - theta * lens / (sine * sine)
    return theta * lens * cosine / sine, -slope / sine


@lean_kernel
def view_terms(
    q: Question,
    threat: int,
    k: int,
    poses: Floats,
    host: int,
    lens: int,
    direction: Floats,
    factor: Floats,
    margin: Floats,
) -> None:
    """Fill the ray (unit vector, distance), the factor and the pixel margin with their gradients by the pose."""
    ex = q.points_m[threat, k, 0] - poses[host, 0]
    ey = q.points_m[threat, k, 1] - poses[host, 1]
    ez = q.points_m[threat, k, 2] - poses[host, 2]
    d = math.sqrt(ex * ex + ey * ey + ez * ez)
    ux, uy, uz = ex / d, ey / d, ez / d
    direction[0], direction[1], direction[2], direction[3] = ux, uy, uz, d
    base = distance_factor(q, lens, threat, d)
    power = 2.0
    if q.rms:
        power = 1.0 if q.position_sigma_m <= 0 else 1 - (q.position_sigma_m / base) ** 2
    reach = q.range_m[lens, threat]
    if lens % 2 == CENTRAL:
        factor[0] = base
        factor[1], factor[2], factor[3], factor[4] = (
            -power * base / d * ux,
            -power * base / d * uy,
            -power * base / d * uz,
            0.0,
        )
        margin[0] = 1 - d / reach
        margin[1], margin[2], margin[3], margin[4] = ux / reach, uy / reach, uz / reach, 0.0
        return
    ax, ay = math.sin(poses[host, 3]), math.cos(poses[host, 3])
    inner = ux * ax + uy * ay
    sign = 1.0 if inner >= 0 else -1.0
    size, slope = relative_size_slope(min(1.0, abs(inner)), q.distortion, lens // 2)
    # d|u·a| / dx = -(a - (u·a) u) / d, and by the heading u·a'
    sx, sy, sz = -sign * (ax - inner * ux) / d, -sign * (ay - inner * uy) / d, sign * inner * uz / d
    sh = sign * (ux * ay - uy * ax)
    f = base if q.rms else base / size
    growth = 0.0 if q.rms else f / size * slope
    factor[0] = f
    factor[1] = -power * f / d * ux - growth * sx
    factor[2] = -power * f / d * uy - growth * sy
    factor[3] = -power * f / d * uz - growth * sz
    factor[4] = -growth * sh
    margin[0] = size - d / reach
    margin[1] = slope * sx + ux / reach
    margin[2] = slope * sy + uy / reach
    margin[3] = slope * sz + uz / reach
    margin[4] = slope * sh


@lean_kernel
def pair_cost_slopes(q: Question, a: float, b: float, sine: float) -> tuple[float, float, float, float]:
    """Return ``pair_cost`` and its derivatives by both factors and the sine."""
    if not q.rms:
        return a * b / sine, b / sine, a / sine, -a * b / (sine * sine)
    aa, bb, ss = a * a, b * b, sine * sine
    total = aa + bb
    by_a = 2 * a / ss + 2 * a * bb * bb / (total * total)
    by_b = 2 * b / ss + 2 * b * aa * aa / (total * total)
    return total / ss + aa * bb / total, by_a, by_b, -2 * total / (ss * sine)


@lean_kernel
def element(q: Question, e: Ints, poses: Floats, g: Floats, work: Floats) -> float:
    """Return one element's value (a cost, or a margin that must stay positive); g is its gradient by one or two poses.

    e: kind, first host, second host or -1, then what the kind needs. g: (8,). work: (6, 5) scratch.
    """
    kind, i, j = e[0], e[1], e[2]
    g[:] = 0.0
    if kind == COST:
        threat = e[3]
        total = 0.0
        for k in range(2):
            view_terms(q, threat, k, poses, i, e[5], work[0], work[1], work[2])
            view_terms(q, threat, k, poses, j, e[6], work[3], work[4], work[5])
            u, v = work[0], work[3]
            m = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
            sine = math.sqrt(max(1 - m * m, 1e-12))
            value, by_a, by_b, by_sine = pair_cost_slopes(q, work[1, 0], work[4, 0], sine)
            by_m = -by_sine * m / sine
            total += value
            for n in range(3):
                g[n] += by_a * work[1, n + 1] - by_m * (v[n] - m * u[n]) / u[3]
                g[4 + n] += by_b * work[4, n + 1] - by_m * (u[n] - m * v[n]) / v[3]
            g[3] += by_a * work[1, 4]
            g[7] += by_b * work[4, 4]
        cost = threat_cost(q, threat, total)
        g *= 0.5 * q.power * cost / total if q.rms else q.weight[threat]
        return cost
    if kind == PIXELS:
        view_terms(q, e[3], e[4], poses, i, e[5], work[0], work[1], work[2])
        for n in range(4):
            g[n] = work[2, n + 1]
        return float(work[2, 0])
    if kind in (END_POINT, PATH, SEPARATION):
        radius = q.safety_m
        if kind == PATH:
            x, y, z = path_offset(q.paths_m, e[3], poses[i, 0], poses[i, 1], poses[i, 2])
        elif kind == END_POINT:
            x = poses[i, 0] - q.points_m[e[3], e[4], 0]
            y = poses[i, 1] - q.points_m[e[3], e[4], 1]
            z = poses[i, 2] - q.points_m[e[3], e[4], 2]
        else:
            radius = q.separation_m
            x, y, z = poses[i, 0] - poses[j, 0], poses[i, 1] - poses[j, 1], poses[i, 2] - poses[j, 2]
        scale = 1 / (radius * radius)
        g[0], g[1], g[2] = x * scale, y * scale, z * scale
        if kind == SEPARATION:
            g[4], g[5], g[6] = -x * scale, -y * scale, -z * scale
        return 0.5 * ((x * x + y * y + z * z) * scale - 1)
    if kind == FLOOR:
        g[2] = 0.1
        return float(0.1 * (poses[i, 2] - q.floor_m))
    if kind == CEILING:
        g[2] = -0.1
        return float(0.1 * (q.ceiling_m - poses[i, 2]))
    if kind == FENCE:
        room, gx, gy = fence_room(q.sides_m, q.areas, poses[i, 0], poses[i, 1])
        g[0], g[1] = 0.1 * gx, 0.1 * gy
        return float(0.1 * (room - STRICTER_M))
    if kind == KEEP_OUT:
        room, gx, gy, gz = keep_out_room(q.sides_m, q.areas, e[3], poses[i, 0], poses[i, 1], poses[i, 2])
        g[0], g[1], g[2] = 0.1 * gx, 0.1 * gy, 0.1 * gz
        return float(0.1 * (room - STRICTER_M))
    if kind == AIM:
        return aim_margin(q, e, poses, g)
    # PAN and CONE: the field of view less the angle between two points, on the compass or in space.
    ex, ey, ez = (
        q.points_m[e[3], e[4], 0] - poses[i, 0],
        q.points_m[e[3], e[4], 1] - poses[i, 1],
        q.points_m[e[3], e[4], 2] - poses[i, 2],
    )
    fx, fy, fz = (
        q.points_m[e[5], e[6], 0] - poses[i, 0],
        q.points_m[e[5], e[6], 1] - poses[i, 1],
        q.points_m[e[5], e[6], 2] - poses[i, 2],
    )
    if kind == PAN:
        er, fr = ex * ex + ey * ey, fx * fx + fy * fy
        angle = wrapped(math.atan2(ex, ey) - math.atan2(fx, fy))
        sign = 1.0 if angle >= 0 else -1.0
        g[0] = sign * (ey / er - fy / fr)
        g[1] = -sign * (ex / er - fx / fr)
        return float(q.fov_rad[e[7]] - abs(angle))
    ed, fd = math.sqrt(ex * ex + ey * ey + ez * ez), math.sqrt(fx * fx + fy * fy + fz * fz)
    ex, ey, ez, fx, fy, fz = ex / ed, ey / ed, ez / ed, fx / fd, fy / fd, fz / fd
    cosine = ex * fx + ey * fy + ez * fz
    cx, cy, cz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    sine = math.sqrt(cx * cx + cy * cy + cz * cz)
    if sine > 1e-9:
        g[0] = -((fx - cosine * ex) / ed + (ex - cosine * fx) / fd) / sine
        g[1] = -((fy - cosine * ey) / ed + (ey - cosine * fy) / fd) / sine
        g[2] = -((fz - cosine * ez) / ed + (ez - cosine * fz) / fd) / sine
    return float(q.fov_rad[e[7]] - math.atan2(sine, cosine))


@lean_kernel
def aim_margin(q: Question, e: Ints, poses: Floats, g: Floats) -> float:
    """Return the field of view less twice the angle of a point off the aim of a camera that keeps it."""
    i = e[1]
    ex = q.points_m[e[3], e[4], 0] - poses[i, 0]
    ey = q.points_m[e[3], e[4], 1] - poses[i, 1]
    ez = q.points_m[e[3], e[4], 2] - poses[i, 2]
    d = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / d, ey / d, ez / d
    fx, fy, fz = poses[i, 4], poses[i, 5], poses[i, 6]
    cosine = ex * fx + ey * fy + ez * fz
    cx, cy, cz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    sine = math.sqrt(cx * cx + cy * cy + cz * cz)
    if sine > 1e-9:
        g[0] = -2 * (fx - cosine * ex) / (d * sine)
        g[1] = -2 * (fy - cosine * ey) / (d * sine)
        g[2] = -2 * (fz - cosine * ez) / (d * sine)
    return float(q.fov_rad[e[7]] - 2 * math.atan2(sine, cosine))


@lean_kernel
def keeps_aim(q: Question, s: State, host: int) -> bool:
    """Return whether the central camera of a host looks in a direction near its gimbal's limits."""
    if not q.limited:
        return False
    seen = s.incident[host]
    _, _, _, angle = central_aim(q, s.positions, s.axes, s.rigs, host, seen, s.degree[host], s.cameras)
    _, _, w, _ = central_cone(q, s.positions, host, seen, s.degree[host], s.cameras)
    low, high = q.gimbal_rad[s.rigs[host], 0] + NEAR_A_LIMIT_RAD, q.gimbal_rad[s.rigs[host], 1] - NEAR_A_LIMIT_RAD
    panned = q.gimbal_rad[s.rigs[host], 2] > -0.5 * math.pi or q.gimbal_rad[s.rigs[host], 3] < 0.5 * math.pi
    return bool(angle > 0 and (panned or not low < math.asin(max(-1.0, min(1.0, w))) < high))


@kernel
def list_elements(q: Question, s: State, moving: Ints) -> Ints:
    """Return the costs and rules that the poses of moving hosts (marked 1) decide, costs first."""
    threats, hosts = s.pairs.shape[0], s.degree.shape[0]
    most = threats * (1 + 12) + 4 * hosts
    for host in range(hosts):
        if moving[host] > 0:
            most += q.paths_m.shape[0] + hosts + q.areas.shape[0] + 4 * s.degree[host] * s.degree[host]
    rows = np.zeros((most, 8), np.int64)
    m = 0
    for threat in range(threats):
        i, j = s.pairs[threat, 0], s.pairs[threat, 1]
        if moving[i] + moving[j] > 0:
            rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3] = COST, i, j, threat
            rows[m, 5], rows[m, 6] = 2 * s.rigs[i] + s.cameras[threat, 0], 2 * s.rigs[j] + s.cameras[threat, 1]
            m += 1
    for host in range(hosts):
        if moving[host] == 0:
            continue
        keeping = keeps_aim(q, s, host)
        for n in range(s.degree[host]):
            threat, end = s.incident[host, n] // 2, s.incident[host, n] % 2
            for k in range(2):
                rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3], rows[m, 4] = PIXELS, host, -1, threat, k
                rows[m, 5] = 2 * s.rigs[host] + s.cameras[threat, end]
                m += 1
                if not q.whole_path:
                    rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3], rows[m, 4] = END_POINT, host, -1, threat, k
                    m += 1
            if s.cameras[threat, end] == CENTRAL and keeping:
                for k in range(2):
                    rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3], rows[m, 4] = AIM, host, -1, threat, k
                    rows[m, 7] = s.rigs[host]
                    m += 1
            elif s.cameras[threat, end] == CENTRAL:
                for n2 in range(n + 1):
                    second = s.incident[host, n2] // 2
                    if s.cameras[second, s.incident[host, n2] % 2] != CENTRAL:
                        continue
                    for k in range(2):
                        for k2 in range(2):
                            if n2 == n and k2 >= k:
                                continue
                            rows[m, 0], rows[m, 1], rows[m, 2] = PAN if q.plane else CONE, host, -1
                            rows[m, 3], rows[m, 4], rows[m, 5], rows[m, 6] = threat, k, second, k2
                            rows[m, 7] = s.rigs[host]
                            m += 1
        x, y, z = s.positions[host, 0], s.positions[host, 1], s.positions[host, 2]
        if q.whole_path:
            for threat in range(q.paths_m.shape[0]):
                a, b, c = path_offset(q.paths_m, threat, x, y, z)
                if math.sqrt(a * a + b * b + c * c) < q.safety_m + NEAR_M:
                    rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3] = PATH, host, -1, threat
                    m += 1
        if q.separation_m > 0:
            for other in range(hosts):
                if other == host or (other < host and moving[other] > 0):
                    continue
                a, b, c = x - s.positions[other, 0], y - s.positions[other, 1], z - s.positions[other, 2]
                if math.sqrt(a * a + b * b + c * c) < q.separation_m + NEAR_M:
                    rows[m, 0], rows[m, 1], rows[m, 2] = SEPARATION, host, other
                    m += 1
        if q.ceiling_m > q.floor_m:
            rows[m, 0], rows[m, 1], rows[m, 2] = FLOOR, host, -1
            rows[m + 1, 0], rows[m + 1, 1], rows[m + 1, 2] = CEILING, host, -1
            m += 2
        if q.areas.shape[0] > 0:
            if fence_room(q.sides_m, q.areas, x, y)[0] < NEAR_M:
                rows[m, 0], rows[m, 1], rows[m, 2] = FENCE, host, -1
                m += 1
            for n in range(q.areas.shape[0]):
                if q.areas[n, 2] == 0 and keep_out_room(q.sides_m, q.areas, n, x, y, z)[0] < NEAR_M:
                    rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3] = KEEP_OUT, host, -1, n
                    m += 1
    return rows[:m].copy()


@kernel
def poses_of(q: Question, s: State) -> Floats:
    """Return the hosts' positions, headings and, for cameras that keep it, their aim's direction: (hosts, 7)."""
    poses = np.zeros((s.degree.shape[0], 7))
    for host in range(s.degree.shape[0]):
        poses[host, :3] = s.positions[host]
        poses[host, 3] = math.atan2(s.axes[host, 0], s.axes[host, 1])
        if q.limited:
            poses[host, 4], poses[host, 5], poses[host, 6], _ = central_aim(
                q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras
            )
    return poses
