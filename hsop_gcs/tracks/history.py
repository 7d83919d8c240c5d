"""The fixed-lag buffer: what tracks were told lately and what was believed after each, so that late reports fit in.

A late measurement is put in its place: steps that follow the one before it take the place of everything since.
Deterministic: the same measurements in the same order give the same states to the bit.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks import kernels, track_kernels
from hsop_gcs.tracks.filter import FloatArray, State, update
from hsop_gcs.tracks.gate import gate, predicted
from hsop_gcs.tracks.kernels import IntArray
from hsop_gcs.tracks.measured import numbers_of
from hsop_gcs.tracks.rules import TrackRules

_ROOM = 256
"""Steps that a log has room for at least, before its past is left behind."""


class Arrays(NamedTuple):
    """Steps side by side, as the kernels take them, with room for more."""

    times_s: FloatArray
    """(steps,)"""
    means: FloatArray
    """(steps, 6): position, then velocity, after each step."""
    covariances: FloatArray
    """(steps, 6, 6)"""
    rows: FloatArray
    """(steps, kernels.ROW), what was measured."""
    before: IntArray
    """(steps,), the track's step before, -1 for its first."""

    @classmethod
    def empty(cls, room: int) -> "Arrays":
        """Return arrays of ``room`` steps that are still to be filled in."""
        state = np.empty(room), np.empty((room, 6)), np.empty((room, 6, 6))
        return cls(*state, np.empty((room, kernels.ROW)), np.empty(room, np.int64))

    def changed(self, change: Callable[[Any], Any]) -> "Arrays":
        """Return what ``change`` makes of each array."""
        return Arrays(*map(change, self))


