"""What share of a vehicle's frames is lost, by the times at which its autopilot sent those that came.

Positions and attitudes are sent evenly and carry the time of the autopilot's clock: one that did not come leaves a gap
of twice the spacing. Sequence numbers say less: a router that keeps what another station asked for leaves gaps in them
though nothing is lost to us, and one that numbers anew hides what was lost before it.
"""

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Message

_WINDOW_S = 5.0
_MOST_TIMES = 1024
_ENOUGH_TIMES = 8
"""Fewer in a window show no spacing."""
_SINGLE_UP_TO = 1.6
"""Spacings up to so many times a short one are of one period: PX4 sends after 16 and 24 ms by turns."""
_SILENCE_PERIODS = 10
"""A longer gap is a silence or another rate, no loss: those are watched for themselves."""


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
        """Return the share lost over the last seconds, the least that a message shows; None if none shows any.

        What only one kind of message lacks is no loss: somebody asked for less of it.
        """
        times = ([sent_ms for at, sent_ms in sent if now - at <= _WINDOW_S] for sent in self._sent.values())
        losses = [_loss(sorted(set(each))) for each in times if len(each) >= _ENOUGH_TIMES]
        return min(losses, default=None)


def _loss(times_ms: Sequence[int]) -> float:
    gaps_ms = [after - before for before, after in pairwise(times_ms)]
    if not gaps_ms:
        return 0.0
    short_ms = sorted(gaps_ms)[len(gaps_ms) // 10]
    singles_ms = [gap_ms for gap_ms in gaps_ms if gap_ms <= _SINGLE_UP_TO * short_ms]
    period_ms = sum(singles_ms) / len(singles_ms)
    periods = [round(gap_ms / period_ms) for gap_ms in gaps_ms]
    missing = sum(count - 1 for count in periods if 1 < count < _SILENCE_PERIODS)
    return missing / (missing + len(times_ms))
