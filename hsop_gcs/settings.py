"""FLEET.toml: read once, checked whole, turned into the plain values the layers below work with."""

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from hsop_gcs.areas import Area, read_areas
from hsop_gcs.cameras.calibration import load_fisheye
from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import Fleet, FlightLimits, Host
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import message_ids
from hsop_gcs.link.endpoint import parse_endpoint
from hsop_gcs.link.key_files import read_key
from hsop_gcs.mission.core import Rules
from hsop_gcs.mission.pipeline import PlanningRules, TargetError
from hsop_gcs.mission.state import Autonomy, ReplanRules
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon, require_area
from hsop_gcs.placement.problem import Formulation, Objective
from hsop_gcs.reports import Site
from hsop_gcs.tracks import ConfirmAtOnce, TrackRules

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_FAR_DEG = 2.0
"""A corner so far away is a mistake, mostly latitude and longitude the wrong way round."""

Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class OriginSection(_Section):
    lat_deg: Annotated[float, Field(ge=-90, le=90)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    altitude_amsl_m: Annotated[float, Field(ge=-500, le=9000)]


class SiteSection(_Section):
    origin: OriginSection
    geoid_separation_m: Annotated[float, Field(ge=-120, le=120)] | None = None


class ServiceSection(_Section):
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    autonomy: Autonomy = Autonomy.CONFIRM
    max_body_bytes: Annotated[int, Field(gt=0)] = 1_000_000
    journal: Annotated[str, Field(min_length=1)] | None = None
    """Where everything that happens is written down; a mission found there goes on. None: nowhere."""
    tlog: Annotated[str, Field(min_length=1)] | None = None
    """The folder in which each run writes a telemetry log of every frame received and sent. None: nowhere."""


class TargetErrorSection(_Section):
    target_error_m: Positive = 1.0


class PlanningSection(_Section):
    hosts: Literal["fewest", "all"] | Annotated[int, Field(ge=2)] | TargetErrorSection = TargetErrorSection()
    """The target: the fewest that bring every threat's expected error to it, and all of them if none do."""
    formulation: Formulation = Formulation.OPERATIONAL
    objective: Objective = Objective.LETTER
    horizon_s: Positive = 10.0
    safety_distance_m: Positive = 20.0
    safety_margin_m: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 4.0
    min_separation_m: Positive = 10.0
    host_position_sigma_m: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    host_attitude_sigma_deg: Annotated[float, Field(ge=0, le=45)] = 0.0
    max_views: Annotated[int, Field(ge=2)] = 2
    settle_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 3.0
    keep_margin: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.2
    time_limit_s: Positive = 1.0
    departure_m: Positive = 5.0
    seed: Annotated[int, Field(ge=0)] = 0


class TracksSection(_Section):
    default_sigma_m: Positive = 2.0
    """Of a position whose source does not say."""
    confirm_at_once: ConfirmAtOnce = ConfirmAtOnce.ID
    timeout_s: Positive = 10.0


class LimitsSection(_Section):
    floor_m: Finite = 5.0
    ceiling_m: Finite = 120.0
    speed_mps: Positive = 8.0
    climb_mps: Positive = 1.5
    battery_reserve_percent: Annotated[float, Field(ge=0, le=100)] = 20.0
    """A host with less is not sent; 0: it does not matter."""
    link_loss_max: Annotated[float, Field(ge=0, le=1)] = 0.6
    """A host of whose messages a greater share is lost is not sent."""

    @model_validator(mode="after")
    def _floor_below_ceiling(self) -> Self:
        if self.floor_m >= self.ceiling_m:
            raise ValueError(f"floor_m {self.floor_m:g} must be below ceiling_m {self.ceiling_m:g}")
        return self


def _an_area(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    try:
        require_area(corners, "polygon")
    except BadInput as error:
        raise ValueError(error.problem) from error
    return corners


Corner = tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]]
"""Latitude and longitude, degrees."""
Corners = Annotated[tuple[Corner, ...], Field(min_length=3), AfterValidator(_an_area)]


def _read(value: object, info: ValidationInfo) -> tuple[Area, ...]:
    """Read a file of areas; a relative name is looked for beside FLEET.toml."""
    if not isinstance(value, str):
        raise ValueError("must be the name of a file")
    try:
        areas = read_areas((info.context or Path()) / value)
        for area in areas:
            require_area(area.corners, value)
    except BadInput as error:
        raise ValueError(str(error)) from error
    return areas


