"""How the demonstration is judged: tracks by the truth, hosts by what the service says of their orders."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from hsop_gcs.demo.scene import true_positions
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.loopback import ORIGIN
from hsop_gcs.simulator.truth import Truth


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What ``demo --json`` prints; the errors are the worst of all hosts."""

    threats: int
    hosts: int
    all_arrived: bool
    hover_error_m: float | None
    heading_error_deg: float | None
    gimbal_error_deg: float | None
    duration_s: float
    report_error_m: float | None
    """Of the coarse reports against the truth, median."""
    final_error_m: float | None
    """Of the tracks against the truth at the end, mean of the threats."""
    journal: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """How far reports and tracks were from the truth, metres; None where there was none."""

    reports_m: float | None
    first_fix_m: float | None
    """When cameras had fixed a threat for the first time."""
    final_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One host at the end of the demonstration."""

    host: str
    status: str
    hover_error_m: float | None
    heading_error_deg: float | None
    gimbal_error_deg: float | None
    sees: tuple[tuple[str, str], ...]
    """Threats and the cameras for them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """All there is to tell at the end."""

    summary: Summary
    rows: tuple[Row, ...]
    errors: Errors
    plan_cost: float | None
    """Of the plan that was approved last."""
    problem: str
    """Why it ended before all hosts were on station; empty if they are."""


class TrackScore:
    """How far tracks are from the truth: the mean of the threats that are in the picture."""

    def __init__(self, truth: Truth) -> None:
        self._truth = truth
        self._frame = LocalFrame(ORIGIN)
        self.first_fix_m: float | None = None
        self.newest_m: float | None = None

    def take(self, picture: Iterable[dict[str, Any]], *, fixed: bool) -> None:
        """Judge the threats that the API shows. fixed: whether cameras have fixed one by now."""
        errors_m = []
        for threat in picture:
            at_s = datetime.fromisoformat(threat["time"]).timestamp()
            true_m = true_positions(self._truth, at_s).get(threat["id"])
            if true_m is not None:
                believed_m = self._frame.to_enu(GeodeticPoint(**threat["position"]))
                errors_m.append(math.dist(believed_m, true_m))
        if errors_m:
            self.newest_m = sum(errors_m) / len(errors_m)
            if fixed and self.first_fix_m is None:
                self.first_fix_m = self.newest_m


def outcome_of(
    hosts: Iterable[dict[str, Any]],
    plan: dict[str, Any] | None,
    errors: Errors,
    *,
    threats: int,
    problem: str,
    duration_s: float,
    journal: str,
) -> Outcome:
    """Return what became of it. hosts: as the API shows them at the end; plan: as it showed what was approved last."""
    rows = [_row(host) for host in hosts if host["order"] is not None]
    summary = Summary(
        threats=threats,
        hosts=len(rows),
        all_arrived=bool(rows) and not problem and all(row.status.startswith("on station") for row in rows),
        hover_error_m=_worst([row.hover_error_m for row in rows]),
        heading_error_deg=_worst([row.heading_error_deg for row in rows]),
        gimbal_error_deg=_worst([row.gimbal_error_deg for row in rows]),
        duration_s=round(duration_s, 2),
        report_error_m=errors.reports_m,
        final_error_m=errors.final_m,
        journal=journal,
    )
    cost = None if plan is None else plan["placement"]["cost"]
    return Outcome(summary=summary, rows=tuple(rows), errors=errors, plan_cost=cost, problem=problem)


def _row(host: dict[str, Any]) -> Row:
    order = host["order"]
    return Row(
        host=host["id"],
        status=order["status"] + (f" ({order['note']})" if order["note"] else ""),
        hover_error_m=order["hover_error_m"],
        heading_error_deg=order["heading_error_deg"],
        gimbal_error_deg=order["gimbal_error_deg"],
        sees=tuple((view["threat"], view["camera"]) for view in order["views"]),
    )


def _worst(values: Sequence[float | None]) -> float | None:
    return max((abs(value) for value in values if value is not None), default=None)
