"""The mission as a fold: whatever happens to it is an ``Input``, and ``apply`` gives the mission after it.

    MissionStarted ─ ReportsArrived ─ RaysArrived ─ SolverAsked ─ DecisionMade ─ PlanFlew ─ HostSpoke ─ HostsHeld ...
         │                │               │              │            │           │              │
         └────────────────┴───────────────┴── apply ─────┴────────────┴───────────┴──────────────┘
                                             Mission, Mission, Mission, ...

Pure. The shell (``controller``) writes an input into the journal, applies it and acts on it; recovery and replay apply
the same inputs again and come to the same mission, to the bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from hsop_gcs.assignment import Mover
from hsop_gcs.detections import DetectionRules, Ray, Refused, Watch, assimilate, let_go
from hsop_gcs.detections import Verdict as RayVerdict
from hsop_gcs.link.events import Event, OrderEvent
from hsop_gcs.mission.dispatch import OrderProgress, OrderStatus, progressed
from hsop_gcs.mission.pipeline import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import (
    Autonomy,
    Plans,
    ReplanRules,
    ready,
    with_decision,
    with_proposal_flying,
    with_proposal_refused,
    without_threats,
)
from hsop_gcs.placement.problem import Point, Threat
from hsop_gcs.reports import Measurement, ReportRules
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, TrackRules, Verdict, dismiss, prune, update


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Everything a mission is judged and planned by."""

    autonomy: Autonomy = Autonomy.CONFIRM
    planning: PlanningRules = field(default_factory=PlanningRules)
    replanning: ReplanRules = field(default_factory=ReplanRules)
    tracks: TrackRules = field(default_factory=TrackRules)
    reports: ReportRules = field(default_factory=ReportRules)
    detections: DetectionRules = field(default_factory=DetectionRules)
    dismissed_for_s: float = 300.0
    """How long the reports of a dismissed threat are refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Base of all inputs; times are seconds since the Unix epoch."""

    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStarted(Input):
    """The service started, for the first time or again, with these rules."""

    rules: Rules


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportsArrived(Input):
    """Measurements that arrived together, and where our own hosts were."""

    measurements: tuple[Measurement, ...]
    hosts_m: Mapping[str, Point]


@dataclass(frozen=True, slots=True, kw_only=True)
class RaysArrived(Input):
    """What hosts' cameras saw, as rays, and where our own hosts were."""

    rays: tuple[Ray | Refused, ...]
    hosts_m: Mapping[str, Point]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimePassed(Input):
    """So much time that a track changed its status or left, or a ray was held in vain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverAsked(Input):
    """A plan was due: ``trigger`` says why, the situation is all that the solver is told."""

    trigger: str
    situation: Situation


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionMade(Input):
    """The solver's answer to what it was asked last."""

    decision: Decision


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFlew(Input):
    """The proposed plan was approved and its orders are about to be sent."""

    plan_id: str
    via_m: Mapping[str, tuple[Point, ...]]
    """Each host's way past threats, from where it is now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposalRefused(Input):
    """The proposed plan was to fly and could not: a host or its safe way had gone."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LegFlown(Input):
    """A host has come to a point of its route and is about to be sent to the next."""

    host: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HostsHeld(Input):
    """An operator stopped hosts."""

    hosts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreatDismissed(Input):
    """An operator took a threat out of the picture."""

    threat_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HostSpoke(Input):
    """A host's link told something."""

    host: str
    event: Event


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionState:
    """All that is known and decided at one moment."""

    rules: Rules = field(default_factory=Rules)
    autonomy: Autonomy = Autonomy.CONFIRM
    """The rules' own until an operator's hold takes automation away."""
    picture: Picture = field(default_factory=Picture)
    watch: Watch = field(default_factory=Watch)
    """Of detections: those that wait for an explanation, and what became of all."""
    plans: Plans = field(default_factory=Plans)
    progress: Mapping[str, OrderProgress] = field(default_factory=lambda: MappingProxyType({}))
    """The newest order of each host."""
    asked: SolverAsked | None = None
    """What the solver is working on."""
    dismissed: Mapping[tuple[str, str], float] = field(default_factory=lambda: MappingProxyType({}))
    """Sources' own ids whose reports are refused, and until when."""


def apply(mission: MissionState, given: Input) -> MissionState:
    """Return the mission after an input."""
    match given:
        case MissionStarted(rules=rules):
            return _started(mission, rules)
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
        case PlanFlew(via_m=via_m):
            return _with_plan_flying(mission, via_m)
        case ProposalRefused(reason=reason):
            return replace(mission, plans=with_proposal_refused(mission.plans, reason))
        case LegFlown(host=host):
            progress = mission.progress[host]
            return _with_progress(mission, host, replace(progress, leg=progress.leg + 1))
        case HostsHeld(hosts=hosts):
            left = {host: progress for host, progress in mission.progress.items() if host not in hosts}
            autonomy = Autonomy.CONFIRM if mission.autonomy is Autonomy.AUTO else mission.autonomy
            return replace(mission, progress=MappingProxyType(left), autonomy=autonomy)
        case HostSpoke(host=host, event=event):
            return _with_event(mission, host, event)
    raise ValueError(f"no mission takes {type(given).__name__}")


