"""Areas from files: three formats, the same square; and what is refused."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
import shapely

from hsop_gcs.areas import read_areas
from hsop_gcs.errors import BadInput

SQUARE = ((47.397, 8.545), (47.399, 8.545), (47.399, 8.547), (47.397, 8.547))
RING = [[lon, lat] for lat, lon in (*SQUARE, SQUARE[0])]


def written(tmp_path: Path, name: str, content: Any) -> Path:
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def polygon(ring: Any = RING, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}


def kml(coordinates: str, head: str = "") -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>{head}
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><Polygon>
<outerBoundaryIs><LinearRing><coordinates>{coordinates}</coordinates></LinearRing></outerBoundaryIs>
</Polygon></Placemark></Document></kml>"""


def plan(**fence: Any) -> dict[str, Any]:
    return {"fileType": "Plan", "geoFence": {"circles": [], "polygons": [], "version": 2} | fence}


def test_geojson_has_longitude_first_and_altitudes_as_properties(tmp_path: Path) -> None:
    collection = {
        "type": "FeatureCollection",
        "features": [
            polygon(floor_m=10, ceiling_m=30.5),
            {"type": "Feature", "geometry": {"type": "MultiPolygon", "coordinates": [[RING], [RING]]}},
        ],
    }
    low, *others = read_areas(written(tmp_path, "fence.geojson", collection))
    assert (low.corners, low.floor_m, low.ceiling_m, low.keep_out) == (SQUARE, 10.0, 30.5, None)
    assert [(area.corners, area.floor_m) for area in others] == [(SQUARE, None)] * 2


def test_a_hole_is_a_keep_out(tmp_path: Path) -> None:
    geometry = {"type": "Polygon", "coordinates": [RING, RING]}
    outer, hole = read_areas(written(tmp_path, "fence.json", geometry))
    assert (outer.keep_out, hole.keep_out) == (None, True)


def test_a_plan_says_what_is_inside_and_what_is_not(tmp_path: Path) -> None:
    corners = [list(corner) for corner in SQUARE]
    circles = [{"inclusion": inside, "circle": {"center": [47.398, 8.546], "radius": 50}} for inside in (True, False)]
    fence = plan(polygons=[{"inclusion": True, "polygon": corners, "version": 1}], circles=circles)
    square, within, around = read_areas(written(tmp_path, "site.plan", fence))
    assert (square.corners, square.keep_out) == (SQUARE, False)
    assert (within.keep_out, around.keep_out) == (False, True)
    metres_per_deg = 6_371_000 * math.radians(1)

    def reach_m(corners: tuple[tuple[float, float], ...]) -> tuple[float, float]:
        shrink = math.cos(math.radians(47.398))
        ring = shapely.LinearRing(
            [((lon - 8.546) * shrink * metres_per_deg, (lat - 47.398) * metres_per_deg) for lat, lon in corners]
        )
        return ring.distance(shapely.Point(0, 0)), max(math.hypot(*corner) for corner in ring.coords)

    assert reach_m(within.corners) == pytest.approx((49.76, 50.0), abs=0.01)
    assert reach_m(around.corners) == pytest.approx((50.0, 50.24), abs=0.01)


def test_kml_has_longitude_first_and_an_altitude_nobody_needs(tmp_path: Path) -> None:
    text = kml("\n".join(f"{lon},{lat},0" for lon, lat in RING))
    (area,) = read_areas(written(tmp_path, "fence.kml", text))
    assert (area.corners, area.keep_out) == (SQUARE, None)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "", r"is none of \.geojson"),
        ("a.geojson", "{", "not JSON"),
        ("a.geojson", "[" * 100_000, "not JSON"),
        ("a.geojson", {"type": "Feature", "geometry": {"type": "Point", "coordinates": [8, 47]}}, "not 'Point'"),
        ("a.geojson", {"type": "FeatureCollection", "features": []}, "holds no area"),
        ("a.geojson", polygon([[8, 47], [8, "x"], [9, 47]]), r"coordinates\[0\]: x is no number"),
        ("a.geojson", polygon([[8, 47], [8, 97], [9, 47]]), "97, 8 is no place on Earth"),
        ("a.geojson", polygon(floor_m="low"), r"document\.properties\.floor_m: low is no number"),
        ("a.geojson", [1], "document: is no object"),
        ("a.plan", {"fileType": "Mission"}, "fileType: must be 'Plan'"),
        ("a.plan", plan(polygons=[{"polygon": []}]), r"polygons\[0\]\.inclusion: must be true or false"),
        (
            "a.plan",
            plan(circles=[{"inclusion": True, "circle": {"center": [47, 8], "radius": 0}}]),
            r"circles\[0\]\.circle\.radius: 0 m is no radius",
        ),
        ("a.kml", kml("8,47 8.1"), r"'8\.1' is not LON,LAT"),
        ("a.kml", "<kml", "not KML"),
        ("a.kml", kml("&bomb;", '<!DOCTYPE k [<!ENTITY bomb "1,1">]>'), "not KML that is safe to read"),
    ],
)
def test_what_is_no_area_is_refused_by_name(tmp_path: Path, name: str, content: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read_areas(written(tmp_path, name, content))


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_areas(tmp_path / "none.kml")
