"""Areas from files: GeoJSON, QGroundControl's .plan and KML, on WGS-84.

What a file holds and nobody can fly by (a line, a circle of no radius) is a fault, never left out in silence. A hole is
a keep-out: out of a fence it is one, and a hole in a keep-out is not flown in either.
Sources: RFC 7946; the QGroundControl developer guide, "Plan file format"; OGC 12-007r2 (KML 2.3).
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import ParseError, fromstring

from hsop_gcs.errors import BadInput

Corner = tuple[float, float]
"""Latitude and longitude, degrees."""

_LARGEST_FILE_BYTES = 5_000_000
_CIRCLE_CORNERS = 32
_EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """A polygon on the ground, with the altitudes it holds for, metres above the mission's origin; None: without end.

    keep_out: what the file says it is; None if it does not say.
    """

    corners: tuple[Corner, ...]
    floor_m: float | None = None
    ceiling_m: float | None = None
    keep_out: bool | None = None


def read_areas(path: Path) -> tuple[Area, ...]:
    """Return the areas of a .geojson, .json, .plan or .kml file. Raises BadInput that names the place in the file."""
    readers = {".geojson": _from_geojson, ".json": _from_geojson, ".plan": _from_plan, ".kml": _from_kml}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise BadInput(str(path), f"is none of {', '.join(readers)}")
    try:
        if path.stat().st_size > _LARGEST_FILE_BYTES:
            raise BadInput(str(path), f"is larger than {_LARGEST_FILE_BYTES} bytes")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(str(path), f"cannot be read: {error}") from error
    try:
        areas = tuple(reader(text))
    except BadInput as error:
        raise BadInput(str(path), str(error)) from error
    except (json.JSONDecodeError, RecursionError) as error:
        raise BadInput(str(path), f"not JSON: {error}") from error
    except (ParseError, DefusedXmlException) as error:
        raise BadInput(str(path), f"not KML that is safe to read: {error}") from error
    if not areas:
        raise BadInput(str(path), "holds no area")
    return areas


def _from_geojson(text: str) -> Iterator[Area]:
    document = json.loads(text)
    kind = document.get("type") if isinstance(document, dict) else None
    features = document.get("features") if kind == "FeatureCollection" else [document]
    if not isinstance(features, list):
        raise BadInput("features", "must be an array")
    for index, feature in enumerate(features):
        name = f"features[{index}]" if kind == "FeatureCollection" else "document"
        if not isinstance(feature, dict):
            raise BadInput(name, "is no object")
        properties = (feature.get("properties") or {}) if feature.get("type") == "Feature" else {}
        geometry = feature.get("geometry") if feature.get("type") == "Feature" else feature
        yield from _of_geometry(geometry, properties, name)


def _of_geometry(geometry: Any, properties: Any, name: str) -> Iterator[Area]:
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if kind not in ("Polygon", "MultiPolygon"):
        raise BadInput(f"{name}.geometry.type", f"must be Polygon or MultiPolygon, not {kind!r}")
    if not isinstance(properties, dict):
        raise BadInput(f"{name}.properties", "must be an object")
    floor_m, ceiling_m = (
        None if properties.get(key) is None else _number(properties[key], f"{name}.properties.{key}")
        for key in ("floor_m", "ceiling_m")
    )
    coordinates = geometry.get("coordinates")
    for rings in _list([coordinates] if kind == "Polygon" else coordinates, f"{name}.geometry.coordinates"):
        for number, ring in enumerate(_list(rings, f"{name}.geometry.coordinates")):
            where = f"{name}.geometry.coordinates[{number}]"
            corners = [_on_earth(_pair(each, where)[::-1], where) for each in _list(ring, where)]
            area = Area(corners=_closed_off(corners), floor_m=floor_m, ceiling_m=ceiling_m)
            yield area if number == 0 else replace(area, keep_out=True)


def _from_plan(text: str) -> Iterator[Area]:
    document = json.loads(text)
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        raise BadInput("fileType", "must be 'Plan'")
    fence = document.get("geoFence")
    if not isinstance(fence, dict):
        raise BadInput("geoFence", "is missing")
    for index, polygon in enumerate(_list(fence.get("polygons", []), "geoFence.polygons")):
        name = f"geoFence.polygons[{index}]"
        inclusion = _inclusion(polygon, name)
        where = f"{name}.polygon"
        corners = [_on_earth(_pair(each, where), where) for each in _list(polygon.get("polygon"), where)]
        yield Area(corners=tuple(corners), keep_out=not inclusion)
    for index, each in enumerate(_list(fence.get("circles", []), "geoFence.circles")):
        name = f"geoFence.circles[{index}]"
        inclusion = _inclusion(each, name)
        circle = each.get("circle")
        if not isinstance(circle, dict):
            raise BadInput(f"{name}.circle", "is missing")
        radius_m = _number(circle.get("radius"), f"{name}.circle.radius")
        if not 0 < radius_m < 100_000:
            raise BadInput(f"{name}.circle.radius", f"{radius_m:g} m is no radius of an area to fly in")
        centre = _on_earth(_pair(circle.get("center"), f"{name}.circle.center"), f"{name}.circle.center")
        yield Area(corners=_around(centre, radius_m, outside=not inclusion), keep_out=not inclusion)


def _inclusion(value: Any, name: str) -> bool:
    if not isinstance(value, dict) or not isinstance(value.get("inclusion"), bool):
        raise BadInput(f"{name}.inclusion", "must be true or false")
    return bool(value["inclusion"])


def _around(centre: Corner, radius_m: float, *, outside: bool) -> tuple[Corner, ...]:
    """Corners of a polygon that lies within the circle, or around it: on the safe side of it either way."""
    if outside:
        radius_m /= math.cos(math.pi / _CIRCLE_CORNERS)
    lat_deg, lon_deg = centre
    step = math.degrees(radius_m / _EARTH_RADIUS_M)
    angles = [2 * math.pi * number / _CIRCLE_CORNERS for number in range(_CIRCLE_CORNERS)]
    shrink = math.cos(math.radians(lat_deg))
    return tuple((lat_deg + step * math.cos(a), lon_deg + step * math.sin(a) / shrink) for a in angles)


def _from_kml(text: str) -> Iterator[Area]:
    root = fromstring(text, forbid_dtd=True)
    for number, polygon in enumerate(each for each in root.iter() if _tag(each) == "Polygon"):
        for child in polygon:
            if _tag(child) in ("outerBoundaryIs", "innerBoundaryIs"):
                name = f"Polygon[{number}].{_tag(child)}"
                texts = [each.text or "" for each in child.iter() if _tag(each) == "coordinates"]
                if len(texts) != 1:
                    raise BadInput(name, f"has {len(texts)} lists of coordinates instead of one")
                corners = [_kml_corner(each, name) for each in texts[0].split()]
                hole = True if _tag(child) == "innerBoundaryIs" else None
                yield Area(corners=_closed_off(corners), keep_out=hole)


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _kml_corner(text: str, name: str) -> Corner:
    try:
        lon_deg, lat_deg, *_ = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(name, f"{text[:40]!r} is not LON,LAT[,ALTITUDE]") from None
    return _on_earth((lat_deg, lon_deg), name)


def _closed_off(corners: list[Corner]) -> tuple[Corner, ...]:
    """Without the last corner where it says the first one again."""
    return tuple(corners[:-1] if len(corners) > 1 and corners[0] == corners[-1] else corners)


def _list(value: Any, name: str) -> list[Any]:
    if not isinstance(value, list):
        raise BadInput(name, "must be an array")
    return value


def _pair(value: Any, name: str) -> Corner:
    if not isinstance(value, list) or len(value) < 2:
        raise BadInput(name, f"{str(value)[:40]} is no pair of degrees")
    return _number(value[0], name), _number(value[1], name)


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadInput(name, f"{str(value)[:40]} is no number")
    return float(value)


def _on_earth(corner: Corner, name: str) -> Corner:
    lat_deg, lon_deg = corner
    if not (-90 <= lat_deg <= 90 and -180 <= lon_deg <= 180):
        raise BadInput(name, f"{lat_deg:g}, {lon_deg:g} is no place on Earth")
    return corner
