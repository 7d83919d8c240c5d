"""Which figures there are, and how one becomes two files and some lines of measurements."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsop_gcs.errors import Unavailable
from hsop_gcs.study.figures import cameras, errors, pair_sets, placements

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawn = tuple["Figure", list[str]]
"""A figure, and what was measured while it was drawn."""

FIGURES: dict[str, Callable[[], Drawn]] = {
    "fig01-distortion": cameras.distortion,
    "fig02-pixel-size": cameras.pixel_size,
    "fig03-regions": cameras.regions,
    "fig06-pair-sets": pair_sets.infeasible_and_feasible,
    "fig07-backtracking": pair_sets.backtracking_tree,
    "fig08-geometry": placements.pair_geometry,
    "fig09-static": placements.static_threats,
    "fig10-mobile": placements.mobile_threats,
    "fig11-error": errors.error_by_hosts,
    "error-by-size": errors.error_by_size,
}


def draw(name: str, out: Path, rows: Path | None = None) -> list[str]:
    """Write OUT/NAME.svg and OUT/NAME.png and return what was measured. Raises Unavailable without Matplotlib.

    rows: the JSON rows of a study for Fig. 11, instead of those of the study that comes with the package.
    """
    if find_spec("matplotlib") is None:
        raise Unavailable("Matplotlib is not installed; it comes with hsop-gcs[plots]")
    from matplotlib.style import context

    ours: Any = {"svg.hashsalt": "hsop-gcs", "svg.fonttype": "path", "font.family": "DejaVu Sans", "font.size": 9.0}
    with context(["default", ours]):
        if name == "fig11-error" and rows is not None:
            figure, lines = errors.error_by_hosts(rows)
        else:
            figure, lines = FIGURES[name]()
        figure.savefig(out / f"{name}.svg", metadata={"Date": None, "Creator": "hsop-gcs"})
        figure.savefig(out / f"{name}.png", dpi=120, metadata={"Software": "hsop-gcs"})
    return lines
