"""What given poses are worth: cost (Eq. 8), constraint margins (Eqs. 9-11) and expected error. The exact reference.

Nothing here is in a hurry; the solvers' kernels are held against it. The operational formulation is that of the letter
with distances and angles in space; the letter's own is plane, and the third coordinate counts only for its expected
error.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.rig import PIXEL_NOISE_PX, CameraKind, CameraRig
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.geometry.rays import camera_axes
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, View

FloatArray = npt.NDArray[np.float64]
Views = Mapping[str, tuple[View, View]]
"""Threat id to the two views that triangulate it: a pair set with its cameras."""


class Eye(NamedTuple):
    """One camera of a host that hovers."""

    pose: HoverPose
    rig: CameraRig
    camera: CameraKind

    @property
    def min_pixels(self) -> float:
        """The smallest width at which its detector finds an object, pixels."""
        return self.rig.central.min_pixels if self.camera is CameraKind.CENTRAL else self.rig.peripheral.min_pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """The smallest slack of each kind of constraint; negative where one is broken, infinite where none applies."""

    pixels: float = math.inf
    fov_deg: float = math.inf
    image_deg: float = math.inf
    """To the upper and lower edges of the central cameras' images."""
    distance_m: float = math.inf
    separation_m: float = math.inf
    fence_m: float = math.inf
    keep_out_m: float = math.inf
    altitude_m: float = math.inf
    gimbal_deg: float = math.inf
    """To the limits of the central cameras' gimbals."""

    @property
    def smallest(self) -> float:
        """The smallest of all, whatever its unit: negative if a constraint is broken."""
        return min(
            self.pixels,
            self.fov_deg,
            self.image_deg,
            self.distance_m,
            self.separation_m,
            self.fence_m,
            self.keep_out_m,
            self.altitude_m,
            self.gimbal_deg,
        )

    @property
    def feasible(self) -> bool:
        """Whether every constraint holds."""
        return self.smallest >= 0


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


def threat_ways_m(problem: Problem) -> FloatArray:
    """Return the ends of the ways that hosts keep clear of, (ways, 2, 3), ENU metres; they begin ``lead_s`` ago.

    Those of the threats come first, then those of the bystanders.
    """
    return np.array(
        [
            [threat.predicted_m(-problem.lead_s), threat.predicted_m(problem.horizon_s)]
            for threat in (*problem.threats, *problem.bystanders)
        ],
        dtype=np.float64,
    )


def hover_altitudes_m(problem: Problem) -> tuple[float, float]:
    """Return the lowest and the highest altitude at which the problem lets hosts hover, metres."""
    up = threat_points_m(problem)[:, :, 2]
    if problem.formulation is Formulation.LETTER:
        return float(up.mean()), float(up.mean())
    floor, ceiling = problem.airspace.floor_m, problem.airspace.ceiling_m
    low, high = float(up.min()), float(up.max())
    if floor is not None:
        low, high = floor, max(high, floor)
    if ceiling is not None:
        low, high = min(low, ceiling), ceiling
    return low, high


def weight(problem: Problem, threat: Threat) -> float:
    """Return what the threat's share of the cost is multiplied by; the letter weighs all threats equally."""
    return 1.0 if problem.formulation is Formulation.LETTER else threat.weight


def wrapped(angle_rad: float) -> float:
    """Return the same direction in [-π, π)."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi


def segment_distance(point_m: npt.ArrayLike, start_m: npt.ArrayLike, end_m: npt.ArrayLike) -> float:
    """Return the distance of a point from a straight path, in the plane or in space, metres."""
    point, start, end = (np.asarray(p, dtype=np.float64) for p in (point_m, start_m, end_m))
    along = end - start
    length_squared = float(along @ along)
    fraction = 0.0 if length_squared == 0 else min(1.0, max(0.0, float((point - start) @ along) / length_squared))
    return math.dist(point, start + fraction * along)


def path_distances_m(points_m: FloatArray, ways_m: FloatArray) -> FloatArray:
    """Return the distances of points, (n, 3), from straight ways, (m, 2, 3): (n, m) metres."""
    starts, along = ways_m[:, 0], ways_m[:, 1] - ways_m[:, 0]
    squares = np.einsum("mx,mx->m", along, along)
    offsets = points_m[:, None] - starts
    shares = np.einsum("nmx,mx->nm", offsets, along) / np.where(squares > 0, squares, 1.0)
    return np.asarray(np.linalg.norm(offsets - np.clip(shares, 0.0, 1.0)[..., None] * along, axis=2))


def angle_between(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Return the angle between two directions (3,), radians in [0, π]."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def ray(pose: HoverPose, point_m: npt.ArrayLike) -> FloatArray:
    """Return the vector from a host to a point (2 or 3,); a point without an altitude is at the host's."""
    point = np.asarray(point_m, dtype=np.float64)
    if len(point) == 2:
        point = np.append(point, pose.position_m[2])
    return np.asarray(point - np.array(pose.position_m))


