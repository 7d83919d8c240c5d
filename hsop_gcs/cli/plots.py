"""``--plot FILE``: a figure, if matplotlib (extra ``plots``) is installed, and its PNG."""

from pathlib import Path
from typing import TYPE_CHECKING

from hsop_gcs.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Return an empty figure. Raises BadInput without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise BadInput("--plot", "needs matplotlib; install hsop-gcs[plots]") from None
    return Figure(figsize=(width_in, height_in), layout="constrained")


def save(figure: "Figure", path: Path) -> None:
    """Write a PNG. Raises BadInput if that fails."""
    try:
        figure.savefig(path, format="png", dpi=150)
    except OSError as error:
        raise BadInput("--plot", f"{path} cannot be written: {error.strerror or error}") from None