class Log:
    """The steps of all tracks. It is only ever added to, so that pictures can share it."""

    def __init__(self, room: int = _ROOM) -> None:
        self.steps = Arrays.empty(room)
        self._full_at = room
        self.measurements: list[Measurement] = []

    def __getstate__(self) -> dict[str, object]:
        """Without the room for more."""
        size = len(self.measurements)
        return {**self.__dict__, "steps": self.steps.changed(lambda array: array[:size])}

    @property
    def life(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """What of the steps decides on a track's life: times, covariances and predecessors."""
        return self.steps.times_s, self.steps.covariances, self.steps.before

    def state(self, at: int) -> State:
        """Return what was believed after a step."""
        return State(self.steps.times_s.item(at), self.steps.means[at], self.steps.covariances[at])

    def follow(
        self, newest: IntArray, measurements: Sequence[Measurement], rows: FloatArray, rules: TrackRules
    ) -> IntArray:
        """Return the newest steps of n tracks, -1 for one that begins, after a measurement of each, all later ones
        replayed.

        Of measurements with the same time, the one that arrived first comes first.
        """
        if self._correct(newest, measurements, rows, rules):
            size = len(self.measurements)
            return np.arange(size - len(newest), size)
        at: list[int] = []
        later: list[list[int]] = []
        for step, measurement in zip(newest.tolist(), measurements, strict=True):
            since: list[int] = []
            while step >= 0 and self.steps.times_s[step] > measurement.time_s:
                since.append(step)
                step = self.steps.before.item(step)
            at.append(step)
            later.append(since)
        at = self._advance(at, measurements, rows, rules)
        while due := [index for index, since in enumerate(later) if since]:
            again = [later[index].pop() for index in due]
            replayed = [self.measurements[step] for step in again]
            after = self._advance([at[each] for each in due], replayed, self.steps.rows[again], rules)
            for index, step in zip(due, after, strict=True):
                at[index] = step
        return np.array(at)

    def without_the_past(self, newest: IntArray, memory_s: float) -> tuple["Log", IntArray]:
        """Return a log of nothing but what tracks remember, with room for more, and their newest steps in it."""
        kept, before, places = track_kernels.remembered(self.steps.times_s, self.steps.before, newest, memory_s)
        log = Log(room=4 * len(kept) + _ROOM)
        for array, given in zip(log.steps, self.steps, strict=True):
            array[: len(kept)] = given[kept]
        log.steps.before[: len(kept)] = before
        log.measurements = [self.measurements[at] for at in kept.tolist()]
        return log, places

    def take(self, steps: "History") -> int:
        """Add another log's history of a track; return where its newest step is."""
        other, _ = steps.log.without_the_past(np.array([steps.newest]), steps.memory_s)
        count = len(other.measurements)
        start = self.make_room(count)
        for array, given in zip(self.steps, other.steps, strict=True):
            array[start : start + count] = given[:count]
        self.steps.before[start : start + count - 1] += start
        self.measurements += other.measurements
        return start

    @property
    def is_full(self) -> bool:
        """Whether it is time to leave the past behind."""
        return len(self.measurements) >= self._full_at

    def make_room(self, count: int) -> int:
        """Return where the next ``count`` steps go."""
        while len(self.measurements) + count > len(self.steps.times_s):
            self.steps = self.steps.changed(lambda array: np.concatenate((array, np.empty_like(array))))
        return len(self.measurements)

    def _correct(self, at: IntArray, measurements: Sequence[Measurement], rows: FloatArray, rules: TrackRules) -> bool:
        """Add what follows steps, -1 where a track begins, by reports that are not older, all or none."""
        end = self.make_room(len(at))
        done = kernels.correct(*self.steps, at, rows, end, numbers_of(rules))
        if done:
            self.measurements += measurements
        return done

    def _advance(
        self, at: Sequence[int], measurements: Sequence[Measurement], rows: FloatArray, rules: TrackRules
    ) -> list[int]:
        """Return the steps that follow steps by measurements that are not older."""
        after = list(at)
        reports = [index for index, each in enumerate(measurements) if isinstance(each, Report)]
        if reports:
            size = len(self.measurements)
            chosen = [measurements[index] for index in reports]
            self._correct(np.array([at[index] for index in reports]), chosen, rows[reports], rules)
            for number, index in enumerate(reports):
                after[index] = size + number
        seen = {index: each for index, each in enumerate(measurements) if isinstance(each, Bearing)}
        if seen:
            bearings = list(seen.values())
            times_s = [each.time_s for each in bearings]
            mean, covariance = predicted([self.state(at[index]) for index in seen], times_s, rules)
            common = self.steps.rows[[at[index] for index in seen], kernels.CARRIED :].reshape(-1, 3, 3)
            covariance[:, :3, :3] -= common
            means, covariances = update(mean, covariance, bearings, gate(bearings[0], rules))
            covariances[:, :3, :3] += common
            for number, (index, bearing) in enumerate(seen.items()):
                state = State(times_s[number], means[number], covariances[number])
                after[index] = self.add(at[index], bearing, rows[index], state)
        return after

    def add(self, before: int, measurement: Measurement, row: FloatArray, state: State) -> int:
        """Add one step; return where it is."""
        at = self.make_room(1)
        steps = self.steps
        steps.times_s[at], steps.means[at], steps.covariances[at] = state
        steps.rows[at], steps.before[at] = row, before
        steps.rows[at, kernels.CARRIED :] = steps.rows[before, kernels.CARRIED :] if before >= 0 else 0.0
        self.measurements.append(measurement)
        return at


class History:
    """What a track was told in its last ``memory_s``, and one measurement older to start from, newest first."""

    __slots__ = ("log", "memory_s", "newest")

    def __init__(self, log: Log, newest: int, memory_s: float) -> None:
        self.log, self.newest, self.memory_s = log, newest, memory_s

    def __iter__(self) -> Iterator[Measurement]:
        at, steps = self.newest, self.log.steps
        oldest = track_kernels.step_at(steps.times_s, steps.before, at, -np.inf, self.memory_s)
        yield self.log.measurements[at]
        while at != oldest:
            at = steps.before.item(at)
            yield self.log.measurements[at]

    def since(self, time_s: float) -> Iterator[Measurement]:
        """Return what is not older than ``time_s``, newest first."""
        return takewhile(lambda each: each.time_s >= time_s, self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, History) and tuple(self) == tuple(other)

    def __getstate__(self) -> tuple[None, dict[str, object]]:
        log, (newest,) = self.log.without_the_past(np.array([self.newest]), self.memory_s)
        return None, {"log": log, "newest": int(newest), "memory_s": self.memory_s}


def step_before(steps: History, time_s: float) -> int:
    """Return where the newest step not after ``time_s`` is, or the oldest there is."""
    times_s, before = steps.log.steps.times_s, steps.log.steps.before
    return track_kernels.step_at(times_s, before, steps.newest, time_s, steps.memory_s)


def state_before(steps: History, time_s: float) -> State:
    """Return the newest state not after ``time_s``, or the oldest there is."""
    return steps.log.state(step_before(steps, time_s))


def can_take(steps: History, measurement: Measurement, rules: TrackRules) -> bool:
    """Return whether a measurement is not too late: newer than the lag, and a bearing with a state to correct."""
    if steps.log.steps.times_s[steps.newest] - measurement.time_s > rules.lag_s:
        return False
    return isinstance(measurement, Report) or state_before(steps, measurement.time_s).time_s <= measurement.time_s
