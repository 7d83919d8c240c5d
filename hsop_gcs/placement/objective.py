"""What given poses are worth: cost (Eq. 8), constraint margins (Eqs. 9-11) and expected error. The exact reference.

Nothing here is in a hurry; the solvers' kernels are held against it. Geometry of cost and margins is plane, as in the
letter: the third coordinate counts only for the expected error.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, View

FloatArray = npt.NDArray[np.float64]
Views = Mapping[str, tuple[View, View]]
"""Threat id to the two views that triangulate it: a pair set with its cameras."""

PIXEL_NOISE_PX = {CameraKind.PERIPHERAL: 30.0, CameraKind.CENTRAL: 3.0}
"""Standard deviation of a threat's place in the image, each axis (letter, section V)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """The smallest slack of each kind of constraint; negative where one is broken, infinite where none applies."""

    pixels: float = math.inf
    fov_deg: float = math.inf
    distance_m: float = math.inf
    separation_m: float = math.inf

    @property
    def feasible(self) -> bool:
        return min(self.pixels, self.fov_deg, self.distance_m, self.separation_m) >= 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What a set of poses and views is worth."""

    cost: float
    pair_costs: dict[str, float]
    """Each threat's share of the cost, weight included."""
    expected_errors_m: dict[str, float]
    margins: Margins


def threat_points_m(problem: Problem) -> FloatArray:
    """Return where every threat is now and after the horizon (Eq. 7): (threats, 2 points, 3), ENU metres."""
    return np.array([[t.position_m, t.predicted_m(problem.horizon_s)] for t in problem.threats], dtype=np.float64)


def weight(problem: Problem, threat: Threat) -> float:
    """Return what the threat's share of the cost is multiplied by; the letter weighs all threats equally."""
    return 1.0 if problem.formulation is Formulation.LETTER else threat.weight


def wrapped(angle_rad: float) -> float:
    """Return the same direction in [-π, π)."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi


def compass_bearing(origin_m: npt.ArrayLike, point_m: npt.ArrayLike) -> float:
    """Return the direction from one point to another, radians clockwise from north."""
    east, north = np.asarray(point_m)[:2] - np.asarray(origin_m)[:2]
    return math.atan2(east, north)


def plane_distance(origin_m: npt.ArrayLike, point_m: npt.ArrayLike) -> float:
    return math.dist(np.asarray(origin_m)[:2], np.asarray(point_m)[:2])


def segment_distance(point_m: npt.ArrayLike, start_m: npt.ArrayLike, end_m: npt.ArrayLike) -> float:
    """Return the distance of a point from a straight path, in the plane, metres."""
    point, start, end = (np.asarray(p, dtype=np.float64)[:2] for p in (point_m, start_m, end_m))
    along = end - start
    length_squared = float(along @ along)
    fraction = 0.0 if length_squared == 0 else min(1.0, max(0.0, float((point - start) @ along) / length_squared))
    return math.dist(point, start + fraction * along)


def angle_from_nearer_boresight(pose: HoverPose, point_m: npt.ArrayLike) -> float:
    """Return θ of Eq. 1 for the fisheye that faces the point, radians in [0, π/2]."""
    off = abs(wrapped(compass_bearing(pose.position_m, point_m) - math.radians(pose.heading_deg)))
    return min(off, math.pi - off)


def pixel_width(rig: CameraRig, size_m: float, pose: HoverPose, camera: CameraKind, point_m: npt.ArrayLike) -> float:
    """Return the width of an object at a point in the image of one of the host's cameras, pixels (Eqs. 3 and 4)."""
    distance = plane_distance(pose.position_m, point_m)
    if camera is CameraKind.CENTRAL:
        return float(rig.central.pixel_width(size_m, distance))
    return float(rig.peripheral.pixel_width(size_m, distance, angle_from_nearer_boresight(pose, point_m)))


def pair_cost(
    rig: CameraRig, size_m: float, points_m: FloatArray, views: Sequence[tuple[HoverPose, CameraKind]]
) -> float:
    """Return one host-threat pair's share of Eq. 8 before weighting, over the points given.

    points_m: (points, 2 or 3), ENU. Infinite where both hosts look along one line or a camera does not see a point.
    """
    total = 0.0
    for point in points_m:
        factor, bearings = 1.0, []
        for pose, camera in views:
            pixels = pixel_width(rig, size_m, pose, camera, point)
            factor *= plane_distance(pose.position_m, point) / pixels if pixels > 0 else math.inf
            bearings.append(compass_bearing(pose.position_m, point))
        sine = abs(math.sin(bearings[1] - bearings[0]))
        total += factor / sine if sine > 0 else math.inf
    return total


