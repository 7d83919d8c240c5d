"""Between datagrams and vehicles: who sent this frame, whose message is that, and what of it all is no good.

One decoder and one encoder per peer, so that sequence numbers mean something. A vehicle is bound to the peer that its
heartbeat came from:

    unbound ──autopilot's heartbeat──► bound ──link lost──► unbound
                                         └─ a frame of the same id from another peer: refused and counted

Without I/O, like the machines below it: a recording can be played through it with any clock.
"""

from collections.abc import Container, Iterable
from dataclasses import dataclass

from hsop_gcs.link.codec import Decoder, DecoderCounters, Encoder, Frame
from hsop_gcs.link.enums import MavComponent
from hsop_gcs.link.events import Event
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import Heartbeat, Message
from hsop_gcs.link.protocol.heartbeat import OwnHeartbeat
from hsop_gcs.link.vehicle import Vehicle, VehicleLimits

_MOST_PEERS = 256
_MOST_STRANGERS = 64
_REORDERED = 200
"""A sequence number that seems to leap further than this is an old frame that came late, or a copy."""


@dataclass(frozen=True, slots=True, order=True)
class Peer:
    """Where datagrams come from and go to: which of our transports, and the address behind it."""

    transport: int
    host: str
    port: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkCounters:
    """What went through the link since it was opened."""

    received: int
    sent: int
    bad_frames: int
    unknown_messages: int
    """Good frames whose message id this system does not speak."""
    lost: int
    """Frames missing between the sequence numbers that came."""
    not_in_fleet: int
    refused: int
    """Frames that carried a vehicle's id but came from another peer than the one it is bound to."""
    peers_turned_away: int
    """Datagrams from addresses beyond the number of peers we keep account of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stranger:
    """A system that is heard and not in the fleet."""

    system: int
    component: int
    peer: Peer
    frames: int
    last_heard_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLink:
    """One vehicle's share of the link."""

    system: int
    peer: Peer | None
    received: int
    lost: int
    refused: int
    commands_resent: int
    command_noise: int


@dataclass(slots=True)
class _Tally:
    peer: Peer | None = None
    received: int = 0
    lost: int = 0
    refused: int = 0


