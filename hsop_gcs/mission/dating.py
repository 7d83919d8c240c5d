"""What comes in is dated in UTC by its source's clock; here it is put on mission time, before it becomes an input.

A system clock that is set leaves two kinds of sources behind: those that follow it, and those that stay where they were
(because they were right). Each is understood by itself, by the offset that fits what it sends.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from hsop_gcs.detections import Detection
from hsop_gcs.mission.clock import likeliest_offset_s
from hsop_gcs.mission.core import MissionState
from hsop_gcs.reports import Measurement


@dataclass(slots=True)
class Dating:
    """Remembers which sources do not follow the system clock, for people to see."""

    elsewhere: dict[str, float] = field(default_factory=dict)
    """The offset of each source whose clock is not taken for the system's."""

    def reports(self, given: Sequence[Measurement], now_s: float, mission: MissionState) -> tuple[Measurement, ...]:
        """Return measurements that arrived together, on mission time."""
        sources = mission.picture.sources
        offsets = {}
        for source, utc_s in _newest((each.source, each.time_s) for each in given).items():
            watch = sources.get(source)
            usual_age_s = 0.0 if watch is None else -watch.clock_offset_s
            offsets[source] = _offset_s(utc_s, now_s, mission, mission.rules.believable.max_age_s, usual_age_s)
        self._remember(offsets, mission)
        if not any(offsets.values()):
            return tuple(given)
        return tuple(replace(each, time_s=each.time_s - offsets[each.source]) for each in given)

    def detections(self, given: Sequence[Detection], now_s: float, mission: MissionState) -> tuple[Detection, ...]:
        """Return detections that arrived together, on mission time: each host's computer has a clock of its own."""
        oldest_s = mission.rules.detections.max_age_s
        newest = _newest((each.host, each.time_s) for each in given)
        offsets = {host: _offset_s(utc_s, now_s, mission, oldest_s) for host, utc_s in newest.items()}
        if not any(offsets.values()):
            return tuple(given)
        return tuple(replace(each, time_s=each.time_s - offsets[each.host]) for each in given)

    def _remember(self, offsets: dict[str, float], mission: MissionState) -> None:
        now_s = mission.timeline.offset_s
        for source, offset_s in offsets.items():
            if offset_s == now_s:
                self.elsewhere.pop(source, None)
            else:
                self.elsewhere[source] = offset_s
        for source in self.elsewhere.keys() - mission.picture.sources.keys() - offsets.keys():
            del self.elsewhere[source]


def _newest(dated: Iterable[tuple[str, float]]) -> dict[str, float]:
    newest: dict[str, float] = {}
    for source, time_s in dated:
        newest[source] = max(time_s, newest.get(source, time_s))
    return newest


def _offset_s(utc_s: float, now_s: float, mission: MissionState, max_age_s: float, usual_age_s: float = 0.0) -> float:
    offsets_s = mission.timeline.offsets_s
    if len(offsets_s) == 1:
        return offsets_s[0]
    max_future_s = mission.rules.reports.max_future_s
    return likeliest_offset_s(
        utc_s, now_s, offsets_s, max_future_s=max_future_s, max_age_s=max_age_s, usual_age_s=usual_age_s
    )
