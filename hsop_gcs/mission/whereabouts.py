"""Where an aircraft of ours may be: where it is heard to be, and while it is not heard, where its last order takes it.

    heard ──position older than 2 s──► anywhere on its leg ──it must have flown it──► at one of the leg's ends ──► heard

A host that gives way to a threat is on the whole of that way, heard or not: it turns as the threat does.
A host that is not heard ends its leg and hovers there, or never began it. What its autopilot's failsafe does some ten
seconds later, nobody can see: it climbs and goes home, at an altitude that is the operator's to keep free.
"""

from hsop_gcs.assignment import Flight, Mover, flight_s
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.link.protocol.ready import position_fresh
from hsop_gcs.mission.core import MissionState
from hsop_gcs.mission.gates import Aircraft

_SLOWLY = 2.0
"""By how much an unheard flight may take longer than planned: against wind, or by the autopilot's own limits."""


def whereabouts(mission: MissionState, aircraft: Aircraft, limits: FlightLimits) -> tuple[Flight, ...]:
    """Return the line on which an aircraft may be, or the places, as flights of one point; none if it is not in the air
    or was never heard to be anywhere.
    """
    state, here_m = aircraft.state, aircraft.position_m
    if here_m is None or state.in_air is False:
        return ()
    here = Flight(host=aircraft.id, points_m=(here_m,))
    pending, way = mission.pending.get(aircraft.id), mission.ways_given.get(aircraft.id)
    fresh, gives_way = position_fresh(state, aircraft.now_s), way is not None and not way.over
    goal_m = way.goal_m if way is not None and gives_way else None if pending is None else pending.goal_m
    if goal_m is None or (fresh and not gives_way):
        return (here,)
    leg = Flight(host=aircraft.id, points_m=(here_m, goal_m))
    mover = Mover(id=aircraft.id, position_m=here_m, speed_mps=limits.speed_mps, climb_mps=limits.climb_mps)
    since_s = state.position_heard_s
    if fresh or since_s is None or aircraft.now_s - since_s <= _SLOWLY * flight_s(mover, (goal_m,)):
        return (leg,)
    return here, leg.goal
