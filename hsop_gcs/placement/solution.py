"""What is answered: where hosts hover, where they look, and which camera sees which threat."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.problem import Formulation, Objective, Point


class Status(StrEnum):
    """How good the answer is. Infeasible is an answer, not an error."""

    OPTIMAL = "optimal"
    """No better placement exists within 0.1 %; every constraint holds."""
    FEASIBLE = "feasible"
    """The best placement found; every constraint holds."""
    PARTIAL = "partial"
    """The best placement found sees some of the threats, and every constraint holds; ``left_out`` says why not all."""
    INFEASIBLE = "infeasible"
    """No placement was found that sees every threat, or any if some would do; ``reason`` says why."""


class Method(StrEnum):
    """How a placement is looked for."""

    LETTER = "letter"
    """Algorithm 3: an interior-point solve of every pair set and camera choice."""
    SEARCH = "search"
    """The global search: annealing over poses, pairs and cameras, in compiled code."""
    COVERAGE_ONLY = "coverage-only"
    """The letter's baseline: the same constraints, no cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverPose:
    """One host's place: position ENU metres, compass heading of its fisheye axis, aim of its central camera."""

    host: str
    position_m: Point
    heading_deg: float
    pan_deg: float | None
    """Compass pan of the central camera; None when it is not used."""
    tilt_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One camera of one host on one threat."""

    host: str
    camera: CameraKind


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreatPair:
    """A host-threat pair: the threat and the two views that triangulate it."""

    threat: str
    views: tuple[View, View]
    cost: float
    """Its share of Eq. 8, both points."""
    expected_error_m: float | None = None
    """Of the fix from all views."""
    more_views: tuple[View, ...] = ()
    """Further views that see it as the hosts stand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """The answer to a ``Problem``."""

    status: Status
    formulation: Formulation
    objective: Objective
    hosts: tuple[HoverPose, ...] = ()
    pairs: tuple[ThreatPair, ...] = ()
    cost: float | None = None
    lower_bound: float = 0.0
    solve_time_s: float = 0.0
    seed: int = 0
    reason: str = ""
    """Why nothing was found, in terms of the input; empty otherwise."""
    method: str = Method.LETTER
    iterations: int = 0
    """What the search, asked for it again, gives the same placement for: above 0 the rounds that it had time for, or
    fewer; below 0 the steps of a search that was cut short."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Threats that are not seen, and why, where a placement may be partial."""


def worst_error_m(placement: Placement) -> float:
    """Return the largest expected error of any threat, metres; infinite without one."""
    return max(
        (math.inf if p.expected_error_m is None else p.expected_error_m for p in placement.pairs), default=math.inf
    )


def mean_error_m(placement: Placement) -> float:
    """Return the mean of the threats' expected errors, metres; infinite without one."""
    errors_m = [math.inf if pair.expected_error_m is None else pair.expected_error_m for pair in placement.pairs]
    return sum(errors_m) / len(errors_m) if errors_m else math.inf


def without_hosts(placement: Placement, hosts: Collection[str]) -> Placement:
    """Return the placement without these hosts and the threats of which they see one view, and without hosts that then
    see nothing; it costs less, and its bound says nothing."""
    gone = set(hosts)
    pairs = tuple(pair for pair in placement.pairs if not any(view.host in gone for view in pair.views))
    needed = {view.host for pair in pairs for view in pair.views}
    pairs = tuple(
        replace(pair, more_views=tuple(view for view in pair.more_views if view.host in needed)) for pair in pairs
    )
    return replace(
        placement,
        status=Status.PARTIAL,
        hosts=tuple(pose for pose in placement.hosts if pose.host in needed),
        pairs=pairs,
        cost=sum(pair.cost for pair in pairs),
        lower_bound=0.0,
    )


def renamed(placement: Placement, names: Mapping[str, str]) -> Placement:
    """Return the placement with its hosts under other names; every host must have one."""
    pairs = []
    for pair in placement.pairs:
        first, second = (replace(view, host=names[view.host]) for view in pair.views)
        more = tuple(replace(view, host=names[view.host]) for view in pair.more_views)
        pairs.append(replace(pair, views=(first, second), more_views=more))
    hosts = tuple(replace(pose, host=names[pose.host]) for pose in placement.hosts)
    return replace(placement, hosts=hosts, pairs=tuple(pairs))
