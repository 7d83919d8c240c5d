"""Where hosts may hover: inside the fence, outside keep-out areas, between the floor and the ceiling."""

import math
from dataclasses import dataclass
from functools import lru_cache

import shapely

from hsop_gcs.errors import BadInput

PlanePoint = tuple[float, float]
"""East, north, metres, local frame."""
Polygon = tuple[PlanePoint, ...]
"""Corners in order, either way round; the last side closes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOut:
    """An area that no host hovers in. It may be flown over and under; altitudes in metres above the origin."""

    polygon: Polygon
    floor_m: float = -math.inf
    ceiling_m: float = math.inf
    host: str = ""
    """The aircraft of ours that this is around; empty: an area of the site."""

    def __post_init__(self) -> None:
        require_area(self.polygon, "keep_out.polygon")
        if not self.floor_m < self.ceiling_m:
            raise BadInput("keep_out.floor_m", f"{self.floor_m:g} must be below ceiling_m {self.ceiling_m:g}")

    def room_m(self, position_m: tuple[float, float, float]) -> float:
        """Return how far a point is outside, metres: sideways, over or under it, whichever is most; negative inside."""
        east, north, up = position_m
        return max(-depth_m(self.polygon, (east, north)), self.floor_m - up, up - self.ceiling_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Airspace:
    """The limits of hover points; by default there are none. Raises BadInput for what is no area."""

    inside: tuple[Polygon, ...] = ()
    """The geofence: a hover point lies in at least one of these. Empty: anywhere."""
    keep_outs: tuple[KeepOut, ...] = ()
    floor_m: float | None = None
    ceiling_m: float | None = None
    """Metres above the local origin; None: no limit."""

    def __post_init__(self) -> None:
        for polygon in self.inside:
            require_area(polygon, "fence.inside")
        if self.floor_m is not None and self.ceiling_m is not None and self.floor_m > self.ceiling_m:
            raise BadInput("floor_m", f"{self.floor_m:g} must not be above ceiling_m {self.ceiling_m:g}")

    def fence_room_m(self, position_m: tuple[float, float, float]) -> float:
        """Return how deep a point is inside the fence, metres; negative outside, infinite without a fence."""
        return max((depth_m(polygon, position_m[:2]) for polygon in self.inside), default=math.inf)

    def keep_out_room_m(self, position_m: tuple[float, float, float]) -> float:
        """Return how far a point is outside the nearest keep-out area, metres; infinite if there is none."""
        return min((area.room_m(position_m) for area in self.keep_outs), default=math.inf)

    def room_m(self, position_m: tuple[float, float, float]) -> float:
        """Return how far a point is from the fence and from keep-out areas, metres; negative where nobody may be."""
        return min(self.fence_room_m(position_m), self.keep_out_room_m(position_m))

    def altitude_room_m(self, up_m: float) -> float:
        """Return how far an altitude is from the floor or the ceiling, metres; negative beyond them."""
        below = math.inf if self.ceiling_m is None else self.ceiling_m - up_m
        above = math.inf if self.floor_m is None else up_m - self.floor_m
        return min(above, below)


def depth_m(polygon: Polygon, point_m: PlanePoint) -> float:
    """Return how far inside a polygon a point lies, metres to its nearest side; negative outside."""
    area, point = _area(polygon), shapely.Point(point_m)
    away = float(area.exterior.distance(point))
    return away if area.contains(point) else -away


@lru_cache(maxsize=256)
def _area(polygon: Polygon) -> shapely.Polygon:
    area = shapely.Polygon(polygon)
    shapely.prepare(area)
    return area


def require_area(polygon: Polygon, field: str) -> None:
    """Raise BadInput unless the corners enclose an area whose sides do not cross."""
    if len(polygon) < 3:
        raise BadInput(field, f"an area has at least 3 corners, not {len(polygon)}")
    if not all(math.isfinite(value) for corner in polygon for value in corner):
        raise BadInput(field, f"corners must be finite, not {polygon!r}")
    area = shapely.Polygon(polygon)
    if not area.is_valid or area.area <= 0:
        raise BadInput(field, f"is no area: {shapely.is_valid_reason(area)}")
