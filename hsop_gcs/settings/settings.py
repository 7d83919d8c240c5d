"""All of FLEET.toml, checked as a whole, and the plain values it gives to the layers below."""

import math
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.fleet import Fleet, FlightLimits, Host
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.endpoint import parse_endpoint
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.planning import PlanningRules, TargetError
from hsop_gcs.mission.state import ReplanRules
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon
from hsop_gcs.reports import Site
from hsop_gcs.settings.areas import Corner, FenceSection, KeepOutSection
from hsop_gcs.settings.rigs import RigSection
from hsop_gcs.settings.sections import (
    HostSection,
    LimitsSection,
    PlanningSection,
    Section,
    ServiceSection,
    SigningSection,
    SiteSection,
    TargetErrorSection,
    TracksSection,
)
from hsop_gcs.tracks import TrackRules
from hsop_gcs.tracks.own import remote_id

_FAR_DEG = 2.0
"""A corner so far away is a mistake, mostly latitude and longitude the wrong way round."""


class Settings(Section):
    """All of FLEET.toml."""

    site: SiteSection
    service: ServiceSection = ServiceSection()
    planning: PlanningSection = PlanningSection()
    tracks: TracksSection = TracksSection()
    limits: LimitsSection = LimitsSection()
    rig: RigSection = RigSection()
    rigs: dict[str, RigSection] = Field(default_factory=dict)
    signing: SigningSection = SigningSection()
    fence: FenceSection | None = None
    keep_out: tuple[KeepOutSection, ...] = ()
    hosts: Annotated[tuple[HostSection, ...], Field(min_length=1)]

    @field_validator("hosts")
    @classmethod
    def _unique(cls, hosts: tuple[HostSection, ...]) -> tuple[HostSection, ...]:
        twice = [
            f"two hosts have {name} {value!r}"
            for name in ("id", "system_id", "mavsdk_port")
            for value, count in Counter(getattr(host, name) for host in hosts).items()
            if count > 1 and value is not None
        ]
        if twice:
            raise ValueError("; ".join(twice))
        return hosts

    @field_validator("hosts")
    @classmethod
    def _remote_ids_unique(cls, hosts: tuple[HostSection, ...]) -> tuple[HostSection, ...]:
        owners: dict[str, str] = {}
        for host in hosts:
            for each in host.remote_id:
                before = owners.setdefault(remote_id(each), host.id)
                if before != host.id:
                    raise ValueError(f"hosts {before!r} and {host.id!r} both have remote_id {each!r}")
                if [remote_id(other) for other in host.remote_id].count(remote_id(each)) > 1:
                    raise ValueError(f"host {host.id!r} has remote_id {each!r} twice")
        return hosts

    @model_validator(mode="after")
    def _pinned_where_many_speak(self) -> Self:
        for host in self.hosts:
            if host.address is not None and parse_endpoint(host.connection).kind != "udpin":
                raise ValueError(f"host {host.id!r}: address is for a udpin connection; {host.connection} has only one")
        return self

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

    @model_validator(mode="after")
    def _connections_can_all_be_open(self) -> Self:
        for one, other in combinations(dict.fromkeys(host.connection for host in self.hosts), 2):
            if parse_endpoint(one).excludes(parse_endpoint(other)):
                raise ValueError(f"hosts: {one} and {other} cannot be open at a time: write both the same way")
        return self

    @model_validator(mode="after")
    def _mavsdk_beside_the_links(self) -> Self:
        ours = {each.port for each in (parse_endpoint(host.connection) for host in self.hosts) if each.kind == "udpin"}
        for host in self.hosts:
            if host.mavsdk_port in ours:
                raise ValueError(f"hosts: mavsdk_port {host.mavsdk_port} of {host.id!r} is that of a connection")
        return self

    def key_files(self) -> dict[str, Path]:
        """Return the signing key of every connection that has one."""
        files = {host.connection: host.key_file or self.signing.key_file for host in self.hosts}
        return {connection: Path(file) for connection, file in sorted(files.items()) if file is not None}

    def to_site(self) -> Site:
        """Return the local frame at the site's origin, and what is known of its altitudes."""
        origin = GeodeticPoint(**self.site.origin.model_dump())
        return Site(frame=LocalFrame(origin), geoid_separation_m=self.site.geoid_separation_m)

    def to_fleet(self) -> Fleet:
        """Return the hosts with their rigs; one that carries what most do has none of its own."""
        common = self.rig.to_rig(CameraRig())
        rigs: dict[str | None, CameraRig | None] = {None: None}
        for name, section in self.rigs.items():
            own = section.to_rig(common)
            rigs[name] = None if own == common else own
        return Fleet(
            hosts=tuple(
                Host(**host.model_dump(exclude={"rig", "key_file", "mavsdk_port", "address"}), rig=rigs[host.rig])
                for host in self.hosts
            ),
            limits=FlightLimits(**self.limits.model_dump()),
            rig=common,
        )

    def to_planning_rules(self) -> PlanningRules:
        """Return what plans must keep to. Raises BadInput for an area that is none."""
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
        """Return all that the mission goes by. Raises BadInput for an area that is none."""
        return Rules(
            autonomy=self.service.autonomy,
            planning=self.to_planning_rules(),
            tracks=TrackRules(**self.tracks.model_dump()),
            replanning=ReplanRules(departure_m=self.planning.departure_m),
            remote_ids={remote_id(each): host.id for host in self.hosts for each in host.remote_id},
        )


def _to_polygon(corners: tuple[Corner, ...], frame: LocalFrame) -> Polygon:
    """Return the corners in the local plane, metres."""
    altitude_m = frame.origin.altitude_amsl_m
    places = [frame.to_enu(GeodeticPoint(lat_deg=a, lon_deg=b, altitude_amsl_m=altitude_m)) for a, b in corners]
    return tuple((float(east), float(north)) for east, north, _ in places)
