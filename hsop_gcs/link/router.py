"""Between datagrams and vehicles: who sent this frame, whose message is that, and what of it all is no good.

One decoder and one encoder per peer, so that sequence numbers mean something. A vehicle is registered with the address
that its first heartbeat came from, and stays so, whether its link is lost or not:

    unknown ──autopilot's heartbeat, over its own endpoint──► registered ◄──an operator registers another address──┐
                                                                  └──frame of the same id from another address:────┘
                                                                     refused, counted, told

When the link is lost, an autopilot's heartbeat registers another port of the same host: it has started again. A signed
one registers any address: the key says more than an address does. One that is pinned is the only one, first or not.

A fault of ours costs the frame it came from, and the vehicle its order (``Vehicle.mend``); one that belongs to no
vehicle is noted in ``faults``. Only a heartbeat of ours that cannot be made is raised: nothing flies on without it.

Without I/O, like the machines below it: a recording can be played through it with any clock.
"""

import heapq
import math
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from typing import Literal

from hsop_gcs.errors import BadInput
from hsop_gcs.link.account import Account, LinkCounters, Sequence, Stranger, Trust, VehicleLink
from hsop_gcs.link.codec import Decoder, DecoderCounters, Encoder, Frame, is_signed, marked_signed, message_id
from hsop_gcs.link.endpoint import Peer, Pin
from hsop_gcs.link.enums import MavResult
from hsop_gcs.link.events import AddressRefused, AddressRegistered, Event
from hsop_gcs.link.faults import Faults
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Message, Unknown
from hsop_gcs.link.passing import denial, withheld
from hsop_gcs.link.protocol.heartbeat import OwnHeartbeat
from hsop_gcs.link.protocol.speaker import begins_link
from hsop_gcs.link.signing import Signing, Verdict
from hsop_gcs.link.vehicle import Vehicle, VehicleLimits

_MOST_PEERS = 256
_MOST_STRANGERS = 64
_MOST_GREETED = 16
_GREETED_FOR_S = 3.0
_TIMED: dict[int, type[Attitude] | type[GlobalPositionInt]] = {cls.ID: cls for cls in (Attitude, GlobalPositionInt)}
"""Messages by whose times losses are told; see ``TimedLoss``."""
_LOOKED_AT_AGAIN_S = 0.5
"""After a vehicle could not even say when it has something to do."""


