"""MAVLink 2 message signing: what we send is signed, what comes is believed only if it is genuine and new.

    unsigned frame ──► its message on the allow-list? ──► ALLOWED or UNSIGNED
    signed frame ──► hash ──► date ──► replay window ──► remembered, GENUINE
                      └ FORGED └ STALE, FUTURE └ REPLAYED

Nothing is remembered of a frame whose hash is wrong, so that a forger can neither advance the window of a stream nor
fill a table. A stream is (system, component, link id), as in the source; frames may overtake each other by a little.
Without I/O: the clock is passed in.

Source: MAVLink developer guide, "Message signing": the signature is the first 48 bits of
SHA-256(key ‖ frame ‖ link id ‖ timestamp), timestamps count 10 µs from 2015-01-01.
"""

import hmac
from bisect import bisect_left, insort
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from enum import StrEnum
from hashlib import sha256

from hsop_gcs.link.codec import SIGNATURE_BYTES, is_signed, message_id

KEY_BYTES = 32
_HASH_BYTES = 6
_EPOCH_UNIX_S = 1_420_070_400
TICKS_PER_S = 100_000

_NEW_STREAM_WITHIN = 60 * TICKS_PER_S
"""A stream that was not heard yet must not begin further back than this."""
_FUTURE_WITHIN = 600 * TICKS_PER_S
"""A frame dated further ahead than this comes from a wrong clock; it would drag ours along."""
_WINDOW = 5 * TICKS_PER_S
_WINDOW_FRAMES = 128
"""How far frames of a stream may overtake each other."""
_MOST_STREAMS = 1024
_SAVE_AHEAD = 10 * TICKS_PER_S


class Verdict(StrEnum):
    """What is thought of one frame over a signed link."""

    GENUINE = "genuine"
    ALLOWED = "allowed unsigned"
    UNSIGNED = "unsigned"
    FORGED = "forged"
    """Another key, or a frame that was changed."""
    REPLAYED = "replayed"
    STALE = "stale"
    """The first of its stream, and dated more than a minute ago: a replay, or a vehicle that lost its clock."""
    FUTURE = "future-dated"

    @property
    def accepted(self) -> bool:
        """Whether the frame is believed."""
        return self in (Verdict.GENUINE, Verdict.ALLOWED)


class SigningClock:
    """Timestamps for everything one ground station signs: rising, never behind the wall's clock, kept over restarts.

    unix_s: the wall's clock. rising: the same, but never back (``clocks.RisingClock``): a vehicle's frames would come
    from the future once our clock is set back and that vehicle is not heard for a while. saved: what ``save`` was last
    called with, in an earlier life; ``save`` is called now and then with a timestamp that is still to come, and may
    raise OSError.
    """

    def __init__(
        self,
        unix_s: Callable[[], float],
        *,
        rising: Callable[[], float] | None = None,
        saved: int = 0,
        save: Callable[[int], None] | None = None,
    ) -> None:
        self._unix_s = unix_s
        self._rising = rising or unix_s
        self._last = saved
        self._save = save
        self._saved = 0
        self.problem: str | None = None
        """Why timestamps cannot be saved, for a person."""

    def next(self) -> int:
        """Return a timestamp that was never used."""
        self._last = max(self._last + 1, _ticks(self._rising()))
        if self._save is not None and self._last >= self._saved - _SAVE_AHEAD // 2:
            self._saved = self._last + _SAVE_AHEAD
            try:
                self._save(self._saved)
                self.problem = None
            except OSError as error:
                self.problem = f"signing timestamps cannot be saved: {error.strerror}"
        return self._last

    def wall(self) -> int:
        """The wall's clock as a timestamp."""
        return _ticks(self._unix_s())

    def ahead(self) -> int:
        """The newest of the clock that rises and everything sent and believed."""
        return max(self._last, _ticks(self._rising()))

    def believed(self, timestamp: int) -> None:
        """Stay ahead of what a vehicle has sent: it takes nothing older from a stream it does not know."""
        self._last = max(self._last, timestamp)


def _ticks(unix_s: float) -> int:
    return max(0, int((unix_s - _EPOCH_UNIX_S) * TICKS_PER_S))


@dataclass(slots=True)
class _Stream:
    """The newest timestamps of one stream, oldest first; nothing at or below ``floor`` is new."""

    floor: int
    seen: list[int] = field(default_factory=list)

    def take(self, timestamp: int) -> bool:
        """Remember a timestamp; False if it is not new."""
        place = bisect_left(self.seen, timestamp)
        if timestamp <= self.floor or (place < len(self.seen) and self.seen[place] == timestamp):
            return False
        insort(self.seen, timestamp)
        self.floor = max(self.floor, self.seen[-1] - _WINDOW)
        while len(self.seen) > _WINDOW_FRAMES or self.seen[0] <= self.floor:
            self.floor = max(self.floor, self.seen.pop(0))
        return True


class Signing:
    """Signs for one link with one key, and judges what comes over it.  ``allow_unsigned``: ids of messages."""

    def __init__(self, key: bytes, *, clock: SigningClock, link_id: int = 0, allow_unsigned: Collection[int] = ()):
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(key)}")
        self._key = key
        self._clock = clock
        self._link_id = link_id
        self._allow_unsigned = frozenset(allow_unsigned)
        self._streams: dict[tuple[int, int, int], _Stream] = {}

    @property
    def problem(self) -> str | None:
        """Why a restart could not go on from here, for a person."""
        return self._clock.problem

    def sign(self, frame: bytes) -> bytes:
        """Return a frame whose header says that it is signed, with its signature behind it."""
        dated = frame + bytes([self._link_id]) + self._clock.next().to_bytes(6, "little")
        return dated + self._hash(dated)

    def judge(self, frame: bytes) -> Verdict:
        """Say whether to believe a whole frame."""
        if not is_signed(frame):
            return Verdict.ALLOWED if message_id(frame) in self._allow_unsigned else Verdict.UNSIGNED
        if not hmac.compare_digest(self._hash(frame[:-_HASH_BYTES]), frame[-_HASH_BYTES:]):
            return Verdict.FORGED
        timestamp = int.from_bytes(frame[-_HASH_BYTES - 6 : -_HASH_BYTES], "little")
        if timestamp > self._clock.ahead() + _FUTURE_WITHIN:
            return Verdict.FUTURE
        name = (frame[5], frame[6], frame[-SIGNATURE_BYTES])
        stream = self._streams.get(name)
        if stream is None:
            if timestamp < self._clock.wall() - _NEW_STREAM_WITHIN:
                return Verdict.STALE
            if len(self._streams) >= _MOST_STREAMS:
                del self._streams[next(iter(self._streams))]
            stream = self._streams[name] = _Stream(floor=timestamp - _WINDOW)
        if not stream.take(timestamp):
            return Verdict.REPLAYED
        self._clock.believed(timestamp)
        return Verdict.GENUINE

    def _hash(self, dated: bytes) -> bytes:
        return sha256(self._key + dated).digest()[:_HASH_BYTES]
