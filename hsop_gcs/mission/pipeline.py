"""From threats to orders, on one screen: threats → problem → placement → assignment.

Pure: a ``Situation`` goes in, a ``Decision`` comes out; the solver's clock is an argument.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import repeat

from hsop_gcs.assignment import (
    HostOrder,
    Mover,
    NoSafeFlight,
    Route,
    clear_of,
    flight_s,
    order_for,
    orders_for,
    safe_route,
)
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.mission.effort import Stages
from hsop_gcs.mission.planning import Decision, PlanningRules, Sigma, Situation, TargetError, flight_rules, margin_m
from hsop_gcs.placement import place
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.holding import held_over, why_broken
from hsop_gcs.placement.partial import without
from hsop_gcs.placement.problem import AvailableHost, Point, Problem, Threat
from hsop_gcs.placement.reasons import out_of_sight
from hsop_gcs.placement.solution import HoverPose, Placement, Status, renamed, without_hosts, worst_error_m

_ARRIVAL_TOLERANCE_S = 1.0
_GLANCE_ROUNDS = 1
"""Enough to know how far hosts will have to fly."""
_GLANCE_SHARE, _GLANCE_UNTIL = 0.3, 0.45
"""Shares of a decision's time: for the first placement, and until that has been carried out."""
_CARRYING_SHARE, _CARRYING_MOST = 0.15, 0.3
"""Shares of a decision's time that are kept for carrying the final placement out, at least and at most."""
_LEAST_SHARE = 0.2
"""The share of a decision's time that a question which has waited too long is given all the same."""
_REASONING_S = 0.05
_STANDING_M = 1.0
"""How much farther than the separation hover points are from aircraft that cannot be sent: those wander, too."""
_SURE = Sigma(position_m=0.0, velocity_mps=0.0)


def decide(
    situation: Situation,
    rules: PlanningRules,
    *,
    now: Callable[[], float],
    iterations: tuple[int, ...] = (),
    late_s: float = 0.0,
) -> Decision:
    """Place hosts for the moment at which they can be there, and say who flies where.

    The travel time is guessed from the distances to the threats; a placement of a few rounds, made first, shows where
    that is too short. The plan that flies is kept if it still holds and the new one is not better by more than the
    rules' margin. Threats that cannot be seen, or not with these hosts, or not in this time, are left out by name; the
    rules' time limit is that of the whole decision. ``now``: the clock that limits it, seconds. ``iterations``: those
    of an earlier decision, to come to the same one whatever the clock says. late_s: so much of the time has passed.
    """
    began = now()
    time_s = max(rules.time_limit_s - late_s, _LEAST_SHARE * rules.time_limit_s)
    effort = Stages(now, iterations[2:] if iterations else None)
    effort.least_s = _CARRYING_SHARE * time_s
    lead_s = _first_lead_s(situation, rules)
    effort.deadline = began + _GLANCE_UNTIL * time_s
    glance, unreachable = _decide_for(
        situation,
        replace(rules, hosts="all"),
        lead_s,
        now,
        began + _GLANCE_SHARE * time_s,
        iterations[:1],
        effort,
        {},
        most_rounds=_GLANCE_ROUNDS,
    )
    needed_s = _slowest_s(glance, situation) + rules.settle_s
    if glance.orders and needed_s > lead_s + _ARRIVAL_TOLERANCE_S:
        lead_s = needed_s
    effort.deadline = began + time_s
    # carrying the placement out takes about as long as it took before
    until = effort.deadline - max(effort.least_s, min(effort.longest_s, _CARRYING_MOST * time_s))
    decision, _ = _decide_for(situation, rules, lead_s, now, until, iterations[1:2], effort, unreachable)
    counts = (*glance.iterations, *decision.iterations, *effort.counts)
    if glance.orders and not decision.orders:
        decision = glance  # there was no time for more
    kept = _kept(situation, rules, decision)
    return replace(decision if kept is None else kept, iterations=counts)


