"""The mission as a fold: whatever happens to it is an ``Input``, and ``apply`` gives the mission after it.

    MissionStarted ─ ReportsArrived ─ RaysArrived ─ SolverAsked ─ DecisionMade ─ PlanFlew ─ HostSpoke ─ HostsHeld ...
         │                │               │              │            │           │              │
         └────────────────┴───────────────┴── apply ─────┴────────────┴───────────┴──────────────┘
                                             Mission, Mission, Mission, ...

Pure. The shell (``controller``) writes an input into the journal, applies it and acts on it; recovery and replay apply
the same inputs again and come to the same mission, to the bit.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import TypeVar

from hsop_gcs.assignment import Departure, Flight, Mover
from hsop_gcs.detections import Verdict as RayVerdict
from hsop_gcs.detections import Watch, assimilate, let_go
from hsop_gcs.link.events import CommandFinished, Event, LinkLost, LinkUp, OrderEvent, OrderFailed
from hsop_gcs.mission.clock import Timeline
from hsop_gcs.mission.dispatch import OrderProgress, OrderStatus, WayGiven, progressed
from hsop_gcs.mission.inputs import (
    ClockStepped,
    DecisionMade,
    EntriesGivenUp,
    HostDeparted,
    HostGaveWay,
    HostRetried,
    HostSetAside,
    HostsHeld,
    HostSpoke,
    HostsRecalled,
    HostsReleased,
    HostStopped,
    HostThreatened,
    Input,
    LegFlown,
    MissionStarted,
    PlanFlew,
    ProposalRefused,
    RaysArrived,
    ReportsArrived,
    Rules,
    SolverAsked,
    ThreatDismissed,
    TimePassed,
    WishLapsed,
)
from hsop_gcs.mission.planning import Sigma, Situation
from hsop_gcs.mission.state import (
    Autonomy,
    Plans,
    ready,
    threat_of,
    with_decision,
    with_proposal_flying,
    with_proposal_refused,
    without_threats,
)
from hsop_gcs.placement.problem import Point
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, Track, Verdict, dismiss, prune, update
from hsop_gcs.tracks.crowd import with_room_for_sources
from hsop_gcs.tracks.lifecycle import has_left
from hsop_gcs.tracks.own import is_remote_id, remote_id

_SENT_AGAIN = (
    OrderStatus.SENT,
    OrderStatus.ACCEPTED,
    OrderStatus.ARRIVED,
    OrderStatus.ON_STATION,
    OrderStatus.UNHEARD,
)
"""Orders of hosts that the link of a service does not watch when it starts again."""


RECALLED = "recalled by the operator"

_MOST_DISMISSED = 500
"""Ids of dismissed threats whose reports are refused, and the same of threats that cameras still see."""

K = TypeVar("K")
V = TypeVar("V")


@dataclass(frozen=True, slots=True, kw_only=True)
class Aside:
    """Why a host is planned without, and until when; None: until it is released."""

    reason: str
    until_s: float | None


class Wish(StrEnum):
    """What stops a flight; the values are the link's names of the commands."""

    HOLD = "hold"
    RECALL = "return to launch"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pending:
    """A hold or recall that its host has not confirmed: it is ordered whenever the host is heard and flies for us."""

    wish: Wish
    since_s: float
    by_operator: bool
    """Else by the mission, which gives it up when somebody else flies the host."""
    goal_m: Point | None
    """Where the host's leg ends that it may still fly while it is not heard, ENU metres; None: it was on none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionState:
    """All that is known and decided at one moment."""

    rules: Rules = field(default_factory=Rules)
    timeline: Timeline = field(default_factory=Timeline)
    """Where mission time has come to, and how the system clock stands to it."""
    held: bool = False
    """An operator's hold or recall took automation away, until hosts are released."""
    held_hosts: frozenset[str] = frozenset()
    """Hosts that an operator stopped, and that were not sent out again since: they stay even in a threat's way."""
    aside: Mapping[str, Aside] = field(default_factory=lambda: MappingProxyType({}))
    """Hosts that are planned without."""
    pending: Mapping[str, Pending] = field(default_factory=lambda: MappingProxyType({}))
    """Holds and recalls that hosts have not confirmed; until they do, are sent out again, or are released."""
    picture: Picture = field(default_factory=Picture)
    watch: Watch = field(default_factory=Watch)
    """Of detections: those that wait for an explanation, and what became of all."""
    plans: Plans = field(default_factory=Plans)
    progress: Mapping[str, OrderProgress] = field(default_factory=lambda: MappingProxyType({}))
    """The newest order of each host."""
    ways_given: Mapping[str, WayGiven] = field(default_factory=lambda: MappingProxyType({}))
    """Hosts that were sent out of a threat's way, and did not depart to a hover point since."""
    times_given: int = 0
    """How often a host was sent out of a threat's way: flights of that kind are numbered."""
    asked: SolverAsked | None = None
    """What the solver is working on."""
    unwanted: Mapping[str, Track] = field(default_factory=lambda: MappingProxyType({}))
    """Dismissed threats, by names of their own, as long as cameras see them: what they see would begin them again."""
    dismissed: Mapping[tuple[str, str], float] = field(default_factory=lambda: MappingProxyType({}))
    """Sources' own ids whose reports are refused, and until when."""

    @property
    def autonomy(self) -> Autonomy:
        """The rules' own, but nothing flies unasked while hosts are held."""
        own = self.rules.autonomy
        return Autonomy.CONFIRM if self.held and own is Autonomy.AUTO else own

    def why_aside(self, host: str, now_s: float) -> str | None:
        """Return why a host is planned without at this time, if it is."""
        aside = self.aside.get(host)
        return None if aside is None or (aside.until_s is not None and now_s >= aside.until_s) else aside.reason

    def flies_to_m(self, host: str) -> tuple[Point, ...]:
        """Return the points that a host on its way has still to fly to, ENU metres; none if it is not."""
        progress, way = self.progress.get(host), self.ways_given.get(host)
        if way is not None:
            return () if way.over else (way.goal_m,)
        return progress.ahead_m if progress is not None and progress.flying else ()