class Router:
    """Owns the vehicles, our heartbeat, and what is known of every peer."""

    def __init__(
        self,
        systems: Iterable[int],
        *,
        own: Identity = GROUND_STATION,
        limits: VehicleLimits | None = None,
        streams: Container[int] = (),
    ) -> None:
        """streams: which transports carry bytes without the bounds of datagrams."""
        self.own = own
        self._streams = streams
        self.vehicles = {system: Vehicle(system, own=own, limits=limits) for system in systems}
        self._heartbeat = OwnHeartbeat()
        self._always: list[Peer] = []
        self._decoders: dict[Peer, Decoder] = {}
        self._encoders: dict[Peer, Encoder] = {}
        self._sequences: dict[tuple[Peer, int, int], int] = {}
        self._tallies = {system: _Tally() for system in self.vehicles}
        self._strangers: dict[tuple[int, int], Stranger] = {}
        self._forgotten = DecoderCounters()
        self._sent = self._lost = self._not_in_fleet = self._turned_away = 0

    def greet(self, peer: Peer) -> None:
        """Send our heartbeat to this peer although nothing was heard from it yet."""
        self._always.append(peer)

    def receive(self, data: bytes, peer: Peer, now: float) -> list[Frame]:
        """Take a datagram, or a piece of a stream (empty: it ended); returns the frames found, for a recording."""
        decoder = self._decoders.get(peer)
        if decoder is None:
            if len(self._decoders) >= _MOST_PEERS and not self._forget_a_peer():
                self._turned_away += 1
                return []
            decoder = self._decoders[peer] = Decoder()
        stream = peer.transport in self._streams
        if stream and not data:
            decoder.forget_partial()
        frames = decoder.feed_stream(data) if stream else decoder.feed_datagram(data)
        for frame in frames:
            lost = self._missing_before(frame, peer)
            self._lost += lost
            if frame.system in self.vehicles:
                self._deliver(frame, peer, lost, now)
            else:
                self._note_stranger(frame, peer, now)
        return frames

    @property
    def wake_at(self) -> float | None:
        """When ``advance`` has something to do; None before its first call."""
        times = [self._heartbeat.wake_at, *(vehicle.wake_at for vehicle in self.vehicles.values())]
        return min((at for at in times if at is not None), default=None)

    def advance(self, now: float) -> None:
        """Let every machine do what is due."""
        self._heartbeat.advance(now)
        for vehicle in self.vehicles.values():
            wake_at = vehicle.wake_at
            if wake_at is not None and now >= wake_at:
                vehicle.advance(now)

    def take_outgoing(self) -> list[tuple[Peer, bytes]]:
        """Return the frames to be sent and where to, once."""
        outgoing: list[tuple[Peer, bytes]] = []
        bound = {system: tally.peer for system, tally in self._tallies.items()}
        peers = dict.fromkeys([*self._always, *(peer for peer in bound.values() if peer is not None)])
        for message in self._heartbeat.take_outgoing():
            outgoing += [(peer, self._encode(message, peer)) for peer in peers]
        for system, vehicle in self.vehicles.items():
            peer = bound[system]
            messages = vehicle.take_outgoing()
            if peer is not None:
                outgoing += [(peer, self._encode(message, peer)) for message in messages]
        self._sent += len(outgoing)
        return outgoing

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        return [event for vehicle in self.vehicles.values() for event in vehicle.take_events()]

    @property
    def counters(self) -> LinkCounters:
        """What went through since the start."""
        decoders = [self._forgotten, *(decoder.counters for decoder in self._decoders.values())]
        return LinkCounters(
            received=sum(counters.frames for counters in decoders),
            sent=self._sent,
            bad_frames=sum(counters.bad_frames for counters in decoders),
            unknown_messages=sum(counters.unknown for counters in decoders),
            lost=self._lost,
            not_in_fleet=self._not_in_fleet,
            refused=sum(tally.refused for tally in self._tallies.values()),
            peers_turned_away=self._turned_away,
        )

    @property
    def strangers(self) -> tuple[Stranger, ...]:
        """Who is heard and not in the fleet."""
        return tuple(self._strangers.values())

    @property
    def vehicle_links(self) -> tuple[VehicleLink, ...]:
        """Every vehicle's share of the link."""
        return tuple(
            VehicleLink(
                system=system,
                peer=tally.peer,
                received=tally.received,
                lost=tally.lost,
                refused=tally.refused,
                commands_resent=self.vehicles[system].commands_resent,
                command_noise=self.vehicles[system].command_noise,
            )
            for system, tally in self._tallies.items()
        )

    def _forget_a_peer(self) -> bool:
        """Make room by forgetting the oldest peer that is no vehicle's: a flood of addresses shall lock nobody out."""
        bound = {tally.peer for tally in self._tallies.values()}
        peer = next((peer for peer in self._decoders if peer not in bound), None)
        if peer is None:
            return False
        counters = self._decoders.pop(peer).counters
        self._forgotten.frames += counters.frames
        self._forgotten.bad_frames += counters.bad_frames
        self._forgotten.unknown += counters.unknown
        self._sequences = {key: last for key, last in self._sequences.items() if key[0] != peer}
        return True

    def _deliver(self, frame: Frame, peer: Peer, lost: int, now: float) -> None:
        vehicle, tally = self.vehicles[frame.system], self._tallies[frame.system]
        # Silence counts from now on, not from when somebody last looked at the clock.
        wake_at = vehicle.wake_at
        if wake_at is not None and now >= wake_at:
            vehicle.advance(now)
        if tally.peer != peer:
            if vehicle.state.link_up:
                tally.refused += 1
                return
            if not (isinstance(frame.message, Heartbeat) and frame.component == MavComponent.AUTOPILOT1):
                return
            tally.peer = peer
        tally.received += 1
        tally.lost += lost
        vehicle.receive(frame.message, now, component=frame.component)

    def _note_stranger(self, frame: Frame, peer: Peer, now: float) -> None:
        self._not_in_fleet += 1
        key = (frame.system, frame.component)
        before = self._strangers.get(key)
        if before is None and len(self._strangers) >= _MOST_STRANGERS:
            return
        frames = before.frames + 1 if before is not None else 1
        self._strangers[key] = Stranger(
            system=frame.system, component=frame.component, peer=peer, frames=frames, last_heard_s=now
        )

    def _missing_before(self, frame: Frame, peer: Peer) -> int:
        key = (peer, frame.system, frame.component)
        last = self._sequences.get(key)
        if last is None:
            if len(self._sequences) < _MOST_PEERS * 4:
                self._sequences[key] = frame.sequence
            return 0
        leap = (frame.sequence - last) % 256
        if leap == 0 or leap > _REORDERED:
            return 0
        self._sequences[key] = frame.sequence
        return leap - 1

    def _encode(self, message: Message, peer: Peer) -> bytes:
        encoder = self._encoders.get(peer)
        if encoder is None:
            encoder = self._encoders[peer] = Encoder(system=self.own.system, component=self.own.component)
        return encoder.encode(message)
