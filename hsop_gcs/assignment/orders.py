"""Orders: a placement's hover poses given to hosts, with the aim of each central camera worked out in 3-D."""

import math
from dataclasses import dataclass

import numpy as np

from hsop_gcs.assignment.matching import FloatArray, assign
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.geometry.frames import Aim, aim_at, wrap_deg
from hsop_gcs.placement.problem import Point, Threat
from hsop_gcs.placement.solution import HoverPose, Placement

_STEP_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A host that can be sent: where it is, ENU metres, and how fast it flies."""

    id: str
    position_m: Point
    speed_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HostOrder:
    """What one host is told: a hover point (ENU metres), a compass heading and the aim of its central camera."""

    host: str
    position_m: Point
    heading_deg: float
    aim: Aim | None
    """None: this plan does not use the central camera."""
    views: tuple[tuple[str, CameraKind], ...]
    """Which threat by which camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSafeFlight:
    """No assignment lets every host reach its hover point at the safety distance from all threats."""

    reason: str


def orders_for(
    placement: Placement,
    movers: tuple[Mover, ...],
    *,
    threats_now: tuple[Threat, ...],
    threats_then: tuple[Threat, ...],
    horizon_s: float,
    safety_distance_m: float,
) -> tuple[HostOrder, ...] | NoSafeFlight:
    """Give every hover pose to a host: minimum longest flight among flights that keep the safety distance.

    ``threats_now`` decide which flights are safe: straight ones that begin at once. ``threats_then``, the threats of
    the placement, decide where cameras look. Orders come in the sequence of the placement's hosts.
    """
    flight_m = np.array(
        [
            [
                math.dist(mover.position_m, pose.position_m)
                if clearance_m(mover, pose.position_m, threats_now, horizon_s=horizon_s) >= safety_distance_m
                else math.inf
                for pose in placement.hosts
            ]
            for mover in movers
        ]
    ).reshape(len(movers), len(placement.hosts))
    chosen = assign(flight_m)
    if chosen is None:
        return NoSafeFlight(reason=_why_not(flight_m, placement, safety_distance_m))
    return tuple(
        _order(movers[host].id, pose, placement, threats_then, horizon_s)
        for host, pose in zip(chosen, placement.hosts, strict=True)
    )


def clearance_m(mover: Mover, goal_m: Point, threats: tuple[Threat, ...], *, horizon_s: float) -> float:
    """Return the least distance to any threat on a straight flight to ``goal_m``, metres, threats flying straight on.

    A host that starts inside a threat's reach is judged only from the moment on which it can change: its distance
    must not fall below what it already is.
    """
    start, goal = np.array(mover.position_m), np.array(goal_m)
    flight_s = float(np.linalg.norm(goal - start)) / mover.speed_mps
    times = np.arange(0.0, min(flight_s, horizon_s) + _STEP_S, _STEP_S)
    share = np.minimum(times / flight_s, 1.0) if flight_s > 0 else np.ones_like(times)
    path = start + share[:, None] * (goal - start)
    least = math.inf
    for threat in threats:
        positions = np.array(threat.position_m) + times[:, None] * np.array(threat.velocity_mps)
        distances = np.linalg.norm(path - positions, axis=1)
        if distances.min() >= distances[0]:
            continue
        least = min(least, float(distances.min()))
    return least


def _order(
    host: str, pose: HoverPose, placement: Placement, threats: tuple[Threat, ...], horizon_s: float
) -> HostOrder:
    views = tuple(
        (pair.threat, view.camera) for pair in placement.pairs for view in pair.views if view.host == pose.host
    )
    central = [threat for threat in threats if (threat.id, CameraKind.CENTRAL) in views]
    return HostOrder(
        host=host,
        position_m=pose.position_m,
        heading_deg=pose.heading_deg,
        aim=_central_aim(pose, central, horizon_s) if pose.pan_deg is not None and central else None,
        views=views,
    )


def _central_aim(pose: HoverPose, threats: list[Threat], horizon_s: float) -> Aim:
    """The placement's pan, which holds its threats in the field of view, and the middle of their elevations."""
    assert pose.pan_deg is not None
    tilts = [
        aim_at(np.array(pose.position_m), np.array(threat.predicted_m(after_s))).tilt_deg
        for threat in threats
        for after_s in (0.0, horizon_s)
    ]
    return Aim(pan_deg=pose.pan_deg % 360.0, tilt_deg=wrap_deg((min(tilts) + max(tilts)) / 2))


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
