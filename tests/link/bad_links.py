"""A fleet of simulated vehicles and the router, with a bad link to each, in virtual time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Decoder, Encoder
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.events import Event, OnStation, OrderEvent
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.router import Router
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.channel import Channel, Impairment
from hsop_gcs.simulator.fleet import grid
from hsop_gcs.simulator.px4 import Px4
from hsop_gcs.simulator.vehicle import Vehicle

ORIGIN = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
LOCAL = LocalFrame(ORIGIN)
HEIGHT_M = 30.0
_STEP_S = 0.05
_NEAR_M = 3.0
"""So near to a point of its way a host is sent on."""

Place = tuple[float, float, float]


@dataclass(frozen=True)
class HostPlan:
    """What one host is ordered to: points on its way, then a hover point, ENU metres."""

    order_id: str
    legs_m: Sequence[Place]
    heading_deg: float
    aim: Aim


@dataclass
class _End:
    """One simulated vehicle at its end of the line."""

    vehicle: Vehicle
    peer: Peer
    inward: Channel[bytes]
    outward: Channel[bytes]
    encoder: Encoder
    decoder: Decoder = field(default_factory=Decoder)
    flown_m: list[Place] = field(default_factory=list)
    """Every goal it ever had, in the order in which it took them up."""

    @property
    def position_m(self) -> Place:
        """Where it really is, ENU of the origin."""
        return self.from_home_m(self.vehicle.state.position_m)

    def from_home_m(self, place_m: Place) -> Place:
        east, north, up = (float(each) for each in LOCAL.to_enu(self.vehicle.config.home) + np.array(place_m))
        return east, north, up


class FleetOverBadLinks:
    """As many vehicles as asked for, PX4 and ArduPilot in turn, airborne."""

    def __init__(self, vehicles: int, impairment: Impairment, seed: int) -> None:
        self.now = 0.0
        self.events: list[tuple[float, Event]] = []
        self.router = Router(range(1, vehicles + 1))
        self.ends: list[_End] = []
        homes = grid(ORIGIN, vehicles, 20.0)
        for index, chances in enumerate(np.random.SeedSequence(seed).spawn(vehicles)):
            config = VehicleConfig(system=index + 1, home=homes[index], airborne_m=HEIGHT_M, ready_after_s=0.0)
            flight, inward, outward = (np.random.default_rng(child) for child in chances.spawn(3))
            stack = ArduCopter if index % 2 else Px4
            self.ends.append(
                _End(
                    vehicle=stack(config, now=0.0, rng=flight),
                    peer=Peer(0, "127.0.0.1", 14580 + index),
                    inward=Channel(impairment, inward),
                    outward=Channel(impairment, outward),
                    encoder=Encoder(system=index + 1, component=1),
                )
            )

    def until(self, condition: Callable[[], bool], *, within_s: float) -> None:
        """Let time pass until something is so; it is an error if it takes too long."""
        end = self.now + within_s
        while not condition():
            assert self.now < end, f"not so within {within_s} s: {[event for _, event in self.events[-8:]]}"
            self._step()

    def ready(self) -> "FleetOverBadLinks":
        vehicles = self.router.vehicles.values()
        self.until(lambda: all(v.why_not_ready(self.now) is None for v in vehicles), within_s=60.0)
        return self

    def fly(self, plan: Sequence[HostPlan], *, within_s: float) -> float:
        """Give every host its orders, leg by leg; return how long it took until all were on station."""
        started = self.now
        legs = [0] * len(plan)
        for system, of_host in enumerate(plan, start=1):
            self._order(system, of_host, 0)

        def all_on_station() -> bool:
            for index, of_host in enumerate(plan):
                progress = self.router.vehicles[index + 1].progress
                near = progress is not None and (progress.horizontal_error_m or 0.0) < _NEAR_M
                known = progress is not None and progress.phase != "ordered"
                if known and near and legs[index] < len(of_host.legs_m) - 1:
                    legs[index] += 1
                    self._order(index + 1, of_host, legs[index])
            done = {event.order_id for event in self.of(OnStation)}
            return {of_host.order_id for of_host in plan} <= done

        self.until(all_on_station, within_s=within_s)
        return self.now - started

    def of(self, kind: type[OrderEvent]) -> list[OrderEvent]:
        return [event for _, event in self.events if isinstance(event, kind)]

    def _order(self, system: int, plan: HostPlan, leg: int) -> None:
        last = leg == len(plan.legs_m) - 1
        order = HoverOrder(
            order_id=plan.order_id if last else f"{plan.order_id}/via{leg + 1}",
            point=LOCAL.to_geodetic(np.array(plan.legs_m[leg])),
            heading_deg=plan.heading_deg,
            aim=plan.aim,
            deadline_s=self.now + 15.0,
        )
        self.router.touch(system).hover(order, self.now)

    def _step(self) -> None:
        self.now += _STEP_S
        by_peer = {end.peer: end for end in self.ends}
        for end in self.ends:
            for raw in end.inward.take_due(self.now):
                for frame in end.decoder.feed_datagram(raw):
                    end.vehicle.receive(frame, self.now)
                    self._note_goal(end)
            end.vehicle.advance(self.now)
            for message in end.vehicle.take_outgoing():
                end.outward.put(end.encoder.encode(message), self.now)
            for raw in end.outward.take_due(self.now):
                self.router.receive(raw, end.peer, self.now)
        self.router.advance(self.now)
        for peer, raw in self.router.take_outgoing():
            by_peer[peer].inward.put(raw, self.now)
        self.events += [(self.now, event) for event in self.router.take_events()]

    def _note_goal(self, end: _End) -> None:
        goal = end.vehicle.goal
        if goal is None:
            return
        place_m = end.from_home_m(goal.position_m)
        if not end.flown_m or np.linalg.norm(np.subtract(end.flown_m[-1], place_m)) > 0.5:
            end.flown_m.append(place_m)
