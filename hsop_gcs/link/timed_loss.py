"""What share of a vehicle's frames is lost, by the times at which its autopilot sent those that came.

Positions and attitudes are sent evenly and carry the time of the autopilot's clock: one that did not come leaves a gap
of twice the spacing. Sequence numbers say less: a router that keeps what another station asked for leaves gaps in them
though nothing is lost to us, and one that numbers anew hides what was lost before it.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import pairwise

from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Message

_WINDOW_S = 5.0
_SLICE_MS = 2500
_MOST_TIMES = 1024
_ENOUGH_TIMES = 5
"""Fewer in a slice show no spacing."""
_SINGLE_UP_TO = 1.6
"""Spacings up to so many times a short one are of one period: PX4 sends after 16 and 24 ms by turns."""
_SILENCE_PERIODS = 15
"""A longer gap is a silence or another rate, no loss: those are watched for themselves."""
_OF_ONE_MESSAGE = 0.3
"""A line loses all messages alike: what only one of them lacks by so much more was asked for less, or not passed on."""


class TimedLoss:
    """Keeps the times of one autopilot's evenly sent messages."""

    def __init__(self) -> None:
        self._sent: dict[type[Message], deque[tuple[float, int]]] = {
            Attitude: deque(maxlen=_MOST_TIMES),
            GlobalPositionInt: deque(maxlen=_MOST_TIMES),
        }
        """When each came, and the autopilot's time in it, milliseconds."""

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the autopilot."""
        if isinstance(message, Attitude | GlobalPositionInt) and message.time_boot_ms:
            self._sent[type(message)].append((now, message.time_boot_ms))

    def loss(self, now: float) -> float | None:
        """Return the share lost over the last seconds; None if too few came to show it."""
        counts = [count for sent in self._sent.values() if (count := _count(sent, now)) is not None]
        if not counts:
            return None
        least = min(missing / (missing + came) for missing, came in counts)
        all_missing, all_came = (sum(each) for each in zip(*counts, strict=True))
        pooled = all_missing / (all_missing + all_came)
        return least if pooled - least > _OF_ONE_MESSAGE else pooled


def _count(sent: Iterable[tuple[float, int]], now: float) -> tuple[int, int] | None:
    """Count what is missing of one message and what came; None if too little came.

    Each slice of the window by itself: a rate that somebody changes is mixed up with another in one slice only.
    """
    times_ms = [sent_ms for at, sent_ms in sent if now - at < _WINDOW_S]
    slices: dict[int, set[int]] = {}
    for sent_ms in times_ms:
        slices.setdefault((times_ms[-1] - sent_ms) // _SLICE_MS, set()).add(sent_ms)
    counted = [each for each in slices.values() if len(each) >= _ENOUGH_TIMES]
    if not counted:
        return None
    return sum(_missing(sorted(each)) for each in counted), sum(len(each) for each in counted)


def _missing(times_ms: Sequence[int]) -> int:
    """Count what was sent evenly and is missing between these times."""
    gaps_ms = [after - before for before, after in pairwise(times_ms)]
    short_ms = sorted(gaps_ms)[len(gaps_ms) // 10]
    singles_ms = [gap_ms for gap_ms in gaps_ms if gap_ms <= _SINGLE_UP_TO * short_ms]
    period_ms = sum(singles_ms) / len(singles_ms)
    periods = [round(gap_ms / period_ms) for gap_ms in gaps_ms]
    return sum(count - 1 for count in periods if 1 < count < _SILENCE_PERIODS)
