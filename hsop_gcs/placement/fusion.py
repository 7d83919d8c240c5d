"""More than two views of a threat: every camera that sees it anyway makes its fix better."""

from dataclasses import replace

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.objective import (
    Eye,
    FloatArray,
    angle_from_central_axis,
    expected_error_m,
    pixel_width,
    threat_points_m,
)
from hsop_gcs.placement.problem import Problem, Threat
from hsop_gcs.placement.solution import Placement, ThreatPair, View


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
    eyes = {
        View(host=pose.host, camera=camera): Eye(pose, problem.rig_of(pose.host), camera)
        for pose in placement.hosts
        for camera in CameraKind
    }
    chosen = list(pair.views)
    waiting = [
        view
        for view, eye in eyes.items()
        if view not in chosen and all(_sees(eye, threat.size_m, point) for point in points_m)
    ]

    def error_m(views: list[View]) -> float:
        return expected_error_m(
            points_m,
            [eyes[view] for view in views],
            position_sigma_m=problem.position_sigma_m,
            attitude_sigma_rad=problem.attitude_sigma_rad,
        )

    while waiting and len(chosen) < problem.max_views:
        best = min(waiting, key=lambda view: error_m([*chosen, view]))
        waiting.remove(best)
        chosen.append(best)
    return replace(pair, more_views=tuple(chosen[2:]), expected_error_m=error_m(chosen))


def _sees(eye: Eye, size_m: float, point_m: FloatArray) -> bool:
    """Return whether a camera as it is aimed detects an object at a point."""
    if pixel_width(eye, size_m, point_m) < eye.min_pixels:
        return False
    # The central camera's angle is not a number while it is not in use.
    peripheral = eye.camera is CameraKind.PERIPHERAL
    return peripheral or angle_from_central_axis(eye.pose, point_m) <= eye.rig.central.half_fov_rad