def apply(mission: MissionState, given: Input) -> MissionState:
    """Return the mission after an input."""
    return _applied(replace(mission, timeline=mission.timeline.at(given.time_s)), given)


def _applied(mission: MissionState, given: Input) -> MissionState:
    match given:
        case MissionStarted():
            return _started(mission, given)
        case ClockStepped(time_s=time_s, by_s=by_s, offset_s=offset_s):
            timeline = mission.timeline.stepped(time_s, by_s=by_s, offset_s=offset_s)
            return replace(mission, timeline=timeline)
        case ReportsArrived():
            return take_reports(mission, given)[0]
        case RaysArrived():
            return take_rays(mission, given)[0]
        case TimePassed(time_s=time_s):
            picture, _ = prune(mission.picture, time_s, mission.rules.tracks)
            watch = let_go(mission.watch, time_s, mission.rules.detections)
            return _with_picture(replace(mission, watch=watch), picture)
        case ThreatDismissed(threat_id=threat_id):
            return _without(mission, threat_id, time_s=given.time_s)
        case SolverAsked():
            return replace(mission, asked=given)
        case DecisionMade():
            return _with_decision(mission, given)
        case PlanFlew(departures=departures):
            under_way = [host for host, progress in mission.progress.items() if progress.flying]
            return _with_plan_flying(_wished(mission, under_way, Wish.HOLD, given.time_s), departures)
        case ProposalRefused(reason=reason):
            return replace(mission, plans=with_proposal_refused(mission.plans, reason))
        case LegFlown() | HostDeparted() | HostStopped() | HostRetried() | HostSetAside():
            return _with_move(mission, given)
        case HostsHeld(hosts=hosts):
            mission = _wished(mission, hosts, Wish.HOLD, given.time_s, by_operator=True)
            return replace(_without_orders(mission, hosts), held=True, held_hosts=mission.held_hosts.union(hosts))
        case HostsRecalled(hosts=hosts):
            recalled = dict.fromkeys(hosts, Aside(reason=RECALLED, until_s=None))
            aside = MappingProxyType({**mission.aside, **recalled})
            mission = _wished(mission, hosts, Wish.RECALL, given.time_s, by_operator=True)
            return replace(_without_orders(mission, hosts), held=True, aside=aside)
        case HostsReleased(hosts=hosts, everyone=everyone):
            left = {host: aside for host, aside in mission.aside.items() if host not in hosts}
            mission = replace(mission, aside=MappingProxyType(left), held=mission.held and not everyone)
            return _not_held(_not_pending(mission, hosts), hosts)
        case HostGaveWay():
            return _with_way_given(mission, given)
        case HostThreatened():
            return mission
        case WishLapsed(host=host):
            return _not_pending(mission, (host,))
        case HostSpoke(host=host, event=event):
            return _with_event(mission, host, event, given.time_s)
        case EntriesGivenUp():
            return mission
    raise ValueError(f"no mission takes {type(given).__name__}")


