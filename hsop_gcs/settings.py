"""FLEET.toml: read once, checked whole, turned into the plain values the layers below work with."""

import math
import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import Fleet, FlightLimits, Host
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.mission.core import Rules
from hsop_gcs.mission.pipeline import PlanningRules, TargetError
from hsop_gcs.mission.state import Autonomy, ReplanRules
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon
from hsop_gcs.placement.problem import Formulation, Objective
from hsop_gcs.reports import Site
from hsop_gcs.tracks import ConfirmAtOnce, TrackRules

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
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
    safety_margin_m: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 1.0
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

    @model_validator(mode="after")
    def _floor_below_ceiling(self) -> Self:
        if self.floor_m >= self.ceiling_m:
            raise ValueError(f"floor_m {self.floor_m:g} must be below ceiling_m {self.ceiling_m:g}")
        return self


Corner = tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]]
"""Latitude and longitude, degrees."""
Corners = Annotated[tuple[Corner, ...], Field(min_length=3)]


class FenceSection(_Section):
    inside: Corners


class KeepOutSection(_Section):
    polygon: Corners
    floor_m: Finite | None = None
    ceiling_m: Finite | None = None
    """Metres above the origin, like those of the flight limits; None: without end."""


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


class RigSection(_Section):
    peripheral: PeripheralSection = PeripheralSection()
    central: CentralSection = CentralSection()


class HostSection(_Section):
    id: Annotated[str, Field(min_length=1, max_length=64)]
    system_id: Annotated[int, Field(ge=1, le=250)]
    connection: Annotated[str, Field(pattern=r"^udp(in|out):[^:\s]+:\d{1,5}$")]


class Settings(_Section):
    """All of FLEET.toml."""

    site: SiteSection
    service: ServiceSection = ServiceSection()
    planning: PlanningSection = PlanningSection()
    tracks: TracksSection = TracksSection()
    limits: LimitsSection = LimitsSection()
    rig: RigSection = RigSection()
    fence: FenceSection | None = None
    keep_out: tuple[KeepOutSection, ...] = ()
    hosts: Annotated[tuple[HostSection, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        for name in ("id", "system_id"):
            seen: set[object] = set()
            for host in self.hosts:
                value = getattr(host, name)
                if value in seen:
                    raise ValueError(f"two hosts have {name} {value!r}")
                seen.add(value)
        return self

    def to_site(self) -> Site:
        origin = GeodeticPoint(**self.site.origin.model_dump())
        return Site(frame=LocalFrame(origin), geoid_separation_m=self.site.geoid_separation_m)

    def to_fleet(self) -> Fleet:
        return Fleet(
            hosts=tuple(Host(**host.model_dump()) for host in self.hosts),
            limits=FlightLimits(**self.limits.model_dump()),
            rig=CameraRig(
                peripheral=FisheyeCamera(**self.rig.peripheral.model_dump()),
                central=PinholeCamera(**self.rig.central.model_dump()),
            ),
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
        return Airspace(
            inside=() if self.fence is None else (_to_polygon(self.fence.inside, frame),),
            keep_outs=tuple(
                KeepOut(
                    polygon=_to_polygon(area.polygon, frame),
                    floor_m=-math.inf if area.floor_m is None else area.floor_m,
                    ceiling_m=math.inf if area.ceiling_m is None else area.ceiling_m,
                )
                for area in self.keep_out
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


def read_settings(path: Path) -> Settings:
    """Read FLEET.toml. Raises BadInput that names the field and the value of the first fault."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput("--config", f"cannot read {str(path)!r}: {error}") from error
    try:
        return Settings.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise BadInput(str(path), f"not TOML: {error}") from error
    except ValidationError as error:
        raise BadInput(*first_fault(error)) from error


def first_fault(error: ValidationError) -> tuple[str, str]:
    """Return the field of the first fault (``hosts.0.system_id``), and what is wrong with which value."""
    fault = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in fault["loc"]) or "input"
    problem = fault["msg"].removeprefix("Value error, ")
    value = fault.get("input")
    shown = "" if fault["type"] in ("missing", "value_error") else f" (given: {_short(value)})"
    return field, problem[:1].lower() + problem[1:] + shown


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
