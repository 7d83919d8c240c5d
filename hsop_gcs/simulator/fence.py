"""A simulated vehicle's geofence: polygons and circles that a ground station uploads by the mission protocol.

    MISSION_COUNT ──► MISSION_REQUEST_INT(0) ──item──► ... ──last item──► MISSION_ACK: all of it, or nothing, is kept

Source: mavlink.io/en/services/mission.html.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import shapely

from hsop_gcs.link.enums import MavCmd, MavMissionResult, MavMissionType
from hsop_gcs.link.messages import (
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
)
from hsop_gcs.simulator.flight import Point
from hsop_gcs.simulator.gimbal import Identity

_MOST_ITEMS = 250
_LARGEST = 1e5
_POLYGONS: dict[int, bool] = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES: dict[int, bool] = {MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True, MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False}

Area = tuple[bool, shapely.Polygon]
"""Whether the vehicle must be inside of it, else outside; local ENU, metres."""


class Fence:
    """The vehicle's half of the protocol, and what it keeps of it."""

    def __init__(self, place_of: Callable[[float, float], Point], inside_all: bool) -> None:
        """place_of: local ENU of a latitude and longitude. inside_all: whether of one inclusion or of each."""
        self.items: list[MissionItemInt] = []
        self._areas: list[Area] = []
        self._place_of = place_of
        self._inside_all = inside_all
        self._sender: Identity | None = None
        self._wanted = 0
        self._arriving: list[MissionItemInt] = []

    def outside(self, target_m: Point) -> bool:
        """Whether the fence forbids a place."""
        point = shapely.Point(target_m[:2])
        inclusions = [area.covers(point) for included, area in self._areas if included]
        kept_out = any(area.covers(point) for included, area in self._areas if not included)
        return kept_out or (bool(inclusions) and not (all if self._inside_all else any)(inclusions))

    def hear(self, message: Message, sender: Identity) -> Message | None:
        """Return the answer to a message of the protocol; None to what is none, or of another kind of mission."""
        kind = getattr(message, "mission_type", None)
        if kind != MavMissionType.FENCE and not (isinstance(message, MissionClearAll) and kind == MavMissionType.ALL):
            return None
        match message:
            case MissionRequestList():
                return _to(sender, MissionCount(count=len(self.items), mission_type=MavMissionType.FENCE))
            case MissionRequestInt(seq=seq) if seq < len(self.items):
                return _to(sender, self.items[seq])
            case MissionClearAll():
                return self._keep([], sender)
            case MissionCount(count=count) if count > _MOST_ITEMS:
                return _acknowledge(MavMissionResult.NO_SPACE, sender)
            case MissionCount(count=count):
                self._sender, self._wanted, self._arriving = sender, count, []
                return self._go_on(sender)
            case MissionItemInt(seq=seq) if sender == self._sender:
                if seq == len(self._arriving):
                    self._arriving.append(message)
                return self._go_on(sender)
        return None

    def _go_on(self, sender: Identity) -> Message:
        if len(self._arriving) < self._wanted:
            return _to(sender, MissionRequestInt(seq=len(self._arriving), mission_type=MavMissionType.FENCE))
        self._sender = None
        return self._keep(self._arriving, sender)

    def _keep(self, items: Sequence[MissionItemInt], sender: Identity) -> Message:
        try:
            self._areas = self._read(items)
        except ValueError:
            return _acknowledge(MavMissionResult.INVALID, sender)
        self.items = list(items)
        return _acknowledge(MavMissionResult.ACCEPTED, sender)

    def _read(self, items: Sequence[MissionItemInt]) -> list[Area]:
        """Raises ValueError for items that are no areas."""
        areas: list[Area] = []
        at = 0
        while at < len(items):
            kind, size = items[at].command, items[at].param1
            if not 0 < size < _LARGEST:
                raise ValueError(f"{size} corners, or metres of radius")
            if kind in _CIRCLES:
                included, count = _CIRCLES[kind], 1
                area = shapely.Point(self._place(items[at])).buffer(size)
            elif kind in _POLYGONS:
                included, count = _POLYGONS[kind], math.ceil(size)
                corners = [each for each in items[at : at + count] if each.command == kind]
                if len(corners) != count:
                    raise ValueError(f"{len(corners)} of {count} corners")
                area = shapely.Polygon([self._place(each) for each in corners])
            else:
                raise ValueError(f"command {kind} is no part of a fence")
            if not area.is_valid:
                raise ValueError("the sides of an area cross")
            areas.append((included, area))
            at += count
        return areas

    def _place(self, item: MissionItemInt) -> tuple[float, float]:
        lat_deg, lon_deg = item.x * 1e-7, item.y * 1e-7
        if abs(lat_deg) >= 90 or abs(lon_deg) > 180:
            raise ValueError(f"no place is at {lat_deg}, {lon_deg}")
        east, north, _ = self._place_of(lat_deg, lon_deg)
        return east, north


def _acknowledge(result: MavMissionResult, sender: Identity) -> Message:
    return _to(sender, MissionAck(type=result, mission_type=MavMissionType.FENCE))


def _to(sender: Identity, message: MissionAck | MissionCount | MissionItemInt | MissionRequestInt) -> Message:
    return replace(message, target_system=sender[0], target_component=sender[1])