def take_reports(mission: MissionState, given: ReportsArrived) -> tuple[MissionState, tuple[Verdict, ...]]:
    """Return the mission with the reports in its picture, and a verdict on each."""
    refused = {
        index: Refusal(RefusalKind.DISMISSED, "threat_id", f"{each.threat_id!r} was dismissed by the operator")
        for index, each in enumerate(given.measurements)
        if each.threat_id is not None and given.time_s < mission.dismissed.get((each.source, each.threat_id), 0.0)
    }
    remote_ids = mission.rules.remote_ids
    if remote_ids:
        named = {index: each.threat_id for index, each in enumerate(given.measurements) if each.threat_id is not None}
        refused |= {
            index: is_remote_id(name, remote_ids[plain])
            for index, name in named.items()
            if (plain := remote_id(name)) in remote_ids
        }
    known, crowded = with_room_for_sources(mission.picture, given.measurements, given.time_s, mission.rules.tracks)
    taken = [index for index in range(len(given.measurements)) if index not in crowded]
    picture, verdicts = update(
        known,
        [given.measurements[index] for index in taken],
        given.time_s,
        mission.rules.tracks,
        own=given.own,
        clock=mission.rules.believable,
        refused={place: refused[index] for place, index in enumerate(taken) if index in refused},
    )
    rest = iter(verdicts)
    timeline = mission.timeline.at(given.time_s)
    return replace(mission, picture=picture, timeline=timeline), tuple(
        crowded[index] if index in crowded else next(rest) for index in range(len(given.measurements))
    )


def take_rays(mission: MissionState, given: RaysArrived) -> tuple[MissionState, tuple[RayVerdict, ...]]:
    """Return the mission with what cameras saw in its picture, and a verdict on each detection."""
    known, unwanted = mission.picture.tracks, mission.unwanted
    after = assimilate(
        mission.picture._replace(tracks=MappingProxyType({**known, **unwanted})) if unwanted else mission.picture,
        mission.watch,
        given.rays,
        given.time_s,
        own=given.own,
        rules=mission.rules.detections,
        track_rules=mission.rules.tracks,
        clock=mission.rules.reports,
    )
    picture = after.picture
    if unwanted:
        tracks, rules = picture.tracks, mission.rules.tracks
        seen = {name: tracks[name] for name in unwanted if not has_left(tracks[name], given.time_s, rules)}
        wanted = {name: track for name, track in tracks.items() if name not in unwanted}
        picture, unwanted = picture._replace(tracks=MappingProxyType(wanted)), MappingProxyType(seen)
    timeline = mission.timeline.at(given.time_s)
    mission = replace(mission, picture=picture, unwanted=unwanted, watch=after.watch, timeline=timeline)
    return mission, after.verdicts


def situation(
    mission: MissionState, movers: tuple[Mover, ...], now_s: float, *, standing: tuple[Flight, ...] = ()
) -> Situation:
    """Return what a decision made now depends on: the threats worth planning for, the hosts and the flying plan."""
    tracks = ready(mission.picture.tracks.values(), now_s, mission.rules.replanning)
    flying, psd_m2ps3 = mission.plans.flying, mission.rules.tracks.acceleration_psd_m2ps3
    return Situation(
        now_s=now_s,
        threats=tuple(threat_of(track, now_s) for track in tracks),
        sigmas=tuple(
            Sigma(
                position_m=track.sigma_m,
                velocity_mps=track.velocity_sigma_mps if track.velocity_known else 0.0,
                acceleration_psd_m2ps3=psd_m2ps3,
            )
            for track in tracks
        ),
        movers=movers,
        standing=standing,
        flying=None if flying is None else flying.decision.placement,
    )


