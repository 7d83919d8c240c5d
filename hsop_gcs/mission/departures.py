"""Who of a plan's hosts departs when, and by which way, as the sky is now."""

from hsop_gcs.assignment import Departure, Flight, NoSafeFlight, arrange, safe_route, straight
from hsop_gcs.errors import Refused
from hsop_gcs.mission.core import MissionState, situation
from hsop_gcs.mission.pipeline import flight_rules
from hsop_gcs.mission.sky import Sky
from hsop_gcs.mission.state import Plan


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
    rules = flight_rules(mission.rules.planning, known.sigmas)
    sent = {mover.id: mover for mover in movers if mover.id in goals_m}
    safe = {host: safe_route(sent[host], goal_m, known.threats, rules) for host, goal_m in goals_m.items()}
    if not any(safe.values()):
        raise Refused(
            f"no host has a way to its hover point that keeps {rules.safety_distance_m:.0f} m from all threats and"
            " stays in the airspace"
        )
    idle = tuple(Flight(host=mover.id, points_m=(mover.position_m,)) for mover in movers if mover.id not in sent)
    arranged = arrange(
        {host: route or straight(sent[host], goals_m[host]) for host, route in safe.items()},
        tuple(sent.values()),
        known.threats,
        rules,
        standing=idle + sky.standing(mission, closed),
    )
    if isinstance(arranged, NoSafeFlight):
        raise Refused(arranged.reason)
    return arranged
