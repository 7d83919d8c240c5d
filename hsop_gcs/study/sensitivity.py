"""What the letter does not state, varied one thing at a time."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hsop_gcs.study.assumptions import Assumptions, CoverageCameras, MeasuredAt
from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.summary import error_of, rows
from hsop_gcs.study.trial import Record

SIZES_M = (0.75, 1.0, 1.25, 2.0, 3.0)
AREAS_M = (20.0, 60.0, 80.0)
STARTS_M = (20.0, 80.0, 160.0)
LENSES = {
    "a lens that squeezes its rim, k1 = -0.08": (-0.08, 0.0, 0.0, 0.0),
    "a lens that stretches its rim, k1 = 0.08": (0.08, 0.0, 0.0, 0.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """The chosen assumptions with one of them changed, and the placements that it touches."""

    name: str
    varied: str
    """Name of the assumption; empty for the ones chosen."""
    assumptions: Assumptions
    kinds: tuple[Kind, ...] = (Kind.HSOP, Kind.COVERAGE_ONLY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What becomes of the letter's numbers: errors by Eq. 5, averaged over hosts, then threats, metres."""

    name: str
    varied: str
    size_m: float
    hsop_m: float | None
    coverage_only_m: float | None

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def variants() -> Iterator[Variant]:
    """Yield the chosen assumptions and all their variations."""
    chosen = Assumptions()
    yield Variant(name="as chosen", varied="", assumptions=chosen)
    for size in SIZES_M:
        yield Variant(name=f"size {size:g} m", varied="size_m", assumptions=replace(chosen, size_m=size))
    for area in AREAS_M:
        wider = replace(chosen, area_m=area, coverage_start_m=area)
        yield Variant(name=f"area {area:g} m x {area:g} m", varied="area_m", assumptions=wider)
    for name, distortion in LENSES.items():
        yield Variant(name=name, varied="distortion", assumptions=replace(chosen, distortion=distortion))
    for when in (MeasuredAt.NOW, MeasuredAt.LATER):
        measured = replace(chosen, measured_at=when)
        yield Variant(name=f"threats localized {when.value} only", varied="measured_at", assumptions=measured)
    covering = (Kind.COVERAGE_ONLY,)
    for side in STARTS_M:
        name, started = f"coverage-only starts in {side:g} m x {side:g} m", replace(chosen, coverage_start_m=side)
        yield Variant(name=name, varied="coverage_start_m", assumptions=started, kinds=covering)
    determined = replace(chosen, coverage_cameras=CoverageCameras.DETERMINED)
    name = "coverage-only takes the central camera where Algorithm 2 does"
    yield Variant(name=name, varied="coverage_cameras", assumptions=determined, kinds=covering)


def outcome(variant: Variant, records: Sequence[Record]) -> Outcome:
    """Average a variant's records."""
    table = rows(records)
    means: dict[Kind, float | None] = {Kind.HSOP: None, Kind.COVERAGE_ONLY: None}
    for kind in variant.kinds:
        by_threats = [
            np.mean(list(error_of(table, threats, kind, Estimator.EQ5).values()))
            for threats in sorted({row.threats for row in table if row.placement == kind.value})
        ]
        means[kind] = float(np.mean(by_threats)) if by_threats else None
    return Outcome(
        name=variant.name,
        varied=variant.varied,
        size_m=variant.assumptions.size_m,
        hsop_m=means[Kind.HSOP],
        coverage_only_m=means[Kind.COVERAGE_ONLY],
    )


def table_title() -> str:
    return "| assumption | HSOP, m | coverage-only, m |\n|---|--:|--:|"


def table_line(found: Outcome) -> str:
    cells = ["" if value is None else f"{value:.2f}" for value in (found.hsop_m, found.coverage_only_m)]
    return f"| {found.name} | {cells[0]} | {cells[1]} |"