def _started(mission: MissionState, given: MissionStarted) -> MissionState:
    """Take up the flights that a service before this one left: whoever flew is stopped, and sent on by the same plan as
    soon as nothing is in the way; whoever hovered is sent to where it hovers, so that the link watches it again.

    Hosts that the fleet does not have any more are forgotten, and with one of them the plan that it flew in.
    """
    lost = {host for host in (*mission.progress, *mission.pending, *mission.aside) if host not in given.hosts}
    under_way = [host for host, progress in mission.progress.items() if progress.flying]
    under_way += [host for host, way in mission.ways_given.items() if not way.over]
    mission = _not_pending(_without_orders(_wished(mission, under_way, Wish.HOLD, given.time_s), lost), lost)
    flying = None if given.rules.autonomy is Autonomy.ADVISE else mission.plans.flying
    plan_id, note = None if flying is None else flying.id, "the service was started again"

    def taken_up(progress: OrderProgress) -> OrderProgress:
        if progress.plan_id != plan_id:
            return replace(progress, status=OrderStatus.SUPERSEDED, note=note)
        again = progress.status in _SENT_AGAIN
        return replace(progress, status=OrderStatus.WAITING, since_s=given.time_s, note=note) if again else progress

    return replace(
        mission,
        rules=given.rules,
        timeline=mission.timeline.started(given.time_s, steady_s=given.steady_s, boot=given.boot),
        aside=MappingProxyType({host: aside for host, aside in mission.aside.items() if host not in lost}),
        plans=Plans(made=mission.plans.made, flying=flying),
        progress=MappingProxyType({host: taken_up(each) for host, each in mission.progress.items()}),
        asked=None,
        ways_given=MappingProxyType({}),
    )


def _with_picture(mission: MissionState, picture: Picture) -> MissionState:
    plans = mission.plans if picture.tracks else without_threats(mission.plans)
    return replace(mission, picture=picture, plans=plans)


def _with_decision(mission: MissionState, given: DecisionMade) -> MissionState:
    if mission.asked is None:
        raise ValueError("a decision that nobody asked for")
    horizon_s = mission.rules.planning.horizon_s
    plans = with_decision(
        mission.plans,
        given.decision,
        asked=mission.asked.situation,
        trigger=mission.asked.trigger,
        now_s=given.time_s,
        horizon_s=horizon_s,
    )
    # threats may have left while the solver worked: then there is nothing to fly for
    return replace(mission, plans=plans if mission.picture.tracks else without_threats(plans), asked=None)


def _without(mission: MissionState, threat_id: str, *, time_s: float) -> MissionState:
    until_s = time_s + mission.rules.dismissed_for_s
    track = mission.picture.tracks[threat_id]
    ids = {(binding.source, binding.threat_id): until_s for binding in track.sources}
    name = f"dismissed {threat_id}"
    refused = {key: end_s for key, end_s in mission.dismissed.items() if end_s > time_s}
    seen = {key: each for key, each in mission.unwanted.items() if not has_left(each, time_s, mission.rules.tracks)}
    mission = replace(
        mission,
        dismissed=_newest({**refused, **ids}),
        unwanted=_newest({**seen, name: replace(track, id=name, source=name, sources=())}),
    )
    return _with_picture(mission, dismiss(mission.picture, threat_id))


def _newest(entries: Mapping[K, V]) -> Mapping[K, V]:
    """Return no more entries than are kept, the newest."""
    return MappingProxyType(dict(list(entries.items())[-_MOST_DISMISSED:]))


def _with_plan_flying(mission: MissionState, departures: tuple[Departure, ...]) -> MissionState:
    """Hosts that the plan does not need keep their old order only where they have arrived."""
    plans = with_proposal_flying(mission.plans)
    plan = plans.flying
    assert plan is not None
    there = (OrderStatus.ARRIVED, OrderStatus.ON_STATION, OrderStatus.UNHEARD, OrderStatus.GIVEN_UP)
    progress = {host: each for host, each in mission.progress.items() if each.status in there}
    orders = {order.host: order for order in plan.decision.orders}
    for rank, departure in enumerate(departures):
        order = replace(orders[departure.host], via_m=departure.route_m[:-1], wait_s=departure.wait_s)
        progress[order.host] = OrderProgress(
            order_id=f"{plan.id}/{order.host}", plan_id=plan.id, order=order, rank=rank
        )
    return replace(mission, plans=plans, progress=MappingProxyType(progress))


def _with_move(
    mission: MissionState, given: LegFlown | HostDeparted | HostStopped | HostRetried | HostSetAside
) -> MissionState:
    progress = mission.progress[given.host]
    match given:
        case LegFlown():
            progress = replace(progress, leg=progress.leg + 1)
        case HostDeparted(route_m=route_m):
            mission = _not_held(_not_pending(mission, (given.host,)), (given.host,))
            mission = _without_ways(mission, (given.host,))
            progress = replace(
                progress,
                order=replace(progress.order, via_m=route_m[:-1]),
                leg=0,
                departures=progress.departures + 1,
                since_s=given.time_s,
                status=OrderStatus.SENT,
                note="",
            )
        case HostStopped(reason=reason):
            mission = _wished(mission, (given.host,), Wish.HOLD, given.time_s)
            progress = replace(progress, status=OrderStatus.WAITING, since_s=given.time_s, note=reason)
        case HostRetried():
            progress = replace(
                progress, status=OrderStatus.WAITING, since_s=given.time_s, attempts=progress.attempts + 1
            )
        case HostSetAside(host=host, reason=reason, until_s=until_s):
            progress = replace(progress, status=OrderStatus.GIVEN_UP, note=reason)
            aside = {**mission.aside, host: Aside(reason=reason, until_s=until_s)}
            mission = replace(mission, aside=MappingProxyType(aside))
    return _with_progress(mission, given.host, progress)


