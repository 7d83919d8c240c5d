"""What goes over the API: requests are checked here, answers are shaped here. Degrees, UTC and WGS-84 at this edge."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, BeforeValidator, ConfigDict, Field

from hsop_gcs.api.commands import HostId, NamedHosts
from hsop_gcs.link.account import Trust
from hsop_gcs.mission.core import Wish
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.reports import AltitudeDatum
from hsop_gcs.tracks import TrackStatus

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


def _text_only(value: object) -> object:
    if not isinstance(value, str | datetime):
        raise ValueError("must be an RFC 3339 time with a time zone, such as 2026-01-31T12:00:00Z")
    return value


UtcTime = Annotated[AwareDatetime, BeforeValidator(_text_only)]


def _printable(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError("must be printable and not blank")
    return text


LONGEST_NAME = 64
ShortText = Annotated[str, Field(min_length=1, max_length=128)]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(_printable)]


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PositionIn(_Request):
    lat_deg: Annotated[Number, Field(ge=-90, le=90)]
    lon_deg: Annotated[Number, Field(ge=-180, le=180)]
    altitude_m: Annotated[Number, Field(ge=-1000, le=20000)]
    altitude_datum: Annotated[
        AltitudeDatum, Field(description="amsl, hae (WGS-84 ellipsoid) or agl (above the origin)")
    ]


class VelocityIn(_Request):
    east_mps: Annotated[Number, Field(ge=-200, le=200)]
    north_mps: Annotated[Number, Field(ge=-200, le=200)]
    up_mps: Annotated[Number, Field(ge=-200, le=200)] = 0.0


class ReportIn(_Request):
    """One sighting of one threat."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "source": "radar-1",
                    "threat_id": "t1",
                    "time": "2026-11-22T10:00:00.250Z",
                    "position": {
                        "lat_deg": 47.3978,
                        "lon_deg": 8.5461,
                        "altitude_m": 530.0,
                        "altitude_datum": "amsl",
                    },
                    "velocity": {"east_mps": 1.5, "north_mps": -0.5, "up_mps": 0.0},
                    "size_m": 1.0,
                    "sigma_m": 5.0,
                }
            ]
        }
    )

    source: Name
    threat_id: Name | None = None
    time: UtcTime
    position: PositionIn
    velocity: VelocityIn | None = None
    size_m: Annotated[Number, Field(gt=0, le=50)] | None = None
    sigma_m: Annotated[Number, Field(ge=0, le=1000, description="standard deviation of each axis")] | None = None


class FieldFault(BaseModel):
    field: str
    problem: str


class ReportResult(BaseModel):
    index: int
    status: Literal["accepted", "rejected"]
    threat: str | None = None
    errors: list[FieldFault] = Field(default_factory=list)


class ReportResults(BaseModel):
    accepted: int
    rejected: int
    results: list[ReportResult]


class PositionOut(BaseModel):
    lat_deg: float
    lon_deg: float
    altitude_amsl_m: float


class SourceIdOut(BaseModel):
    source: str
    threat_id: str


class ThreatOut(BaseModel):
    id: str
    source: str
    source_threat_id: str | None
    sources: list[SourceIdOut]
    """All ids that stand for this threat."""
    status: TrackStatus
    time: datetime
    position: PositionOut
    position_enu_m: tuple[float, float, float]
    velocity_enu_mps: tuple[float, float, float]
    velocity_known: bool
    covariance_enu: list[list[float]]
    """Of position and velocity, 6 x 6, metres and metres per second."""
    size_m: float
    sigma_m: float
    """Standard deviation of the position, each axis."""
    reports: int


class AimOut(BaseModel):
    pan_deg: float
    tilt_deg: float


class ViewOut(BaseModel):
    threat: str
    camera: str


class OrderOut(BaseModel):
    order_id: str
    plan_id: str
    status: str
    note: str
    position: PositionOut
    heading_deg: float
    aim: AimOut | None
    views: list[ViewOut]
    more_views: list[ViewOut]
    """What is seen beyond the pairs and fused into the fixes."""
    hover_error_m: float | None
    heading_error_deg: float | None
    gimbal_error_deg: float | None


