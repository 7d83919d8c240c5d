"""More than two views of a threat: every camera that sees it anyway makes its fix better."""

from dataclasses import replace

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.objective import (
    FloatArray,
    angle_from_central_axis,
    expected_error_m,
    pixel_width,
    threat_points_m,
)
from hsop_gcs.placement.problem import Problem, Threat
from hsop_gcs.placement.solution import HoverPose, Placement, ThreatPair, View


def with_more_views(problem: Problem, placement: Placement) -> Placement:
    """Give every threat the views, up to the problem's ``max_views``, that bring its expected error down most.

    Poses, pairs and cost stay; ``expected_error_m`` becomes that of the fix fused from all views.
    """
    if problem.max_views <= 2:
        return placement
    points = dict(zip((threat.id for threat in problem.threats), threat_points_m(problem), strict=True))
    threats = {threat.id: threat for threat in problem.threats}
    pairs = (_fused(problem, placement, pair, threats[pair.threat], points[pair.threat]) for pair in placement.pairs)
    return replace(placement, pairs=tuple(pairs))


def _fused(
    problem: Problem, placement: Placement, pair: ThreatPair, threat: Threat, points_m: FloatArray
) -> ThreatPair:
    """Add the best view, one after the other."""
    poses = {pose.host: pose for pose in placement.hosts}
    chosen = list(pair.views)
    waiting = [
        View(host=pose.host, camera=camera)
        for pose in placement.hosts
        for camera in CameraKind
        if View(host=pose.host, camera=camera) not in chosen
        and all(_sees(problem, threat, pose, camera, point) for point in points_m)
    ]

    def error_m(views: list[View]) -> float:
        return expected_error_m(
            problem.rig,
            points_m,
            [(poses[view.host], view.camera) for view in views],
            position_sigma_m=problem.position_sigma_m,
            attitude_sigma_rad=problem.attitude_sigma_rad,
        )

    while waiting and len(chosen) < problem.max_views:
        best = min(waiting, key=lambda view: error_m([*chosen, view]))
        waiting.remove(best)
        chosen.append(best)
    return replace(pair, more_views=tuple(chosen[2:]), expected_error_m=error_m(chosen))


def _sees(problem: Problem, threat: Threat, pose: HoverPose, camera: CameraKind, point_m: FloatArray) -> bool:
    """Return whether a camera as it is aimed detects the threat at a point."""
    rig = problem.rig
    width = pixel_width(rig, threat.size_m, pose, camera, point_m)
    if camera is CameraKind.PERIPHERAL:
        return width >= rig.peripheral.min_pixels
    in_use = pose.pan_deg is not None
    in_field = in_use and angle_from_central_axis(pose, point_m) <= rig.central.half_fov_rad
    return in_field and width >= rig.central.min_pixels