def _with_way_given(mission: MissionState, given: HostGaveWay) -> MissionState:
    """A host's order for the plan that flies waits until its way is free again; another order is over."""
    number = mission.times_given + 1
    way = WayGiven(order_id=f"way{number}/{given.host}", goal_m=given.goal_m, threat=given.threat, since_s=given.time_s)
    mission = replace(
        _not_pending(mission, (given.host,)),
        ways_given=MappingProxyType({**mission.ways_given, given.host: way}),
        times_given=number,
    )
    progress, flying = mission.progress.get(given.host), mission.plans.flying
    if progress is None or progress.status is OrderStatus.GIVEN_UP:
        return mission
    goes_on = flying is not None and flying.id == progress.plan_id
    status = OrderStatus.WAITING if goes_on else OrderStatus.SUPERSEDED
    note = f"gives way to threat {given.threat}"
    return _with_progress(mission, given.host, replace(progress, status=status, since_s=given.time_s, note=note))


def _without_orders(mission: MissionState, hosts: Collection[str]) -> MissionState:
    """Held hosts carry out no plan any more, and a plan without them is none."""
    left = {host: progress for host, progress in mission.progress.items() if host not in hosts}
    flying = mission.plans.flying
    over = flying is not None and any(order.host in hosts for order in flying.decision.orders)
    plans = replace(mission.plans, flying=None) if over else mission.plans
    return _without_ways(replace(mission, plans=plans, progress=MappingProxyType(left)), hosts)


def _with_event(mission: MissionState, host: str, event: Event, time_s: float) -> MissionState:
    if isinstance(event, CommandFinished):
        pending = mission.pending.get(host)
        obeyed = pending is not None and event.problem is None and event.command == pending.wish
        return _not_pending(mission, (host,)) if obeyed else mission
    way = mission.ways_given.get(host)
    if way is not None and isinstance(event, OrderEvent) and event.order_id == way.order_id:
        return replace(mission, ways_given=MappingProxyType({**mission.ways_given, host: way.after(event)}))
    progress = mission.progress.get(host)
    if progress is not None and isinstance(event, LinkLost | LinkUp):
        return _with_progress(mission, host, progressed(progress, event))
    if progress is None or not isinstance(event, OrderEvent) or event.order_id != progress.leg_id:
        return mission
    if isinstance(event, OrderFailed):
        mission = _wished(mission, (host,), Wish.HOLD, time_s)
    return _with_progress(mission, host, progressed(progress, event))


def _wished(
    mission: MissionState, hosts: Iterable[str], wish: Wish, time_s: float, *, by_operator: bool = False
) -> MissionState:
    """A host that has not heard the wish before this one may still fly what it flew then."""
    pending = dict(mission.pending)
    for host in hosts:
        before = pending.get(host)
        goal_m = next(iter(mission.flies_to_m(host)), before.goal_m if before else None)
        pending[host] = Pending(wish=wish, since_s=time_s, by_operator=by_operator, goal_m=goal_m)
    return replace(mission, pending=MappingProxyType(pending))


def _not_pending(mission: MissionState, hosts: Iterable[str]) -> MissionState:
    left = {host: pending for host, pending in mission.pending.items() if host not in hosts}
    return replace(mission, pending=MappingProxyType(left))


def _not_held(mission: MissionState, hosts: Iterable[str]) -> MissionState:
    return replace(mission, held_hosts=mission.held_hosts.difference(hosts))


def _without_ways(mission: MissionState, hosts: Iterable[str]) -> MissionState:
    left = {host: way for host, way in mission.ways_given.items() if host not in hosts}
    return replace(mission, ways_given=MappingProxyType(left))


def _with_progress(mission: MissionState, host: str, progress: OrderProgress) -> MissionState:
    return replace(mission, progress=MappingProxyType({**mission.progress, host: progress}))