class HostLinkOut(BaseModel):
    address: str | None
    """Where the host is registered: nothing else is listened to under its system id."""
    trust: Trust
    """Why what comes from there is taken for the host's: ``spoke first`` if it is neither signed nor pinned."""
    claimants: list[str]
    """Other addresses that spoke under its system id; one may be registered."""
    received: int
    rate_hz: float
    """Frames a second over the last five seconds."""
    lost: int
    """Frames missing between its sequence numbers: lost, or kept by a router for another station."""
    loss: float | None
    """Share of what is sent to us that was lost over the last five seconds."""
    bad_frames: int
    """From its address; shared by hosts behind one radio."""
    skipped_bytes: int
    """From its address, of no frame: another protocol, another baud rate, or frames that were cut."""
    refused: int
    """Frames from other addresses."""
    signature_refused: dict[str, int]
    """Frames that were not believed, by what was wrong; only over signed links."""
    round_trip_ms: float | None
    """To the autopilot and back, median of the newest five."""
    commands_resent: int
    command_noise: int
    """Acknowledgements that no command was waiting for."""
    withheld: dict[str, int]
    """What other programs wanted to send to it over our link (``mavsdk_port``) and may not."""
    not_taken: dict[str, int]
    """Messages under its system id that are not listened to, by the kind of component that sent them."""
    other_autopilots: list[int]
    """Components that speak as a second autopilot under its system id, and are not listened to."""
    faults: int
    """How often the service's own code has failed at a message of the host; its order was given up each time."""
    foreign_heartbeats: int
    """Under its autopilot's ids and not the autopilot's: of a companion computer, a camera, a tracker. Left out."""


class PendingOut(BaseModel):
    command: Wish
    since: datetime
    by_operator: bool
    """Else by the mission, which stops a flight when a gate closes or something is in its way."""
    why: str
    """Why it is not confirmed."""


class FailsafesOut(BaseModel):
    """Whether the autopilot will come home by itself, by its parameters."""

    checked: bool
    """False: they are still being read."""
    problems: list[str]


class HostOut(BaseModel):
    id: str
    system_id: int
    remote_id: list[str]
    """The ids under which others report it, as far as FLEET.toml says."""
    reported: int
    """Reports that were taken for this aircraft, and so for no threat."""
    available: bool
    unavailable_reason: str | None
    link_up: bool
    heard_s_ago: float | None
    link: HostLinkOut
    autopilot: str | None
    vehicle_type: str | None
    """What kind of vehicle the autopilot says it is; only multicopters are flown."""
    component: int
    """The autopilot's component id."""
    firmware: str | None
    armed: bool | None
    in_air: bool | None
    mode: str | None
    position: PositionOut | None
    position_enu_m: tuple[float, float, float] | None
    heading_deg: float | None
    gimbal: AimOut | None
    battery_percent: float | None
    last_text: str | None
    order: OrderOut | None
    failsafes: FailsafesOut
    take_off: str | None
    """How an ordered take-off stands, or why the last one failed; null once it is done or another order came."""
    pending: PendingOut | None
    """A hold or recall that the host has not confirmed; it is ordered again whenever the host is heard."""


class HoverOut(BaseModel):
    host: str
    position: PositionOut
    position_enu_m: tuple[float, float, float]
    heading_deg: float
    aim: AimOut | None
    views: list[ViewOut]
    more_views: list[ViewOut]
    """What is seen beyond the pairs and fused into the fixes."""


class PlanOut(BaseModel):
    id: str
    made_at: datetime
    window_start: datetime
    expires_at: datetime
    trigger: str
    reason: str
    left_out: dict[str, str]
    """Threats that the plan does not see, and why; it is for the others, and keeps clear of these."""
    orders: list[HoverOut]
    placement: dict[str, Any]
    """The plan file format."""


class PlansOut(BaseModel):
    autonomy: Autonomy
    proposed: PlanOut | None
    flying: PlanOut | None
    failed: PlanOut | None
    awaited: dict[str, str]
    """What the next plan waits for, each with the reason; empty while plans are made."""


class ReadyOut(BaseModel):
    ready: bool
    awaited: dict[str, str]
    """What is awaited, each with the reason: mission, kernels, planner, links."""


class ApprovalIn(_Request):
    model_config = ConfigDict(json_schema_extra={"examples": [{"plan_id": "P3"}]})

    plan_id: ShortText