def angle_from_nearer_boresight(pose: HoverPose, point_m: npt.ArrayLike) -> float:
    """Return θ of Eq. 1 for the fisheye that faces the point, radians in [0, π/2]. Boresights are level."""
    heading = math.radians(pose.heading_deg)
    off = angle_between((math.sin(heading), math.cos(heading), 0.0), ray(pose, point_m))
    return min(off, math.pi - off)


def angle_from_central_axis(pose: HoverPose, point_m: npt.ArrayLike) -> float:
    """Return how far a point is off the axis of the central camera, radians; not a number while it is not in use."""
    if pose.pan_deg is None:
        return math.nan
    pan, tilt = math.radians(pose.pan_deg), math.radians(pose.tilt_deg)
    axis = (math.cos(tilt) * math.sin(pan), math.cos(tilt) * math.cos(pan), math.sin(tilt))
    return angle_between(axis, ray(pose, point_m))


def room_in_field_deg(eye: Eye, point_m: npt.ArrayLike) -> float:
    """Return how far inside the central camera's field of view a point lies, degrees; not a number while it rests."""
    return eye.rig.central.fov_deg / 2 - math.degrees(angle_from_central_axis(eye.pose, point_m))


def room_in_height_deg(eye: Eye, point_m: npt.ArrayLike) -> float:
    """Return how far below the upper and above the lower edge of the central camera's image a point lies, degrees."""
    pan_rad, tilt_rad = math.radians(eye.pose.pan_deg or 0.0), math.radians(eye.pose.tilt_deg)
    _, down, ahead = camera_axes(pan_rad, tilt_rad) @ ray(eye.pose, point_m)
    return math.degrees(eye.rig.central.half_height_rad - abs(math.atan2(down, ahead)))


def pixel_width(eye: Eye, size_m: float, point_m: npt.ArrayLike) -> float:
    """Return the width of an object at a point in the image of one of a host's cameras, pixels (Eqs. 3 and 4)."""
    distance = float(np.linalg.norm(ray(eye.pose, point_m)))
    if eye.camera is CameraKind.CENTRAL:
        return float(eye.rig.central.pixel_width(size_m, distance))
    return float(eye.rig.peripheral.pixel_width(size_m, distance, angle_from_nearer_boresight(eye.pose, point_m)))


def pair_cost(size_m: float, points_m: FloatArray, eyes: Sequence[Eye]) -> float:
    """Return one host-threat pair's share of Eq. 8 before weighting, over the points given.

    points_m: (points, 2 or 3), ENU. Infinite where both hosts look along one line or a camera does not see a point.
    """
    total = 0.0
    for point in points_m:
        factor, rays = 1.0, []
        for eye in eyes:
            pixels = pixel_width(eye, size_m, point)
            rays.append(ray(eye.pose, point))
            factor *= float(np.linalg.norm(rays[-1])) / pixels if pixels > 0 else math.inf
        sine = math.sin(angle_between(*rays))
        total += factor / sine if sine > 0 else math.inf
    return total


def noise_rad(rig: CameraRig, attitude_sigma_rad: float = 0.0) -> dict[CameraKind, float]:
    """Return the standard deviation of a ray's direction, each axis across it: pixel noise and the camera's attitude.

    A fisheye's pixels are equal angles; a pinhole's are so near its axis.
    """
    focal_px = {
        CameraKind.PERIPHERAL: rig.peripheral.focal_length_px,
        CameraKind.CENTRAL: rig.central.focal_length_px,
    }
    return {
        kind: math.hypot(PIXEL_NOISE_PX[kind] / focal, attitude_sigma_rad)
        if attitude_sigma_rad
        else PIXEL_NOISE_PX[kind] / focal
        for kind, focal in focal_px.items()
    }


def expected_error_m(
    points_m: FloatArray,
    eyes: Sequence[Eye],
    *,
    position_sigma_m: float = 0.0,
    attitude_sigma_rad: float = 0.0,
) -> float:
    """Predict the root-mean-square error of a triangulated position, metres, to first order in the noise.

    points_m: (points, 3), ENU. eyes: two or more. At each point the rays, of unit directions uᵢ and lengths dᵢ, carry
    the information J = Σ (I - uᵢuᵢᵀ) / sᵢ², sᵢ² = (σᵢdᵢ)² + (host's position noise)², with the angular noise σᵢ of
    ``noise_rad``. The mean squared error there is trace J⁻¹, which for two level rays is (s₁² + s₂²) / sin²θ across
    and 1 / (s₁⁻² + s₂⁻²) upwards; the points count equally. Infinite if the rays are parallel.
    """
    angular = [noise_rad(eye.rig, attitude_sigma_rad)[eye.camera] for eye in eyes]
    squares = []
    for point in points_m:
        information = np.zeros((3, 3))
        for eye, sigma in zip(eyes, angular, strict=True):
            sight = ray(eye.pose, point)
            length = float(np.linalg.norm(sight))
            across = np.eye(3) - np.outer(sight, sight) / length**2
            information += across / ((sigma * length) ** 2 + position_sigma_m**2)
        smallest = float(np.linalg.eigvalsh(information)[0])
        parallel = smallest <= 1e-14 * float(np.trace(information))
        squares.append(math.inf if parallel else float(np.trace(np.linalg.inv(information))))
    return math.sqrt(sum(squares) / len(squares))


