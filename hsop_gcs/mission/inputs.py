"""Everything that can happen to a mission, as values, and the rules that it is judged by."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from hsop_gcs.assignment import Departure
from hsop_gcs.detections import DetectionRules, Ray, Refused
from hsop_gcs.link.events import Event
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy, ReplanRules
from hsop_gcs.placement.problem import Point
from hsop_gcs.reports import Measurement, ReportRules
from hsop_gcs.tracks import TrackRules
from hsop_gcs.tracks.own import OwnAircraft


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Everything a mission is judged and planned by."""

    autonomy: Autonomy = Autonomy.CONFIRM
    planning: PlanningRules = field(default_factory=PlanningRules)
    replanning: ReplanRules = field(default_factory=ReplanRules)
    tracks: TrackRules = field(default_factory=TrackRules)
    reports: ReportRules = field(default_factory=ReportRules)
    detections: DetectionRules = field(default_factory=DetectionRules)
    remote_ids: Mapping[str, str] = field(default_factory=dict)
    """Which host is reported under each id (``own.remote_id``), whoever reports it and wherever."""
    attempts: int = 3
    """At one order, before its host is set aside."""
    set_aside_s: float = 60.0
    """How long the mission plans without a host that failed."""
    dismissed_for_s: float = 300.0
    """How long the reports of a dismissed threat are refused."""

    @property
    def believable(self) -> ReportRules:
        """How far a report's time may be from ours: of one older than a threat may be silent, nothing is left."""
        return replace(self.reports, max_age_s=min(self.reports.max_age_s, self.tracks.timeout_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Base of all inputs; times are mission time, see ``clock``."""

    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStarted(Input):
    """The service started, for the first time or again, with these rules and hosts."""

    rules: Rules
    hosts: tuple[str, ...]
    steady_s: float | None = None
    """The machine's steady clock, by which the next start can tell how much time has passed."""
    boot: str | None = None
    """The machine's run of which it is; see ``clock.Timeline``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockStepped(Input):
    """The system clock was set; mission time goes on as if it had not been."""

    by_s: float
    """Seconds, forward positive."""
    offset_s: float
    """System clock minus mission time, from now on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportsArrived(Input):
    """Measurements that arrived together, and where those of our own hosts were that they may be of."""

    measurements: tuple[Measurement, ...]
    own: OwnAircraft = field(default_factory=OwnAircraft)


@dataclass(frozen=True, slots=True, kw_only=True)
class RaysArrived(Input):
    """What hosts' cameras saw, as rays, and where our own hosts were."""

    rays: tuple[Ray | Refused, ...]
    own: OwnAircraft = field(default_factory=OwnAircraft)


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
    """The proposed plan was approved: its hosts depart, each when nothing is in its way."""

    plan_id: str
    departures: tuple[Departure, ...]
    """The order in which they go, and each host's way past threats and the others, from where it is now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HostDeparted(Input):
    """A host's order is about to be sent: the first time, after a stop, or by another way than before."""

    host: str
    route_m: tuple[Point, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class HostStopped(Input):
    """A flying host is stopped where it is, for a gate has closed or something is in its way; its order waits."""

    host: str
    gate: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HostGaveWay(Input):
    """A host is about to be sent out of a threat's way, whatever it was doing; its order, if it has one, waits."""

    host: str
    goal_m: Point
    threat: str
    distance_m: float
    """How near the threat was expected to come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HostThreatened(Input):
    """A threat is expected to come within the safety distance of a host that does not give way; for people."""

    host: str
    threat: str
    distance_m: float
    """How near the threat is expected to come."""
    reason: str
    """Why the host does not give way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WishLapsed(Input):
    """A hold or recall that its host has not confirmed has no object any more, and is not ordered again."""

    host: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HostRetried(Input):
    """A host's order failed and is to be tried again."""

    host: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HostSetAside(Input):
    """A host cannot carry out its order, or somebody else flies it. until_s None: until it is released."""

    host: str
    reason: str
    until_s: float | None


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
class HostsRecalled(Input):
    """An operator sent hosts home."""

    hosts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class HostsReleased(Input):
    """An operator gave hosts back to the mission; all of them: and its autonomy too."""

    hosts: tuple[str, ...]
    everyone: bool


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
class EntriesGivenUp(Input):
    """The journal does not have inputs that stood here: neither disk nor memory had room, or they were lost."""

    kinds: Mapping[str, int]
    """How many of each kind, as far as that is known."""
    from_s: float
    to_s: float
    why: str = "no room"