def take_reports(mission: MissionState, given: ReportsArrived) -> tuple[MissionState, tuple[Verdict, ...]]:
    """Return the mission with the reports in its picture, and a verdict on each."""
    refused = {
        index: Refusal(RefusalKind.DISMISSED, "threat_id", f"{each.threat_id!r} was dismissed by the operator")
        for index, each in enumerate(given.measurements)
        if each.threat_id is not None and given.time_s < mission.dismissed.get((each.source, each.threat_id), 0.0)
    }
    picture, verdicts = update(
        mission.picture,
        [each for index, each in enumerate(given.measurements) if index not in refused],
        given.time_s,
        mission.rules.tracks,
        hosts_m=given.hosts_m,
        clock=mission.rules.reports,
    )
    rest = iter(verdicts)
    return replace(mission, picture=picture), tuple(
        refused[index] if index in refused else next(rest) for index in range(len(given.measurements))
    )


def take_rays(mission: MissionState, given: RaysArrived) -> tuple[MissionState, tuple[RayVerdict, ...]]:
    """Return the mission with what cameras saw in its picture, and a verdict on each detection."""
    after = assimilate(
        mission.picture,
        mission.watch,
        given.rays,
        given.time_s,
        hosts_m=given.hosts_m,
        rules=mission.rules.detections,
        track_rules=mission.rules.tracks,
        clock=mission.rules.reports,
    )
    return replace(mission, picture=after.picture, watch=after.watch), after.verdicts


def situation(mission: MissionState, movers: tuple[Mover, ...], now_s: float) -> Situation:
    """Return what a decision made now depends on: the threats worth planning for, the hosts and the flying plan."""
    tracks = ready(mission.picture.tracks.values(), now_s, mission.rules.replanning)
    flying = mission.plans.flying
    return Situation(
        now_s=now_s,
        threats=tuple(
            Threat(
                id=track.id,
                position_m=track.position_at(now_s),
                velocity_mps=track.velocity_mps if track.velocity_known else (0.0, 0.0, 0.0),
                size_m=track.size_m,
            )
            for track in tracks
        ),
        movers=movers,
        flying=None if flying is None else flying.decision.placement,
    )


def _started(mission: MissionState, rules: Rules) -> MissionState:
    """A service that starts again watches over no order that was sent before: hosts hover, and a new plan is due."""
    left = {
        host: replace(progress, status=OrderStatus.SUPERSEDED, note="the service was started again")
        for host, progress in mission.progress.items()
    }
    return replace(
        mission,
        rules=rules,
        autonomy=rules.autonomy,
        plans=Plans(made=mission.plans.made),
        progress=MappingProxyType(left),
        asked=None,
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
        trigger=mission.asked.trigger,
        now_s=given.time_s,
        horizon_s=horizon_s,
    )
    return replace(mission, plans=plans, asked=None)


def _without(mission: MissionState, threat_id: str, *, time_s: float) -> MissionState:
    until_s = time_s + mission.rules.dismissed_for_s
    ids = {(binding.source, binding.threat_id): until_s for binding in mission.picture.tracks[threat_id].sources}
    mission = replace(mission, dismissed=MappingProxyType({**mission.dismissed, **ids}))
    return _with_picture(mission, dismiss(mission.picture, threat_id))


def _with_plan_flying(mission: MissionState, via_m: Mapping[str, tuple[Point, ...]]) -> MissionState:
    plans = with_proposal_flying(mission.plans)
    plan = plans.flying
    assert plan is not None
    new = {
        order.host: OrderProgress(
            order_id=f"{plan.id}/{order.host}", plan_id=plan.id, order=replace(order, via_m=via_m[order.host])
        )
        for order in plan.decision.orders
    }
    return replace(mission, plans=plans, progress=MappingProxyType({**mission.progress, **new}))


def _with_event(mission: MissionState, host: str, event: Event) -> MissionState:
    progress = mission.progress.get(host)
    if progress is None or not isinstance(event, OrderEvent) or event.order_id != progress.leg_id:
        return mission
    return _with_progress(mission, host, progressed(progress, event))


def _with_progress(mission: MissionState, host: str, progress: OrderProgress) -> MissionState:
    return replace(mission, progress=MappingProxyType({**mission.progress, host: progress}))