AreaFile = Annotated[tuple[Area, ...], BeforeValidator(_read)]
"""The name of a GeoJSON, QGroundControl .plan or KML file; what it holds."""


class FenceSection(_Section):
    inside: Corners | None = None
    file: AreaFile | None = None
    """Its exclusions are keep-outs."""

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if (self.inside is None) == (self.file is None):
            raise ValueError("needs inside or file, one of them")
        if self.file is not None and all(area.keep_out for area in self.file):
            raise ValueError("file: holds exclusions only, nothing to be inside of")
        return self

    def areas(self) -> tuple[Area, ...]:
        return self.file or (Area(corners=self.inside or ()),)


class KeepOutSection(_Section):
    polygon: Corners | None = None
    file: AreaFile | None = None
    floor_m: Finite | None = None
    ceiling_m: Finite | None = None
    """Metres above the origin, like those of the flight limits; None: what the file says, or without end."""

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if (self.polygon is None) == (self.file is None):
            raise ValueError("needs polygon or file, one of them")
        for area in self.areas():
            floor_m, ceiling_m = area.floor_m, area.ceiling_m
            if floor_m is not None and ceiling_m is not None and floor_m >= ceiling_m:
                raise ValueError(f"floor_m {floor_m:g} must be below ceiling_m {ceiling_m:g}")
        if self.file is not None and any(area.keep_out is False for area in self.file):
            raise ValueError("file: holds inclusions; they belong into [fence]")
        return self

    def areas(self) -> tuple[Area, ...]:
        return tuple(
            replace(
                area,
                floor_m=area.floor_m if self.floor_m is None else self.floor_m,
                ceiling_m=area.ceiling_m if self.ceiling_m is None else self.ceiling_m,
            )
            for area in self.file or (Area(corners=self.polygon or ()),)
        )


class PeripheralSection(_Section):
    focal_length_mm: Positive = 1.0
    sensor_width_mm: Positive = 3.3
    resolution_px: Annotated[int, Field(gt=0)] = 1504
    distortion: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 0.0)
    min_pixels: Positive = 5.0


class CentralSection(_Section):
    focal_length_mm: Positive = 4.8
    sensor_width_mm: Positive = 4.8
    resolution_px: Annotated[int, Field(gt=0)] = 1280
    fov_deg: Annotated[float, Field(gt=0, lt=180)] = 53.0
    min_pixels: Positive = 30.0


def _calibrated(value: object, info: ValidationInfo) -> FisheyeCamera:
    """Read a calibration; a relative name is looked for beside FLEET.toml."""
    if not isinstance(value, str):
        raise ValueError("must be the name of a file")
    try:
        return load_fisheye((info.context or Path()) / value)
    except BadInput as error:
        raise ValueError(str(error)) from error


CalibrationFile = Annotated[FisheyeCamera, BeforeValidator(_calibrated)]
"""The name of an OpenCV fisheye calibration, YAML or JSON; the lens it describes."""


class RigSection(_Section):
    """A section that is missing from ``[rigs.NAME]`` is that of ``[rig]``, and from that the letter's."""

    peripheral: PeripheralSection | None = None
    calibration: CalibrationFile | None = None
    """Of the fisheyes: takes the place of all that ``peripheral`` says but ``min_pixels``."""
    central: CentralSection | None = None
    tilt_deg: tuple[Finite, Finite] | None = None
    pan_deg: tuple[Finite, Finite] | None = None
    """How far the central camera's gimbal tilts, and pans from the heading; None: as far as one can."""

    @model_validator(mode="after")
    def _some_camera(self) -> Self:
        if self.calibration is not None and self.peripheral is not None:
            known = self.peripheral.model_fields_set - {"min_pixels"}
            if known:
                raise ValueError(f"the calibration file says what peripheral.{min(known)} is")
        try:
            self.to_rig(CameraRig())
        except BadInput as error:
            raise ValueError(str(error)) from error
        return self

    def to_rig(self, otherwise: CameraRig) -> CameraRig:
        lens = otherwise.peripheral
        if self.calibration is not None:
            lens = replace(self.calibration, min_pixels=(self.peripheral or PeripheralSection()).min_pixels)
        elif self.peripheral is not None:
            lens = FisheyeCamera(**self.peripheral.model_dump())
        central = otherwise.central if self.central is None else PinholeCamera(**self.central.model_dump())
        return CameraRig(
            peripheral=lens,
            central=central,
            tilt_deg=self.tilt_deg or otherwise.tilt_deg,
            pan_deg=self.pan_deg or otherwise.pan_deg,
        )


