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

Whatever it does, a host gives way to a threat that comes too near (``giving_way``); its order waits meanwhile.
Pure: the mission and its aircraft go in, inputs for the mission come out. The shell journals them, then acts on them.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from types import MappingProxyType

from hsop_gcs.assignment import Flight, FlightRules, Mover, gains_by_staying, in_the_way, safe_route, why_unsafe
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.link.protocol.ready import position_fresh
from hsop_gcs.mission.core import MissionState, Pending, Wish, situation
from hsop_gcs.mission.dispatch import OrderProgress, OrderStatus
from hsop_gcs.mission.evasion import ACCELERATION_MPS2, LOOK_S, REACTION_S, Approach
from hsop_gcs.mission.gates import Aircraft, Closed
from hsop_gcs.mission.giving_way import GivingWay
from hsop_gcs.mission.inputs import (
    HostDeparted,
    HostGaveWay,
    HostRetried,
    HostSetAside,
    HostStopped,
    HostThreatened,
    LegFlown,
    WishLapsed,
)
from hsop_gcs.mission.planning import Situation, flight_rules
from hsop_gcs.mission.whereabouts import whereabouts
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.problem import Point

Move = HostDeparted | HostStopped | HostGaveWay | HostThreatened | HostRetried | HostSetAside | LegFlown | WishLapsed

_TURN_EARLIER_S = 2.0
"""How much farther ahead a flying host is watched for threats to turn aside than, where it cannot, to stop or to give
way. What is predicted for later will have changed by then: a host that heeded it would stop and go all the way."""
_STAYS_S = 5.0
"""So long a host that gave way has to be able to stay at its hover point, before it goes back there."""
_SETTLED_S, _STILL_MPS = 4.0, 0.5
"""So long after a wish, and slower than this, a host that holds stands still; PX4 at rest reports up to 0.7 m/s now and
then."""
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
class Faulty:
    """A host that could not be looked at, for a fault of our own."""

    host: str
    error: Exception

    @property
    def part(self) -> str:
        """What of the mission has failed, for a person."""
        return SUPERVISION + self.host


SUPERVISION = "the supervision of "


