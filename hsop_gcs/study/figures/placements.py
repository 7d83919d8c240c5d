"""Figs. 8-10: the geometry of a pair set, and placements for static and for mobile threats."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.geometry.rays import intersection_angle_rad
from hsop_gcs.placement.objective import threat_points_m
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.search import search
from hsop_gcs.placement.solution import Placement
from hsop_gcs.study.assumptions import Assumptions
from hsop_gcs.study.coverage import cover
from hsop_gcs.study.figures.drawing import draw_placement, frame_points, new_figure, plan_view
from hsop_gcs.study.localization import Estimator, threat_errors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROUNDS = 8
DRAWS = 10_000
SIZE_M = Assumptions().size_m
COVER_SEED = 3
MOBILE_AT_S = (0.0, 10.0, 20.0)


def _threats(*states: tuple[float, float, float, float]) -> Problem:
    threats = tuple(
        Threat(id=f"t{k + 1}", position_m=(x, y, 0.0), velocity_mps=(vx, vy, 0.0), size_m=SIZE_M)
        for k, (x, y, vx, vy) in enumerate(states)
    )
    return Problem(threats=threats, formulation=Formulation.LETTER)


def placed(problem: Problem, n_hosts: int | None) -> Placement:
    return search(problem, n_hosts=n_hosts, seed=0, deadline=0.0, now=lambda: 0.0, iterations=ROUNDS)


def angles_deg(problem: Problem, placement: Placement) -> list[float]:
    """Return the intersection angle at every point of every threat, threat by threat, in [0, 90]."""
    at = {pose.host: np.array(pose.position_m) for pose in placement.hosts}
    result = []
    for pair, points in zip(placement.pairs, threat_points_m(problem), strict=True):
        first, second = (at[view.host] for view in pair.views)
        for point in points:
            angle = math.degrees(float(intersection_angle_rad(point - first, point - second)))
            result.append(min(angle, 180 - angle))
    return result


def _error_m(problem: Problem, placement: Placement) -> float:
    """Return the mean localization error by Eq. 5."""
    found = threat_errors(problem, placement, DRAWS, np.random.default_rng(0))
    return float(np.mean([point.mean_error_m[Estimator.EQ5] for both in found for point in both]))


def _described(problem: Problem, placement: Placement) -> str:
    cameras = [view.camera for pair in placement.pairs for view in pair.views]
    angles = angles_deg(problem, placement)
    return (
        f"{len(placement.hosts)} hosts, {cameras.count(CameraKind.CENTRAL)} of {len(cameras)} views central, "
        f"angles {min(angles):.0f}° to {max(angles):.0f}°, error by Eq. 5 {_error_m(problem, placement):.2f} m"
    )


def pair_geometry() -> "tuple[Figure, list[str]]":
    """Draw Fig. 8: one host-threat pair with its distances, the intersection angle and the field of view."""
    problem = _threats((0.0, 0.0, 1.0, 0.3))
    placement = placed(problem, 2)
    figure = new_figure(6.0, 5.4)
    axes = figure.subplots()
    draw_placement(axes, problem, placement)
    point = threat_points_m(problem)[0, 0]
    for pose in placement.hosts:
        position = np.array(pose.position_m)
        axes.plot([position[0], point[0]], [position[1], point[1]], ":", color="black", linewidth=0.9)
        middle = (position + point)[:2] / 2
        axes.annotate(f"d = {np.linalg.norm(point - position):.1f} m", middle)
    angle = angles_deg(problem, placement)[0]
    axes.annotate(f"θ = {angle:.0f}°", point[:2], xytext=(8, -14), textcoords="offset points")
    plan_view(axes, "pair set {(t1, h1, h2)}, with t1 later")
    frame_points(axes, [pose.position_m for pose in placement.hosts] + [*threat_points_m(problem)[0]], 35.0)
    return figure, [_described(problem, placement)]


def static_problem() -> Problem:
    """Return two threats at rest, 28 m apart."""
    return _threats((-14.0, 0.0, 0.0, 0.0), (14.0, 0.0, 0.0, 0.0))


def static_threats() -> "tuple[Figure, list[str]]":
    """Draw Fig. 9: two static threats; coverage only, and HSOP with two, three and four hosts."""
    problem = static_problem()
    covered = cover(problem, 2, Assumptions(), np.random.default_rng(COVER_SEED))
    assert covered is not None
    panels = [("(a) coverage only, 2 hosts", covered)]
    panels += [(f"({letter}) HSOP, {n} hosts", placed(problem, n)) for letter, n in zip("bcd", (2, 3, 4), strict=True)]
    figure = new_figure(9.6, 9.2)
    _draw_panels(figure.subplots(2, 2).ravel(), problem, panels)
    return figure, [f"{title}: {_described(problem, placement)}" for title, placement in panels]


def mobile_problems() -> list[Problem]:
    """Return two threats that fly towards each other, at three times."""
    first = _threats((-145.0, 20.0, 5.0, -0.5), (145.0, -20.0, -5.0, 0.5))
    return [
        replace(first, threats=tuple(replace(t, position_m=t.predicted_m(after_s)) for t in first.threats))
        for after_s in MOBILE_AT_S
    ]


def mobile_threats() -> "tuple[Figure, list[str]]":
    """Draw Fig. 10: two threats that approach each other; hosts are placed anew each time the horizon has passed."""
    figure = new_figure(12.6, 4.8)
    columns = figure.subplots(1, 3)
    lines = []
    for axes, after_s, problem in zip(columns, MOBILE_AT_S, mobile_problems(), strict=True):
        placement = placed(problem, None)
        title = f"t = {after_s:g} s: {len(placement.hosts)} hosts"
        _draw_panels([axes], problem, [(title, placement)])
        lines.append(f"{after_s:g} s: {_described(problem, placement)}")
    return figure, lines


def _draw_panels(columns: "list[Axes] | np.ndarray", problem: Problem, panels: list[tuple[str, Placement]]) -> None:
    shown = [point for both in threat_points_m(problem) for point in both]
    shown += [np.array(pose.position_m) for _, placement in panels for pose in placement.hosts]
    for axes, (title, placement) in zip(columns, panels, strict=True):
        draw_placement(axes, problem, placement)
        plan_view(axes, title)
        frame_points(axes, [list(point) for point in shown], 15.0)
