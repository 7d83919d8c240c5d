"""What a placement costs and by how much it breaks the rules, compiled (letter, Eqs. 3, 4, 8-11).

A host is its position (east, north, up), the compass heading of its fisheye axis and its rig. A *lens* is a camera of a
rig: 2 * rig + camera. A view's *factor* is the share of a pair's cost that one lens contributes at one point: distance
over pixel width (letter), or the standard deviation of its ray at the threat in metres (rms). Headings and bearings are
compass angles, radians. A *violation* is relative: 0.01 is one hundredth too far, too near, or one hundredth of a
radian outside.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import lean_kernel
from hsop_gcs.placement.search.areas import trespass

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

PERIPHERAL = 0
CENTRAL = 1
SMALLEST_SINE = 0.02
SMALLEST_RELATIVE_SIZE = 0.03
CONE_STEPS = 12


class Question(NamedTuple):
    """A placement problem as plain arrays, in the frame of the search."""

    points_m: Floats
    """(threats, 2, 3): where every threat is when the window opens and after the horizon."""
    paths_m: Floats
    """(ways, 2, 3): the ends of the ways that hosts keep clear of, every threat's from now to the window's end."""
    weight: Floats
    range_m: Floats
    """(lenses, threats): how far each lens detects each threat on its boresight."""
    factor: Floats
    """(lenses, threats): a view's factor per metre^power of distance, on the boresight."""
    distortion: Floats
    """(rigs, 4): k1..k4 of the fisheyes (Eq. 1)."""
    fov_rad: Floats
    """(rigs,)"""
    fov_cosine: Floats
    height_rad: Floats
    """(rigs,): the angle between the upper and the lower edge of the central camera's image."""
    gimbal_rad: Floats
    """(rigs, 4): least and largest tilt, least and largest pan from the host's heading."""
    limited: bool
    """Gimbals cannot look everywhere."""
    hosts_of_rig: Ints
    """(rigs,): how many hosts there are of each."""
    safety_m: float
    separation_m: float
    """0: hosts may stand anywhere relative to each other."""
    whole_path: bool
    """The safety distance holds for every host to every threat's path, not only to the points it sees."""
    rms: bool
    power: float
    """Of a threat's expected error in its cost, rms only; a high one makes the largest errors count."""
    position_sigma_m: float
    """Of a host's own position, each axis; rms only."""
    plane: bool
    """All threats and hosts are at one altitude."""
    floor_m: float
    ceiling_m: float
    """Hosts hover in between; equal to the floor: altitudes are not searched."""
    sides_m: Floats
    """Of the fence and the keep-out areas; see ``areas``."""
    areas: Floats


@lean_kernel
def relative_size(cosine: float, k: Floats, rig: int) -> float:
    """Return θ_d / tan θ for the angle θ = arccos(cosine) from the nearer boresight, cosine >= 0 (Eq. 2)."""
    theta = math.acos(min(1.0, cosine))
    square = theta * theta
    lens = 1 + square * (k[rig, 0] + square * (k[rig, 1] + square * (k[rig, 2] + square * k[rig, 3])))
    if theta < 1e-4:
        return float(lens * (1 - square / 3))
    return float(theta * lens * cosine / math.sqrt(1 - cosine * cosine))


@lean_kernel
def pair_cost(q: Question, first: float, second: float, sine: float) -> float:
    """Return the cost of one point seen with two factors at an intersection angle of the given sine (Eq. 8).

    rms: the mean squared error of the fix, trace of the covariance: across the rays' plane and normal to it.
    """
    if q.rms:
        a, b = first * first, second * second
        return (a + b) / (sine * sine) + a * b / (a + b)
    return first * second / sine


@lean_kernel
def distance_factor(q: Question, lens: int, threat: int, d: float) -> float:
    """Return a view's factor on the boresight at a distance; rms: the deviation of its ray at the threat, metres."""
    if not q.rms:
        return float(q.factor[lens, threat] * (d * d))
    across = q.factor[lens, threat] * d
    if q.position_sigma_m > 0:
        return math.sqrt(across * across + q.position_sigma_m * q.position_sigma_m)
    return float(across)


