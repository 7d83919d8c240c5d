"""Whether a straight flight stays inside the fence and out of the keep-out areas, and the corners to fly around."""

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from hsop_gcs.assignment.separation import Flight
from hsop_gcs.placement.airspace import Airspace, KeepOut, PlanePoint, Polygon
from hsop_gcs.placement.problem import Point

_TOLERANCE_M = 0.1
"""A hover point on the very edge may be flown to."""
_STEP_M = 1.0
_BESIDE_M = 4.0
"""How far from an edge the corners are that flights go around by."""
_QUARTER = 3
"""Sides of a quarter of a circle."""


def why_outside(airspace: Airspace, way_m: tuple[Point, ...]) -> str | None:
    """Return where a way through these points, straight from each to the next, leaves the airspace; None: nowhere.

    A way that begins outside may lead straight back in, and must then stay inside.
    """
    problem = _why_outside(airspace, way_m)
    entry_m = None if problem is None else _entry_m(airspace, *way_m[:2])
    return problem if entry_m is None else _why_outside(airspace, (entry_m, *way_m[1:]))


def _entry_m(airspace: Airspace, start_m: Point, end_m: Point) -> Point | None:
    """Return where a line that begins outside is inside for the first time; None if it does not lead straight there."""
    before_m, way = airspace.room_m(start_m), np.array(end_m) - start_m
    if before_m >= 0:
        return None
    for share in np.linspace(0.0, 1.0, 2 + math.ceil(float(np.linalg.norm(way)) / _STEP_M))[1:]:
        east, north, up = (start_m + share * way).tolist()
        room_m = airspace.room_m((east, north, up))
        if room_m >= 0:
            return east, north, up
        if room_m <= before_m:
            return None
        before_m = room_m
    return None


def _why_outside(airspace: Airspace, way_m: tuple[Point, ...]) -> str | None:
    for a, b in pairwise(way_m):
        line = shapely.LineString([a[:2], b[:2]]) if a[:2] != b[:2] else shapely.Point(a[:2])
        if airspace.inside and not shapely.covers(_fence(airspace.inside), line):
            return "leaves the fence"
        for area in airspace.keep_outs:
            if _enters(line, a, b, area):
                return f"comes too near to {area.host}" if area.host else "leads through a keep-out area"
    return None


def clear_of(airspace: Airspace, flights: Iterable[Flight], by_m: float) -> Airspace:
    """Return the airspace without what is nearer to these aircraft's lines, or places, than so many metres: sideways,
    over and under them.
    """
    areas = tuple(_around(flight, by_m) for flight in flights) if by_m > 0 else ()
    return replace(airspace, keep_outs=(*airspace.keep_outs, *areas)) if areas else airspace


@lru_cache(maxsize=64)
def inner(airspace: Airspace, by_m: float) -> Airspace:
    """Return the airspace without what is nearer to its edges than so many metres, sideways.

    A fence too narrow for that stays as it is.
    """
    if by_m <= 0:
        return airspace
    fence = shapely.union_all([shapely.Polygon(polygon) for polygon in airspace.inside])
    inside = _polygons(shapely.buffer(fence, -by_m, join_style="mitre"))
    if not inside or any(part.interiors for part in shapely.get_parts(fence)):
        # several that surround a hole have no one outline
        inside = tuple(one for each in airspace.inside for one in _polygons(_buffered(each, -by_m)) or (each,))
    areas = (
        replace(area, polygon=polygon)
        for area in airspace.keep_outs
        for polygon in _polygons(_buffered(area.polygon, by_m))
    )
    return replace(airspace, inside=inside, keep_outs=tuple(areas))


def _polygons(area: shapely.Geometry) -> tuple[Polygon, ...]:
    """The outlines of an area's parts."""
    return tuple(
        tuple((float(x), float(y)) for x, y in list(part.exterior.coords)[:-1])
        for part in shapely.get_parts(area)
        if not part.is_empty
    )


def _around(flight: Flight, by_m: float) -> KeepOut:
    plane, ups_m = [point[:2] for point in flight.points_m], [point[2] for point in flight.points_m]
    line = shapely.LineString(plane) if len(set(plane)) > 1 else shapely.Point(plane[0])
    corners = shapely.get_coordinates(shapely.buffer(line, by_m, quad_segs=_QUARTER).exterior)[:-1].tolist()
    polygon = tuple((east, north) for east, north in corners)
    return KeepOut(polygon=polygon, floor_m=min(ups_m) - by_m, ceiling_m=max(ups_m) + by_m, host=flight.host)


def corners_beside(airspace: Airspace) -> tuple[PlanePoint, ...]:
    """Return points just outside the keep-out areas and just inside the fence, at their corners."""
    areas = [_buffered(area.polygon, _BESIDE_M) for area in airspace.keep_outs]
    if airspace.inside:
        areas.append(shapely.buffer(_fence(airspace.inside), -_BESIDE_M, join_style="mitre"))
    rings = [ring for area in areas for part in shapely.get_parts(area) for ring in (part.exterior, *part.interiors)]
    return tuple((float(x), float(y)) for ring in rings for x, y in list(ring.coords)[:-1])


def _enters(line: shapely.Geometry, a: Point, b: Point, area: KeepOut) -> bool:
    inner = _buffered(area.polygon, -_TOLERANCE_M)
    if not shapely.intersects(inner, line):
        return False
    length = math.dist(a[:2], b[:2])
    ups: list[float] = []
    for x, y in shapely.get_coordinates(shapely.intersection(inner, line)):
        shares = (0.0, 1.0) if length == 0 else (math.dist(a[:2], (x, y)) / length,)
        ups += [a[2] + share * (b[2] - a[2]) for share in shares]
    return max(ups) > area.floor_m + _TOLERANCE_M and min(ups) < area.ceiling_m - _TOLERANCE_M


@lru_cache(maxsize=64)
def _fence(polygons: tuple[Polygon, ...]) -> shapely.Geometry:
    fence = shapely.union_all([shapely.Polygon(polygon) for polygon in polygons]).buffer(_TOLERANCE_M)
    shapely.prepare(fence)
    return fence


@lru_cache(maxsize=512)
def _buffered(polygon: Polygon, by_m: float) -> shapely.Geometry:
    area = shapely.Polygon(polygon).buffer(by_m, join_style="mitre")
    shapely.prepare(area)
    return area
