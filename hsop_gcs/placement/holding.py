"""Whether hosts that hover already still see what they should: an old placement under a new prediction."""

from dataclasses import replace

import numpy as np

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.geometry.frames import aim_at, aim_between
from hsop_gcs.placement.answer import valued
from hsop_gcs.placement.objective import FloatArray, Views, margins, threat_points_m
from hsop_gcs.placement.problem import Formulation, Point, Problem
from hsop_gcs.placement.solution import HoverPose, Placement

_TOLERANCE = 1e-6
_CONE_STEPS = 12
_BROKEN = {
    "distance_m": "too near to a hover point",
    "pixels": "too far from a camera",
    "fov_deg": "out of a camera's view",
    "image_deg": "out of a camera's view",
    "gimbal_deg": "where a gimbal cannot look",
}
"""What threats can break, by the margin that tells it."""


def held_over(placement: Placement, problem: Problem) -> Placement | None:
    """Return the placement with its cameras turned to the problem's threats; None if a constraint does not hold.

    Hosts stay where they are with the headings and views they have; central cameras turn to the middle of what they are
    to see.
    """
    if {pair.threat for pair in placement.pairs} != {threat.id for threat in problem.threats}:
        return None
    hosts, views = _looking(placement, problem)
    if margins(problem, hosts, views).smallest < -_TOLERANCE:
        return None
    held = valued(problem, hosts, views)
    return replace(held, method=placement.method, seed=placement.seed, iterations=placement.iterations)


def why_broken(placement: Placement, problem: Problem) -> str | None:
    """Return where, for a person, the problem's threats are when their hosts cannot do any more what they were placed
    for; None if they can. The problem has the threats of the placement.
    """
    slack = margins(problem, *_looking(placement, problem))
    return next((where for name, where in _BROKEN.items() if getattr(slack, name) < -_TOLERANCE), None)


def _looking(placement: Placement, problem: Problem) -> tuple[tuple[HoverPose, ...], Views]:
    """The placement's hosts with their cameras turned to the problem's threats, and what they see."""
    points = {threat.id: at for threat, at in zip(problem.threats, threat_points_m(problem), strict=True)}
    hosts = tuple(_turned(pose, placement, points, problem.rig_of(pose.host)) for pose in placement.hosts)
    return hosts, {pair.threat: pair.views for pair in placement.pairs}


def _turned(pose: HoverPose, placement: Placement, points: dict[str, tuple[Point, Point]], rig: CameraRig) -> HoverPose:
    seen = [
        point
        for pair in placement.pairs
        for view in pair.views
        if view.host == pose.host and view.camera is CameraKind.CENTRAL
        for point in points[pair.threat]
    ]
    if not seen:
        return pose
    here = np.array(pose.position_m)
    if placement.formulation is Formulation.LETTER:
        aim = aim_between(here, np.array(seen))
    else:
        aim = aim_at(here, here + middle_direction(np.array(seen) - here))
    aim = rig.nearest_aim(aim, pose.heading_deg)
    return replace(pose, pan_deg=aim.pan_deg, tilt_deg=aim.tilt_deg)


def middle_direction(rays: FloatArray) -> FloatArray:
    """Return the axis, (3,), of the narrowest cone around rays (n, 3); for more than two, the narrowest but for little.

    From the middle between two far rays it goes towards whatever ray is farthest, in ever smaller steps.
    """
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    first = units[int((units @ units[0]).argmin())]
    second = units[int((units @ first).argmin())]
    axis = best = (first + second) / np.linalg.norm(first + second)
    for step in range(_CONE_STEPS):
        if (units @ axis).min() > (units @ best).min():
            best = axis
        axis = axis + 0.5 / (step + 2) * (units[int((units @ axis).argmin())] - axis)
        axis = axis / np.linalg.norm(axis)
    return np.asarray(best)
