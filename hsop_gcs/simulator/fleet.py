"""Simulated vehicles on real UDP sockets: one process, one socket each, as PX4's and ArduPilot's simulators have them.

    clock ──> advance ──> vehicle ──> encoder ──> channel ──> socket ──> target, and every peer that has spoken lately
    socket ──> channel ──> decoder ──> vehicle

Vehicle k of N (from 0) has system id k + 1, sends to the target's port + k (or to one port that all share) and listens
on its own local port, so that a ground station may also call it.
"""

import asyncio
import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import MavComponent
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import AircraftConfig, VehicleConfig
from hsop_gcs.simulator.channel import Channel, Impairment
from hsop_gcs.simulator.faults import FaultKind
from hsop_gcs.simulator.px4 import Px4
from hsop_gcs.simulator.vehicle import Vehicle

Address = tuple[str, int]

_PEER_FORGOTTEN_AFTER_S = 30.0
_LONGEST_GAP_S = 0.25
_SHORTEST_NAP_S = 0.002
_LARGEST_FLEET = 250


class Autopilot(StrEnum):
    PX4 = "px4"
    ARDUPILOT = "ardupilot"


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetConfig(AircraftConfig):
    """A simulated fleet. One home per vehicle; the first one's system id is 1."""

    autopilot: Autopilot
    homes: Sequence[GeodeticPoint]
    target: Address = ("127.0.0.1", 14540)
    shared_port: bool = False
    bind: str = "127.0.0.1"
    local_port: int = 14580
    """Port of the first vehicle, the others count up from it; 0 lets the system choose."""
    impairment: Impairment = field(default_factory=Impairment)
    signing_key: bytes | None = field(default=None, repr=False)
    """With it, vehicles sign what they send and believe only what is signed."""
    unix_s: Callable[[], float] = time.time
    """The clock that signatures are dated by."""
    seed: int = 0
    speed: float = 1.0
    """Simulated seconds per second of the clock."""


class SimulatedFleet:
    """Vehicles, their sockets and the loop that moves them.  ``clock`` gives seconds and never runs backwards."""

    def __init__(self, config: FleetConfig, *, clock: Callable[[], float]) -> None:
        if not 1 <= len(config.homes) <= _LARGEST_FLEET:
            raise BadInput("vehicles", f"{len(config.homes)} is not between 1 and {_LARGEST_FLEET}")
        self._config = config
        self._clock = _SteadyClock(clock, config.speed)
        seeds = np.random.SeedSequence(config.seed).spawn(len(config.homes))
        self.members = [
            _Member(_build(config, number, self._clock.now(), seed), self._target(number), config, seed, self._clock)
            for number, seed in enumerate(seeds)
        ]
        self._pump: asyncio.Task[None] | None = None

    @property
    def vehicles(self) -> list[Vehicle]:
        return [member.vehicle for member in self.members]

    @property
    def lost(self) -> int:
        """Datagrams that the simulated links did not carry."""
        return sum(member.lost for member in self.members)

    @property
    def refused(self) -> Counter[str]:
        """Frames whose signature was not believed, by what was wrong."""
        return sum((member.refused for member in self.members), Counter())

    @property
    def local_addresses(self) -> list[Address]:
        """Where each vehicle listens, once started."""
        return [member.local_address for member in self.members]

    @property
    def targets(self) -> list[Address]:
        """Where each vehicle sends unasked."""
        return [member.target for member in self.members]

    async def start(self) -> None:
        """Open the sockets and begin to fly. Raises Unavailable if a port is taken."""
        loop = asyncio.get_running_loop()
        for number, member in enumerate(self.members):
            port = self._config.local_port + number if self._config.local_port else 0
            try:
                await loop.create_datagram_endpoint(partial(_itself, member), local_addr=(self._config.bind, port))
            except OSError as error:
                await self.close()
                raise Unavailable(
                    f"UDP {self._config.bind}:{port} of vehicle {number + 1}: {error.strerror}"
                ) from error
        self._pump = asyncio.create_task(self._run(), name="simulated fleet")

    async def close(self) -> None:
        """Stop flying and give the sockets back."""
        if self._pump is not None:
            self._pump.cancel()
            await asyncio.gather(self._pump, return_exceptions=True)
            self._pump = None
        for member in self.members:
            member.close()

    def advance(self) -> None:
        """Fly until now, and send what has fallen due."""
        now = self._clock.now()
        for member in self.members:
            member.advance(now)

    async def failed(self) -> None:
        """Wait until the fleet stops by itself, which is a fault, and raise it."""
        if self._pump is not None:
            await asyncio.shield(self._pump)

    async def _run(self) -> None:
        while True:
            self.advance()
            wake_at = min(member.wake_at for member in self.members)
            nap_s = (wake_at - self._clock.now()) / self._config.speed
            await asyncio.sleep(min(_LONGEST_GAP_S / 2, max(_SHORTEST_NAP_S, nap_s)))

    def _target(self, number: int) -> Address:
        host, port = self._config.target
        return host, port if self._config.shared_port else port + number


