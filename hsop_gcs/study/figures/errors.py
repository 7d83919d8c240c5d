"""Fig. 11, the localization error by number of hosts, and the error by size of the threats."""

import json
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsop_gcs.errors import BadInput
from hsop_gcs.study.figures.drawing import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STUDY = "letter-study.json"
"""The full study's rows, as ``hsop-gcs study letter --json`` wrote them."""
SENSITIVITY = "sensitivity.json"
"""Errors by assumption, as ``hsop-gcs study sensitivity --json`` wrote them."""
WAYS = (
    ("coverage-only", "eq5", "coverage only", "s--", "tab:orange"),
    ("hsop", "eq5", "HSOP, Eq. 5", "o-", "tab:blue"),
    ("rms", "ml-all-views", "least rms, maximum likelihood, all views", "^-", "tab:green"),
)


def error_by_hosts(path: Path | None = None) -> "tuple[Figure, list[str]]":
    """Draw Fig. 11 from a study's JSON file, or from the study that comes with the package. Raises BadInput."""
    rows = _rows(path)
    counts = sorted({row["threats"] for row in rows})
    figure = new_figure(4.0 * len(counts), 4.2)
    lines = []
    for axes, threats in zip(figure.subplots(1, len(counts), sharey=True, squeeze=False)[0], counts, strict=True):
        for placement, estimator, label, style, colour in WAYS:
            series = {
                row["hosts"]: row["mean_error_m"]
                for row in rows
                if (row["threats"], row["placement"], row["estimator"]) == (threats, placement, estimator)
            }
            if not series:
                continue
            axes.plot(list(series), list(series.values()), style, color=colour, label=label, markersize=4)
            shown = " ".join(f"{error:.2f}" for error in series.values())
            lines.append(f"{threats} threats, {label}: {shown} m, mean {sum(series.values()) / len(series):.2f} m")
        axes.set_yscale("log")
        axes.set_title(f"{threats} threats")
        axes.set_xlabel("hosts")
        axes.set_xticks(range(2, 2 * threats + 1))
        axes.grid(alpha=0.3, which="both")
    figure.axes[0].set_ylabel("mean localization error, m")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure, lines


def error_by_size() -> "tuple[Figure, list[str]]":
    """Draw the error, averaged over numbers of hosts and threats, against the size of the threats."""
    outcomes = json.loads(files(__package__).joinpath(SENSITIVITY).read_text(encoding="utf-8"))
    points = sorted((p for p in outcomes if p["varied"] in ("", "size_m")), key=lambda p: p["size_m"])
    figure = new_figure(5.6, 3.8)
    axes = figure.subplots()
    sizes = [point["size_m"] for point in points]
    axes.plot(sizes, [point["coverage_only_m"] for point in points], "s--", color="tab:orange", label="coverage only")
    axes.plot(sizes, [point["hsop_m"] for point in points], "o-", color="tab:blue", label="HSOP, Eq. 5")
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    axes.set_yscale("log")
    axes.set_xlabel("size of the threats, m")
    axes.set_ylabel("mean localization error, m")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    return figure, [
        f"size {p['size_m']:g} m: HSOP {p['hsop_m']:.2f} m, coverage only {p['coverage_only_m']:.1f} m" for p in points
    ]


def _rows(path: Path | None) -> list[dict[str, Any]]:
    if path is None:
        content = json.loads(files(__package__).joinpath(STUDY).read_text(encoding="utf-8"))
        return list(content["rows"])
    try:
        return list(json.loads(path.read_text(encoding="utf-8"))["rows"])
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error)) from None
    except (ValueError, KeyError, TypeError):
        raise BadInput(str(path), "not a study's JSON: it has no list of rows") from None
