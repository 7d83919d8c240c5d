"""The sections of FLEET.toml that stand for themselves; what is not said has the rules' own defaults."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator

from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import FlightLimits
from hsop_gcs.journal import KEEP_BYTES
from hsop_gcs.link.codec import message_ids
from hsop_gcs.link.endpoint import parse_endpoint, parse_pin
from hsop_gcs.link.key_files import read_key
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.planning import PlanningRules, TargetError
from hsop_gcs.mission.state import Autonomy, ReplanRules
from hsop_gcs.placement.problem import Formulation, Objective
from hsop_gcs.tracks import ConfirmAtOnce, TrackRules
from hsop_gcs.tracks.own import remote_id

_PLANNING, _REPLANNING, _TRACKS, _LIMITS = PlanningRules(), ReplanRules(), TrackRules(), FlightLimits()

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def file_read_by(load: Callable[[Path], object]) -> BeforeValidator:
    """Return a validator that reads the file a field names; a relative name is looked for beside FLEET.toml."""

    def read(value: object, info: ValidationInfo) -> object:
        if not isinstance(value, str):
            raise ValueError("must be the name of a file")
        try:
            return load((info.context or Path()) / value)
        except BadInput as error:
            raise ValueError(str(error)) from error

    return BeforeValidator(read)


class OriginSection(Section):
    lat_deg: Annotated[float, Field(ge=-90, le=90)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    altitude_amsl_m: Annotated[float, Field(ge=-500, le=9000)]


class SiteSection(Section):
    origin: OriginSection
    geoid_separation_m: Annotated[float, Field(ge=-120, le=120)] | None = None


class ServiceSection(Section):
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    autonomy: Autonomy = Rules().autonomy
    max_body_bytes: Annotated[int, Field(gt=0)] = 1_000_000
    max_connections: Annotated[int, Field(ge=8, le=10_000)] = 256
    """Connections of all clients at the same time."""
    max_connections_per_address: Annotated[int, Field(ge=4, le=10_000)] = 64
    """Programs behind one proxy share an address."""
    max_requests_per_s: Annotated[float, Field(ge=10, le=1e6)] = 1000.0
    """Requests of one address; holds and recalls are counted by themselves."""
    journal: Annotated[str, Field(min_length=1)] | None = None
    """Where everything that happens is written down; a mission found there goes on. None: nowhere."""
    journal_keep_bytes: Annotated[int, Field(ge=0)] = KEEP_BYTES
    """What closed segments of the journal may take, compressed, before the oldest lose their raw reports."""
    disk_reserve_bytes: Annotated[int, Field(ge=0)] = 500_000_000
    """With less than this left on the disk of journal or telemetry log no new plan flies; 0: it is not watched."""
    tlog: Annotated[str, Field(min_length=1)] | None = None
    """The folder in which each run writes a telemetry log of every frame received and sent. None: nowhere."""


class TargetErrorSection(Section):
    target_error_m: Positive = TargetError().target_error_m


class PlanningSection(Section):
    hosts: Literal["fewest", "all"] | Annotated[int, Field(ge=2)] | TargetErrorSection = TargetErrorSection()
    """The target: the fewest that bring every threat's expected error to it, and all of them if none do."""
    formulation: Formulation = _PLANNING.formulation
    objective: Objective = _PLANNING.objective
    horizon_s: Positive = _PLANNING.horizon_s
    safety_distance_m: Positive = _PLANNING.safety_distance_m
    safety_margin_m: NotNegative = _PLANNING.safety_margin_m
    min_separation_m: Positive = _PLANNING.min_separation_m
    fence_margin_m: NotNegative = _PLANNING.fence_margin_m
    host_position_sigma_m: NotNegative = _PLANNING.host_position_sigma_m
    host_attitude_sigma_deg: Annotated[float, Field(ge=0, le=45)] = _PLANNING.host_attitude_sigma_deg
    max_views: Annotated[int, Field(ge=2)] = _PLANNING.max_views
    settle_s: NotNegative = _PLANNING.settle_s
    keep_margin: NotNegative = _PLANNING.keep_margin
    time_limit_s: Positive = _PLANNING.time_limit_s
    departure_m: Positive = _REPLANNING.departure_m
    seed: Annotated[int, Field(ge=0)] = _PLANNING.seed


