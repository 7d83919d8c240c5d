"""Orders: a placement's hover poses given to hosts, with the aim of each central camera worked out in 3-D."""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from hsop_gcs.assignment.arrangement import NoSafeFlight, arrange
from hsop_gcs.assignment.matching import FloatArray, assign
from hsop_gcs.assignment.routes import FlightRules, Mover, Route, safe_route
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.geometry.frames import Aim, aim_between
from hsop_gcs.placement.problem import Formulation, Point, Threat
from hsop_gcs.placement.solution import HoverPose, Placement


@dataclass(frozen=True, slots=True, kw_only=True)
class HostOrder:
    """What one host is told: a hover point (ENU metres), a compass heading and the aim of its central camera."""

    host: str
    position_m: Point
    via_m: tuple[Point, ...] = ()
    """Points to fly to first, past threats and other hosts."""
    wait_s: float = 0.0
    """About how long it waits for others to pass before it departs."""
    heading_deg: float
    aim: Aim | None
    """None: this plan does not use the central camera."""
    views: tuple[tuple[str, CameraKind], ...]
    """Which threat by which camera; none: it only gives way to the others."""
    more_views: tuple[tuple[str, CameraKind], ...] = ()
    """The same, beyond the pairs: what the camera sees from there as well, fused into the threat's fix."""


def orders_for(
    placement: Placement,
    movers: tuple[Mover, ...],
    *,
    threats_now: tuple[Threat, ...],
    threats_then: tuple[Threat, ...],
    rules: FlightRules,
    late: Callable[[], bool] = lambda: False,
    known: dict[tuple[str, Point], Route | None] | None = None,
) -> tuple[HostOrder, ...] | NoSafeFlight:
    """Give every hover pose to a host: minimum longest flight among safe routes, flown without conflict.

    A pose goes to a host with the same rig as the one that it was found for.
    ``threats_now`` decide which routes are safe for hosts that set out at once. ``threats_then``, the threats of
    the placement, decide where cameras look. late: from then on no way is looked for any more, and ways not known are
    taken for unsafe. known: ways that were looked for before, of these movers past these threats; it is filled.
    Orders come in the sequence of the placement's hosts; behind them those of idle hosts that have to give way.
    """
    flown_by = _shared_out(placement, movers, threats_now, rules, late, {} if known is None else known)
    if isinstance(flown_by, NoSafeFlight):
        return flown_by
    arranged = arrange(flown_by, movers, threats_now, rules, late=late)
    if isinstance(arranged, NoSafeFlight):
        return replace(arranged, hosts=_least_needed(placement, flown_by, arranged.hosts))
    flown = {departure.host: departure for departure in arranged}
    orders = [
        order_for(host, pose, placement, threats_then, rules.horizon_s)
        for host, pose in zip(flown_by, placement.hosts, strict=True)
    ]
    orders += [
        HostOrder(host=host, position_m=departure.route_m[-1], heading_deg=0.0, aim=None, views=())
        for host, departure in flown.items()
        if host not in flown_by
    ]
    return tuple(
        replace(order, via_m=flown[order.host].route_m[:-1], wait_s=flown[order.host].wait_s) for order in orders
    )