@lean_kernel
def threat_cost(q: Question, threat: int, both_points: float) -> float:
    """Return a threat's cost from the sum over its points; rms: weight times the power of the root of their mean."""
    if q.rms and q.power != 1:
        return float(q.weight[threat] * (0.5 * both_points) ** (0.5 * q.power))
    if q.rms:
        return float(q.weight[threat] * math.sqrt(0.5 * both_points))
    return float(q.weight[threat] * both_points)


@lean_kernel
def edge_energy(
    q: Question, positions: Floats, axes: Floats, rigs: Ints, threat: int, i: int, j: int, camera_i: int, camera_j: int
) -> tuple[float, float]:
    """Return cost and violation of a threat seen by hosts i and j; always finite, exact without violation."""
    lens_i, lens_j = 2 * rigs[i] + camera_i, 2 * rigs[j] + camera_j
    cost = 0.0
    violation = 0.0
    for k in range(2):
        px, py, pz = q.points_m[threat, k, 0], q.points_m[threat, k, 1], q.points_m[threat, k, 2]
        ex, ey, ez = px - positions[i, 0], py - positions[i, 1], pz - positions[i, 2]
        gx, gy, gz = px - positions[j, 0], py - positions[j, 1], pz - positions[j, 2]
        di = math.sqrt(ex * ex + ey * ey + ez * ez) + 1e-12
        dj = math.sqrt(gx * gx + gy * gy + gz * gz) + 1e-12
        cosine = (ex * gx + ey * gy + ez * gz) / (di * dj)
        sine = math.sqrt(max(1 - cosine * cosine, SMALLEST_SINE * SMALLEST_SINE))
        if cosine * cosine > 1 - SMALLEST_SINE * SMALLEST_SINE:
            violation += 1e-3
        fi = distance_factor(q, lens_i, threat, di)
        fj = distance_factor(q, lens_j, threat, dj)
        if camera_i == PERIPHERAL:
            size = relative_size(abs(ex * axes[i, 0] + ey * axes[i, 1]) / di, q.distortion, rigs[i])
            violation += max(0.0, di / q.range_m[lens_i, threat] - size)
            if not q.rms:
                fi /= max(size, SMALLEST_RELATIVE_SIZE)
        else:
            violation += max(0.0, di / q.range_m[lens_i, threat] - 1)
        if camera_j == PERIPHERAL:
            size = relative_size(abs(gx * axes[j, 0] + gy * axes[j, 1]) / dj, q.distortion, rigs[j])
            violation += max(0.0, dj / q.range_m[lens_j, threat] - size)
            if not q.rms:
                fj /= max(size, SMALLEST_RELATIVE_SIZE)
        else:
            violation += max(0.0, dj / q.range_m[lens_j, threat] - 1)
        if not q.whole_path:
            violation += max(0.0, 1 - di / q.safety_m) + max(0.0, 1 - dj / q.safety_m)
        cost += pair_cost(q, fi, fj, sine)
    return threat_cost(q, threat, cost), violation