class _Member(asyncio.DatagramProtocol):
    """One vehicle with its socket."""

    def __init__(
        self,
        vehicle: Vehicle,
        target: Address,
        config: FleetConfig,
        seed: np.random.SeedSequence,
        clock: "_SteadyClock",
    ) -> None:
        self.vehicle = vehicle
        self.target = target
        self.refused: Counter[str] = Counter()
        """Frames whose signature was not believed, by what was wrong."""
        self._clock = clock
        key = config.signing_key
        self._signing = None if key is None else Signing(key, clock=SigningClock(config.unix_s))
        self._encoder = Encoder(
            system=vehicle.config.system,
            component=MavComponent.AUTOPILOT1,
            sign=None if self._signing is None else self._signing.sign,
        )
        self._decoder = Decoder()
        inward, outward = seed.spawn(2)
        self._inward = Channel[tuple[bytes, Address]](config.impairment, np.random.default_rng(inward))
        self._outward = Channel[tuple[bytes, Address]](config.impairment, np.random.default_rng(outward))
        self._peers: dict[Address, float] = {}
        self._transport: asyncio.DatagramTransport | None = None
        self._cut_off = 0

    @property
    def lost(self) -> int:
        """Datagrams the link did not carry, both ways: lost by chance, or while it was cut."""
        return self._inward.lost + self._outward.lost + self._cut_off

    @property
    def local_address(self) -> Address:
        if self._transport is None:
            raise ValueError("the vehicle has no socket yet")
        host, port = self._transport.get_extra_info("sockname")[:2]
        return host, port

    @property
    def wake_at(self) -> float:
        return min(self.vehicle.wake_at, self._inward.next_due, self._outward.next_due)

    def advance(self, now: float) -> None:
        for datagram, peer in self._inward.take_due(now):
            for frame in self._decoder.feed_datagram(datagram):
                if self._believes(frame):
                    self._peers[peer] = now
                    self.vehicle.receive(frame, now)
        self.vehicle.advance(now)
        self._send(now)

    def close(self) -> None:
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        now = self._clock.now()
        if self._cut(now):
            return
        self._inward.put((data, (addr[0], addr[1])), now)
        self.advance(now)

    def error_received(self, exc: Exception) -> None:
        """A peer's port is closed, say: it may open again, and until then nobody misses anything."""

    def _believes(self, frame: Frame) -> bool:
        if self._signing is None:
            return True
        verdict = self._signing.judge(frame.raw)
        if not verdict.accepted:
            self.refused[verdict] += 1
        return verdict.accepted

    def _cut(self, now: float) -> bool:
        """Whether the link is cut now; counts what is lost by it."""
        cut = self.vehicle.faults.active(FaultKind.LINK_CUT, now - self.vehicle.boot_at)
        self._cut_off += cut
        return cut

    def _send(self, now: float) -> None:
        self._peers = {peer: heard for peer, heard in self._peers.items() if now - heard < _PEER_FORGOTTEN_AFTER_S}
        for message in self.vehicle.take_outgoing():
            frame = self._encoder.encode(message)
            for peer in {self.target, *self._peers}:
                if not self._cut(now):
                    self._outward.put((frame, peer), now)
        for datagram, peer in self._outward.take_due(now):
            if self._transport is not None:
                self._transport.sendto(datagram, peer)


class _SteadyClock:
    """Simulated time: the clock's, times the speed, except that a stopped process does not leave a gap to catch up."""

    def __init__(self, clock: Callable[[], float], speed: float) -> None:
        self._clock = clock
        self._speed = speed
        self._seen = clock()
        self._now = 0.0

    def now(self) -> float:
        seen = self._clock()
        self._now += min(seen - self._seen, _LONGEST_GAP_S) * self._speed
        self._seen = seen
        return self._now


def _itself(member: _Member) -> _Member:
    return member


def _build(config: FleetConfig, number: int, now: float, seed: np.random.SeedSequence) -> Vehicle:
    common = {each.name: getattr(config, each.name) for each in fields(AircraftConfig)}
    if config.airborne_m > 0:
        common["ready_after_s"] = 0.0
    common["faults"] = tuple(fault for fault in config.faults if fault.vehicle in (None, number + 1))
    vehicle = VehicleConfig(system=number + 1, home=config.homes[number], **common)
    rng = np.random.default_rng(seed)
    return (
        Px4(vehicle, now=now, rng=rng) if config.autopilot == Autopilot.PX4 else ArduCopter(vehicle, now=now, rng=rng)
    )


def grid(origin: GeodeticPoint, vehicles: int, spacing_m: float) -> list[GeodeticPoint]:
    """Return homes in a square grid whose first corner is the origin, filled row by row from west to east."""
    columns = math.ceil(math.sqrt(vehicles))
    return places(origin, [(number % columns * spacing_m, number // columns * spacing_m) for number in range(vehicles)])


def places(origin: GeodeticPoint, positions_m: Sequence[tuple[float, float]]) -> list[GeodeticPoint]:
    """Return the places ``(east, north)`` metres from the origin, all at its altitude."""
    local = LocalFrame(origin)
    homes = [local.to_geodetic(np.array([east, north, 0.0])) for east, north in positions_m]
    return [
        GeodeticPoint(lat_deg=home.lat_deg, lon_deg=home.lon_deg, altitude_amsl_m=origin.altitude_amsl_m)
        for home in homes
    ]