def _shared_out(
    placement: Placement,
    movers: tuple[Mover, ...],
    threats: tuple[Threat, ...],
    rules: FlightRules,
    late: Callable[[], bool],
    known: dict[tuple[str, Point], Route | None],
) -> dict[str, Route] | NoSafeFlight:
    """The hosts that fly to the placement's hover points, in their sequence, and their routes.

    Routes past threats take long to find. No route is shorter than the straight line: so only those are looked for that
    an assignment by the lengths known so far would fly, until it flies none that is not known.
    """
    rigs = {mover.id: mover.rig for mover in movers}
    least_m = np.array(
        [
            [math.dist(mover.position_m, pose.position_m) if mover.rig == rigs.get(pose.host) else math.inf]
            for mover in movers
            for pose in placement.hosts
        ]
    ).reshape(len(movers), len(placement.hosts))
    routes: dict[tuple[int, int], Route | None] = {}
    while (chosen := assign(least_m)) is not None:
        flights = [(host, point) for point, host in enumerate(chosen)]
        unknown = [flight for flight in flights if flight not in routes]
        if not unknown:
            return {movers[host].id: route for host, point in flights if (route := routes[host, point]) is not None}
        for host, point in unknown:
            flight = movers[host].id, placement.hosts[point].position_m
            if flight not in known:
                if late():
                    # what is not known counts as unsafe, all of it at once
                    routes = {
                        (n, k): known.get((mover.id, pose.position_m))
                        for n, mover in enumerate(movers)
                        for k, pose in enumerate(placement.hosts)
                    }
                    for at, way in routes.items():
                        least_m[at] = math.inf if way is None else way.length_m
                    break
                known[flight] = safe_route(movers[host], flight[1], threats, rules)
            routes[host, point] = route = known[flight]
            least_m[host, point] = math.inf if route is None else route.length_m
    return NoSafeFlight(
        reason=_why_not(least_m, placement, rules.safety_distance_m), hosts=_without_a_taker(least_m, placement)
    )


def order_for(
    host: str, pose: HoverPose, placement: Placement, threats: tuple[Threat, ...], horizon_s: float
) -> HostOrder:
    """Return the order that sends a host to one of the placement's poses."""
    views, more = (
        tuple((threat, view.camera) for threat, view in seen if view.host == pose.host)
        for seen in (
            [(pair.threat, view) for pair in placement.pairs for view in pair.views],
            [(pair.threat, view) for pair in placement.pairs for view in pair.more_views],
        )
    )
    central = [threat for threat in threats if (threat.id, CameraKind.CENTRAL) in views]
    return HostOrder(
        host=host,
        position_m=pose.position_m,
        heading_deg=pose.heading_deg,
        aim=_central_aim(placement, pose, central, horizon_s) if pose.pan_deg is not None and central else None,
        views=views,
        more_views=more,
    )


def _central_aim(placement: Placement, pose: HoverPose, threats: list[Threat], horizon_s: float) -> Aim:
    """Where the placement has the camera look.

    The letter's plane problem knows no elevations: then it is the placement's pan, and the middle of the elevations.
    """
    assert pose.pan_deg is not None
    if placement.formulation is Formulation.OPERATIONAL:
        return Aim(pan_deg=pose.pan_deg, tilt_deg=pose.tilt_deg)
    ends = np.array([threat.predicted_m(after_s) for threat in threats for after_s in (0.0, horizon_s)])
    return Aim(pan_deg=pose.pan_deg % 360.0, tilt_deg=aim_between(np.array(pose.position_m), ends).tilt_deg)


def _least_needed(placement: Placement, flown_by: Iterable[str], stuck: Collection[str]) -> tuple[str, ...]:
    """Whose hover point of those is needed least that are flown to by hosts that are stuck."""
    views = Counter(view.host for pair in placement.pairs for view in pair.views)
    points = [pose.host for host, pose in zip(flown_by, placement.hosts, strict=True) if host in stuck]
    return (min(points, key=lambda host: views[host]),) if points else ()


def _without_a_taker(flight_m: FloatArray, placement: Placement) -> tuple[str, ...]:
    """Whose hover points nobody takes when as many as can be are shared out."""
    hosts, points = linear_sum_assignment(np.where(np.isfinite(flight_m), 0.0, 1.0))
    taken = {int(point) for host, point in zip(hosts, points, strict=True) if math.isfinite(flight_m[host, point])}
    return tuple(pose.host for point, pose in enumerate(placement.hosts) if point not in taken)


def _why_not(flight_m: FloatArray, placement: Placement, safety_distance_m: float) -> str:
    hosts, points = flight_m.shape
    if points > hosts:
        return f"the placement needs {points} hosts; {hosts} can be sent"
    blocked = [
        placement.hosts[point].position_m for point in range(points) if not np.isfinite(flight_m[:, point]).any()
    ]
    if blocked:
        east, north, _ = blocked[0]
        return f"no host can reach ({east:.0f}, {north:.0f}) m and stay {safety_distance_m:g} m from all threats"
    return f"not all hosts can reach their hover points and stay {safety_distance_m:g} m from all threats"