def _connection(text: str) -> str:
    try:
        return str(parse_endpoint(text))
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


class SigningSection(_Section):
    key_file: KeyFile | None = None
    """32 bytes or 64 hex digits, readable by its owner only; hosts may have keys of their own. None: no signing."""
    link_id: Annotated[int, Field(ge=0, le=255)] = 0
    """Of the first endpoint, the others count up: two ground stations of one id must not share them."""
    allow_unsigned: Annotated[tuple[str, ...], AfterValidator(_messages)] = ("RADIO_STATUS",)
    timestamp_file: Annotated[str, Field(min_length=1)] | None = None
    """Where the newest timestamp is kept. None: beside the key."""


class HostSection(_Section):
    id: Annotated[str, Field(min_length=1, max_length=64)]
    system_id: Annotated[int, Field(ge=1, le=250)]
    connection: Annotated[str, AfterValidator(_connection)]
    rig: str | None = None
    """Names one of ``[rigs.NAME]``; None: ``[rig]``."""
    key_file: KeyFile | None = None
    """Instead of signing.key_file."""


class Settings(_Section):
    """All of FLEET.toml."""

    site: SiteSection
    service: ServiceSection = ServiceSection()
    planning: PlanningSection = PlanningSection()
    tracks: TracksSection = TracksSection()
    limits: LimitsSection = LimitsSection()
    rig: RigSection = RigSection()
    rigs: dict[str, RigSection] = {}
    signing: SigningSection = SigningSection()
    fence: FenceSection | None = None
    keep_out: tuple[KeepOutSection, ...] = ()
    hosts: Annotated[tuple[HostSection, ...], Field(min_length=1)]

    @field_validator("hosts")
    @classmethod
    def _unique(cls, hosts: tuple[HostSection, ...]) -> tuple[HostSection, ...]:
        twice = [
            f"two hosts have {name} {value!r}"
            for name in ("id", "system_id")
            for value, count in Counter(getattr(host, name) for host in hosts).items()
            if count > 1
        ]
        if twice:
            raise ValueError("; ".join(twice))
        return hosts

    @model_validator(mode="after")
    def _rigs_exist(self) -> Self:
        for host in self.hosts:
            if host.rig is not None and host.rig not in self.rigs:
                raise ValueError(f"host {host.id!r}: there is no [rigs.{host.rig}]")
        return self

    @model_validator(mode="after")
    def _near_the_origin(self) -> Self:
        origin = self.site.origin
        for name, sections in (("fence", (self.fence,) if self.fence else ()), ("keep_out", self.keep_out)):
            for area in (area for section in sections for area in section.areas()):
                away_deg = max(math.dist((origin.lat_deg, origin.lon_deg), corner) for corner in area.corners)
                if away_deg > _FAR_DEG:
                    raise ValueError(f"{name}: has a corner {away_deg:.1f}° from site.origin")
        return self

    @model_validator(mode="after")
    def _one_key_per_connection(self) -> Self:
        keys: dict[str, str | None] = {}
        for host in self.hosts:
            if keys.setdefault(host.connection, host.key_file) != host.key_file:
                raise ValueError(f"hosts: those behind {host.connection} must have the same key_file")
        return self

    def key_files(self) -> dict[str, Path]:
        """Return the signing key of every connection that has one."""
        files = {host.connection: host.key_file or self.signing.key_file for host in self.hosts}
        return {connection: Path(file) for connection, file in sorted(files.items()) if file is not None}

    def to_site(self) -> Site:
        origin = GeodeticPoint(**self.site.origin.model_dump())
        return Site(frame=LocalFrame(origin), geoid_separation_m=self.site.geoid_separation_m)

    def to_fleet(self) -> Fleet:
        common = self.rig.to_rig(CameraRig())
        rigs: dict[str | None, CameraRig | None] = {None: None}
        for name, section in self.rigs.items():
            own = section.to_rig(common)
            rigs[name] = None if own == common else own
        return Fleet(
            hosts=tuple(
                Host(**host.model_dump(exclude={"rig", "key_file"}), rig=rigs[host.rig]) for host in self.hosts
            ),
            limits=FlightLimits(**self.limits.model_dump()),
            rig=common,
        )

    def to_planning_rules(self) -> PlanningRules:
        fleet = self.to_fleet()
        given = self.planning.model_dump(exclude={"departure_m", "hosts"})
        hosts = self.planning.hosts
        wanted = TargetError(**hosts.model_dump()) if isinstance(hosts, TargetErrorSection) else hosts
        return PlanningRules(**given, hosts=wanted, limits=fleet.limits, rig=fleet.rig, airspace=self.to_airspace())

    def to_airspace(self) -> Airspace:
        """Return the fence and the keep-out areas in the local frame. Raises BadInput for what is no area."""
        frame = self.to_site().frame
        fence = () if self.fence is None else self.fence.areas()
        keep_outs = [area for area in fence if area.keep_out]
        keep_outs += [area for section in self.keep_out for area in section.areas()]
        return Airspace(
            inside=tuple(_to_polygon(area.corners, frame) for area in fence if not area.keep_out),
            keep_outs=tuple(
                KeepOut(
                    polygon=_to_polygon(area.corners, frame),
                    floor_m=-math.inf if area.floor_m is None else area.floor_m,
                    ceiling_m=math.inf if area.ceiling_m is None else area.ceiling_m,
                )
                for area in keep_outs
            ),
        )

    def to_rules(self) -> Rules:
        return Rules(
            autonomy=self.service.autonomy,
            planning=self.to_planning_rules(),
            tracks=TrackRules(**self.tracks.model_dump()),
            replanning=ReplanRules(horizon_s=self.planning.horizon_s, departure_m=self.planning.departure_m),
        )