def _decide_for(
    situation: Situation,
    rules: PlanningRules,
    lead_s: float,
    now: Callable[[], float],
    until_s: float,
    iterations: tuple[int, ...],
    effort: Stages,
    unreachable: Mapping[str, str],
    *,
    most_rounds: int | None = None,
) -> tuple[Decision, Mapping[str, str]]:
    """The decision for one travel time, and the threats whose hosts were found not to get there, with the reason.

    unreachable: those that are known before; the others are placed for.
    """
    problem, left_out = _problem_in_sight(situation, rules, lead_s)
    if unreachable.keys() < {threat.id for threat in problem.threats}:
        problem, left_out = without(problem, unreachable), {**left_out, **unreachable}
    placement = place(
        problem,
        n_hosts=_host_count(problem, rules),
        seed=rules.seed,
        time_limit_s=until_s - now(),
        iterations=iterations[0] if iterations else None,
        most_rounds=most_rounds,
        now=now,
        target_error_m=_target_m(rules),
        warm_start=situation.flying,
        until_settled=True,
        thorough_bound=False,
        partial=True,
        reasoning_s=_REASONING_S,
    )
    decision = Decision(
        placement=placement,
        threats=_predicted(situation, rules, lead_s),
        window_start_s=situation.now_s + lead_s,
        reason=placement.reason,
        iterations=(placement.iterations,),
        left_out={} if placement.status is Status.INFEASIBLE else {**left_out, **placement.left_out},
    )
    if placement.status is Status.INFEASIBLE:
        return decision, {}
    # what was found is to be carried out even if it took too long to find
    effort.deadline = max(effort.deadline, now() + effort.least_s)
    with effort.measured():
        carried_out = _carried_out(decision, problem, situation, rules, effort)
    if effort.was_late:
        return carried_out, {}
    lost = carried_out.left_out.keys() - decision.left_out.keys()
    return carried_out, {threat: why for threat, why in carried_out.left_out.items() if threat in lost}


def _carried_out(
    decision: Decision, problem: Problem, situation: Situation, rules: PlanningRules, effort: Stages
) -> Decision:
    """The decision with orders: for its placement, or one that its hosts are sooner at."""
    placement = decision.placement
    known: dict[tuple[str, Point], Route | None] = {}
    decision = _ordered(decision, placement, problem, situation, rules, effort.stage(), known)
    if not decision.orders:
        return decision
    # compiled kernels, which whoever only reads settings need not load
    from hsop_gcs.placement.search.nearer import nearer

    placement, problem = decision.placement, without(problem, decision.left_out)
    climb = max((mover.speed_mps / mover.climb_mps for mover in situation.movers), default=1.0)
    # what was placed for threats that were hardly known is not worth mending
    flying = situation.flying if margin_m(rules, situation.sigmas) <= rules.safety_margin_m else None
    turned = nearer(problem, placement, tolerance=rules.keep_margin, climb=climb, flying=flying, late=effort.stage())
    if turned is None or not _about_as_good(turned, placement, rules):
        return decision
    sooner = _ordered(decision, turned, problem, situation, rules, effort.stage(), known)
    if len(sooner.left_out) > len(decision.left_out) or _slowest_s(decision, situation) <= _slowest_s(
        sooner, situation
    ):
        return decision
    return sooner


def _about_as_good(turned: Placement, placement: Placement, rules: PlanningRules) -> bool:
    """Whether a placement may stand for another that its hosts reach later: it meets the target if the other does."""
    target_m = _target_m(rules)
    return target_m is None or not worst_error_m(placement) <= target_m < worst_error_m(turned)


def _ordered(
    decision: Decision,
    placement: Placement,
    problem: Problem,
    situation: Situation,
    rules: PlanningRules,
    late: Callable[[], bool],
    known: dict[tuple[str, Point], Route | None],
) -> Decision:
    """The decision with this placement and the orders that carry it out, or the reason why nothing does.

    Where not all hosts can get to their hover points, the threats that the others do not see are left out as well.
    """
    placement = replace(placement, hosts=tuple(_within_limits(pose, rules.limits) for pose in placement.hosts))
    left_out = dict(decision.left_out)
    keeping = flight_rules(rules, situation.sigmas, situation.standing)
    then = {threat.id: threat for threat in problem.threats}
    orders: tuple[HostOrder, ...] | NoSafeFlight = NoSafeFlight(reason="")
    while placement.hosts:
        seen = tuple(then[pair.threat] for pair in placement.pairs)
        orders = orders_for(
            placement,
            situation.movers,
            threats_now=situation.threats,
            threats_then=seen,
            rules=keeping,
            late=late,
            known=known,
        )
        if not isinstance(orders, NoSafeFlight):
            break
        smaller = without_hosts(placement, orders.hosts)
        gone = {pair.threat for pair in placement.pairs} - {pair.threat for pair in smaller.pairs}
        left_out |= {threat: f"threat {threat} is left out: {orders.reason}" for threat in sorted(gone)}
        if not gone or not smaller.hosts:
            break
        placement = smaller
    in_order = {threat.id: left_out[threat.id] for threat in situation.threats if threat.id in left_out}
    if isinstance(orders, NoSafeFlight):
        return replace(decision, reason=orders.reason, left_out=in_order)
    flown_by = {pose.host: order.host for pose, order in zip(placement.hosts, orders, strict=False)}
    return replace(decision, placement=renamed(placement, flown_by), orders=orders, left_out=in_order)


