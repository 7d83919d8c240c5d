"""Our aircraft, as their telemetry has them: where they are, where they should look, which of them can be sent, and why
the others cannot."""

import math
from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from hsop_gcs.assignment import Flight, Mover
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.geometry.frames import Aim, aim_between
from hsop_gcs.link.adapters.adapter import Mode
from hsop_gcs.link.pump import Link
from hsop_gcs.mission.core import RECALLED, MissionState
from hsop_gcs.mission.dispatch import OrderStatus, mover_of
from hsop_gcs.mission.gates import Aircraft, Closed, closed
from hsop_gcs.mission.traffic import Blocked, Traffic
from hsop_gcs.mission.whereabouts import whereabouts
from hsop_gcs.placement.problem import Point
from hsop_gcs.reports import Site

_LEG_REACHED_M = 3.0
"""So near to a point of its route a host is sent on; routes keep more than this in hand."""


class Sky:
    """Reads the link; holds nothing but counters."""

    def __init__(self, fleet: Fleet, site: Site, link: Link) -> None:
        self.closings: Counter[str] = Counter()
        """How often each gate closed for a host, and each rule of traffic stopped one."""
        self._fleet = fleet
        self._site = site
        self._link = link
        self._before: dict[str, str] = {}

    def aircraft(self) -> dict[str, Aircraft]:
        """Return every host of the fleet by its id."""
        return {host.id: self._aircraft(host) for host in self._fleet.hosts}

    def closed(self, mission: MissionState, now_s: float) -> dict[str, Closed]:
        """Return the gate at which each host that cannot be sent stands, and why."""
        found = {}
        for host_id, aircraft in self.aircraft().items():
            progress = mission.progress.get(host_id)
            ahead_m = () if progress is None else progress.ahead_m
            at = closed(aircraft, self._fleet.limits, mission.rules.planning.airspace, ahead_m)
            aside = mission.why_aside(host_id, now_s)
            as_ordered = at is not None and at.gate == "mode" and aircraft.returns and aside == RECALLED
            if aside is not None and (at is None or as_ordered):
                at = Closed(gate="set aside", reason=aside)
            if at is not None:
                found[host_id] = at
        return found

    def note(self, found: Mapping[str, Closed]) -> None:
        """Count the gates that have closed since the last time."""
        gates = {host_id: at.gate for host_id, at in found.items()}
        self.closings.update(gate for host_id, gate in gates.items() if self._before.get(host_id) != gate)
        self._before = gates

    def movers(self, found: Mapping[str, Closed]) -> tuple[Mover, ...]:
        """Return the hosts that can be sent: those that stand at no gate."""
        return tuple(
            mover_of(host, self._link.vehicles[host.system_id].state, self._site.frame, self._fleet.limits)
            for host in self._fleet.hosts
            if host.id not in found
        )

    def standing(self, mission: MissionState, found: Mapping[str, Closed]) -> tuple[Flight, ...]:
        """Return where the aircraft in the air that cannot be sent may be."""
        return tuple(
            flight
            for host_id, aircraft in self.aircraft().items()
            if host_id in found and aircraft.state.in_air
            for flight in whereabouts(mission, aircraft, self._fleet.limits)
        )

    def traffic(
        self, mission: MissionState, now_s: float, blocked: Mapping[str, Blocked] = MappingProxyType({})
    ) -> Traffic:
        """Return everything the traffic rules look at."""
        return Traffic(
            mission=mission,
            aircraft=self.aircraft(),
            closed=self.closed(mission, now_s),
            limits=self._fleet.limits,
            now_s=now_s,
            blocked=blocked,
        )

    def above_home_m(self, host: Host, altitude_m: float) -> Point:
        """Return the point straight over a host at an altitude above its home; both must be known."""
        state = self._link.vehicles[host.system_id].state
        assert state.position is not None
        assert state.home is not None
        east, north, _ = self._site.frame.to_enu(state.position).tolist()
        _, _, home_m = self._site.frame.to_enu(state.home).tolist()
        return east, north, home_m + altitude_m

    def heading_deg(self, mission: MissionState, host: Host) -> float:
        """Return the heading that a host has by its order; without one, the heading that it has."""
        progress = mission.progress.get(host.id)
        if progress is not None:
            return progress.order.heading_deg
        return (self._link.vehicles[host.system_id].state.heading_deg or 0.0) % 360.0

    def target_of(self, mission: MissionState, host: Host, at_s: float) -> Aim | None:
        """Return where a host should look for its threats at a time, from where it is; None if it is to follow none."""
        progress, position = mission.progress.get(host.id), self._link.vehicles[host.system_id].state.position
        if progress is None or progress.order.aim is None or position is None:
            return None
        looking = (OrderStatus.ACCEPTED, OrderStatus.ARRIVED, OrderStatus.ON_STATION)
        if progress.status not in looking and not (
            host.id in mission.ways_given and progress.status is OrderStatus.WAITING
        ):
            return None
        tracks = mission.picture.tracks
        seen = [name for name, camera in progress.order.views if camera is CameraKind.CENTRAL and name in tracks]
        if not seen:
            return None
        here, places = self._site.frame.to_enu(position), [tracks[name].position_at(at_s) for name in seen]
        rig = host.rig or self._fleet.rig
        return rig.nearest_aim(aim_between(here, np.array(places)), progress.order.heading_deg)

    def hosts_m(self) -> dict[str, Point]:
        """Return where our own aircraft are, as far as they are heard."""
        places = {host_id: aircraft.position_m for host_id, aircraft in self.aircraft().items()}
        return {host_id: place for host_id, place in places.items() if place is not None}

    def _aircraft(self, host: Host) -> Aircraft:
        vehicle, now_s = self._link.vehicles[host.system_id], self._link.read_until()
        state, adapter = vehicle.state, vehicle.adapter
        position_m: Point | None = None
        if state.position is not None:
            east, north, up = self._site.frame.to_enu(state.position).tolist()
            position_m = (east, north, up)
        flown, reached = vehicle.progress, None
        if flown is not None and flown.horizontal_error_m is not None and flown.vertical_error_m is not None:
            near = math.hypot(flown.horizontal_error_m, flown.vertical_error_m) <= _LEG_REACHED_M
            reached = flown.order.order_id if near else None
        takes_off = vehicle.takes_off

        def is_in(*modes: Mode) -> bool:
            return state.custom_mode in {mode.custom_mode for mode in modes}

        return Aircraft(
            id=host.id,
            state=state,
            now_s=now_s,
            position_m=position_m,
            loss=self._link.vehicle_link(host.system_id).loss,
            obeys=adapter is not None
            and (is_in(adapter.hover_mode, adapter.hold_mode) or (takes_off and is_in(adapter.climb_mode))),
            takes_off=takes_off,
            holds=adapter is not None and is_in(adapter.hold_mode),
            returns=adapter is not None and is_in(*adapter.return_modes),
            reached=reached,
        )
