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
_STRAIGHT_M = 0.25
"""How far a thinned path may be from the samples."""


class _Lately:
    """The newest places of one host, and a box around them."""

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque()
        self._low_m, self._high_m = [math.inf] * 3, [-math.inf] * 3
        self._until_tight = _TIGHT_AFTER

    def note(self, time_s: float, position_m: Point) -> None:
        samples = self.samples
        if samples and time_s < samples[-1][0] + _EVERY_S:
            return
        samples.append((time_s, position_m))
        # the one before the oldest that counts says where the host was until then
        while len(samples) > 2 and samples[1][0] < time_s - _MEMORY_S:
            samples.popleft()
        self._until_tight -= 1
        places = [position_m]
        if self._until_tight == 0:
            self._low_m, self._high_m, self._until_tight = [math.inf] * 3, [-math.inf] * 3, _TIGHT_AFTER
            places = [place for _, place in samples]
        for place in places:
            self._low_m = [min(a, b) for a, b in zip(self._low_m, place, strict=True)]
            self._high_m = [max(a, b) for a, b in zip(self._high_m, place, strict=True)]

    def is_near(self, low_m: Sequence[float], high_m: Sequence[float], margin_m: float) -> bool:
        """Whether a box, or a point, is within a margin of the box around the host's places."""
        return all(self._low_m[i] - margin_m <= high_m[i] and low_m[i] <= self._high_m[i] + margin_m for i in range(3))

    def since(self, from_s: float) -> Path:
        """Return the samples since a time and the one before it; the newest one at least."""
        count = 1
        while count < len(self.samples) and self.samples[-count][0] > from_s:
            count += 1
        return tuple(self.samples[index] for index in range(-count, 0))


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
            host: thinned(lately.since(oldest_s))
            for host, lately in self._hosts.items()
            if lately.samples
            and lately.is_near(low_m, high_m, margin_m)
            and any(lately.is_near(place, place, margin_m) for place in places_m)
        }
        return OwnAircraft(paths=near, unheard=unheard)

    def all_since(self, from_s: float, now_s: float) -> OwnAircraft:
        """Return all hosts with where they were since a time."""
        paths = {host: thinned(lately.since(from_s)) for host, lately in self._hosts.items() if lately.samples}
        return OwnAircraft(paths=paths, unheard=self._unheard(now_s))

    def _unheard(self, now_s: float) -> tuple[str, ...]:
        return tuple(
            host
            for host, lately in self._hosts.items()
            if not lately.samples or now_s - lately.samples[-1][0] > _HEARD_WITHIN_S
        )


def thinned(path: Path) -> Path:
    """Return a path without the samples that lie where the others say, rounded to centimetres and milliseconds."""
    keep = {0, len(path) - 1}
    open_ = [(0, len(path) - 1)]
    while open_:
        first, last = open_.pop()
        off_m, at = max(
            ((_off_m(path[index], path[first], path[last]), index) for index in range(first + 1, last)),
            default=(0.0, first),
        )
        if off_m > _STRAIGHT_M:
            keep.add(at)
            open_ += [(first, at), (at, last)]
    if len(keep) == 2 and math.dist(path[0][1], path[-1][1]) <= _STRAIGHT_M:
        keep = {len(path) - 1}
    return tuple(_rounded(path[index]) for index in sorted(keep))


def _off_m(sample: Sample, first: Sample, last: Sample) -> float:
    spent_s = last[0] - first[0]
    share = (sample[0] - first[0]) / spent_s if spent_s > 0 else 0.0
    expected = [a + share * (b - a) for a, b in zip(first[1], last[1], strict=True)]
    return math.dist(sample[1], expected)


def _rounded(sample: Sample) -> Sample:
    time_s, (east, north, up) = sample
    return round(time_s, 3), (round(east, 2), round(north, 2), round(up, 2))
