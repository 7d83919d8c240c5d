"""The letter's claims, and ours, held against what a study found."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.summary import Row, error_of, rows
from hsop_gcs.study.trial import Record

PLATEAU_M = 0.01
"""Once central cameras see everything the error stays where it is; Eq. 8 is not the error itself."""


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

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


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
    return [*result, *_bound_claim(records)]


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


def _bound_claim(records: Iterable[Record]) -> Iterable[Claim]:
    central = [result for record in records for result in record["results"] if result["central_share"] == 1.0]
    if central:
        error_m = np.linalg.norm([result["rms_error_m"][Estimator.ML.value] for result in central])
        share = float(error_m / np.linalg.norm([result["bound_m"] for result in central]))
        yield Claim(
            claim="central pairs, maximum likelihood: error at most 1.05 of the Cramér-Rao bound",
            measured=f"{share:.3f} over {len(central)} placements",
            holds=share <= 1.05,
        )


def claims_markdown(found: Iterable[Claim]) -> str:
    lines = ["| claim | measured | holds |", "|---|---|---|"]
    lines += [f"| {claim.claim} | {claim.measured} | {'yes' if claim.holds else 'NO'} |" for claim in found]
    return "\n".join(lines) + "\n"


def shares(records: Sequence[Record]) -> dict[Kind, dict[Estimator, float]]:
    """Return each way's error as a share of that of HSOP with Eq. 5; empty without HSOP."""
    kinds = {result["placement"] for record in records for result in record["results"]}
    if Kind.HSOP.value not in kinds:
        return {}
    ways = [kind for kind in Kind if kind.value in kinds and kind is not Kind.COVERAGE_ONLY]
    return {kind: {e: ratio(records, (kind, e), (Kind.HSOP, Estimator.EQ5)) for e in Estimator} for kind in ways}


def shares_markdown(found: dict[Kind, dict[Estimator, float]]) -> str:
    lines = ["| | " + " | ".join(estimator.value for estimator in Estimator) + " |", "|---|" + "--:|" * len(Estimator)]
    lines += [f"| {kind.value} | " + " | ".join(f"{by[e]:.2f}" for e in Estimator) + " |" for kind, by in found.items()]
    return "\n".join(lines) + "\n"
