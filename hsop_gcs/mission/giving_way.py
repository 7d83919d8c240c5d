"""Giving way: which of our aircraft a threat comes too near to, which of them fly out of its way, and whereto.

Whoever flies for us gives way, on station, waiting or in flight, whether a plan needs it or not. A host stays, and
people are told, if an operator holds or has recalled it, if somebody else flies it, if it cannot take an order, or if
the service only advises. A way out stays in the airspace and keeps the separation; where that leaves none, it may lead
across what another host has still to fly, for that one is stopped in its turn.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from hsop_gcs.assignment import Flight, in_the_way, why_outside
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.link.protocol.ready import position_fresh, why_not_ready
from hsop_gcs.mission.core import RECALLED, MissionState, Wish
from hsop_gcs.mission.evasion import (
    Approach,
    Body,
    Tubes,
    can_wait,
    closes_in,
    flying_to,
    may_come_near,
    staying,
    tubes,
    way_out,
)
from hsop_gcs.mission.gates import Aircraft
from hsop_gcs.mission.inputs import HostGaveWay, HostThreatened
from hsop_gcs.mission.planning import Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.mission.whereabouts import whereabouts
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point

_AGAIN_S = 1.0
"""No host is sent out of a threat's way more often: every order takes time."""
_BETTER_M = 2.0
"""By how much another way out has to be better than the one that a host is on."""
_CLEARLY_M = 2.0
"""A host with no better place than where it is is told of when a threat comes so far inside the safety distance."""


