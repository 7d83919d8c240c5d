"""Two real ends over a seeded line: our vehicle machine and a simulated autopilot, in simulated time."""

import math
from collections.abc import Callable
from typing import Literal, Self

import numpy as np
import pytest

from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.events import Event, OrderEvent
from hsop_gcs.link.messages import CommandInt, CommandLong, Message
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.vehicle import Vehicle
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.channel import Channel, Impairment
from hsop_gcs.simulator.gimbal import GimbalLimits
from hsop_gcs.simulator.px4 import Px4

HOME = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
LOCAL = LocalFrame(HOME)
METRE = 1.0
DEGREE = 1.0
Stack = Literal["px4", "ardupilot"]
BOTH = pytest.mark.parametrize("stack", ["px4", "ardupilot"])
PERFECT = Impairment(delay_s=0.02)
BAD = Impairment(loss=0.25, duplication=0.1, delay_s=0.05, jitter_s=0.2)


class TwoEnds:
    """A vehicle of ours and a simulated one with a line between them."""

    def __init__(
        self,
        stack: Stack,
        *,
        airborne_m: float = 20.0,
        impairment: Impairment = PERFECT,
        seed: int = 1,
        gimbal: GimbalLimits | None = None,
    ) -> None:
        seeds = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3)]
        config = VehicleConfig(
            system=1,
            home=HOME,
            airborne_m=airborne_m,
            ready_after_s=0.0 if airborne_m else 8.0,
            gimbal=gimbal or GimbalLimits(),
        )
        self.sim = Px4(config, now=0.0, rng=seeds[0]) if stack == "px4" else ArduCopter(config, now=0.0, rng=seeds[0])
        self.vehicle = Vehicle(1)
        self.now = 0.0
        self.cut = False
        self.events: list[tuple[float, Event]] = []
        self.heard: list[tuple[float, Frame]] = []
        self._to_sim = Channel[bytes](impairment, seeds[1])
        self._to_us = Channel[bytes](impairment, seeds[2])
        self._our_encoder, self._its_encoder = Encoder(system=255, component=190), Encoder(system=1, component=1)
        self._our_decoder, self._its_decoder = Decoder(), Decoder()

    def until(self, condition: Callable[[], bool], *, within_s: float = 120.0) -> None:
        """Let time pass until something is so; it is an error if it takes too long."""
        end = self.now + within_s
        while not condition():
            assert self.now < end, f"not so within {within_s} s: {[event for _, event in self.events[-5:]]}"
            self._step()

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        end = self.now + duration_s
        self.until(lambda: self.now >= end, within_s=duration_s + 1.0)

    def standing(self) -> Self:
        """Let time pass until the vehicle is known to stand on the ground, and its home is."""
        self.until(lambda: self.vehicle.state.home is not None and self.vehicle.state.in_air is False)
        return self

    def ready(self) -> Self:
        """Let time pass until the vehicle can take a hover order."""
        self.until(lambda: self.vehicle.why_not_ready(self.now) is None)
        return self

    def order(
        self,
        order_id: str = "o1",
        *,
        east_m: float = 30.0,
        north_m: float = 20.0,
        up_m: float = 25.0,
        heading_deg: float = 200.0,
        aim: Aim | None = None,
        speed_mps: float | None = None,
    ) -> HoverOrder:
        order = HoverOrder(
            order_id=order_id,
            point=LOCAL.to_geodetic(np.array([east_m, north_m, up_m])),
            heading_deg=heading_deg,
            aim=aim,
            deadline_s=self.now + 20.0,
            speed_mps=speed_mps,
        )
        self.vehicle.hover(order, self.now)
        return order

    def send(self, message: Message) -> None:
        """Put a message of another ground station on the simulated vehicle's desk."""
        raw = Encoder(system=200, component=190).encode(message)
        for frame in Decoder().feed_datagram(raw):
            self.sim.receive(frame, self.now)

    def reach(self, frame: Frame) -> None:
        """Let the simulated vehicle have a frame of ours; what stands on the way may change that."""
        self.sim.receive(frame, self.now)

    def hear(self, message: Message, component: int) -> None:
        """Let our machine have a message of the vehicle; what stands on the way may change that."""
        self.vehicle.receive(message, self.now, component=component)

    def of(self, kind: type[Event]) -> list[Event]:
        return [event for _, event in self.events if isinstance(event, kind)]

    def saw(self, kind: type[Event], order_id: str | None = None) -> bool:
        return any(
            order_id is None or (isinstance(event, OrderEvent) and event.order_id == order_id)
            for event in self.of(kind)
        )

    def sent(self, command: int) -> list[tuple[float, CommandLong | CommandInt]]:
        return [
            (at, frame.message)
            for at, frame in self.heard
            if isinstance(frame.message, CommandLong | CommandInt) and frame.message.command == command
        ]

    def error_m(self) -> float:
        """How far the simulated vehicle really is from the current order."""
        progress = self.vehicle.progress
        assert progress is not None
        return float(np.linalg.norm(LOCAL.to_enu(progress.order.point) - np.array(self.sim.state.position_m)))

    def _step(self) -> None:
        wake_ats = [self.sim.wake_at, self._to_sim.next_due, self._to_us.next_due, self.now + 0.5]
        wake_at = self.vehicle.wake_at
        self.now = max(self.now, min([*wake_ats, wake_at if wake_at is not None else math.inf]))
        for raw in self._to_sim.take_due(self.now):
            for frame in self._its_decoder.feed_datagram(raw):
                self.heard.append((self.now, frame))
                self.reach(frame)
        for raw in self._to_us.take_due(self.now):
            for frame in self._our_decoder.feed_datagram(raw):
                self.hear(frame.message, frame.component)
        self.sim.advance(self.now)
        self.vehicle.advance(self.now)
        for message in self.sim.take_outgoing():
            if not self.cut:
                self._to_us.put(self._its_encoder.encode(message), self.now)
        for message in self.vehicle.take_outgoing():
            if not self.cut:
                self._to_sim.put(self._our_encoder.encode(message), self.now)
        self.events += [(self.now, event) for event in self.vehicle.take_events()]
