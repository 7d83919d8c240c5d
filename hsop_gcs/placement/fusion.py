"""More than two views of a threat: every camera that sees it anyway makes its fix better."""

import math
from dataclasses import replace

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.objective import (
    Eye,
    FloatArray,
    expected_error_m,
    noise_rad,
    pixel_width,
    room_in_field_deg,
    room_in_height_deg,
    threat_points_m,
    weight,
)
from hsop_gcs.placement.problem import Formulation, Objective, Problem, Threat
from hsop_gcs.placement.solution import Placement, ThreatPair, View


def fuses(problem: Problem) -> bool:
    """Return whether the cost is the error of fixes from more than two views."""
    return problem.objective is Objective.RMS and problem.max_views > 2


def fused_lower_bound(problem: Problem) -> float:
    """Return a sum of weighted expected errors that no placement with ``max_views`` goes below.

    trace J⁻¹ is no less than 9 / trace J for the information of k rays, trace J = Σ 2 / sᵢ²; and no ray is better than
    the best lens's from the safety distance, which in the letter's problem only the two hosts of a pair keep.
    """
    if problem.formulation is not Formulation.OPERATIONAL:
        return 0.0
    angular = min(min(noise_rad(rig, problem.attitude_sigma_rad).values()) for rig in problem.rigs)
    best_square = (angular * problem.safety_distance_m) ** 2 + problem.position_sigma_m**2
    error_m = math.sqrt(4.5 * best_square / problem.max_views)
    return sum(weight(problem, threat) * error_m for threat in problem.threats)


def with_more_views(problem: Problem, placement: Placement) -> Placement:
    """Give every threat the views, up to the problem's ``max_views``, that bring its expected error down most.

    Poses and pairs stay; ``expected_error_m`` becomes that of the fix fused from all views, and so does what the
    objective makes of it.
    """
    if problem.max_views <= 2:
        return placement
    points = dict(zip((threat.id for threat in problem.threats), threat_points_m(problem), strict=True))
    threats = {threat.id: threat for threat in problem.threats}
    pairs = (_fused(problem, placement, pair, threats[pair.threat], points[pair.threat]) for pair in placement.pairs)
    fused = replace(placement, pairs=tuple(pairs))
    return replace(fused, cost=sum(pair.cost for pair in fused.pairs)) if fuses(problem) else fused


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
    fused_m = error_m(chosen)
    cost = weight(problem, threat) * fused_m if fuses(problem) else pair.cost
    return replace(pair, more_views=tuple(chosen[2:]), expected_error_m=fused_m, cost=cost)


def _sees(eye: Eye, size_m: float, point_m: FloatArray) -> bool:
    """Return whether a camera as it is aimed detects an object at a point."""
    if pixel_width(eye, size_m, point_m) < eye.min_pixels:
        return False
    if eye.camera is CameraKind.PERIPHERAL:
        return True
    # While the central camera is not in use its room in the field is not a number.
    return room_in_field_deg(eye, point_m) >= 0 and room_in_height_deg(eye, point_m) >= 0