def why_over(
    decision: Decision,
    threats: tuple[Threat, ...],
    movers: tuple[Mover, ...],
    rules: PlanningRules,
    *,
    from_s: float,
    until_s: float,
) -> str | None:
    """Return why a decision's hosts, hovering, cannot do what they were placed for; None if they can.

    threats: where they are now; those that the placement does not see count for their distance only. Looked at from
    ``from_s`` until ``until_s`` from now, and for their distance at once.
    """
    seen = {pair.threat for pair in decision.placement.pairs}
    then = tuple(replace(threat, position_m=threat.predicted_m(from_s)) for threat in threats)
    problem = Problem(
        threats=tuple(threat for threat in then if threat.id in seen),
        bystanders=tuple(threat for threat in then if threat.id not in seen),
        hosts=_available(movers),
        rig=rules.rig,
        horizon_s=until_s - from_s,
        safety_distance_m=rules.safety_distance_m,
        formulation=rules.formulation,
        lead_s=from_s,
    )
    return why_broken(decision.placement, problem)


def _available(movers: tuple[Mover, ...]) -> tuple[AvailableHost, ...]:
    return tuple(AvailableHost(id=mover.id, position_m=mover.position_m, rig=mover.rig) for mover in movers)


def _problem(situation: Situation, rules: PlanningRules, lead_s: float) -> Problem:
    threats = _predicted(situation, rules, lead_s)
    return Problem(
        threats=threats,
        hosts=_available(situation.movers),
        rig=rules.rig,
        horizon_s=rules.horizon_s,
        safety_distance_m=rules.safety_distance_m + margin_m(rules, situation.sigmas),
        formulation=rules.formulation,
        objective=rules.objective,
        min_separation_m=rules.min_separation_m,
        airspace=clear_of(_airspace(threats, rules), situation.standing, rules.min_separation_m + _STANDING_M),
        lead_s=lead_s,
        position_sigma_m=rules.host_position_sigma_m,
        attitude_sigma_rad=math.radians(rules.host_attitude_sigma_deg),
        max_views=rules.max_views,
    )


def _predicted(situation: Situation, rules: PlanningRules, lead_s: float) -> tuple[Threat, ...]:
    """The threats at the start of the window.

    A velocity counts for as long as its doubt comes to no more than the safety distance: what is known to 3 m/s takes
    nobody 40 s ahead. Over a longer time a threat is planned for more slowly, as far as that.
    """
    predicted = []
    for threat, sigma in zip(situation.threats, situation.sigmas or repeat(_SURE), strict=False):
        counts_s = rules.safety_distance_m / max(sigma.velocity_mps, 1e-9)
        share = min(1.0, counts_s / (lead_s + rules.horizon_s))
        east, north, up = threat.velocity_mps
        slowed = replace(threat, velocity_mps=(share * east, share * north, share * up))
        predicted.append(replace(slowed, position_m=slowed.predicted_m(lead_s)))
    return tuple(predicted)


def _problem_in_sight(situation: Situation, rules: PlanningRules, lead_s: float) -> tuple[Problem, dict[str, str]]:
    """The problem without the threats that nobody can see, and why nobody can; all of them if there are no others.

    Hosts keep clear of those as well, but not to their altitudes.
    """
    problem = _problem(situation, rules, lead_s)
    left_out = out_of_sight(problem)
    within = without(problem, left_out)
    if not within.threats or not left_out:
        return problem, {}
    airspace = clear_of(_airspace(within.threats, rules), situation.standing, rules.min_separation_m + _STANDING_M)
    return replace(within, airspace=airspace), left_out


def _airspace(threats: tuple[Threat, ...], rules: PlanningRules) -> Airspace:
    """Within the flight limits hosts keep to the altitudes of the threats.

    A coarse track's altitude is what is known least, and an image is less high than wide: a threat that is not where
    its track says leaves the picture soonest upwards or downwards, most easily when it is looked at steeply.
    """
    floor_m, ceiling_m = rules.limits.floor_m, rules.limits.ceiling_m
    ups_m = [threat.predicted_m(after_s)[2] for threat in threats for after_s in (0.0, rules.horizon_s)]
    low_m, high_m = (min(max(up_m, floor_m), ceiling_m) for up_m in (min(ups_m), max(ups_m)))
    return replace(rules.hover_airspace(), floor_m=low_m, ceiling_m=high_m)