@dataclass(frozen=True, kw_only=True)
class GivingWay:
    """Our aircraft and the threats, at one moment."""

    mission: MissionState
    aircraft: Mapping[str, Aircraft]
    limits: FlightLimits
    now_s: float
    known: Situation
    _given: dict[str, Flight] = field(default_factory=dict)
    """The ways out that were found at this moment."""

    def move(self, host: str, route_m: tuple[Point, ...] = ()) -> HostGaveWay | HostThreatened | None:
        """Return what is to be done about threats that come near to a host. route_m: what it has still to fly to a
        hover point; nothing: it is on no way there.
        """
        body = self._body(host)
        if body is None:
            return None
        way = self.mission.ways_given.get(host)
        under_way = way is not None and not way.over
        ahead_m = (way.goal_m,) if way is not None and under_way else route_m
        now = flying_to(body, ahead_m, self._tubes) if ahead_m else staying(body, self._tubes)
        if now.lacks_m <= 0:
            return None
        reason = self._why_it_stays(host)
        if reason is not None:
            return self._threatened(host, now, reason) if now.distance_m < self._safety_distance_m else None
        if way is not None and self.now_s < way.since_s + _AGAIN_S:
            return None
        if any(can_wait(body, self._tubes, allowed=allowed) for allowed in self._allowances(host, body)):
            return None
        given = self._way_out(host, body, now, now.lacks_m - (_BETTER_M if under_way else 0.0))
        if given is None and not ahead_m and now.distance_m < self._safety_distance_m - _CLEARLY_M:
            return self._threatened(host, now, "it has no way out by which it would be farther away")
        return given

    def closing_in(
        self, host: str, route_m: tuple[Point, ...], *, within_s: float, answers_s: float = 0.0
    ) -> Approach | None:
        """Return how near a host comes to a threat by its own flight, if within this time it does. answers_s: when it
        begins to fly this route.
        """
        body = self._body(host)
        if body is None:
            return None
        return closes_in(body, route_m, self._tubes, within_s=within_s, answers_s=answers_s)

    def flying(self, host: str, route_m: tuple[Point, ...], *, may_go_on: bool) -> HostGaveWay | None:
        """Return the way out of a flying host, if that is better than to stop, or to fly on where that may be."""
        body = self._body(host)
        if body is None or self._why_it_stays(host) is not None:
            return None
        go_on, stop = flying_to(body, route_m, self._tubes), staying(body, self._tubes)
        best = go_on if may_go_on and go_on.lacks_m < stop.lacks_m else stop
        return self._way_out(host, body, replace(best, threat=go_on.threat, distance_m=go_on.distance_m), best.lacks_m)

    def keeps_clear(self, host: str, route_m: tuple[Point, ...], *, for_sure: bool) -> bool:
        """Return whether a host that is sent along a route now, as fast as it is, keeps the safety distance for as long
        as is looked ahead. for_sure: from all that threats' tracks leave open.
        """
        body = self._body(host)
        if body is None:
            return True
        found = flying_to(body, route_m, self._tubes)
        return found.lacks_m <= 0 if for_sure else found.distance_m >= self._safety_distance_m

    @property
    def _safety_distance_m(self) -> float:
        return self.mission.rules.planning.safety_distance_m

    @cached_property
    def _tubes(self) -> Tubes:
        return tubes(self.known, self.mission.rules.planning)

    @cached_property
    def _airspaces(self) -> tuple[Airspace, Airspace]:
        """What ways out stay in, if they can: as hover points do; and at least."""
        planning = self.mission.rules.planning
        return planning.hover_airspace(), planning.airspace

    def _body(self, host: str) -> Body | None:
        """The host as it moves; None if it is not in the air or not known to be anywhere, or nothing can come near."""
        aircraft, planning = self.aircraft[host], self.mission.rules.planning
        state = aircraft.state
        if aircraft.position_m is None or not state.in_air or not position_fresh(state, aircraft.now_s):
            return None
        body = Body(
            position_m=aircraft.position_m,
            velocity_mps=state.velocity_enu_mps or (0.0, 0.0, 0.0),
            speed_mps=self.limits.speed_mps,
            climb_mps=self.limits.climb_mps,
        )
        return body if may_come_near(body, self.known.threats, planning, self.known.sigmas) else None

    def _why_it_stays(self, host: str) -> str | None:
        """Why a host is not to be commanded out of a threat's way; None if it is."""
        mission, aircraft = self.mission, self.aircraft[host]
        pending, aside = mission.pending.get(host), mission.aside.get(host)
        if host in mission.held_hosts or (pending and pending.by_operator and pending.wish is Wish.HOLD):
            return "an operator holds it"
        if aside is not None and aside.until_s is None:
            return aside.reason
        if pending is not None and pending.by_operator:
            return RECALLED
        if not aircraft.obeys:
            return f"somebody else flies it (mode {aircraft.state.mode})"
        if mission.autonomy is Autonomy.ADVISE:
            return "this service only advises"
        return why_not_ready(aircraft.state, aircraft.now_s)

    def _threatened(self, host: str, approach: Approach, reason: str) -> HostThreatened:
        return HostThreatened(
            time_s=self.now_s, host=host, threat=approach.threat, distance_m=approach.distance_m, reason=reason
        )

    def _way_out(self, host: str, body: Body, approach: Approach, than_m: float) -> HostGaveWay | None:
        for allowed in self._allowances(host, body):
            found = way_out(body, self._tubes, than_m=than_m, allowed=allowed)
            if found is not None:
                self._given[host] = Flight(host=host, points_m=(body.position_m, found.goal_m))
                return HostGaveWay(
                    time_s=self.now_s,
                    host=host,
                    goal_m=found.goal_m,
                    threat=approach.threat,
                    distance_m=approach.distance_m,
                )
        return None

    def _allowances(self, host: str, body: Body) -> Iterator[Callable[[Point], bool]]:
        """Which points a host may fly straight to: first the strict answer, then the one that is good enough."""
        lines, places = tuple(self._others(host, lines=True)), tuple(self._others(host, lines=False))
        for airspace, others in zip(self._airspaces, (lines, places), strict=True):
            yield self._allowed(host, body, airspace, others)

    def _allowed(
        self, host: str, body: Body, airspace: Airspace, others: tuple[Flight, ...]
    ) -> Callable[[Point], bool]:
        separation_m = self.mission.rules.planning.min_separation_m
        here_m = body.position_m
        lowest_m, highest_m = min(self.limits.floor_m, here_m[2]), max(self.limits.ceiling_m, here_m[2])

        def allowed(goal_m: Point) -> bool:
            if not lowest_m <= goal_m[2] <= highest_m:
                return False
            if in_the_way(Flight(host=host, points_m=(here_m, goal_m)), others, separation_m) is not None:
                return False
            return why_outside(airspace, (here_m, goal_m)) is None

        return allowed

    def _others(self, host: str, *, lines: bool) -> Iterator[Flight]:
        """Our other aircraft in the air: where they are or may be; with lines, and all that they have still to fly."""
        for other, aircraft in self.aircraft.items():
            if other == host:
                continue
            if other in self._given:
                yield self._given[other]
                continue
            ahead_m = self.mission.flies_to_m(other) if lines else ()
            for flight in whereabouts(self.mission, aircraft, self.limits):
                yield replace(flight, points_m=(*flight.points_m, *ahead_m))
