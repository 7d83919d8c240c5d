"""The fixed-lag buffer: what a track was told lately and what it believed after each, so that late reports fit in.

A late measurement is put in its place; the state before it is taken up again and everything since is replayed.
Deterministic: the same measurements in the same order give the same states to the bit.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from hsop_gcs.reports import Bearing, Measurement
from hsop_gcs.tracks.filter import State, first_state
from hsop_gcs.tracks.gate import advance
from hsop_gcs.tracks.rules import TrackRules


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One measurement and the state after it."""

    measurement: Measurement
    state: State

    @property
    def time_s(self) -> float:
        return self.state.time_s


Steps = tuple[Step, ...]
"""Oldest first, never empty. All of a track's last ``memory_s`` and one older to start from."""


def state_before(steps: Steps, time_s: float) -> State:
    """Return the newest state not after ``time_s``, or the oldest there is."""
    if steps[-1].time_s <= time_s:
        return steps[-1].state
    return steps[max(_place(steps, time_s) - 1, 0)].state


def can_take(steps: Steps, measurement: Measurement, rules: TrackRules) -> bool:
    """Return whether a measurement is not too late: newer than the lag, and a bearing with a state to correct."""
    if steps[-1].time_s - measurement.time_s > rules.lag_s:
        return False
    return not (isinstance(measurement, Bearing) and measurement.time_s < steps[0].time_s)


def insert(histories: Sequence[Steps], measurements: Sequence[Measurement], rules: TrackRules) -> list[Steps]:
    """Return each history with its measurement in it and all later ones replayed, batched over the histories.

    Of measurements with the same time, the one that arrived first comes first.
    """
    places = [_place(steps, each.time_s) for steps, each in zip(histories, measurements, strict=True)]
    starts: list[State] = []
    pending: list[list[Measurement]] = []
    kept: list[list[Step]] = []
    for steps, place, measurement in zip(histories, places, measurements, strict=True):
        later: list[Measurement] = [each.measurement for each in steps[place:]]
        if place > 0:
            starts.append(steps[place - 1].state)
            kept.append(list(steps[:place]))
            pending.append([measurement, *later])
        else:
            assert not isinstance(measurement, Bearing), "a bearing begins no history: see can_take"
            starts.append(first_state(measurement, rules))
            kept.append([Step(measurement=measurement, state=starts[-1])])
            pending.append(later)
    for depth in range(max(map(len, pending))):
        active = [index for index, each in enumerate(pending) if len(each) > depth]
        due = [pending[index][depth] for index in active]
        for index, measurement, state in zip(
            active, due, advance([starts[index] for index in active], due, rules), strict=True
        ):
            starts[index] = state
            kept[index].append(Step(measurement=measurement, state=state))
    return [_trimmed(each, rules) for each in kept]


def _place(steps: Steps, time_s: float) -> int:
    if steps[-1].time_s <= time_s:
        return len(steps)
    return bisect_right(steps, time_s, key=lambda each: each.time_s)


def _trimmed(steps: list[Step], rules: TrackRules) -> Steps:
    oldest_s = steps[-1].time_s - rules.memory_s
    first = 0
    while first + 1 < len(steps) and steps[first + 1].time_s < oldest_s:
        first += 1
    return tuple(steps[first:])
