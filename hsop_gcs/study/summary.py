"""What a study found: rows for files, tables for people."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.trial import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One mean over scenarios, threats and points."""

    threats: int
    hosts: int
    placement: str
    estimator: str
    mean_error_m: float
    scenarios: int
    standard_error_m: float
    """Of the mean, from the scatter between scenarios."""
    rms_error_m: float
    bound_m: float
    """Cramér-Rao bound of the two assigned views."""
    angle_deg: float
    """Mean intersection angle of the assigned views, as its distance from 0° or 180°."""
    central_share: float
    """Of the assigned views, how many are central cameras'."""

    def as_json(self) -> dict[str, Any]:
        return {name: value if not _is_nan(value) else None for name, value in asdict(self).items()}


def rows(records: Iterable[Record]) -> list[Row]:
    """Average the records for each number of threats and hosts, placement and estimator."""
    groups: dict[tuple[int, int, int, int], list[dict[str, Any]]] = defaultdict(list)
    kinds, estimators = list(Kind), list(Estimator)
    for record in records:
        for result in record["results"]:
            for k in range(len(estimators)):
                groups[record["threats"], result["hosts"], kinds.index(Kind(result["placement"])), k].append(result)
    return [
        _row(threats, hosts, kinds[kind], estimators[k], results)
        for (threats, hosts, kind, k), results in sorted(groups.items())
    ]


def _row(threats: int, hosts: int, kind: Kind, estimator: Estimator, results: Sequence[dict[str, Any]]) -> Row:
    errors = np.array([result["mean_error_m"][estimator.value] for result in results])
    squares = [result["rms_error_m"][estimator.value] ** 2 for result in results]
    return Row(
        threats=threats,
        hosts=hosts,
        placement=kind.value,
        estimator=estimator.value,
        mean_error_m=float(errors.mean()),
        scenarios=len(errors),
        standard_error_m=float(errors.std(ddof=1) / math.sqrt(len(errors))) if len(errors) > 1 else math.nan,
        rms_error_m=math.sqrt(float(np.mean(squares))),
        bound_m=math.sqrt(float(np.mean([result["bound_m"] ** 2 for result in results]))),
        angle_deg=float(np.mean([result["angle_deg"] for result in results])),
        central_share=float(np.mean([result["central_share"] for result in results])),
    )


def error_of(
    table: Sequence[Row], threats: int, kind: Kind, estimator: Estimator, *, column: str = "mean_error_m"
) -> dict[int, float]:
    """Return one column of the rows for each number of hosts."""
    return {
        row.hosts: getattr(row, column)
        for row in table
        if (row.threats, row.placement, row.estimator) == (threats, kind.value, estimator.value)
    }


def markdown(table: Sequence[Row]) -> str:
    """Return one table for each number of threats: mean errors, metres, by number of hosts.

    The last column is for how many scenarios a placement was found, fewest and most where ways of placing differ.
    """
    columns = [
        ("coverage-only, Eq. 5", Kind.COVERAGE_ONLY, Estimator.EQ5),
        ("HSOP, Eq. 5", Kind.HSOP, Estimator.EQ5),
        ("HSOP, ML", Kind.HSOP, Estimator.ML),
        ("HSOP, ML all views", Kind.HSOP, Estimator.ML_ALL_VIEWS),
        ("rms, Eq. 5", Kind.RMS, Estimator.EQ5),
        ("rms, ML", Kind.RMS, Estimator.ML),
        ("rms, ML all views", Kind.RMS, Estimator.ML_ALL_VIEWS),
        ("operational, ML", Kind.OPERATIONAL, Estimator.ML),
        ("operational, ML all views", Kind.OPERATIONAL, Estimator.ML_ALL_VIEWS),
    ]
    kinds = {row.placement for row in table}
    columns = [column for column in columns if column[1].value in kinds]
    parts = []
    for threats in sorted({row.threats for row in table}):
        series = [error_of(table, threats, kind, estimator) for _, kind, estimator in columns]
        counts: dict[int, set[int]] = defaultdict(set)
        for row in table:
            if row.threats == threats:
                counts[row.hosts].add(row.scenarios)
        lines = [
            f"{threats} threats, mean error in metres:",
            "",
            "| hosts | " + " | ".join(name for name, _, _ in columns) + " | scenarios |",
            "|--:|" + "--:|" * (len(columns) + 1),
        ]
        for hosts in sorted(counts):
            cells = [f"{errors[hosts]:.2f}" if hosts in errors else "-" for errors in series]
            scenarios = "-".join(str(count) for count in sorted({min(counts[hosts]), max(counts[hosts])}))
            lines.append(f"| {hosts} | " + " | ".join(cells) + f" | {scenarios} |")
        means = [f"{np.mean(list(errors.values())):.2f}" if errors else "-" for errors in series]
        lines.append("| mean | " + " | ".join(means) + " | |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)