@lean_kernel
def path_offset(ends_m: Floats, threat: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the vector from the nearest point of a threat's way, given all ways' ends, to (x, y, z)."""
    ax, ay, az = ends_m[threat, 0, 0], ends_m[threat, 0, 1], ends_m[threat, 0, 2]
    bx, by, bz = ends_m[threat, 1, 0] - ax, ends_m[threat, 1, 1] - ay, ends_m[threat, 1, 2] - az
    length = bx * bx + by * by + bz * bz
    s = 0.0
    if length > 0:
        s = max(0.0, min(1.0, ((x - ax) * bx + (y - ay) * by + (z - az) * bz) / length))
    return x - ax - s * bx, y - ay - s * by, z - az - s * bz


@lean_kernel
def wrapped(angle: float) -> float:
    """Return the angle in (-π, π]."""
    if angle > math.pi:
        return angle - 2 * math.pi
    if angle <= -math.pi:
        return angle + 2 * math.pi
    return angle


@lean_kernel
def view_window(
    q: Question, positions: Floats, host: int, incident: Ints, degree: int, cameras: Ints
) -> tuple[float, float, int]:
    """Return the lowest and highest bearing of what a host sees centrally, and how many threats that is.

    ``incident`` lists the host's views as 2 * threat + end. Bearings are unwrapped around the first.
    """
    reference = 0.0
    low = high = 0.0
    count = 0
    for n in range(degree):
        view = incident[n]
        if cameras[view // 2, view % 2] != CENTRAL:
            continue
        for k in range(2):
            ex = q.points_m[view // 2, k, 0] - positions[host, 0]
            ey = q.points_m[view // 2, k, 1] - positions[host, 1]
            bearing = math.atan2(ex, ey)
            if count == 0 and k == 0:
                reference = bearing
            off = wrapped(bearing - reference)
            low = min(low, off)
            high = max(high, off)
        count += 1
    return reference + low, reference + high, count


@lean_kernel
def direction(q: Question, positions: Floats, host: int, threat: int, k: int) -> tuple[float, float, float]:
    """Return the unit vector from a host to a point of a threat."""
    x = q.points_m[threat, k, 0] - positions[host, 0]
    y = q.points_m[threat, k, 1] - positions[host, 1]
    z = q.points_m[threat, k, 2] - positions[host, 2]
    d = math.sqrt(x * x + y * y + z * z) + 1e-12
    return x / d, y / d, z / d


@lean_kernel
def farthest_off(
    q: Question, positions: Floats, host: int, incident: Ints, degree: int, cameras: Ints, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return, of what a host sees centrally, the direction farthest from (x, y, z), and the cosine between them."""
    least, fx, fy, fz = 2.0, x, y, z
    for n in range(degree):
        view = incident[n]
        if cameras[view // 2, view % 2] == CENTRAL:
            for k in range(2):
                ux, uy, uz = direction(q, positions, host, view // 2, k)
                cosine = ux * x + uy * y + uz * z
                if cosine < least:
                    least, fx, fy, fz = cosine, ux, uy, uz
    return least, fx, fy, fz


@lean_kernel
def central_cone(
    q: Question, positions: Floats, host: int, incident: Ints, degree: int, cameras: Ints
) -> tuple[float, float, float, float]:
    """Return the axis of a cone around all that a host sees centrally, and the angle across it; 0 for nothing.

    The cone is the narrowest for a single threat, and for several the narrowest but for little: the axis goes from
    the middle between two far directions towards whatever is farthest, in ever smaller steps.
    """
    least, ax, ay, az = farthest_off(q, positions, host, incident, degree, cameras, 0.0, 0.0, 0.0)
    if least > 1.5:
        return 0.0, 1.0, 0.0, 0.0
    _, ax, ay, az = farthest_off(q, positions, host, incident, degree, cameras, ax, ay, az)
    _, bx, by, bz = farthest_off(q, positions, host, incident, degree, cameras, ax, ay, az)
    x, y, z = ax + bx, ay + by, az + bz
    best, kx, ky, kz = -2.0, 0.0, 1.0, 0.0
    for n in range(CONE_STEPS):
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < 1e-6:
            break
        x, y, z = x / norm, y / norm, z / norm
        least, fx, fy, fz = farthest_off(q, positions, host, incident, degree, cameras, x, y, z)
        if least > best:
            best, kx, ky, kz = least, x, y, z
        # No cone is narrower than the two directions it was begun with.
        if least >= ax * x + ay * y + az * z - 1e-12 and n == 0:
            break
        share = 0.5 / (n + 2)
        x, y, z = x + share * (fx - x), y + share * (fy - y), z + share * (fz - z)
    return kx, ky, kz, 2 * math.acos(max(-1.0, min(1.0, best)))


@lean_kernel
def nearest_aim(
    q: Question, rig: int, heading: float, turned: bool, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the direction nearest to (x, y, z), pan by pan and tilt by tilt, that a gimbal can look in.

    turned: fisheyes are used, so that one end of their axis is the nose; otherwise the nose follows the pan.
    """
    tilt = max(q.gimbal_rad[rig, 0], min(q.gimbal_rad[rig, 1], math.atan2(z, math.sqrt(x * x + y * y))))
    pan, turn = math.atan2(x, y), math.inf
    for end in range(2 if turned else 0):
        off = wrapped(pan - heading + end * math.pi)
        needed = max(q.gimbal_rad[rig, 2], min(q.gimbal_rad[rig, 3], off)) - off
        if abs(needed) < abs(turn):
            turn = needed
    if turned:
        pan += turn
    return math.cos(tilt) * math.sin(pan), math.cos(tilt) * math.cos(pan), math.sin(tilt)


@lean_kernel
def central_aim(
    q: Question, positions: Floats, axes: Floats, rigs: Ints, host: int, incident: Ints, degree: int, cameras: Ints
) -> tuple[float, float, float, float]:
    """Return where a host's central camera looks, and the field of view that all it is to see needs; 0 for nothing.

    The image is wider than high: up and down count by as much more.
    """
    x, y, z, angle = central_cone(q, positions, host, incident, degree, cameras)
    if q.limited:
        turned = False
        for n in range(degree):
            turned |= cameras[incident[n] // 2, incident[n] % 2] != CENTRAL
        heading = math.atan2(axes[host, 0], axes[host, 1])
        x, y, z = nearest_aim(q, rigs[host], heading, turned, x, y, z)
        least, _, _, _ = farthest_off(q, positions, host, incident, degree, cameras, x, y, z)
        angle = 2 * math.acos(max(-1.0, min(1.0, least)))
    level = math.sqrt(x * x + y * y)
    if level > 1e-9:
        ux, uy, uz = -z * x / level, -z * y / level, level
        for n in range(degree):
            view = incident[n]
            if cameras[view // 2, view % 2] == CENTRAL:
                for k in range(2):
                    dx, dy, dz = direction(q, positions, host, view // 2, k)
                    up = abs(math.atan2(ux * dx + uy * dy + uz * dz, x * dx + y * dy + z * dz))
                    angle = max(angle, 2 * up * q.fov_rad[rigs[host]] / q.height_rad[rigs[host]])
    return x, y, z, angle


@lean_kernel
def place_violation(q: Question, positions: Floats, host: int) -> float:
    """Return how far a host stands inside the safety zones around whole paths, and where it may not hover."""
    violation = 0.0
    if q.whole_path:
        for threat in range(q.paths_m.shape[0]):
            x, y, z = path_offset(q.paths_m, threat, positions[host, 0], positions[host, 1], positions[host, 2])
            violation += max(0.0, 1 - math.sqrt(x * x + y * y + z * z) / q.safety_m)
    return violation + trespass(q.sides_m, q.areas, positions[host, 0], positions[host, 1], positions[host, 2])


@lean_kernel
def host_violation(
    q: Question, positions: Floats, axes: Floats, rigs: Ints, host: int, incident: Ints, degree: int, cameras: Ints
) -> float:
    """Return by how much what a host sees centrally exceeds the field of view, and its place is not allowed."""
    violation = 0.0
    if not q.plane:
        _, _, _, angle = central_aim(q, positions, axes, rigs, host, incident, degree, cameras)
        return float(max(0.0, angle - q.fov_rad[rigs[host]]) + place_violation(q, positions, host))
    alone = -1
    for n in range(degree):
        view = incident[n]
        if cameras[view // 2, view % 2] == CENTRAL:
            alone = view // 2 if alone == -1 else -2
    if alone >= 0:
        ex, ey = q.points_m[alone, 0, 0] - positions[host, 0], q.points_m[alone, 0, 1] - positions[host, 1]
        gx, gy = q.points_m[alone, 1, 0] - positions[host, 0], q.points_m[alone, 1, 1] - positions[host, 1]
        inner = ex * gx + ey * gy
        if inner < q.fov_cosine[rigs[host]] * math.sqrt((ex * ex + ey * ey) * (gx * gx + gy * gy)):
            violation += abs(math.atan2(ex * gy - ey * gx, inner)) - q.fov_rad[rigs[host]]
    elif alone == -2:
        low, high, _ = view_window(q, positions, host, incident, degree, cameras)
        violation += max(0.0, high - low - q.fov_rad[rigs[host]])
    return float(violation + place_violation(q, positions, host))


@lean_kernel
def crowding(q: Question, positions: Floats, host: int) -> float:
    """Return how far a host intrudes into the separation from all others."""
    violation = 0.0
    if q.separation_m > 0:
        for other in range(positions.shape[0]):
            if other != host:
                x = positions[host, 0] - positions[other, 0]
                y = positions[host, 1] - positions[other, 1]
                z = positions[host, 2] - positions[other, 2]
                violation += max(0.0, 1 - math.sqrt(x * x + y * y + z * z) / q.separation_m)
    return violation