class TracksSection(Section):
    default_sigma_m: Positive = _TRACKS.default_sigma_m
    confirm_at_once: ConfirmAtOnce = _TRACKS.confirm_at_once
    timeout_s: Positive = _TRACKS.timeout_s
    acceleration_psd_m2ps3: Positive = _TRACKS.acceleration_psd_m2ps3
    max_tracks: Annotated[int, Field(ge=1, le=5000)] = _TRACKS.max_tracks
    """Threats in the picture at the same time."""


class LimitsSection(Section):
    floor_m: Finite = _LIMITS.floor_m
    ceiling_m: Finite = _LIMITS.ceiling_m
    speed_mps: Positive = _LIMITS.speed_mps
    climb_mps: Positive = _LIMITS.climb_mps
    battery_reserve_percent: Annotated[float, Field(ge=0, le=100)] = _LIMITS.battery_reserve_percent
    link_loss_max: Annotated[float, Field(ge=0, le=1)] = _LIMITS.link_loss_max

    @model_validator(mode="after")
    def _floor_below_ceiling(self) -> Self:
        if self.floor_m >= self.ceiling_m:
            raise ValueError(f"floor_m {self.floor_m:g} must be below ceiling_m {self.ceiling_m:g}")
        return self


def _connection(text: str) -> str:
    try:
        return str(parse_endpoint(text))
    except BadInput as error:
        raise ValueError(error.problem) from error


def _pin(text: str) -> str:
    try:
        return str(parse_pin(text))
    except BadInput as error:
        raise ValueError(error.problem) from error


def _key_file(name: str, info: ValidationInfo) -> str:
    path: Path = (info.context or Path()) / name
    try:
        read_key(path)
    except BadInput as error:
        raise ValueError(error.problem) from error
    return str(path)


def _messages(names: tuple[str, ...]) -> tuple[str, ...]:
    message_ids(names)
    return names


KeyFile = Annotated[str, AfterValidator(_key_file)]


class SigningSection(Section):
    key_file: KeyFile | None = None
    """32 bytes or 64 hex digits, readable by its owner only; hosts may have keys of their own. None: no signing."""
    link_id: Annotated[int, Field(ge=0, le=255)] = 0
    """Of the first endpoint, the others count up: two ground stations of one id must not share them."""
    allow_unsigned: Annotated[tuple[str, ...], AfterValidator(_messages)] = ("RADIO_STATUS",)
    timestamp_file: Annotated[str, Field(min_length=1)] | None = None
    """Where the newest timestamp is kept. None: beside the key."""


def _told_by(text: str) -> str:
    if not remote_id(text):
        raise ValueError("must not be blank")
    return text


RemoteId = Annotated[str, Field(max_length=64), AfterValidator(_told_by)]


class HostSection(Section):
    id: Annotated[str, Field(min_length=1, max_length=64)]
    system_id: Annotated[int, Field(ge=1, le=250)]
    connection: Annotated[str, AfterValidator(_connection)]
    address: Annotated[str, AfterValidator(_pin)] | None = None
    """The only address, with or without a port, under which the host is believed. None: whoever speaks first is."""
    rig: str | None = None
    """Names one of ``[rigs.NAME]``; None: ``[rig]``."""
    remote_id: tuple[RemoteId, ...] = ()
    """The ids under which others report it, such as its Remote ID's serial number or its ADS-B address."""
    key_file: KeyFile | None = None
    """Instead of signing.key_file."""
    mavsdk_port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """UDP port on this machine through which MAVSDK reaches the host over our link. None: it does not."""
