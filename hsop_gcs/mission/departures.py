"""Who of a plan's hosts departs when, and by which way, as the sky is now; and who may take off."""

from collections.abc import Iterable
from dataclasses import replace

from hsop_gcs.assignment import (
    Departure,
    Flight,
    Mover,
    NoSafeFlight,
    arrange,
    in_the_way,
    safe_route,
    straight,
    why_unsafe,
)
from hsop_gcs.errors import Refused
from hsop_gcs.fleet import Host
from hsop_gcs.mission.core import MissionState, situation
from hsop_gcs.mission.gates import ON_THE_GROUND, Closed
from hsop_gcs.mission.planning import flight_rules
from hsop_gcs.mission.sky import Sky
from hsop_gcs.mission.state import Plan
from hsop_gcs.mission.whereabouts import whereabouts


def departures(plan: Plan, mission: MissionState, sky: Sky, now_s: float) -> tuple[Departure, ...]:
    """Return the order in which a plan's hosts depart, and their routes.

    A host whose way is not safe now waits until it is. Raises Refused if a host cannot be sent, or all would wait.
    """
    if now_s > plan.expires_at_s:
        raise Refused(f"plan {plan.id} ran out {now_s - plan.expires_at_s:.1f} s ago")
    closed = sky.closed(mission, now_s)
    goals_m = {order.host: order.position_m for order in plan.decision.orders}
    for host in goals_m:
        if host in closed:
            raise Refused(f"host {host}: {closed[host].reason}")
    movers, known = sky.movers(closed), situation(mission, (), now_s)
    rules = flight_rules(mission.rules.planning, known.sigmas, sky.standing(mission, closed))
    sent = {mover.id: mover for mover in movers if mover.id in goals_m}
    safe = {host: safe_route(sent[host], goal_m, known.threats, rules) for host, goal_m in goals_m.items()}
    if not any(safe.values()):
        raise Refused(
            f"no host has a way to its hover point that keeps {rules.safety_distance_m:.0f} m from all threats, clear"
            " of aircraft that cannot be sent, and in the airspace"
        )
    idle = tuple(Flight(host=mover.id, points_m=(mover.position_m,)) for mover in movers if mover.id not in sent)
    arranged = arrange(
        {host: route or straight(sent[host], goals_m[host]) for host, route in safe.items()},
        tuple(sent.values()),
        known.threats,
        rules,
        standing=idle,
    )
    if isinstance(arranged, NoSafeFlight):
        raise Refused(arranged.reason)
    return arranged


def check_take_off(hosts: Iterable[Host], altitude_m: float, mission: MissionState, sky: Sky, now_s: float) -> None:
    """Raise Refused, naming the gate, unless hosts may all climb straight up to an altitude above their homes."""
    aircraft, closed, known = sky.aircraft(), sky.closed(mission, now_s), situation(mission, (), now_s)
    rules = flight_rules(mission.rules.planning, known.sigmas)
    in_the_air = [
        replace(flight, points_m=(*flight.points_m, *mission.flies_to_m(name)))
        for name, each in aircraft.items()
        if each.state.in_air
        for flight in whereabouts(mission, each, mission.rules.planning.limits)
    ]

    def gate(host: Host) -> Closed | None:
        at = closed.get(host.id)
        if at is not None and at.gate not in ON_THE_GROUND:
            return at
        if aircraft[host.id].state.in_air:
            return Closed(gate="on the ground", reason="the vehicle is in the air")
        limits = mission.rules.planning.limits
        here_m, top_m = sky.above_home_m(host, 0.0), sky.above_home_m(host, altitude_m)
        if top_m[2] > limits.ceiling_m:
            reason = f"{top_m[2]:.0f} m above the origin is over the ceiling of {limits.ceiling_m:g} m"
            return Closed(gate="ceiling", reason=reason)
        climbing = Mover(id=host.id, position_m=here_m, speed_mps=limits.speed_mps, climb_mps=limits.climb_mps)
        unsafe = why_unsafe(climbing, (top_m,), known.threats, rules)
        if unsafe is not None:
            return Closed(gate="climb", reason=f"its climb {unsafe}")
        other = in_the_way(Flight(host=host.id, points_m=(here_m, top_m)), in_the_air, rules.separation_m)
        return None if other is None else Closed(gate="separation", reason=f"{other} is in the way of its climb")

    for host in hosts:
        if (at := gate(host)) is not None:
            raise Refused(f"host {host.id} does not take off, gate {at.gate}: {at.reason}")
