"""What the letter does not state, varied one thing at a time."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hsop_gcs.study.assumptions import Assumptions, CoverageCameras
from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.summary import error_of, rows
from hsop_gcs.study.trial import Record

SIZES_M = (0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
AREAS_M = (20.0, 40.0, 60.0, 80.0)
STARTS_M = (20.0, 80.0, 160.0)
LENSES = {
    "a lens that squeezes its rim, k1 = -0.08": (-0.08, 0.0, 0.0, 0.0),
    "a lens that stretches its rim, k1 = 0.08": (0.08, 0.0, 0.0, 0.0),
}


def variants() -> Iterator[tuple[str, Assumptions, tuple[Kind, ...]]]:
    """Yield the name of each variation, its assumptions and which placements it touches."""
    chosen = Assumptions()
    both = (Kind.HSOP, Kind.COVERAGE_ONLY)
    yield "as chosen", chosen, both
    for size in SIZES_M:
        if size != chosen.size_m:
            yield f"size {size:g} m", replace(chosen, size_m=size), both
    for area in AREAS_M:
        if area != chosen.area_m:
            yield f"area {area:g} m", replace(chosen, area_m=area, coverage_start_m=area), both
    for name, distortion in LENSES.items():
        yield name, replace(chosen, distortion=distortion), both
    for side in STARTS_M:
        name = f"coverage-only starts in a square of {side:g} m"
        yield name, replace(chosen, coverage_start_m=side), (Kind.COVERAGE_ONLY,)
    determined = replace(chosen, coverage_cameras=CoverageCameras.DETERMINED)
    yield "coverage-only uses central cameras where Algorithm 2 does", determined, (Kind.COVERAGE_ONLY,)


def table_title() -> str:
    return "| assumption | HSOP, m | coverage-only, m | coverage-only by hosts, m |\n|---|--:|--:|---|"


def table_line(name: str, records: Sequence[Record]) -> str:
    """Return one line: errors by Eq. 5, averaged over numbers of hosts and of threats; then by number of hosts."""
    table = rows(records)
    means = {}
    for kind in (Kind.HSOP, Kind.COVERAGE_ONLY):
        errors = [
            np.mean(list(error_of(table, threats, kind, Estimator.EQ5).values()))
            for threats in sorted({row.threats for row in table if row.placement == kind.value})
        ]
        means[kind] = f"{np.mean(errors):.2f}" if errors else ""
    most = max(row.threats for row in table)
    by_hosts = error_of(table, most, Kind.COVERAGE_ONLY, Estimator.EQ5)
    series = " ".join(f"{error:.1f}" for error in by_hosts.values())
    return f"| {name} | {means[Kind.HSOP]} | {means[Kind.COVERAGE_ONLY]} | {most} threats: {series} |"
