"""What has arrived and waits to be worked off, and how far that is behind.

A service that gets too little processor time shall lose what is worth least: of each vehicle's states, sent many times
a second, only the newest matters once there is a newer one. Answers, heartbeats, texts and everything else are kept; of
these the oldest go, and are counted, when there is no room left.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from hsop_gcs.link.codec import STX_V2, frame_length, is_signed, message_id
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.messages import (
    Attitude,
    EkfStatusReport,
    EstimatorStatus,
    GimbalDeviceAttitudeStatus,
    GlobalPositionInt,
    GpsRawInt,
    SysStatus,
)

MOST_WAITING = 4096
_OLD_S = 0.5
"""What has waited for so long is looked through for states that are out of date."""
_BEHIND_S = 1.5
_CAUGHT_UP_S = 0.3
_FOR_S = 3.0
_DEVICE_AT = 48
"""Where a GIMBAL_DEVICE_ATTITUDE_STATUS names its device, bytes into the payload."""
_STATES = frozenset(
    cls.ID
    for cls in (
        SysStatus,
        GpsRawInt,
        Attitude,
        GlobalPositionInt,
        EkfStatusReport,
        EstimatorStatus,
        GimbalDeviceAttitudeStatus,
    )
)
_Key = tuple[Peer, int, int, int, int]


@dataclass(frozen=True, slots=True)
class Arrived:
    """A datagram, or a piece of a stream, as it came. superseded: one frame of a state of which a newer one waits."""

    data: bytes
    peer: Peer
    at_s: float
    superseded: bool = False


class Backlog:
    """Bounded; first in, first out."""

    def __init__(self) -> None:
        self.superseded = 0
        """States that were passed over because a newer one had come."""
        self.dropped = 0
        """Datagrams, or pieces of a stream, for which there was no room."""
        self._waiting: deque[Arrived] = deque()
        self._look_through_at = MOST_WAITING

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes, peer: Peer, now: float) -> None:
        """Take what arrived. If there is no room, the oldest makes some: of a vehicle, the newest says most."""
        if len(self._waiting) >= self._look_through_at:
            self._leave_out_superseded()
            self._look_through_at = min(MOST_WAITING, len(self._waiting) + MOST_WAITING // 4)
        while len(self._waiting) >= MOST_WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(Arrived(data, peer, now))

    def age_s(self, now: float) -> float:
        """How long the oldest has waited."""
        return now - self._waiting[0].at_s if self._waiting else 0.0

    def take(self, now: float) -> Iterator[Arrived]:
        """Yield all that waits, the oldest first; if it has waited long, states that are out of date are so marked."""
        if self.age_s(now) > _OLD_S:
            self._mark_superseded()
        self._look_through_at = MOST_WAITING
        while self._waiting:
            yield self._waiting.popleft()

    def _mark_superseded(self) -> None:
        marked, seen = [], set[_Key]()
        for arrived in reversed(self._waiting):
            key = _state_of(arrived)
            is_old = key is not None and key in seen
            self.superseded += is_old and not arrived.superseded
            marked.append(Arrived(arrived.data, arrived.peer, arrived.at_s, superseded=True) if is_old else arrived)
            if key is not None:
                seen.add(key)
        self._waiting = deque(reversed(marked))

    def _leave_out_superseded(self) -> None:
        self._mark_superseded()
        self._waiting = deque(arrived for arrived in self._waiting if not arrived.superseded)


def _state_of(arrived: Arrived) -> _Key | None:
    """Return whose state of what a datagram is; None for one that is not a single unsigned frame of a state."""
    data = arrived.data
    if len(data) < 12 or data[0] != STX_V2 or frame_length(data, 0) != len(data) or is_signed(data):
        return None
    number = message_id(data)
    if number not in _STATES:
        return None
    device = data[10 + _DEVICE_AT] if number == GimbalDeviceAttitudeStatus.ID and data[1] > _DEVICE_AT else 0
    return arrived.peer, data[5], data[6], number, device


class Lag:
    """How late the pump is, and whether that is so much that nothing new is begun.

    in time ──1.5 s late──► behind ──three seconds without a third of a second's lateness──► in time
    """

    def __init__(self) -> None:
        self.behind = False
        self.longest_s = 0.0
        """The longest lateness since it was in time."""
        self._late_at_s: float | None = None

    def note(self, late_s: float, now: float) -> None:
        """Take how late one turn of the pump was."""
        if late_s > _CAUGHT_UP_S:
            self._late_at_s = now
            self.longest_s = max(self.longest_s, late_s)
            self.behind = self.behind or late_s > _BEHIND_S
        elif self._late_at_s is not None and now > self._late_at_s + _FOR_S:
            self.behind, self.longest_s, self._late_at_s = False, 0.0, None