class Router:
    """Owns the vehicles, our heartbeat, and what is known of every peer."""

    def __init__(
        self,
        systems: Iterable[int],
        *,
        own: Identity = GROUND_STATION,
        limits: VehicleLimits | None = None,
        streams: Container[int] = (),
        calling: Container[int] = (),
        transport_of: Mapping[int, int] | None = None,
        signing: Mapping[int, Signing] | None = None,
        pins: Mapping[int, Pin] | None = None,
        watchdog_s: float | None = None,
    ) -> None:
        """streams: which transports carry bytes without the bounds of datagrams. calling: those whose other end we
        chose. transport_of: where a system must be heard first; one that is left out may be heard anywhere. signing:
        of the transports that are signed. pins: the only address of each system that has one. watchdog_s: see
        ``OwnHeartbeat``.
        """
        self.own = own
        self._streams = streams
        self._calling = calling
        self._transport_of = transport_of or {}
        self._signing = signing or {}
        self._pins = pins or {}
        self.vehicles = {system: Vehicle(system, own=own, limits=limits) for system in systems}
        self.heartbeat = OwnHeartbeat(watchdog_s=watchdog_s)
        self.faults = Faults()
        """Faults that no vehicle is to be blamed for."""
        self._always: list[Peer] = []
        self._greeted_until_s: dict[Peer, float] = {}
        self._decoders: dict[Peer, Decoder] = {}
        self._encoders: dict[Peer, Encoder] = {}
        self._forwarded: list[tuple[Peer, bytes]] = []
        self._sequences: dict[tuple[Peer, int, int], Sequence] = {}
        self._accounts = {system: Account() for system in self.vehicles}
        # With a hundred vehicles most of them are idle at any moment: only those that were touched are looked at.
        self._wakes = dict.fromkeys(self.vehicles, math.inf)
        self._agenda: list[tuple[float, int]] = []
        self._moved: dict[int, None] = {}
        self._to_send: dict[int, None] = {}
        self._to_tell: dict[int, None] = {}
        self._events: list[Event] = []
        self._strangers: dict[tuple[int, int], Stranger] = {}
        self._forgotten = DecoderCounters()
        self._signature_refused: Counter[str] = Counter()
        self._now = 0.0
        """When the machines were last advanced."""
        self._sent = self._lost = self._not_in_fleet = self._turned_away = 0

    def greet(self, peer: Peer) -> None:
        """Send our heartbeat to this peer although nothing was heard from it yet."""
        self._always.append(peer)

    def receive(self, data: bytes, peer: Peer, now: float) -> list[Frame]:
        """Take a datagram, or a piece of a stream (empty: it ended); returns the frames believed, for a recording."""
        decoder = self._decoders.get(peer)
        if decoder is None:
            if len(self._decoders) >= _MOST_PEERS and not self._forget_a_peer():
                self._turned_away += 1
                return []
            decoder = self._decoders[peer] = Decoder()
        stream = peer.transport in self._streams
        if stream and not data:
            decoder.forget_partial()
            self._forget_sequences(peer)
        try:
            found = decoder.feed_stream(data) if stream else decoder.feed_datagram(data)
        except Exception as error:
            self.faults.note("the decoder", error, now)
            self._forget_decoder(peer)
            return []
        frames = []
        for frame in found:
            try:
                if not self._believes(frame, peer, now):
                    continue
                frames.append(frame)
                self._route(frame, peer, now)
            except Exception as error:
                self._blame(frame.system, error, now, frame=frame.raw)
        return frames

    def pass_over(self, raw: bytes, peer: Peer, now: float) -> None:
        """Count a single frame that is not worth reading any more: it came, and is no loss."""
        system, component, sequence = raw[5], raw[6], raw[4]
        account = self._accounts.get(system)
        if account is None or account.peer != peer or peer.transport in self._signing:
            return
        lost = self._missing(peer, system, component, sequence)
        self._lost += lost
        account.take(lost, now)
        self.vehicles[system].pass_over(message_id(raw), component)
        kind = _TIMED.get(message_id(raw))
        if kind is not None and component == self.vehicles[system].state.component:
            account.timed.receive(kind(time_boot_ms=int.from_bytes(raw[10 : 10 + min(raw[1], 4)], "little")), now)

    def _route(self, frame: Frame, peer: Peer, now: float) -> None:
        # Somebody else under the same ids has sequence numbers of his own.
        speaker = self.vehicles.get(frame.system)
        foreign = speaker is not None and speaker.is_foreign(frame.message, frame.component)
        lost = 0 if foreign else self._missing_before(frame, peer)
        self._lost += lost
        if frame.system in self.vehicles:
            self._deliver(frame, peer, lost, now)
        else:
            self._note_stranger(frame, peer, now)

    def _blame(self, system: int, error: Exception, now: float, *, frame: bytes | None = None) -> None:
        """Note a fault of ours, which the vehicle it happened with recovers from as from one of its machines'."""
        if system not in self.vehicles:
            self.faults.note("the router", error, now)
            return
        self.touch(system)
        try:
            self.vehicles[system].mend(error, now, works="vehicle", frame=frame)
        except Exception as beyond_mending:
            self.faults.note(f"the link to system {system}", beyond_mending, now)

    def touch(self, system: int) -> Vehicle:
        """Return a vehicle that is about to be given an order; what it makes of it is sent in the next turn."""
        self._moved[system] = self._to_send[system] = self._to_tell[system] = None
        return self.vehicles[system]

    @property
    def wake_at(self) -> float | None:
        """When ``advance`` has something to do; None before its first call."""
        self._reschedule()
        ours = self.heartbeat.wake_at
        return min(ours, self._agenda[0][0]) if ours is not None and self._agenda else ours

    def advance(self, now: float) -> None:
        """Let every machine do what is due."""
        self.heartbeat.advance(now)
        self._greeted_until_s = {peer: until_s for peer, until_s in self._greeted_until_s.items() if now < until_s}
        self._now = now
        self._reschedule()
        due = []
        while self._agenda and self._agenda[0][0] <= now:
            at, system = heapq.heappop(self._agenda)
            if at == self._wakes[system]:
                due.append(system)
        # Once each: one that is always due shall not keep the others, nor our heartbeat.
        for system in dict.fromkeys(due):
            self._advance(system, now)

    def _advance(self, system: int, now: float) -> None:
        self._wakes[system] = math.inf
        self.touch(system)
        try:
            self.vehicles[system].advance(now)
        except Exception as error:
            self._blame(system, error, now)

    def _reschedule(self) -> None:
        """Put the vehicles that have moved on into the agenda.

        Only where one is to be woken earlier: being woken too early costs little, and silence, which is put off by
        every message, would otherwise be put into the agenda as often.
        """
        moved, self._moved = self._moved, {}
        for system in moved:
            try:
                wake_at = self.vehicles[system].wake_at
            except Exception as error:
                self._blame(system, error, self._now)
                wake_at = self._now + _LOOKED_AT_AGAIN_S
            if wake_at is not None and wake_at < self._wakes[system]:
                self._wakes[system] = wake_at
                heapq.heappush(self._agenda, (wake_at, system))

    def take_outgoing(self) -> list[tuple[Peer, bytes]]:
        """Return the frames to be sent and where to, once."""
        outgoing, self._forwarded = self._forwarded, []
        for message in self.heartbeat.take_outgoing():
            bound = [account.peer for account in self._accounts.values() if account.peer is not None]
            peers = dict.fromkeys([*self._always, *bound, *self._greeted_until_s])
            beats = [(peer, raw) for peer in peers if (raw := self._heartbeat_for(peer, message)) is not None]
            if peers and not beats:
                raise RuntimeError("our heartbeat can be encoded for nobody")
            outgoing += beats
        to_send, self._to_send = self._to_send, {}
        for system in to_send:
            outgoing += self._outgoing_of(system)
        self._sent += len(outgoing)
        return outgoing

    def _heartbeat_for(self, peer: Peer, message: Message) -> bytes | None:
        for _ in range(2):
            try:
                return self._encode(message, peer)
            except Exception as error:
                self.faults.note(f"our heartbeat to {peer.address}", error, self._now)
                self._encoders.pop(peer, None)  # a fresh one may do it
        return None

    def _outgoing_of(self, system: int) -> list[tuple[Peer, bytes]]:
        """What one vehicle is sent. A message that cannot be encoded costs itself and the vehicle's order."""
        outgoing: list[tuple[Peer, bytes]] = []
        peer = self._accounts[system].peer
        try:
            messages = self.vehicles[system].take_outgoing()
        except Exception as error:
            self._blame(system, error, self._now)
            return outgoing
        for message in messages:
            try:
                if peer is not None:
                    outgoing.append((peer, self._encode(message, peer)))
            except Exception as error:
                self._blame(system, error, self._now)
        return outgoing

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        to_tell, self._to_tell = self._to_tell, {}
        for system in to_tell:
            try:
                events += self.vehicles[system].take_events()
            except Exception as error:
                self._blame(system, error, self._now)
        return events

    def register(self, system: int, address: str) -> None:
        """Listen to a vehicle at another address from now on. Raises BadInput for one that does not claim to be it."""
        account = self._accounts[system]
        peer = account.claimants.get(address)
        if peer is None:
            heard = ", ".join(account.claimants) or "nobody"
            raise BadInput(
                "address", f"nothing was heard of system {system} from {address!r} (other than known: {heard})"
            )
        pin = self._pins.get(system)
        if pin is not None and not pin.admits(peer):
            raise BadInput("address", f"system {system} is pinned to {pin} in FLEET.toml")
        before = account.peer.address if account.peer is not None else None
        account.register(peer)
        self._events.append(AddressRegistered(system=system, address=address, before=before, by="operator"))

    def peer_of(self, system: int) -> Peer | None:
        """Where a vehicle is registered; None before it was heard."""
        return self._accounts[system].peer

    def forward(self, system: int, data: bytes) -> list[bytes]:
        """Send a vehicle what of a datagram of somebody else's may pass, with our signature if its link is signed.

        Returns what the sender is to be answered in the vehicle's stead: commands that do not pass are denied.
        """
        account = self._accounts[system]
        answers: list[bytes | None] = []
        try:
            for frame in Decoder().feed_datagram(data):
                why_not = withheld(frame, system)
                if account.peer is None or why_not is not None:
                    account.withheld[why_not or "vehicle not heard yet"] += 1
                    result = MavResult.DENIED if why_not else MavResult.TEMPORARILY_REJECTED
                    answers.append(denial(frame, system, result))
                    continue
                signing = self._signing.get(account.peer.transport)
                raw = frame.raw if signing is None else signing.sign(marked_signed(frame.raw))
                self._forwarded.append((account.peer, raw))
        except Exception as error:
            self.faults.note("what another program sent", error, self._now)
        return [answer for answer in answers if answer is not None]

    @property
    def counters(self) -> LinkCounters:
        """What went through since the start."""
        decoders = [self._forgotten, *(decoder.counters for decoder in self._decoders.values())]
        return LinkCounters(
            received=sum(counters.frames for counters in decoders),
            sent=self._sent,
            bad_frames=sum(counters.bad_frames for counters in decoders),
            skipped_bytes=sum(counters.skipped_bytes for counters in decoders),
            unknown_messages=sum(counters.unknown for counters in decoders),
            lost=self._lost,
            not_in_fleet=self._not_in_fleet,
            refused=sum(account.refused for account in self._accounts.values()),
            signature_refused=dict(self._signature_refused),
            peers_turned_away=self._turned_away,
            faults=self.faults.counts.total() + sum(vehicle.faults for vehicle in self.vehicles.values()),
        )

    @property
    def strangers(self) -> tuple[Stranger, ...]:
        """Who is heard and not in the fleet."""
        return tuple(self._strangers.values())

    def vehicle_link(self, system: int, now: float) -> VehicleLink:
        """One vehicle's share of the link."""
        account, vehicle = self._accounts[system], self.vehicles[system]
        decoder = self._decoders.get(account.peer) if account.peer is not None else None
        return VehicleLink(
            system=system,
            peer=account.peer,
            trust=self.trust(system),
            claimants=tuple(account.claimants),
            received=account.received,
            rate_hz=account.rate_hz(now),
            lost=account.lost,
            loss=account.loss(now),
            bad_frames=0 if decoder is None else decoder.counters.bad_frames,
            skipped_bytes=0 if decoder is None else decoder.counters.skipped_bytes,
            refused=account.refused,
            signature_refused=dict(account.signature_refused),
            round_trip_s=vehicle.round_trip_s,
            commands_resent=vehicle.commands_resent,
            command_noise=vehicle.command_noise,
            withheld=dict(account.withheld),
            foreign_heartbeats=vehicle.foreign_heartbeats,
            not_taken=dict(vehicle.not_taken),
            hears_others=vehicle.hears_others(now),
            other_autopilots=vehicle.other_autopilots(now),
            faults=vehicle.faults,
        )

    def _forget_decoder(self, peer: Peer) -> None:
        """Begin anew with a peer's bytes; what was counted of them stays."""
        counters = self._decoders.pop(peer).counters
        self._forgotten.frames += counters.frames
        self._forgotten.bad_frames += counters.bad_frames
        self._forgotten.skipped_bytes += counters.skipped_bytes
        self._forgotten.unknown += counters.unknown

    def _forget_a_peer(self) -> bool:
        """Make room by forgetting the oldest peer that is no vehicle's: a flood of addresses shall lock nobody out."""
        bound = {account.peer for account in self._accounts.values()}
        peer = next((peer for peer in self._decoders if peer not in bound), None)
        if peer is None:
            return False
        self._forget_decoder(peer)
        self._forget_sequences(peer)
        return True

    def _forget_sequences(self, peer: Peer) -> None:
        self._sequences = {key: last for key, last in self._sequences.items() if key[0] != peer}

    def _believes(self, frame: Frame, peer: Peer, now: float) -> bool:
        """Whether a frame has the signature it needs; if not, it is counted."""
        signing = self._signing.get(peer.transport)
        if signing is None:
            return True
        verdict = signing.judge(frame.raw)
        if verdict.accepted:
            return True
        self._signature_refused[verdict] += 1
        if frame.system in self.vehicles:
            self._accounts[frame.system].signature_refused[verdict] += 1
            # A vehicle that lost its clock takes the date from our heartbeat, and is believed from then on.
            if verdict is Verdict.STALE and len(self._greeted_until_s) < _MOST_GREETED:
                self._greeted_until_s[peer] = now + _GREETED_FOR_S
        return False

    def _deliver(self, frame: Frame, peer: Peer, lost: int, now: float) -> None:
        vehicle, account = self.vehicles[frame.system], self._accounts[frame.system]
        # Silence counts from now on, not from when somebody last looked at the clock.
        if frame.system in self._moved:
            self._reschedule()
        if now >= self._wakes[frame.system]:
            self._advance(frame.system, now)
        if account.peer != peer and not self._registers(frame, peer, now):
            return
        account.take(lost, now)
        if frame.component == vehicle.state.component:
            account.timed.receive(frame.message, now)
        vehicle.receive(frame.message, now, component=frame.component, sequence=frame.sequence, raw=frame.raw)
        self._to_tell[frame.system] = None
        if not isinstance(frame.message, Unknown):  # which puts silence off, and nothing else
            self._moved[frame.system] = self._to_send[frame.system] = None

    def _registers(self, frame: Frame, peer: Peer, now: float) -> bool:
        """Whether a frame from an address that is not its vehicle's makes it so; if not, it is refused."""
        account, vehicle = self._accounts[frame.system], self.vehicles[frame.system]
        pin = self._pins.get(frame.system)
        at_home = self._transport_of.get(frame.system, peer.transport) == peer.transport
        at_home = at_home and (pin is None or pin.admits(peer))
        greets = begins_link(frame.message, frame.component)
        if account.peer is None and at_home:
            if greets:
                account.register(peer)
            else:
                vehicle.note_not_taken(frame.component, now)
        elif at_home and greets and not vehicle.state.link_up and (by := self._why_again(frame, peer)) is not None:
            before = account.peer.address if account.peer is not None else None
            account.register(peer)
            self._events.append(AddressRegistered(system=frame.system, address=peer.address, before=before, by=by))
        elif account.refuse(peer):
            registered = account.peer.address if account.peer is not None else None
            self._events.append(AddressRefused(system=frame.system, address=peer.address, registered=registered))
        return account.peer == peer

    def _why_again(self, frame: Frame, peer: Peer) -> Literal["signature", "same host"] | None:
        """Why a vehicle that fell silent is believed to speak from here now."""
        before = self._accounts[frame.system].peer
        if peer.transport in self._signing:
            return "signature" if is_signed(frame.raw) else None
        same_host = before is not None and (before.transport, before.host) == (peer.transport, peer.host)
        return "same host" if same_host else None

    def trust(self, system: int) -> Trust:
        """Why what comes under a vehicle's id is taken for the vehicle's."""
        peer, home = self._accounts[system].peer, self._transport_of.get(system)
        transport = peer.transport if peer is not None else home
        if transport in self._signing:
            return "signed"
        if system in self._pins:
            return "pinned"
        return "we call it" if transport in self._calling else "spoke first"

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
        return self._missing(peer, frame.system, frame.component, frame.sequence)

    def _missing(self, peer: Peer, system: int, component: int, number: int) -> int:
        key = (peer, system, component)
        sequence = self._sequences.get(key)
        if sequence is not None:
            return sequence.take(number)
        if len(self._sequences) < _MOST_PEERS * 4:
            self._sequences[key] = Sequence(number)
        return 0

    def _encode(self, message: Message, peer: Peer) -> bytes:
        encoder = self._encoders.get(peer)
        if encoder is None:
            signing = self._signing.get(peer.transport)
            sign = signing.sign if signing is not None else None
            encoder = Encoder(system=self.own.system, component=self.own.component, sign=sign)
            self._encoders[peer] = encoder
        return encoder.encode(message)
