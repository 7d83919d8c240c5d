"""Plans as values: the rules they are made by, what a decision depends on, and what it is.

All frozen and picklable, because a decision is made in a worker process.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from hsop_gcs.assignment import Flight, FlightRules, HostOrder, Mover, clear_of, inner
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Formulation, Objective, Threat
from hsop_gcs.placement.solution import Placement

_DOUBTS = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetError:
    """As many hosts as it takes to expect no greater error of any threat; all that are available if none reach it."""

    target_error_m: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningRules:
    """How plans are made; the defaults are the letter's Table 2 and what the service flies."""

    horizon_s: float = 10.0
    safety_distance_m: float = 20.0
    safety_margin_m: float = 4.0
    """What plans keep on top of the safety distance, so that they are still safe when a track moves a little; more for
    threats that are not known well: twice their standard deviation, but no more than the safety distance again."""
    min_separation_m: float = 10.0
    formulation: Formulation = Formulation.OPERATIONAL
    objective: Objective = Objective.RMS
    hosts: int | Literal["fewest", "all"] | TargetError = TargetError()
    """How many hosts to use: "fewest" that see every threat, "all" that are available, a number, or the fewest that
    bring every threat's expected error to a target."""
    settle_s: float = 3.0
    """From reaching a hover point to a steady picture."""
    keep_margin: float = 0.2
    """A new plan takes the place of one that still holds only if this share of the cost is gained."""
    time_limit_s: float = 1.0
    seed: int = 0
    fence_margin_m: float = 2.0
    """How far inside the fence and outside keep-outs hover points lie: hosts misplace themselves, and wind moves them;
    on the very edge that would close a gate."""
    limits: FlightLimits = field(default_factory=FlightLimits)
    airspace: Airspace = field(default_factory=Airspace)
    """The fence and the keep-out areas; floor and ceiling are those of ``limits``."""
    host_position_sigma_m: float = 0.0
    host_attitude_sigma_deg: float = 0.0
    """How well hosts know where they are and where their cameras point, each axis; counts in expected errors."""
    max_views: int = 2
    """Of a threat, fused into its expected error."""
    rig: CameraRig = field(default_factory=CameraRig)
    """Of every host that has none of its own."""

    def hover_airspace(self) -> Airspace:
        """Return the airspace that hover points lie in: the fence and the keep-outs with their margin."""
        return inner(self.airspace, self.fence_margin_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sigma:
    """Standard deviations of a threat's position and velocity, each axis, and how its velocity wanders."""

    position_m: float
    velocity_mps: float
    acceleration_psd_m2ps3: float = 0.0

    def after(self, time_s: float) -> float:
        """Return the position's so much later, metres."""
        wandered_m = math.sqrt(self.acceleration_psd_m2ps3 * abs(time_s) ** 3 / 3)
        return math.hypot(self.position_m, self.velocity_mps * time_s, wandered_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """Everything a decision depends on. ``now_s``: seconds since the Unix epoch."""

    now_s: float
    threats: tuple[Threat, ...]
    """Where they are now."""
    sigmas: tuple[Sigma, ...] = ()
    """How sure that is, of each."""
    movers: tuple[Mover, ...]
    """The hosts that can be sent."""
    standing: tuple[Flight, ...] = ()
    """Our other aircraft in the air, which cannot be sent: where each is, or may be. Others keep clear of all of it."""
    flying: Placement | None = None
    """The plan that flies, if one does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A placement and the orders that carry it out; no orders means that nothing can fly, and ``reason`` says why."""

    placement: Placement
    threats: tuple[Threat, ...]
    """The threats as predicted for the start of the window."""
    window_start_s: float
    """When the hosts can have arrived: the placement holds from here for one horizon."""
    orders: tuple[HostOrder, ...] = ()
    reason: str = ""
    iterations: tuple[int, ...] = ()
    """Rounds of the placements it took, and looks of the stages that carried them out: they make the decision again."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Threats that the plan does not see, and why: it is for the others, and keeps its distance to these."""
    keeps: bool = False
    """The flying plan still does: its hosts stay, only their cameras turn on."""


def margin_m(rules: PlanningRules, sigmas: Iterable[Sigma]) -> float:
    """Return what a plan keeps on top of the safety distance, metres."""
    doubt_m = max((_DOUBTS * sigma.position_m for sigma in sigmas), default=0.0)
    return max(rules.safety_margin_m, min(doubt_m, rules.safety_distance_m))


def flight_rules(rules: PlanningRules, sigmas: Iterable[Sigma], standing: Iterable[Flight] = ()) -> FlightRules:
    """Return what flights to hover points keep to when they depart. standing: aircraft that they go around.

    Half of the margin that hover points keep on top of the safety distance: what was planned a moment ago is still good
    when a threat has moved a little, and what departs now is not stopped at once when it moves a little more.
    """
    return FlightRules(
        horizon_s=rules.horizon_s,
        safety_distance_m=rules.safety_distance_m + margin_m(rules, sigmas) / 2,
        separation_m=rules.min_separation_m,
        airspace=replace(
            clear_of(rules.airspace, standing, rules.min_separation_m),
            floor_m=rules.limits.floor_m,
            ceiling_m=rules.limits.ceiling_m,
        ),
    )
