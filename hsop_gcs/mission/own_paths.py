"""Where our own aircraft were lately, for what sources report of them late.

    telemetry ──▶ samples of the last seconds ──▶ of the hosts that a measurement may be of ──▶ input, journal

What goes into an input is thinned to what matters, and rounded, so that the journal does not grow by it.
"""

import math
from collections import deque
from collections.abc import Iterable, Sequence

from hsop_gcs.placement.problem import Point
from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks.own import OVERSHOOTS_FOR_S, OwnAircraft, Path, Sample
from hsop_gcs.tracks.rules import TrackRules

_MEMORY_S = 15.0
"""Longer than a report may be old."""
_EVERY_S = 0.1
_HEARD_WITHIN_S = 2.0
"""A host whose newest place is older is not known to be there."""
_MARGIN_M = 1.0
"""For what is rounded and thinned away."""
_TIGHT_AFTER = 50
"""Samples: so often the box around a host's places is made anew."""
_MOST_OPEN = 30
_STRAIGHT_M = 0.25
"""How far a thinned path may be from the samples."""


class _Lately:
    """The newest places of one host, thinned as they come, and a box around them."""

    def __init__(self) -> None:
        self._corners: deque[Sample] = deque()
        self._open: list[Sample] = []
        """What has come since the newest corner: as good as straight on from there."""
        self._low_m, self._high_m = [math.inf] * 3, [-math.inf] * 3
        self._until_tight = _TIGHT_AFTER

    @property
    def newest(self) -> Sample | None:
        """Where the host was heard to be last."""
        return self._open[-1] if self._open else None

    def note(self, time_s: float, position_m: Point) -> None:
        if self._open and time_s < self._open[-1][0] + _EVERY_S:
            return
        sample = time_s, position_m
        if not self._open:
            self._corners.append(sample)
        elif len(self._open) >= _MOST_OPEN or not self._is_straight(sample):
            self._corners.append(self._open[-1])
            self._open = []
        self._open.append(sample)
        # the one before the oldest that counts says where the host was until then
        while len(self._corners) > 1 and self._corners[1][0] < time_s - _MEMORY_S:
            self._corners.popleft()
        self._until_tight -= 1
        places = [position_m]
        if self._until_tight == 0:
            self._low_m, self._high_m, self._until_tight = [math.inf] * 3, [-math.inf] * 3, _TIGHT_AFTER
            places = [place for _, place in (*self._corners, *self._open)]
        for place in places:
            self._low_m = [min(a, b) for a, b in zip(self._low_m, place, strict=True)]
            self._high_m = [max(a, b) for a, b in zip(self._high_m, place, strict=True)]

    def is_near(self, low_m: Sequence[float], high_m: Sequence[float], margin_m: float) -> bool:
        """Whether a box, or a point, is within a margin of the box around the host's places."""
        return all(self._low_m[i] - margin_m <= high_m[i] and low_m[i] <= self._high_m[i] + margin_m for i in range(3))

    def since(self, from_s: float) -> Path:
        """Return the host's way since a time, in few samples; where it has hovered, in one."""
        newest = self.newest
        assert newest is not None, "a host that was heard"
        corners = list(self._corners)
        while len(corners) > 1 and corners[1][0] <= from_s:
            del corners[0]
        if all(math.dist(place, newest[1]) <= _STRAIGHT_M for _, place in corners):
            corners = []
        return tuple(_rounded(sample) for sample in (*corners, newest) if sample is newest or sample[0] < newest[0])

    def _is_straight(self, sample: Sample) -> bool:
        """Whether all that is open lies on the straight way from the newest corner to a sample."""
        (from_s, a), (to_s, b) = self._corners[-1], sample
        for time_s, place in self._open:
            share = (time_s - from_s) / (to_s - from_s)
            off_m2 = 0.0
            for i in range(3):
                off_m2 += (a[i] + share * (b[i] - a[i]) - place[i]) ** 2
            if off_m2 > _STRAIGHT_M**2:
                return False
        return True


class OwnPaths:
    """The newest places of every host of a fleet, on mission time."""

    def __init__(self, hosts: Iterable[str]) -> None:
        self._hosts = {host: _Lately() for host in hosts}

    def note(self, host: str, time_s: float, position_m: Point) -> None:
        """Remember where a host is; samples come in order, one that does not is left out."""
        self._hosts[host].note(time_s, position_m)

    def beside(self, measurements: Sequence[Measurement], now_s: float, rules: TrackRules) -> OwnAircraft:
        """Return the hosts that one of the measurements may be of, with where they were since then."""
        unheard = self._unheard(now_s)
        reports = [each for each in measurements if isinstance(each, Report)]
        if not reports:
            return OwnAircraft(unheard=unheard)
        places_m = [each.position_m for each in reports]
        low_m, high_m = (
            [min(axis) for axis in zip(*places_m, strict=True)],
            [max(axis) for axis in zip(*places_m, strict=True)],
        )
        margin_m = rules.host_doubt_m + _MARGIN_M
        oldest_s = min(now_s - OVERSHOOTS_FOR_S, min(each.time_s for each in reports)) - 1.0
        near = {
            host: lately.since(oldest_s)
            for host, lately in self._hosts.items()
            if lately.newest is not None
            and lately.is_near(low_m, high_m, margin_m)
            and any(lately.is_near(place, place, margin_m) for place in places_m)
        }
        return OwnAircraft(paths=near, unheard=unheard)

    def all_since(self, from_s: float, now_s: float) -> OwnAircraft:
        """Return all hosts with where they were since a time."""
        paths = {host: lately.since(from_s) for host, lately in self._hosts.items() if lately.newest}
        return OwnAircraft(paths=paths, unheard=self._unheard(now_s))

    def _unheard(self, now_s: float) -> tuple[str, ...]:
        return tuple(
            host
            for host, lately in self._hosts.items()
            if lately.newest is None or now_s - lately.newest[0] > _HEARD_WITHIN_S
        )


def _rounded(sample: Sample) -> Sample:
    time_s, (east, north, up) = sample
    return round(time_s, 3), (round(east, 2), round(north, 2), round(up, 2))
