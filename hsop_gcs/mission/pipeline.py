"""From tracks to orders, on one screen: tracks → problem → placement → assignment.

Pure: a ``Situation`` goes in, a ``Decision`` comes out; the solver's clock is an argument. Everything is frozen and
picklable, because a decision is made in a worker process.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from hsop_gcs.assignment import HostOrder, Mover, NoSafeFlight, orders_for
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.placement import place
from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, Placement, Status, renamed
from hsop_gcs.tracks import Track

_ARRIVAL_TOLERANCE_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningRules:
    """How plans are made; the defaults are the letter's Table 2 and what the service flies."""

    horizon_s: float = 10.0
    safety_distance_m: float = 20.0
    min_separation_m: float = 10.0
    formulation: Formulation = Formulation.OPERATIONAL
    objective: Objective = Objective.LETTER
    hosts: int | str = "fewest"
    """How many hosts to use: "fewest" that see every threat, "all" that are available, or a number."""
    settle_s: float = 3.0
    """From reaching a hover point to a steady picture."""
    time_limit_s: float = 2.0
    seed: int = 0
    limits: FlightLimits = field(default_factory=FlightLimits)
    rig: CameraRig = field(default_factory=CameraRig)


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """Everything a decision depends on. ``now_s``: seconds since the Unix epoch."""

    now_s: float
    tracks: tuple[Track, ...]
    movers: tuple[Mover, ...]
    """The hosts that can be sent."""


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


def decide(situation: Situation, rules: PlanningRules, *, now: Callable[[], float]) -> Decision:
    """Place hosts for the moment at which they can be there, and say who flies where.

    The travel time is guessed from the distances to the threats; when the placement shows that the slowest host needs
    longer, it is made once more for that moment. ``now``: the clock that limits the solver, seconds.
    """
    lead_s = _first_lead_s(situation, rules)
    decision = _decide_for(situation, rules, lead_s, now)
    slowest_s = _slowest_s(decision, situation, rules)
    if slowest_s > lead_s + _ARRIVAL_TOLERANCE_S:
        decision = _decide_for(situation, rules, slowest_s, now)
    return decision


def _decide_for(situation: Situation, rules: PlanningRules, lead_s: float, now: Callable[[], float]) -> Decision:
    window_start_s = situation.now_s + lead_s
    threats = tuple(_threat(track, window_start_s) for track in situation.tracks)
    problem = Problem(
        threats=threats,
        hosts=tuple(AvailableHost(id=mover.id, position_m=mover.position_m) for mover in situation.movers),
        rig=rules.rig,
        horizon_s=rules.horizon_s,
        safety_distance_m=rules.safety_distance_m,
        formulation=rules.formulation,
        objective=rules.objective,
        min_separation_m=rules.min_separation_m,
    )
    placement = place(
        problem, n_hosts=_host_count(problem, rules), seed=rules.seed, time_limit_s=rules.time_limit_s, now=now
    )
    decision = Decision(placement=placement, threats=threats, window_start_s=window_start_s, reason=placement.reason)
    if placement.status is Status.INFEASIBLE:
        return decision
    placement = replace(placement, hosts=tuple(_within_limits(pose, rules.limits) for pose in placement.hosts))
    orders = orders_for(
        placement,
        situation.movers,
        threats_now=tuple(_threat(track, situation.now_s) for track in situation.tracks),
        threats_then=threats,
        horizon_s=rules.horizon_s,
        safety_distance_m=rules.safety_distance_m,
    )
    if isinstance(orders, NoSafeFlight):
        return replace(decision, placement=placement, reason=orders.reason)
    flown_by = {pose.host: order.host for pose, order in zip(placement.hosts, orders, strict=True)}
    return replace(decision, placement=renamed(placement, flown_by), orders=orders)


def _threat(track: Track, at_s: float) -> Threat:
    return Threat(id=track.id, position_m=track.position_at(at_s), velocity_mps=track.velocity_mps, size_m=track.size_m)


def _host_count(problem: Problem, rules: PlanningRules) -> int | None:
    """The number of hosts to place; None leaves it to the placement: the fewest that see every threat."""
    if rules.hosts == "fewest":
        return None
    wanted = len(problem.hosts) if rules.hosts == "all" else int(rules.hosts)
    return min(wanted, 2 * len(problem.threats))


def _within_limits(pose: HoverPose, limits: FlightLimits) -> HoverPose:
    east, north, up = pose.position_m
    return replace(pose, position_m=(east, north, min(max(up, limits.floor_m), limits.ceiling_m)))


def _first_lead_s(situation: Situation, rules: PlanningRules) -> float:
    """Every host flying to the nearest threat's safety distance: a guess that needs no placement."""
    flights_s = [
        max(
            0.0,
            min(math.dist(mover.position_m, track.position_m) for track in situation.tracks) - rules.safety_distance_m,
        )
        / mover.speed_mps
        for mover in situation.movers
    ]
    return max(flights_s, default=0.0) + rules.settle_s


def _slowest_s(decision: Decision, situation: Situation, rules: PlanningRules) -> float:
    mover_of = {mover.id: mover for mover in situation.movers}
    flights_s = [
        math.dist(mover_of[order.host].position_m, order.position_m) / mover_of[order.host].speed_mps
        for order in decision.orders
    ]
    return max(flights_s, default=0.0) + rules.settle_s if flights_s else 0.0
