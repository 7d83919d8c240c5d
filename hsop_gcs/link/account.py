"""What is kept account of on a link, so that nothing is lost in silence."""

from collections import Counter, deque
from dataclasses import dataclass
from typing import Literal

from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.timed_loss import TimedLoss

Trust = Literal["signed", "pinned", "we call it", "spoke first"]
"""Signed with its key, or from its address in FLEET.toml, or over a line of which we chose the other end; else it is
whoever spoke first."""

_WINDOW_S = 5
_MOST_CLAIMANTS = 8
_HALF = 128
_ALL = (1 << _HALF) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkCounters:
    """What went through the link since it was opened."""

    received: int
    sent: int
    bad_frames: int
    skipped_bytes: int
    """Of no frame: another protocol, another baud rate, or frames that were cut."""
    unknown_messages: int
    """Good frames whose message id this system does not speak."""
    lost: int
    """Frames missing between the sequence numbers that came: lost, or kept by a router for another station."""
    not_in_fleet: int
    refused: int
    """Frames that carried a vehicle's id but came from another address than the one it is registered with."""
    signature_refused: dict[str, int]
    """Frames over signed links that were not believed, by what was wrong."""
    peers_turned_away: int
    """Datagrams from addresses beyond the number of peers we keep account of."""
    faults: int
    """How often our own code has failed at a frame or a vehicle."""


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
    """Where it is registered: nothing else is listened to under its id."""
    trust: Trust
    """Why what comes from there is taken for the vehicle's."""
    claimants: tuple[str, ...]
    """Other addresses that spoke under its id and wait for an operator."""
    received: int
    rate_hz: float
    """Frames a second over the last five."""
    lost: int
    """Frames missing between its sequence numbers: lost, or kept by a router for another station."""
    loss: float | None
    """Share of frames lost over the last five seconds, by the autopilot's times; None if nothing came."""
    bad_frames: int
    """From its address: shared by vehicles behind one radio."""
    skipped_bytes: int
    """Of no frame; from its address too."""
    refused: int
    signature_refused: dict[str, int]
    round_trip_s: float | None
    commands_resent: int
    command_noise: int
    withheld: dict[str, int]
    """What other programs wanted to send to it over our link and may not, by message or command."""
    not_taken: dict[str, int]
    """Messages under its id that are not listened to, by the kind of component that sent them."""
    hears_others: bool
    """Whether one of these came lately."""
    other_autopilots: tuple[int, ...]
    """Components that speak as a second autopilot under its id, and are not listened to."""
    faults: int
    """How often our own code has failed at it: its order was given up each time."""
    foreign_heartbeats: int
    """Heartbeats under its autopilot's ids that are not the autopilot's: a companion computer's, a tracker's."""

    @property
    def address(self) -> str | None:
        return None if self.peer is None else self.peer.address

    @property
    def round_trip_ms(self) -> float | None:
        return None if self.round_trip_s is None else 1e3 * self.round_trip_s


class Sequence:
    """Which of a sender's newest frames came, whatever their order.

    Numbers have eight bits: half of them back is as far as a late frame can be told from one behind a long gap.
    """

    def __init__(self, newest: int) -> None:
        self._newest = newest
        self._came = _ALL
        """Bit n: the frame n before the newest; what was before the first is not missed."""

    def take(self, number: int) -> int:
        """Return by how many the missing frames became more: those skipped, -1 for a late one, 0 for a copy."""
        ahead = (number - self._newest) % 256
        if ahead <= _HALF:
            self._newest, self._came = number, (self._came << ahead | 1) & _ALL
            return max(ahead - 1, 0)
        late = 1 << 256 - ahead
        missed = not self._came & late
        self._came |= late
        return -int(missed)


class Account:
    """One vehicle's account."""

    def __init__(self) -> None:
        self.peer: Peer | None = None
        self.claimants: dict[str, Peer] = {}
        self.received = 0
        self.lost = 0
        self.refused = 0
        self.signature_refused: Counter[str] = Counter()
        self.withheld: Counter[str] = Counter()
        self.timed = TimedLoss()
        """The loss that the autopilot's own times show."""
        self._seconds: deque[tuple[int, int, int]] = deque(maxlen=_WINDOW_S + 1)
        self._loss: tuple[int, float | None] | None = None
        """The loss of the second in which it was asked for last: every round asks for it."""

    def take(self, lost: int, now: float) -> None:
        """Count a frame, and by how many the missing ones became more; see ``Sequence``."""
        self.received += 1
        self.lost = max(self.lost + lost, 0)
        second = int(now)
        if self._seconds and self._seconds[-1][0] == second:
            _, received, lost_before = self._seconds.pop()
            self._seconds.append((second, received + 1, lost_before + lost))
        else:
            self._seconds.append((second, 1, lost))

    def refuse(self, peer: Peer) -> bool:
        """Count a frame from an address that is not the vehicle's; return whether that address is a new one."""
        self.refused += 1
        if peer.address in self.claimants or len(self.claimants) >= _MOST_CLAIMANTS:
            return False
        self.claimants[peer.address] = peer
        return True

    def register(self, peer: Peer) -> None:
        """Listen to this address from now on, and to no other."""
        self.peer = peer
        self.claimants.clear()

    def rate_hz(self, now: float) -> float:
        """Frames a second over the last whole seconds."""
        return sum(received for received, _ in self._window(now)) / _WINDOW_S

    def loss(self, now: float) -> float | None:
        """Share of frames that were lost over the same time; None if nothing came.

        By the autopilot's times; by sequence numbers while it sends too little that has any.
        """
        second = int(now)
        if self._loss is None or self._loss[0] != second:
            timed = self.timed.loss(now)
            self._loss = second, self._missing_share(now) if timed is None else timed
        return self._loss[1]

    def _missing_share(self, now: float) -> float | None:
        window = self._window(now)
        received, lost = sum(each[0] for each in window), max(sum(each[1] for each in window), 0)
        return lost / (received + lost) if received else None

    def _window(self, now: float) -> list[tuple[int, int]]:
        return [(received, lost) for second, received, lost in self._seconds if 0 < int(now) - second <= _WINDOW_S]
