"""The letter's conventions: hosts blue circles, threats green crosses and red ones later, boresights red."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hsop_gcs.cameras.regions import central_region, peripheral_region
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.objective import threat_points_m
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.solution import HoverPose, Placement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HOST, NOW, LATER, BORESIGHT = "tab:blue", "tab:green", "tab:red", "red"
BORESIGHT_M = 12.0


def new_figure(width_in: float, height_in: float, **layout: Any) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained", **layout)


def plan_view(axes: "Axes", title: str) -> None:
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")


def draw_threats(axes: "Axes", problem: Problem) -> None:
    for threat, (now, later) in zip(problem.threats, threat_points_m(problem), strict=True):
        if not np.array_equal(now, later):
            axes.plot([now[0], later[0]], [now[1], later[1]], color="0.6", linewidth=0.8)
            axes.plot(*later[:2], "x", color=LATER, markersize=7, markeredgewidth=2)
        axes.plot(*now[:2], "x", color=NOW, markersize=7, markeredgewidth=2)
        axes.annotate(threat.id, now[:2], xytext=(5, 5), textcoords="offset points")


def draw_host(axes: "Axes", problem: Problem, pose: HoverPose, used: Sequence[CameraKind]) -> None:
    """Draw a host with the detectable regions of the cameras in use; a camera not in use is dashed if it has an aim."""
    size_m = problem.threats[0].size_m
    position = np.array(pose.position_m[:2])
    axes.plot(*position, "o", color=HOST, markersize=4)
    axes.annotate(pose.host, pose.position_m[:2], xytext=(4, -10), textcoords="offset points", color=HOST)
    heading = math.radians(pose.heading_deg)
    if CameraKind.PERIPHERAL in used:
        outline = position + peripheral_region(problem.rig.peripheral, size_m, heading)
        axes.plot(*outline.T, color=HOST, linewidth=0.7)
        ahead = BORESIGHT_M * np.array([math.sin(heading), math.cos(heading)])
        axes.plot(*np.array([position - ahead, position + ahead]).T, color=BORESIGHT, linewidth=1.0)
    if pose.pan_deg is not None:
        outline = position + central_region(problem.rig.central, size_m, math.radians(pose.pan_deg))
        style = "-" if CameraKind.CENTRAL in used else "--"
        axes.plot(*outline.T, color=HOST, linewidth=1.0, linestyle=style)


def draw_placement(axes: "Axes", problem: Problem, placement: Placement) -> None:
    draw_threats(axes, problem)
    views = [view for pair in placement.pairs for view in pair.views]
    for pose in placement.hosts:
        draw_host(axes, problem, pose, sorted({view.camera for view in views if view.host == pose.host}))


def frame_points(axes: "Axes", points_m: Sequence[Sequence[float]], margin_m: float) -> None:
    """Show a square with all points and so much around them; regions may reach beyond."""
    points = np.array([point[:2] for point in points_m])
    low, high = points.min(axis=0), points.max(axis=0)
    (east, north), half = (low + high) / 2, float((high - low).max()) / 2 + margin_m
    axes.set_xlim(east - half, east + half)
    axes.set_ylim(north - half, north + half)