def expected_error_m(rig: CameraRig, points_m: FloatArray, views: Sequence[tuple[HoverPose, CameraKind]]) -> float:
    """Predict the root-mean-square error of a triangulated position, metres, to first order in the pixel noise.

    points_m: (points, 3), ENU. At each point the two rays, of unit directions uᵢ and lengths dᵢ, carry the information
    J = Σ (I - uᵢuᵢᵀ) / (σᵢdᵢ)² with the angular noise σᵢ = pixel noise / focal length in pixels (a fisheye's pixels
    are equal angles; a pinhole's are so near its axis). The mean squared error there is trace J⁻¹, which for level rays
    is ((σ₁d₁)² + (σ₂d₂)²) / sin²θ across and 1 / ((σ₁d₁)⁻² + (σ₂d₂)⁻²) upwards; the points count equally.
    Infinite if the rays are parallel.
    """
    noise_rad = {
        CameraKind.PERIPHERAL: PIXEL_NOISE_PX[CameraKind.PERIPHERAL] / rig.peripheral.focal_length_px,
        CameraKind.CENTRAL: PIXEL_NOISE_PX[CameraKind.CENTRAL] / rig.central.focal_length_px,
    }
    squares = []
    for point in points_m:
        information = np.zeros((3, 3))
        for pose, camera in views:
            ray = point - np.array(pose.position_m)
            length = float(np.linalg.norm(ray))
            across = np.eye(3) - np.outer(ray, ray) / length**2
            information += across / (noise_rad[camera] * length) ** 2
        smallest = float(np.linalg.eigvalsh(information)[0])
        parallel = smallest <= 1e-14 * float(np.trace(information))
        squares.append(math.inf if parallel else float(np.trace(np.linalg.inv(information))))
    return math.sqrt(sum(squares) / len(squares))


def margins(problem: Problem, hosts: Sequence[HoverPose], views: Views) -> Margins:
    """Return the slack of every constraint of the problem's formulation (Eqs. 9-11; design: paths and separation)."""
    rig, poses = problem.rig, {pose.host: pose for pose in hosts}
    pixels, fov_deg, distance_m, separation_m = [math.inf], [math.inf], [math.inf], [math.inf]
    for threat, points in zip(problem.threats, threat_points_m(problem), strict=True):
        for view in views[threat.id]:
            pose = poses[view.host]
            needed = rig.central.min_pixels if view.camera is CameraKind.CENTRAL else rig.peripheral.min_pixels
            for point in points:
                pixels.append(pixel_width(rig, threat.size_m, pose, view.camera, point) - needed)
                distance_m.append(plane_distance(pose.position_m, point) - problem.safety_distance_m)
                if view.camera is CameraKind.CENTRAL:
                    bearing = compass_bearing(pose.position_m, point)
                    pan = math.nan if pose.pan_deg is None else math.radians(pose.pan_deg)
                    fov_deg.append(rig.central.fov_deg / 2 - abs(math.degrees(wrapped(bearing - pan))))
        if problem.formulation is Formulation.OPERATIONAL:
            distance_m += [segment_distance(p.position_m, *points) - problem.safety_distance_m for p in hosts]
    if problem.formulation is Formulation.OPERATIONAL:
        separation_m += [
            plane_distance(a.position_m, b.position_m) - problem.min_separation_m
            for i, a in enumerate(hosts)
            for b in hosts[:i]
        ]
    return Margins(pixels=min(pixels), fov_deg=min(fov_deg), distance_m=min(distance_m), separation_m=min(separation_m))


def evaluate(problem: Problem, hosts: Sequence[HoverPose], views: Views) -> Evaluation:
    """Return what a placement is worth. ``views`` holds every threat's pair; unknown hosts are a KeyError."""
    poses = {pose.host: pose for pose in hosts}
    costs, errors = {}, {}
    for threat, points in zip(problem.threats, threat_points_m(problem), strict=True):
        seen_by = [(poses[view.host], view.camera) for view in views[threat.id]]
        costs[threat.id] = weight(problem, threat) * pair_cost(problem.rig, threat.size_m, points, seen_by)
        errors[threat.id] = expected_error_m(problem.rig, points, seen_by)
    return Evaluation(
        cost=sum(costs.values()),
        pair_costs=costs,
        expected_errors_m=errors,
        margins=margins(problem, hosts, views),
    )
