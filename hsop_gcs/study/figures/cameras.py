"""Figs. 1-3: what the two cameras do to an image, and how far they see."""

import math
from typing import TYPE_CHECKING

import numpy as np

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.regions import central_region, peripheral_region
from hsop_gcs.study.figures.drawing import BORESIGHT, new_figure, plan_view

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZES_M = (0.5, 1.0, 1.5, 2.0)


def distortion() -> "tuple[Figure, list[str]]":
    """Draw Fig. 1: a flat checkered wall before the lens, and equal discs at equal distances, as they are imaged."""
    lens = FisheyeCamera()
    figure = new_figure(8.4, 4.2)
    wall, discs = figure.subplots(1, 2)
    line = np.linspace(-6.0, 6.0, 481)
    for offset in np.arange(-6.0, 6.5, 1.0):
        for across, up in ((line, np.full_like(line, offset)), (np.full_like(line, offset), line)):
            pixels = lens.project(np.column_stack([across, up, np.ones_like(line)]))
            wall.plot(*pixels.T, color="0.3", linewidth=0.8)
    wall.set_title("a flat grid, 1 m squares, 1 m ahead")
    around = np.linspace(0.0, 2 * math.pi, 73)
    widths = []
    for off_deg in (0, 15, 30, 45, 60, 75, 85):
        for side in (0.0, math.pi / 2, math.pi, 3 * math.pi / 2) if off_deg else (0.0,):
            pixels = _disc_image(lens, math.radians(off_deg), side, around)
            discs.fill(*pixels.T, color="tab:orange", alpha=0.7)
        widths.append(f"{off_deg}°: {100 * float(lens.relative_pixel_size(math.radians(off_deg))):.0f} %")
    discs.set_title("equal discs, facing the way the lens does")
    for axes in (wall, discs):
        axes.set_aspect("equal")
        axes.set_xlim(0, lens.resolution_px - 1)
        axes.set_ylim(lens.resolution_px - 1, 0)
        axes.set_xlabel("u, px")
        axes.set_ylabel("v, px")
    return figure, ["an object's size in the image against the boresight: " + ", ".join(widths)]


def _disc_image(
    lens: FisheyeCamera, off_rad: float, side_rad: float, around: np.ndarray, radius: float = 0.12
) -> np.ndarray:
    """Return the image, (n, 2), of a disc parallel to the sensor at unit distance, as Eqs. 2 and 3 measure it."""
    centre = np.array([math.sin(off_rad), 0.0, math.cos(off_rad)])
    rim = centre + radius * np.column_stack([np.cos(around), np.sin(around), np.zeros_like(around)])
    turned = np.column_stack(
        [
            rim[:, 0] * math.cos(side_rad) - rim[:, 1] * math.sin(side_rad),
            rim[:, 0] * math.sin(side_rad) + rim[:, 1] * math.cos(side_rad),
            rim[:, 2],
        ]
    )
    return lens.project(turned)


def pixel_size() -> "tuple[Figure, list[str]]":
    """Draw Fig. 2: the angle of a ray and of its distorted image, and the relative pixel size against the angle."""
    lens = FisheyeCamera()
    figure = new_figure(8.4, 3.6)
    geometry, curve = figure.subplots(1, 2)
    theta = math.radians(55)
    for angle, style, label in ((theta, "-", "θ, the ray"), (float(lens.distorted_angle(theta)), ":", "θ_d")):
        across = 1.2 * math.tan(angle) if style == "-" else angle
        geometry.plot([0, across], [0, 1.2 if style == "-" else -1], style, color="tab:blue", label=label)
    geometry.axvline(0, color="0.5", linewidth=0.8)
    geometry.axhline(0, color="0.5", linewidth=0.8)
    geometry.axhline(-1, color="black", linewidth=1.2)
    geometry.annotate("lens", (-0.9, 0.05))
    geometry.annotate("image plane: r = f θ_d", (-0.9, -0.95))
    geometry.annotate("θ = 55°", (0.12, 0.45))
    geometry.set_xlim(-1, 2)
    geometry.set_ylim(-1.2, 1.3)
    geometry.set_title("(a) a ray and its distorted image")
    geometry.legend(loc="upper left")
    degrees = np.linspace(-90, 90, 721)
    relative = 100 * lens.relative_pixel_size(np.radians(degrees))
    curve.plot(degrees, relative, color="tab:blue")
    curve.set_xlabel("line of sight angle, °")
    curve.set_ylabel("relative pixel size, %")
    curve.set_title("(b) relative pixel size, Eq. 2")
    curve.grid(alpha=0.3)
    half = float(np.interp(-50.0, -relative[degrees >= 0], degrees[degrees >= 0]))
    return figure, [
        f"100 % on the boresight, {relative[degrees == 45][0]:.1f} % at 45°, 50 % at {half:.1f}°, "
        f"{relative[-1]:.0f} % at 90°"
    ]


def regions() -> "tuple[Figure, list[str]]":
    """Draw Fig. 3: detectable regions of the peripheral and the central camera for objects of some sizes."""
    peripheral, central = FisheyeCamera(), PinholeCamera()
    figure = new_figure(9.0, 4.6)
    left, right = figure.subplots(1, 2)
    lines = []
    for size in SIZES_M:
        lobes, sector = peripheral_region(peripheral, size, math.pi / 2), central_region(central, size)
        left.plot(*lobes.T, label=f"{size:g} m")
        right.plot(*sector.T, label=f"{size:g} m")
        far, near = float(np.hypot(*lobes.T).max()), float(np.hypot(*sector.T).max())
        lines.append(
            f"an object of {size:g} m is detected out to {far:.0f} m on a fisheye's boresight, "
            f"{far * float(peripheral.relative_pixel_size(math.pi / 4)):.0f} m at 45°; "
            f"{near:.0f} m by the central camera"
        )
    for sign in (-1, 1):
        left.annotate("", (45 * sign, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": BORESIGHT})
    right.annotate("", (0, 20), (0, 0), arrowprops={"arrowstyle": "->", "color": BORESIGHT})
    plan_view(left, "(a) peripheral camera, 5 px")
    plan_view(right, "(b) central camera, 30 px")
    left.set_ylim(-165, 125)
    left.legend(title="object", loc="lower center", ncols=4)
    right.legend(title="object", loc="lower right")
    return figure, lines