def _as_formulated(problem: Problem, hosts: Sequence[HoverPose]) -> tuple[list[HoverPose], FloatArray, FloatArray]:
    """Return hosts, threats' points and ways as the formulation sees them: the letter's lie in one plane."""
    points, ways = threat_points_m(problem), threat_ways_m(problem)
    if problem.formulation is Formulation.OPERATIONAL:
        return list(hosts), points, ways
    points[:, :, 2] = ways[:, :, 2] = 0.0
    return [replace(h, position_m=(*h.position_m[:2], 0.0), tilt_deg=0.0) for h in hosts], points, ways


def margins(problem: Problem, hosts: Sequence[HoverPose], views: Views) -> Margins:
    """Return the slack of every constraint of the problem's formulation (Eqs. 9-11; design: what we fly)."""
    gimbal_deg = [
        problem.rig_of(pose.host).gimbal_room_deg(Aim(pan_deg=pose.pan_deg, tilt_deg=pose.tilt_deg), pose.heading_deg)
        for pose in hosts
        if pose.pan_deg is not None
    ]
    hosts, all_points, ways = _as_formulated(problem, hosts)
    poses = {pose.host: pose for pose in hosts}
    pixels, fov_deg, image_deg, distance_m = [math.inf], [math.inf], [math.inf], [math.inf]
    for threat, points in zip(problem.threats, all_points, strict=True):
        for view in views[threat.id]:
            pose = poses[view.host]
            eye = Eye(pose, problem.rig_of(view.host), view.camera)
            for point in points:
                pixels.append(pixel_width(eye, threat.size_m, point) - eye.min_pixels)
                distance_m.append(math.dist(pose.position_m, point) - problem.safety_distance_m)
                if view.camera is CameraKind.CENTRAL:
                    fov_deg.append(room_in_field_deg(eye, point))
                    image_deg.append(room_in_height_deg(eye, point))
    slack = Margins(
        pixels=min(pixels),
        fov_deg=min(fov_deg),
        image_deg=min(image_deg),
        distance_m=min(distance_m),
        gimbal_deg=min(gimbal_deg, default=math.inf),
    )
    if problem.formulation is Formulation.LETTER:
        return slack
    places, airspace = [pose.position_m for pose in hosts], problem.airspace
    distance_m.append(float(path_distances_m(np.array(places), ways).min()) - problem.safety_distance_m)
    apart_m = [math.dist(a, b) - problem.min_separation_m for i, a in enumerate(places) for b in places[:i]]
    return replace(
        slack,
        distance_m=min(distance_m),
        separation_m=min(apart_m, default=math.inf),
        fence_m=min(map(airspace.fence_room_m, places), default=math.inf),
        keep_out_m=min(map(airspace.keep_out_room_m, places), default=math.inf),
        altitude_m=min((airspace.altitude_room_m(up) for _, _, up in places), default=math.inf),
    )


def evaluate(problem: Problem, hosts: Sequence[HoverPose], views: Views) -> Evaluation:
    """Return what a placement is worth. ``views`` holds every threat's pair; unknown hosts are a KeyError."""
    in_space = {pose.host: pose for pose in hosts}
    formulated, all_points, _ = _as_formulated(problem, hosts)
    poses = {pose.host: pose for pose in formulated}
    costs, errors = {}, {}
    for threat, points, ends in zip(problem.threats, all_points, threat_points_m(problem), strict=True):
        seen_by = [Eye(poses[view.host], problem.rig_of(view.host), view.camera) for view in views[threat.id]]
        costs[threat.id] = weight(problem, threat) * pair_cost(threat.size_m, points, seen_by)
        errors[threat.id] = expected_error_m(
            ends,
            [eye._replace(pose=in_space[eye.pose.host]) for eye in seen_by],
            position_sigma_m=problem.position_sigma_m,
            attitude_sigma_rad=problem.attitude_sigma_rad,
        )
    return Evaluation(
        cost=sum(costs.values()),
        pair_costs=costs,
        expected_errors_m=errors,
        margins=margins(problem, hosts, views),
    )