class HoldIn(_Request):
    """Stopping is the one command that may leave out whom it is for: then it is for all."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"hosts": ["h1"]}, {}]})

    hosts: NamedHosts = None


class HostsIn(_Request):
    model_config = ConfigDict(json_schema_extra={"examples": [{"hosts": ["h1"]}, {"hosts": "all"}]})

    hosts: NamedHosts


class TakeOffIn(HostsIn):
    model_config = ConfigDict(json_schema_extra={"examples": [{"altitude_m": 20.0, "hosts": ["h1", "h2"]}]})

    altitude_m: Annotated[Number, Field(ge=2, le=120, description="above each host's home")]


class RegisterIn(_Request):
    model_config = ConfigDict(json_schema_extra={"examples": [{"host": "h1", "address": "10.0.0.5:14550"}]})

    host: HostId
    address: ShortText
    """One of the host's ``link.claimants``."""


class EventOut(BaseModel):
    number: int
    time: datetime
    host: str | None
    """None: it happened to the mission, such as ClockStepped."""
    kind: str
    """Such as LinkLost, OrderFailed, OnStation, StatusTextReceived."""
    details: dict[str, Any]


class HostsOut(BaseModel):
    hosts: list[str]


class RecalledOut(HostsOut):
    on_the_ground: list[str]
    """Recalled hosts that stand on the ground: nothing is sent to them, and a take-off under way is given up."""


class SourceCounts(BaseModel):
    """What is watched of one source of reports."""

    accepted: int
    out_of_order: int
    """Of those accepted: came after a newer one and were put in their place."""
    refused: dict[str, int]
    clock_offset_s: float
    """Its clock minus ours, less what reports take to arrive: median of the newest."""
    clock_samples: int
    last_heard: datetime


class ReportCounts(BaseModel):
    accepted: int
    refused_by_field: dict[str, int]
    sources: dict[str, SourceCounts]


class DetectionCounts(BaseModel):
    """Detections since the mission began; fixes and candidates by themselves."""

    received: int
    used: int
    bearing_only: int
    fixes: int
    candidates: int
    ambiguous: int
    unexplained: int
    refused: dict[str, int]


class PlanningHealth(BaseModel):
    ready: bool
    """False while the planner's kernels are loaded or, the first time on a machine, compiled."""
    restarts: int
    """How often the planner's process ended by itself, or hung, and was started again."""
    plans_made: int
    last_solve_s: float | None
    fault: str | None


class JournalHealth(BaseModel):
    file: str
    bytes_cut: int
    """Of a line that was being written when the service before this one ended; it had not taken effect."""
    fault: str | None
    """Why entries wait in memory; they are written when the disk takes them."""
    waiting: int
    """Entries in memory that are not written yet."""
    waiting_bytes: int
    given_up: dict[str, int]
    """Entries by kind that had no room in memory either."""
    late: int
    """Entries that took effect before they were handed to the operating system."""


class TlogHealth(BaseModel):
    fault: str | None
    lost: int
    """Frames that were left out, for the disk took none."""


class LinkHealth(BaseModel):
    """Frames and datagrams since the service started."""

    received: int
    sent: int
    bad_frames: int
    skipped_bytes: int
    unknown_messages: int
    lost: int
    not_in_fleet: int
    refused: int
    signature_refused: dict[str, int]
    peers_turned_away: int
    faults: int
    """How often the service's own code has failed at a frame or a vehicle, which then waited for the next frame."""
    dropped_datagrams: int
    """For which there was no room: the oldest."""
    superseded: int
    """States of hosts that were passed over because a newer one had come before they were read."""
    lag_s: float
    """By how much the service was late at worst in working off its link; 0 while it is in time."""
    send_errors: int
    strangers: list[str]
    """Systems that are heard and not in the fleet."""


class ClientsHealth(BaseModel):
    """Connections of clients, and what was more than one may take."""

    connections: int
    """Open now."""
    refused: dict[str, int]
    """Since the service started, by what there was too much of."""


class HealthOut(BaseModel):
    status: Literal["ok", "degraded"]
    problems: list[str]
    notes: list[str]
    """What works and could be safer."""
    time: datetime
    uptime_s: float
    autonomy: Autonomy
    threats: int
    hosts: int
    hosts_available: int
    reports: ReportCounts
    detections: DetectionCounts
    planning: PlanningHealth
    journal: JournalHealth | None
    """None: the service keeps none."""
    tlog: TlogHealth | None
    """The telemetry log; None: the service keeps none."""
    faults: dict[str, int]
    """How often the mission failed at what, by a fault of its own; the log has the details."""
    gates: dict[str, int]
    """How often each gate closed for a host that was open before, and each traffic rule stopped a flying one."""
    link: LinkHealth
    clients: ClientsHealth
