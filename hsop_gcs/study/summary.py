"""What a study found: rows for files, tables for people, and the letter's claims held against them."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.trial import Record

PLATEAU_M = 0.01
"""Once central cameras see everything the error stays where it is; Eq. 8 is not the error itself."""


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


def ratio(records: Iterable[Record], over: tuple[Kind, Estimator], under: tuple[Kind, Estimator]) -> float:
    """Return the mean error of one way over that of another, on the scenarios and numbers of hosts that both have.

    Each number of threats and hosts counts equally. NaN if they have none in common.
    """
    sums: dict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)
    for record in records:
        found = {(r["placement"], r["hosts"]): r["mean_error_m"] for r in record["results"]}
        for kind, hosts in found:
            if kind == over[0] and (under[0].value, hosts) in found:
                pair = (found[kind, hosts][over[1].value], found[under[0].value, hosts][under[1].value])
                sums[record["threats"], hosts].append(pair)
    means = np.array([np.mean(pairs, axis=0) for pairs in sums.values()])
    return float(means[:, 0].mean() / means[:, 1].mean()) if len(means) else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """Something said, what was measured, and whether the one bears the other out."""

    claim: str
    measured: str
    holds: bool


def claims(records: Sequence[Record]) -> list[Claim]:
    """Hold the letter's claims, and ours, against a study's records, as far as their placements were run."""
    table = rows(records)
    kinds = {row.placement for row in table}
    result = []
    if Kind.HSOP.value in kinds:
        result += [*_hsop_claims(table)]
    if {Kind.HSOP.value, Kind.COVERAGE_ONLY.value} <= kinds:
        result += [*_coverage_claims(table, records)]
    if {Kind.HSOP.value, Kind.RMS.value} <= kinds:
        share = ratio(records, (Kind.RMS, Estimator.ML_ALL_VIEWS), (Kind.HSOP, Estimator.EQ5))
        result.append(
            Claim(
                claim="least rms, maximum likelihood, all views: at most 0.4 of HSOP's error by Eq. 5",
                measured=f"{share:.2f}",
                holds=share <= 0.4,
            )
        )
    return result


def _hsop_claims(table: Sequence[Row]) -> Iterable[Claim]:
    for threats in sorted({row.threats for row in table}):
        errors = error_of(table, threats, Kind.HSOP, Estimator.EQ5)
        shares = error_of(table, threats, Kind.HSOP, Estimator.EQ5, column="central_share")
        series = [errors[hosts] for hosts in sorted(errors)]
        yield Claim(
            claim=f"{threats} threats: HSOP's error falls as hosts are added",
            measured=" ".join(f"{error:.2f}" for error in series) + " m",
            holds=all(later < earlier + PLATEAU_M for earlier, later in pairwise(series)),
        )
        yield Claim(
            claim=f"{threats} threats: HSOP's error, averaged over the numbers of hosts, is below 1 m",
            measured=f"{np.mean(series):.2f} m",
            holds=bool(np.mean(series) < 1.0),
        )
        share = [shares[hosts] for hosts in sorted(shares)]
        yield Claim(
            claim=f"{threats} threats: central cameras take over as hosts are added",
            measured=f"{100 * share[0]:.0f} % of views to {100 * share[-1]:.0f} %",
            holds=share[-1] > share[0],
        )


def _coverage_claims(table: Sequence[Row], records: Sequence[Record]) -> Iterable[Claim]:
    for threats in sorted({row.threats for row in table}):
        errors = error_of(table, threats, Kind.COVERAGE_ONLY, Estimator.EQ5)
        mean, slope, uncertainty = _slope(records, threats)
        span = max(errors) - min(errors)
        yield Claim(
            claim=f"{threats} threats: coverage-only does not depend on the number of hosts",
            measured=f"{slope * span:+.1f} ± {uncertainty * span:.1f} m from {min(errors)} hosts to {max(errors)}",
            holds=abs(slope) <= max(3 * uncertainty, 0.1 * mean / max(1, span)),
        )
        yield Claim(
            claim=f"{threats} threats: coverage-only lies near 9-10 m",
            measured=f"{np.mean(list(errors.values())):.1f} m",
            holds=bool(8.0 <= np.mean(list(errors.values())) <= 11.0),
        )
    factor = 1 / ratio(records, (Kind.HSOP, Estimator.EQ5), (Kind.COVERAGE_ONLY, Estimator.EQ5))
    yield Claim(
        claim="HSOP's error is about a tenth of coverage-only's", measured=f"1/{factor:.1f}", holds=factor >= 8.0
    )


def _slope(records: Sequence[Record], threats: int) -> tuple[float, float, float]:
    """Return mean, slope per host and its standard error of coverage-only's error, by scenario."""
    points = np.array(
        [
            (result["hosts"], result["mean_error_m"][Estimator.EQ5.value])
            for record in records
            if record["threats"] == threats
            for result in record["results"]
            if result["placement"] == Kind.COVERAGE_ONLY.value
        ]
    )
    hosts, errors = points[:, 0] - points[:, 0].mean(), points[:, 1]
    spread = float(hosts @ hosts)
    if spread == 0 or len(points) < 3:
        return float(errors.mean()), 0.0, math.inf
    slope = float(hosts @ errors) / spread
    rest = errors - errors.mean() - slope * hosts
    return float(errors.mean()), slope, math.sqrt(float(rest @ rest) / (len(points) - 2) / spread)


def markdown(table: Sequence[Row]) -> str:
    """Return one table for each number of threats: mean errors, metres, by number of hosts."""
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
        counts = {row.hosts: row.scenarios for row in table if row.threats == threats}
        lines = [
            f"{threats} threats, mean error in metres:",
            "",
            "| hosts | " + " | ".join(name for name, _, _ in columns) + " | scenarios |",
            "|--:|" + "--:|" * (len(columns) + 1),
        ]
        for hosts in sorted(counts):
            cells = [f"{errors[hosts]:.2f}" if hosts in errors else "-" for errors in series]
            lines.append(f"| {hosts} | " + " | ".join(cells) + f" | {counts[hosts]} |")
        means = [f"{np.mean(list(errors.values())):.2f}" if errors else "-" for errors in series]
        lines.append("| mean | " + " | ".join(means) + " | |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)
