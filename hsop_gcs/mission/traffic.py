"""Traffic: which hosts depart, turn aside, stop or try again now. Looked at a few times a second, whatever is planned.

    waiting ──nothing in its way──► sent ─► accepted ─► arrived ─► on station
       ▲                              │         │           │           │
       │ a gate closes; a threat, another host  │           │           │
       │ or the airspace's end is in its way    │           │           │
       ├──────────────────────────────┴─────────┘           │           │
       │                       its order failed             │           │
       └── tries left ──────────── failed ◄─────────────────┴───────────┘
                                     │ none left, or somebody else flies it
                                     ▼
                                  given up: the host is set aside, and the mission plans without it

Pure: the mission and its aircraft go in, inputs for the mission come out. The shell journals them, then acts on them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from types import MappingProxyType

from hsop_gcs.assignment import Flight, FlightRules, Mover, gains_by_staying, in_the_way, safe_route, why_unsafe
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.mission.core import MissionState, Pending, situation
from hsop_gcs.mission.dispatch import OrderProgress, OrderStatus
from hsop_gcs.mission.gates import Aircraft, Closed
from hsop_gcs.mission.inputs import HostDeparted, HostRetried, HostSetAside, HostStopped, LegFlown, WishLapsed
from hsop_gcs.mission.planning import Situation, flight_rules
from hsop_gcs.mission.whereabouts import whereabouts
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point

Move = HostDeparted | HostStopped | HostRetried | HostSetAside | LegFlown | WishLapsed

_TURN_AHEAD_S, _STOP_AHEAD_S = 5.0, 3.0
"""How far ahead a flying host is watched for threats, to turn aside and, where it cannot, to stop, which takes so long;
one that would then be nearer to a threat flies on.
What is predicted for later will have changed by then: a host that heeded it would stop and go all the way."""
_SEEK_EVERY_S = 1.0
"""Between attempts to find a way for a host that waits: seeking one takes long."""
_TURN_EVERY_S = 2.0
"""No host turns aside, or departs after a stop, more often: tracks of threats waver, and every order takes time."""
_PATIENCE_S = 30.0
"""A host that was stopped and cannot go on for so long is planned without: others hover where it would have to pass."""
_STOP_EARLIER_M = 1.0
"""How much nearer than planned two hosts come before one of them is stopped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Blocked:
    """A host whose order waits does not depart now."""

    host: str
    order_id: str
    time_s: float
    reason: str
    """For a person."""
    for_good: bool = False
    """What is in its way stays there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Traffic:
    """Where everybody is and flies to."""

    mission: MissionState
    aircraft: Mapping[str, Aircraft]
    closed: Mapping[str, Closed]
    """The gates that are closed, by host."""
    limits: FlightLimits
    now_s: float
    blocked: Mapping[str, Blocked] = field(default_factory=lambda: MappingProxyType({}))
    """Who waited the last time, and why."""

    def moves(self) -> Iterator[Move | Blocked]:
        """Yield what is to be done now, hosts that depart first before those that wait for them."""
        for host, pending in self.mission.pending.items():
            reason = self._why_lapsed(host, pending)
            if reason is not None:
                yield WishLapsed(time_s=self.now_s, host=host, reason=reason)
        if not self.mission.progress:
            return
        known = situation(self.mission, (), self.now_s)
        for host, progress in sorted(self.mission.progress.items(), key=lambda item: item[1].rank):
            waits = progress.status is OrderStatus.WAITING
            if self.aircraft[host].taken_over and (progress.flying or (waits and progress.departures > 0)):
                yield self._left_alone(host)
            elif progress.flying and host in self.closed:
                at = self.closed[host]
                yield HostStopped(time_s=self.now_s, host=host, gate=at.gate, reason=at.reason)
            elif self.aircraft[host].position_m is None:
                continue
            elif waits and self._stuck(host, progress):
                last = self.blocked.get(host)
                reason = f"it could not go on for {_PATIENCE_S:.0f} s" + (f": {last.reason}" if last else "")
                until_s = self.now_s + self.mission.rules.set_aside_s
                yield HostSetAside(time_s=self.now_s, host=host, reason=reason, until_s=until_s)
            elif waits:
                if (progress.departures == 0 or self._calm(progress)) and self._may_seek(host, progress):
                    yield self._departure(host, progress, known)
            elif progress.flying:
                move = self._watched(host, progress, known) or self._next_leg(host, progress)
                if move is not None:
                    yield move
            elif progress.status is OrderStatus.FAILED and self._current(progress):
                yield self._after_failure(host, progress)

    def _why_lapsed(self, host: str, pending: Pending) -> str | None:
        """Why a wish that was not confirmed is not to be ordered again."""
        aircraft = self.aircraft[host]
        if not aircraft.state.link_up:
            return None
        if aircraft.state.armed is False:
            return "the vehicle is not armed"
        return None if pending.by_operator or aircraft.obeys else f"somebody else flies it (mode {aircraft.state.mode})"

    def _stuck(self, host: str, progress: OrderProgress) -> bool:
        """Whether nothing keeps it back but what is in its way, since it was stopped long ago."""
        late = progress.departures > 0 and self.now_s > progress.since_s + _PATIENCE_S
        return late and self._why_not_sent(host, progress) is None

    def _may_seek(self, host: str, progress: OrderProgress) -> bool:
        last = self.blocked.get(host)
        return last is None or last.order_id != progress.order_id or self.now_s >= last.time_s + _SEEK_EVERY_S

    def _departure(self, host: str, progress: OrderProgress, known: Situation) -> HostDeparted | Blocked:
        blocked = Blocked(host=host, order_id=progress.order_id, time_s=self.now_s, reason="")
        reason = self._why_not_sent(host, progress)
        if reason is not None:
            return replace(blocked, reason=reason)
        mover, rules = self._mover(host), flight_rules(self.mission.rules.planning, known.sigmas)
        route = progress.ahead_m
        flight = Flight(host=host, points_m=(mover.position_m, *route))
        unsafe = why_unsafe(mover, route, known.threats, rules)
        staying = in_the_way(flight, self._staying(host, progress), rules.separation_m)
        if unsafe is not None or staying is not None:
            other_way = self._other_way(host, progress, known)
            if other_way is None:
                return replace(blocked, reason=unsafe or f"{staying} is in its way", for_good=unsafe is None)
            route = other_way
        flight = Flight(host=host, points_m=(mover.position_m, *route))
        first = in_the_way(flight, self._going(host, progress), rules.separation_m)
        if first is not None:
            return replace(blocked, reason=f"waits for {first} to pass")
        return HostDeparted(time_s=self.now_s, host=host, route_m=route)

    def _why_not_sent(self, host: str, progress: OrderProgress) -> str | None:
        """Why a host's order must not be sent, as far as it is not the way's fault."""
        flying = self.mission.plans.flying
        if not self._current(progress) or flying is None:
            return "its plan does not fly any more"
        if self.now_s > flying.expires_at_s:
            return "its order is stale: the plan has run out"
        return self.closed[host].reason if host in self.closed else None

    def _other_way(self, host: str, progress: OrderProgress, known: Situation) -> tuple[Point, ...] | None:
        """Another way than the planned one: past threats and, where they are in its way, around aircraft that stay."""
        mover, staying = self._mover(host), self._staying(host, progress)
        for around in ((), staying):
            rules = flight_rules(self.mission.rules.planning, known.sigmas, around)
            found = safe_route(mover, progress.order.position_m, known.threats, rules)
            if found is None:
                return None
            flight = Flight(host=host, points_m=(mover.position_m, *found.points_m))
            if around or in_the_way(flight, staying, rules.separation_m) is None:
                return found.points_m
        return None

    def _watched(self, host: str, progress: OrderProgress, known: Situation) -> Move | None:
        """A flying host is turned aside or stopped before it comes too near to a threat, another host, or the end of
        the airspace.
        """
        planning = self.mission.rules.planning
        mover, rules = self._mover(host), flight_rules(planning, known.sigmas)
        near = replace(rules, safety_distance_m=planning.safety_distance_m)
        flight = Flight(host=host, points_m=(mover.position_m, *progress.ahead_m))
        if why_unsafe(mover, progress.ahead_m, known.threats, near, within_s=_TURN_AHEAD_S) is not None:
            may_turn = self._calm(progress) and self._why_not_sent(host, progress) is None
            other_way = self._other_way(host, progress, known) if may_turn else None
            if other_way is not None:
                around = replace(flight, points_m=(mover.position_m, *other_way))
                if in_the_way(around, self._going(host, progress), rules.separation_m) is None:
                    return HostDeparted(time_s=self.now_s, host=host, route_m=other_way)
            stop = self._stop(mover, progress, known, near)
            if stop is not None:
                return stop
        others = chain(self._staying(host, progress), self._going(host, progress, flying_only=True))
        other = in_the_way(flight, others, near.separation_m - _STOP_EARLIER_M)
        if other is None:
            return None
        return HostStopped(time_s=self.now_s, host=host, gate="separation", reason=f"comes too near to {other}")

    def _stop(self, mover: Mover, progress: OrderProgress, known: Situation, near: FlightRules) -> HostStopped | None:
        outside = why_unsafe(mover, progress.ahead_m, (), near, within_s=_STOP_AHEAD_S)
        if outside is not None:
            return HostStopped(time_s=self.now_s, host=mover.id, gate="airspace", reason=f"its flight {outside}")
        anywhere = replace(near, airspace=Airspace())
        unsafe = why_unsafe(mover, progress.ahead_m, known.threats, anywhere, within_s=_STOP_AHEAD_S)
        if unsafe is not None and gains_by_staying(
            mover, progress.ahead_m, known.threats, horizon_s=near.horizon_s, within_s=_STOP_AHEAD_S
        ):
            return HostStopped(time_s=self.now_s, host=mover.id, gate="threat", reason=f"its flight {unsafe}")
        return None

    def _next_leg(self, host: str, progress: OrderProgress) -> LegFlown | HostStopped | None:
        """A host that has come near a point of its route is sent on as it was sent: if its order and gates allow it."""
        reached = progress.status is OrderStatus.ACCEPTED and self.aircraft[host].reached == progress.leg_id
        if not reached or progress.on_last_leg:
            return None
        reason = self._why_not_sent(host, progress)
        if reason is not None:
            return HostStopped(time_s=self.now_s, host=host, gate="order", reason=reason)
        return LegFlown(time_s=self.now_s, host=host)

    def _after_failure(self, host: str, progress: OrderProgress) -> Move:
        aircraft, rules = self.aircraft[host], self.mission.rules
        if not aircraft.obeys:
            return self._left_alone(host)
        if progress.attempts < rules.attempts:
            return HostRetried(time_s=self.now_s, host=host)
        reason = f"its order failed {progress.attempts} times: {progress.note}"
        return HostSetAside(time_s=self.now_s, host=host, reason=reason, until_s=self.now_s + rules.set_aside_s)

    def _left_alone(self, host: str) -> HostSetAside:
        reason = f"somebody else flies it (mode {self.aircraft[host].state.mode})"
        return HostSetAside(time_s=self.now_s, host=host, reason=reason, until_s=None)

    def _calm(self, progress: OrderProgress) -> bool:
        """Whether the host's last departure or stop is some time ago."""
        return self.now_s >= progress.since_s + _TURN_EVERY_S

    def _staying(self, host: str, progress: OrderProgress) -> tuple[Flight, ...]:
        """Everybody else who does not fly, nor is about to before it: where they are, or may be."""
        return tuple(
            flight
            for other, aircraft in self.aircraft.items()
            if other != host and not self._goes_on(other, progress)
            for flight in whereabouts(self.mission, aircraft, self.limits)
        )

    def _going(self, host: str, progress: OrderProgress, *, flying_only: bool = False) -> Iterator[Flight]:
        """Those who fly or depart before it, with all that is ahead of them. flying_only: of those who depart later, or
        have not departed, only where they are."""
        for other, aircraft in self.aircraft.items():
            if other == host or not self._goes_on(other, progress):
                continue
            theirs = self.mission.progress[other]
            all_of_it = not flying_only or (theirs.flying and theirs.rank < progress.rank)
            for flight in whereabouts(self.mission, aircraft, self.limits):
                yield replace(flight, points_m=(*flight.points_m, *theirs.ahead_m)) if all_of_it else flight

    def _goes_on(self, other: str, progress: OrderProgress) -> bool:
        theirs = self.mission.progress.get(other)
        if theirs is None or theirs.flying:
            return theirs is not None
        waits = theirs.status is OrderStatus.WAITING and theirs.rank < progress.rank
        return waits and self._current(theirs) and other not in self.closed

    def _current(self, progress: OrderProgress) -> bool:
        flying = self.mission.plans.flying
        return flying is not None and flying.id == progress.plan_id

    def _mover(self, host: str) -> Mover:
        position_m = self.aircraft[host].position_m
        assert position_m is not None, "a host without a position does not move"
        return Mover(id=host, position_m=position_m, speed_mps=self.limits.speed_mps, climb_mps=self.limits.climb_mps)