def _to_polygon(corners: tuple[Corner, ...], frame: LocalFrame) -> Polygon:
    """Return the corners in the local plane, metres."""
    altitude_m = frame.origin.altitude_amsl_m
    places = [frame.to_enu(GeodeticPoint(lat_deg=a, lon_deg=b, altitude_amsl_m=altitude_m)) for a, b in corners]
    return tuple((float(east), float(north)) for east, north, _ in places)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something wrong with FLEET.toml; ``line`` is where the field, or the table it belongs to, is written."""

    field: str
    problem: str
    line: int | None = None

    def __str__(self) -> str:
        return f"{self.field}: {self.problem}"


def check_settings(path: Path) -> tuple[Settings | None, tuple[Fault, ...]]:
    """Read FLEET.toml; return the settings, or None and everything that is wrong with them."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        return None, (Fault(field="--config", problem=f"cannot read {str(path)!r}: {error}"),)
    try:
        settings = Settings.model_validate(tomllib.loads(text), context=path.parent)
    except tomllib.TOMLDecodeError as error:
        return None, (Fault(field=str(path), problem=f"not TOML: {error}"),)
    except ValidationError as error:
        lines = _lines(text)
        return None, tuple(
            Fault(field=field, problem=problem, line=_line_of(field, lines)) for field, problem in _faults(error)
        )
    return settings, ()


def read_settings(path: Path) -> Settings:
    """Read FLEET.toml. Raises BadInput that names the field and the value of the first fault."""
    settings, faults = check_settings(path)
    if settings is None:
        more = f" (and {len(faults) - 1} more: hsop-gcs check-config {path})" if len(faults) > 1 else ""
        raise BadInput(faults[0].field, faults[0].problem + more)
    return settings


def first_fault(error: ValidationError) -> tuple[str, str]:
    """Return the field of the first fault (``hosts.0.system_id``), and what is wrong with which value."""
    return next(_faults(error))


def _faults(error: ValidationError) -> Iterator[tuple[str, str]]:
    for fault in error.errors(include_url=False):
        field = ".".join(str(part) for part in fault["loc"]) or "input"
        problem = fault["msg"].removeprefix("Value error, ")
        shown = "" if fault["type"] in ("missing", "value_error") else f" (given: {_short(fault.get('input'))})"
        yield field, problem[:1].lower() + problem[1:] + shown


def _lines(text: str) -> dict[str, int]:
    """The line of every table and key that is written on a line of its own, by its name as faults have it."""
    lines: dict[str, int] = {}
    table, seen = "", Counter[str]()
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*(\[\[?)\s*([\w.\s-]+?)\s*\]", line)
        key = re.match(r"\s*([\w.-]+)\s*=", line)
        if header is not None:
            table = header[2]
            if header[1] == "[[":
                table = f"{header[2]}.{seen[header[2]]}"
                seen[header[2]] += 1
            lines.setdefault(header[2], number)
            lines[table] = number
        elif key is not None:
            lines[f"{table}.{key[1]}" if table else key[1]] = number
    return lines


def _line_of(field: str, lines: dict[str, int]) -> int | None:
    while field and field not in lines:
        field = field.rpartition(".")[0]
    return lines.get(field)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
