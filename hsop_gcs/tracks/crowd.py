"""How many sources a picture keeps account of, so that names without number do not fill it."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from hsop_gcs.reports import Measurement
from hsop_gcs.tracks.picture import Picture
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.sources import Refusal, RefusalKind

_SILENT_S = 60.0


def with_room_for_sources(
    picture: Picture, measurements: Sequence[Measurement], now_s: float, rules: TrackRules
) -> tuple[Picture, Mapping[int, Refusal]]:
    """Return the picture with room for the sources of what has arrived, and by index what it has no room for.

    Where there is none, sources that have been silent for a minute are forgotten. ``now_s``: mission time.
    """
    sources = picture.sources
    new = dict.fromkeys(each.source for each in measurements if each.source not in sources)
    if len(sources) + len(new) <= rules.max_sources:
        return picture, {}
    speaking = {name: watch for name, watch in sources.items() if now_s - watch.last_heard_s <= _SILENT_S}
    room = max(0, rules.max_sources - len(speaking))
    problem = f"a new one, and {rules.max_sources} report already, the most that are kept account of"
    strangers = set(list(new)[room:])
    return picture._replace(sources=MappingProxyType(speaking)), {
        index: Refusal(RefusalKind.FULL, "source", problem)
        for index, each in enumerate(measurements)
        if each.source in strangers
    }