def _kept(situation: Situation, rules: PlanningRules, new: Decision) -> Decision | None:
    """The flying plan for another window, if every constraint holds in it and nothing new is better by the margin."""
    flying, available = situation.flying, {mover.id for mover in situation.movers}
    if flying is None or not flying.hosts or not {pose.host for pose in flying.hosts} <= available:
        return None
    if _cut_off(flying, situation, rules):
        return None
    now, then = (_held(flying, situation, rules, lead_s) for lead_s in (0.0, new.window_start_s - situation.now_s))
    if now is None or then is None or now.cost is None or then.cost is None:
        return None
    seen = {pair.threat for pair in now.pairs}
    if new.orders:
        newly_seen = {pair.threat for pair in new.placement.pairs}
        worth = {threat.id: threat.weight for threat in situation.threats}
        more = sum(worth[threat] for threat in newly_seen) - sum(worth[threat] for threat in seen)
        if more > 0 or (newly_seen == seen and _is_better(new.placement, then, rules)):
            return None
    left_out = {
        threat.id: new.left_out.get(threat.id, f"threat {threat.id} is left for those of the plan that flies")
        for threat in situation.threats
        if threat.id not in seen
    }
    return Decision(
        placement=now,
        threats=situation.threats,
        window_start_s=situation.now_s,
        orders=tuple(order_for(pose.host, pose, now, situation.threats, rules.horizon_s) for pose in now.hosts),
        left_out=left_out,
        keeps=True,
    )


def _is_better(new: Placement, flying: Placement, rules: PlanningRules) -> bool:
    """Whether a placement is worth flying to from another one that sees the same and still holds."""
    if new.cost is None or flying.cost is None:
        return False
    target_m = _target_m(rules)
    meets = target_m is not None and worst_error_m(new) <= target_m < worst_error_m(flying)
    return meets or flying.cost > (1 + rules.keep_margin) * new.cost


def _cut_off(flying: Placement, situation: Situation, rules: PlanningRules) -> bool:
    """Whether an aircraft that cannot be sent bars a host's way to its hover point."""
    if not situation.standing:
        return False
    goals_m = {pose.host: pose.position_m for pose in flying.hosts}
    keeping = flight_rules(rules, situation.sigmas, situation.standing)
    return any(
        safe_route(mover, goals_m[mover.id], (), keeping) is None for mover in situation.movers if mover.id in goals_m
    )


def _held(flying: Placement, situation: Situation, rules: PlanningRules, lead_s: float) -> Placement | None:
    """The flying placement under a new prediction; None if a rule does not hold, or a threat of it is gone."""
    seen = {pair.threat for pair in flying.pairs}
    others = {threat.id: "" for threat in situation.threats if threat.id not in seen}
    problem = without(_problem(situation, rules, lead_s), others)
    # what was planned a moment ago still holds when a threat has moved a little, or climbed
    keeping = flight_rules(rules, situation.sigmas, situation.standing)
    return held_over(flying, replace(problem, safety_distance_m=keeping.safety_distance_m, airspace=keeping.airspace))


def _host_count(problem: Problem, rules: PlanningRules) -> int | None:
    """The number of hosts to place; None leaves it to the placement: the fewest that do."""
    if rules.hosts == "fewest" or isinstance(rules.hosts, TargetError):
        return None
    wanted = len(problem.hosts) if rules.hosts == "all" else int(rules.hosts)
    return max(2, min(wanted, 2 * len(problem.threats)))


def _target_m(rules: PlanningRules) -> float | None:
    return rules.hosts.target_error_m if isinstance(rules.hosts, TargetError) else None


def _within_limits(pose: HoverPose, limits: FlightLimits) -> HoverPose:
    east, north, up = pose.position_m
    return replace(pose, position_m=(east, north, min(max(up, limits.floor_m), limits.ceiling_m)))


def _first_lead_s(situation: Situation, rules: PlanningRules) -> float:
    """Every host flying to the nearest threat's safety distance: a guess that needs no placement."""
    flights_s = [
        max(
            0.0,
            min(math.dist(mover.position_m, threat.position_m) for threat in situation.threats)
            - rules.safety_distance_m,
        )
        / mover.speed_mps
        for mover in situation.movers
    ]
    return max(flights_s, default=0.0) + rules.settle_s


def _slowest_s(decision: Decision, situation: Situation) -> float:
    """The longest flight of the orders; 0 without orders."""
    mover_of = {mover.id: mover for mover in situation.movers}
    return max(
        (
            order.wait_s + flight_s(mover_of[order.host], (*order.via_m, order.position_m))
            for order in decision.orders
            if order.views
        ),
        default=0.0,
    )
