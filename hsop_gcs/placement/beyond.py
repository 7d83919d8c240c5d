"""Whether any hover point that the airspace allows is near enough to see a threat: geometry in the plane, no search."""

import math

import shapely
from shapely.geometry.base import BaseGeometry

from hsop_gcs.placement.airspace import Polygon
from hsop_gcs.placement.objective import hover_altitudes_m
from hsop_gcs.placement.problem import Problem, Threat

_QUARTER = 16
"""Sides of a quarter of a circle."""


def why_beyond_airspace(problem: Problem, threat: Threat, reach_m: float) -> str | None:
    """Return one sentence on why the fence or keep-out areas leave no hover point from which a threat is detected; None
    if they leave one, or altitudes are in the way.

    reach_m: beyond this distance no camera detects the threat. What is looked at: places from which both ends of its
    path are within reach, at whatever altitude hosts may hover.
    """
    airspace = problem.airspace
    low_m, high_m = hover_altitudes_m(problem)
    within: BaseGeometry | None = None
    for east, north, up in (threat.position_m, threat.predicted_m(problem.horizon_s)):
        off_m = max(low_m - up, up - high_m, 0.0)
        if off_m >= reach_m:
            return None
        # the polygon is around the circle, not in it
        radius_m = math.sqrt(reach_m**2 - off_m**2) / math.cos(math.pi / (4 * _QUARTER))
        disc = shapely.Point(east, north).buffer(radius_m, quad_segs=_QUARTER)
        within = disc if within is None else within.intersection(disc)
    if within is None or within.is_empty:
        return None
    detected = f"is detected no farther than {reach_m:.1f} m away"
    if airspace.inside:
        fence = shapely.union_all([shapely.Polygon(polygon) for polygon in airspace.inside])
        if not fence.intersects(within):
            ends = [threat.position_m[:2], threat.predicted_m(problem.horizon_s)[:2]]
            away_m = max(float(fence.distance(shapely.Point(end))) for end in ends)
            return f"threat {threat.id} is {away_m:.1f} m outside the fence, and {detected}"
        within = within.intersection(fence)
    barred = [area for area in airspace.keep_outs if area.floor_m <= low_m and area.ceiling_m >= high_m]
    if barred and within.difference(shapely.union_all([_area(area.polygon) for area in barred])).is_empty:
        hosts = sorted({area.host for area in barred if area.host and within.intersects(_area(area.polygon))})
        sites = any(not area.host and within.intersects(_area(area.polygon)) for area in barred)
        names = " and ".join((["the keep-out areas"] if sites else []) + hosts)
        return f"threat {threat.id} {detected}, and {names} leave no hover point that is as near"
    return None


def _area(polygon: Polygon) -> shapely.Polygon:
    return shapely.Polygon(polygon)