@dataclass(frozen=True, kw_only=True)
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

    def moves(self) -> Iterator[Move | Blocked | Faulty]:
        """Yield what is to be done now, hosts that depart first before those that wait for them."""
        for host, pending in self.mission.pending.items():
            reason = self._why_lapsed(host, pending)
            if reason is not None:
                yield WishLapsed(time_s=self.now_s, host=host, reason=reason)
        away = set()
        for host in self.aircraft if self._known.threats else ():
            for given in self._contained(host, self._out_of_the_way(host)):
                if isinstance(given, HostGaveWay):
                    away.add(host)
                yield given
        for host, progress in sorted(self.mission.progress.items(), key=lambda item: item[1].rank):
            if host not in away:
                yield from self._contained(host, self._of_order(host, progress))

    def _contained(self, host: str, moves: Iterator[Move | Blocked]) -> Iterator[Move | Blocked | Faulty]:
        """Yield one host's moves. A fault of our own in them costs that host its flight, and no other one anything."""
        try:
            yield from list(moves)
        except Exception as error:
            yield Faulty(host=host, error=error)
            progress = self.mission.progress.get(host)
            if progress is not None and progress.flying:
                yield HostStopped(
                    time_s=self.now_s, host=host, gate="fault", reason=f"it cannot be supervised: {error}"
                )

    def _out_of_the_way(self, host: str) -> Iterator[Move]:
        """A host that flies to no hover point gives way to threats."""
        flies = host in self.mission.progress and self.mission.progress[host].flying
        given = None if flies else self._giving_way.move(host)
        if given is not None:
            yield given

    def _of_order(self, host: str, progress: OrderProgress) -> Iterator[Move | Blocked]:
        """A host with an order departs, is watched on its way, or is sent again."""
        waits = progress.status is OrderStatus.WAITING
        if self.aircraft[host].taken_over and (progress.flying or (waits and progress.departures > 0)):
            yield self._left_alone(host)
        elif progress.flying and host in self.closed:
            at = self.closed[host]
            yield HostStopped(time_s=self.now_s, host=host, gate=at.gate, reason=at.reason)
        elif self.aircraft[host].position_m is None:
            return
        elif waits and self._stuck(host, progress):
            last = self.blocked.get(host)
            reason = f"it could not go on for {_PATIENCE_S:.0f} s" + (f": {last.reason}" if last else "")
            until_s = self.now_s + self.mission.rules.set_aside_s
            yield HostSetAside(time_s=self.now_s, host=host, reason=reason, until_s=until_s)
        elif waits:
            if (progress.departures == 0 or self._calm(progress)) and self._may_seek(host, progress):
                yield self._departure(host, progress, self._known)
        elif progress.flying:
            move = self._watched(host, progress, self._known) or self._giving_way.move(host, progress.ahead_m)
            if isinstance(move, HostThreatened):
                yield move
                move = None
            move = move or self._next_leg(host, progress)
            if move is not None:
                yield move
        elif progress.status is OrderStatus.FAILED and self._current(progress):
            yield self._after_failure(host, progress)

    @cached_property
    def _known(self) -> Situation:
        return situation(self.mission, (), self.now_s)

    @cached_property
    def _giving_way(self) -> GivingWay:
        return GivingWay(
            mission=self.mission, aircraft=self.aircraft, limits=self.limits, now_s=self.now_s, known=self._known
        )

    @property
    def _stop_ahead_s(self) -> float:
        """So long before a host would come too near to a threat it has to brake, or to turn away."""
        return REACTION_S + self.limits.speed_mps / ACCELERATION_MPS2 / 2

    def _why_lapsed(self, host: str, pending: Pending) -> str | None:
        """Why a wish that was not confirmed is not to be ordered again."""
        aircraft = self.aircraft[host]
        if not aircraft.state.link_up:
            return None
        if aircraft.state.armed is False:
            return "the vehicle is not armed"
        if (done := self._why_done(aircraft, pending)) is not None:
            return done
        return None if pending.by_operator or aircraft.obeys else f"somebody else flies it (mode {aircraft.state.mode})"

    def _why_done(self, aircraft: Aircraft, pending: Pending) -> str | None:
        """Why a wish is fulfilled though no answer said so; an answer may be lost, telemetry shows what is."""
        state = aircraft.state
        if self.now_s < pending.since_s + _SETTLED_S or not position_fresh(state, aircraft.now_s):
            return None
        if state.in_air is False:
            return "the vehicle is on the ground"
        if pending.wish is Wish.RECALL:
            return f"it returns (mode {state.mode})" if aircraft.returns else None
        speed_mps = math.inf if state.velocity_enu_mps is None else math.hypot(*state.velocity_enu_mps)
        return f"it stands still (mode {state.mode})" if aircraft.holds and speed_mps < _STILL_MPS else None

    def _stuck(self, host: str, progress: OrderProgress) -> bool:
        """Whether nothing keeps it back but what is in its way, since it was stopped long ago."""
        late = progress.departures > 0 and self.now_s > progress.since_s + _PATIENCE_S
        if host in self.mission.ways_given:
            return False
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
        back_too_early = self._why_not_back(host, route, known)
        if back_too_early is not None:
            return replace(blocked, reason=back_too_early)
        carried = self._giving_way.closing_in(host, route, within_s=LOOK_S, answers_s=REACTION_S)
        if carried is not None:
            return replace(blocked, reason=f"brakes first: it would come too near to threat {carried.threat}")
        flight = Flight(host=host, points_m=(mover.position_m, *route))
        first = in_the_way(flight, self._going(host, progress), rules.separation_m)
        if first is not None:
            return replace(blocked, reason=f"waits for {first} to pass")
        return HostDeparted(time_s=self.now_s, host=host, route_m=route)

    def _why_not_back(self, host: str, route_m: tuple[Point, ...], known: Situation) -> str | None:
        """Why a host that gave way is not to go to its hover point yet: it would have to give way again."""
        way = self.mission.ways_given.get(host)
        if way is None:
            return None
        rules = flight_rules(self.mission.rules.planning, known.sigmas)
        stays = why_unsafe(self._mover(host), route_m, known.threats, rules, stays_s=_STAYS_S)
        if stays is None and self._giving_way.keeps_clear(host, route_m, for_sure=True):
            return None
        return f"gave way to threat {way.threat}, which is still too near to its hover point or its way there"

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
        turn_ahead_s = self._stop_ahead_s + _TURN_EARLIER_S
        closes_in = self._giving_way.closing_in(host, progress.ahead_m, within_s=self._stop_ahead_s)
        unsafe = why_unsafe(mover, progress.ahead_m, known.threats, near, within_s=turn_ahead_s)
        if unsafe is not None or closes_in is not None:
            may_turn = self._calm(progress) and self._why_not_sent(host, progress) is None
            other_way = self._other_way(host, progress, known) if may_turn else None
            if other_way is not None and self._giving_way.keeps_clear(host, other_way, for_sure=False):
                around = replace(flight, points_m=(mover.position_m, *other_way))
                if in_the_way(around, self._going(host, progress), rules.separation_m) is None:
                    return HostDeparted(time_s=self.now_s, host=host, route_m=other_way)
            stop = self._stop(mover, progress, known, near, closes_in)
            if stop is not None:
                return stop
        others = chain(self._staying(host, progress), self._going(host, progress, flying_only=True))
        other = in_the_way(flight, others, near.separation_m - _STOP_EARLIER_M)
        if other is None:
            return None
        return HostStopped(time_s=self.now_s, host=host, gate="separation", reason=f"comes too near to {other}")

    def _stop(
        self,
        mover: Mover,
        progress: OrderProgress,
        known: Situation,
        near: FlightRules,
        closes_in: Approach | None,
    ) -> HostStopped | HostGaveWay | None:
        ahead_s = self._stop_ahead_s
        outside = why_unsafe(mover, progress.ahead_m, (), near, within_s=ahead_s)
        if outside is not None:
            return HostStopped(time_s=self.now_s, host=mover.id, gate="airspace", reason=f"its flight {outside}")
        anywhere = replace(near, airspace=Airspace())
        unsafe = why_unsafe(mover, progress.ahead_m, known.threats, anywhere, within_s=ahead_s)
        if closes_in is not None:
            unsafe = unsafe or f"comes to {closes_in.distance_m:.0f} m from threat {closes_in.threat}"
        if unsafe is None:
            return None
        gives_way = self._giving_way.flying(mover.id, progress.ahead_m, may_go_on=closes_in is None)
        if gives_way is not None:
            return gives_way
        if closes_in is not None or gains_by_staying(
            mover, progress.ahead_m, known.threats, horizon_s=near.horizon_s, within_s=ahead_s
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
        if theirs is None or other in self.mission.ways_given:
            return False
        if theirs.flying:
            return True
        waits = theirs.status is OrderStatus.WAITING and theirs.rank < progress.rank
        return waits and self._current(theirs) and other not in self.closed

    def _current(self, progress: OrderProgress) -> bool:
        flying = self.mission.plans.flying
        return flying is not None and flying.id == progress.plan_id

    def _mover(self, host: str) -> Mover:
        position_m = self.aircraft[host].position_m
        assert position_m is not None, "a host without a position does not move"
        return Mover(id=host, position_m=position_m, speed_mps=self.limits.speed_mps, climb_mps=self.limits.climb_mps)
