"""Orders on their way to hosts: who can be sent, what is put on the link, and what became of it."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from hsop_gcs.assignment import HostOrder, Mover
from hsop_gcs.fleet import FlightLimits, Host
from hsop_gcs.geometry.frames import Aim, LocalFrame
from hsop_gcs.link.events import (
    AimClipped,
    Arrived,
    Drifted,
    Event,
    GimbalFailed,
    GimbalOffTarget,
    LinkLost,
    LinkUp,
    OnStation,
    OrderAccepted,
    OrderFailed,
    OrderSuperseded,
)
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.protocol.telemetry import VehicleState
from hsop_gcs.placement.problem import Point


class OrderStatus(StrEnum):
    WAITING = "waiting"
    """Not sent yet, or stopped on the way, until nothing is in the way."""
    SENT = "sent"
    ACCEPTED = "accepted"
    """The autopilot said yes; it is on its way."""
    ARRIVED = "arrived"
    ON_STATION = "on station"
    """At the hover point, and the gimbal looks where it should."""
    UNHEARD = "not heard"
    """It had arrived when it was heard last."""
    FAILED = "failed"
    SUPERSEDED = "superseded"
    GIVEN_UP = "given up"
    """Failed too often; the host is set aside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderProgress:
    """What became of one order so far. ``note`` is for a person."""

    order_id: str
    plan_id: str
    order: HostOrder
    rank: int = 0
    """Hosts of one plan depart in this order, where they would meet."""
    leg: int = 0
    """How many points of its route the host has passed."""
    departures: int = 0
    """How often it set out."""
    attempts: int = 1
    """How often it may have failed, and one."""
    since_s: float = 0.0
    """When it departed, was stopped or failed last, seconds since the Unix epoch."""
    status: OrderStatus = OrderStatus.WAITING
    note: str = ""

    @property
    def flying(self) -> bool:
        """Whether it is on its way."""
        return self.status in (OrderStatus.SENT, OrderStatus.ACCEPTED)

    @property
    def on_last_leg(self) -> bool:
        return self.leg == len(self.order.via_m)

    @property
    def leg_id(self) -> str:
        """The name of the present leg on the link."""
        departure = self.order_id if self.departures <= 1 else f"{self.order_id}/again{self.departures - 1}"
        return departure if self.on_last_leg else f"{departure}/via{self.leg + 1}"

    @property
    def ahead_m(self) -> tuple[Point, ...]:
        """The points it has still to fly to, ENU metres."""
        return (*self.order.via_m[self.leg :], self.order.position_m)

    @property
    def goal_m(self) -> Point:
        """Where the host is flying to now, ENU metres."""
        return self.ahead_m[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class WayGiven:
    """A host's flight out of a threat's way: until it departs to a hover point again."""

    order_id: str
    goal_m: Point
    threat: str
    since_s: float
    """When it was sent, seconds since the Unix epoch."""
    over: bool = False
    """It has arrived, or will not: it stays where it is."""

    def after(self, event: Event) -> "WayGiven":
        """Return how it stands after an event of its order."""
        return replace(self, over=True) if isinstance(event, Arrived | OrderFailed | OrderSuperseded) else self


def mover_of(host: Host, state: VehicleState, frame: LocalFrame, limits: FlightLimits) -> Mover:
    """Return the host as assignment sees it. The state must have a position."""
    assert state.position is not None
    east, north, up = (float(value) for value in frame.to_enu(state.position))
    return Mover(
        id=host.id,
        position_m=(east, north, up),
        speed_mps=limits.speed_mps,
        climb_mps=limits.climb_mps,
        rig=host.rig,
    )


def evasion_order(
    way: WayGiven, frame: LocalFrame, *, heading_deg: float, aim: Aim | None, deadline_s: float, speed_mps: float
) -> HoverOrder:
    """Return what goes on the link for a host that gives way; its camera goes on looking where it looks."""
    return HoverOrder(
        order_id=way.order_id,
        point=frame.to_geodetic(np.array(way.goal_m)),
        heading_deg=heading_deg,
        aim=aim,
        deadline_s=deadline_s,
        speed_mps=speed_mps,
    )


def hover_order(progress: OrderProgress, frame: LocalFrame, *, deadline_s: float, speed_mps: float) -> HoverOrder:
    """Return what goes on the link for the present leg, on WGS-84, AMSL; ``deadline_s`` is on the link's clock."""
    return HoverOrder(
        order_id=progress.leg_id,
        point=frame.to_geodetic(np.array(progress.goal_m)),
        heading_deg=progress.order.heading_deg,
        aim=progress.order.aim,
        deadline_s=deadline_s,
        speed_mps=speed_mps,
    )


def progressed(progress: OrderProgress, event: Event) -> OrderProgress:
    """Return the order's progress after an event of its present leg; a point on the way is no arrival."""
    if progress.status in (OrderStatus.WAITING, OrderStatus.GIVEN_UP):
        return progress
    if isinstance(event, LinkLost | LinkUp):
        return _heard(progress, is_up=isinstance(event, LinkUp))
    if not progress.on_last_leg and not isinstance(event, OrderAccepted | OrderFailed):
        return progress
    match event:
        case OrderAccepted():
            return replace(progress, status=OrderStatus.ACCEPTED, note="")
        case Arrived():
            return replace(progress, status=OrderStatus.ARRIVED, note="")
        case OnStation():
            return replace(progress, status=OrderStatus.ON_STATION, note="")
        case Drifted(problem=problem):
            return replace(progress, status=OrderStatus.ACCEPTED, note=problem)
        case GimbalOffTarget() if progress.status is OrderStatus.ON_STATION:
            return replace(progress, status=OrderStatus.ARRIVED, note="gimbal off target")
        case GimbalFailed(reason=reason) | OrderFailed(reason=reason):
            return replace(progress, status=OrderStatus.FAILED, note=reason)
        case AimClipped(wanted=wanted, given=given):
            return replace(
                progress,
                note=f"gimbal limits: looks at {given.pan_deg:.0f}°/{given.tilt_deg:.0f}°"
                f" instead of {wanted.pan_deg:.0f}°/{wanted.tilt_deg:.0f}°",
            )
        case OrderSuperseded():
            return replace(progress, status=OrderStatus.SUPERSEDED)
    return progress


def _heard(progress: OrderProgress, *, is_up: bool) -> OrderProgress:
    """A host that is not heard is on no station; one heard again is where it was, or its link says otherwise."""
    if is_up and progress.status is OrderStatus.UNHEARD:
        return replace(progress, status=OrderStatus.ARRIVED, note="")
    if not is_up and progress.status in (OrderStatus.ARRIVED, OrderStatus.ON_STATION):
        return replace(progress, status=OrderStatus.UNHEARD, note=f"it was {progress.status} when it was heard last")
    return progress
