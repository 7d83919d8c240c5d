"""The picture as JSON: made a little at a time, and once for all who ask while it stays the same."""

import asyncio

from pydantic import TypeAdapter

from hsop_gcs.api.bodies import Pace
from hsop_gcs.api.schemas import ThreatOut
from hsop_gcs.api.views import threat_out
from hsop_gcs.mission.controller import Mission
from hsop_gcs.tracks import Picture

_AT_ONCE = 50
_THREATS = TypeAdapter(list[ThreatOut])


class PictureAsJson:
    """What ``GET /api/v1/threats`` answers."""

    def __init__(self, mission: Mission, turn: asyncio.Lock) -> None:
        self._mission, self._turn = mission, turn
        self._newest: tuple[Picture, float, asyncio.Task[bytes]] | None = None
        """What was made last, of which picture and on which offset of the clock."""

    async def threats(self) -> bytes:
        """Return all threats as a JSON array."""
        picture, offset_s = self._mission.state.picture, self._mission.state.timeline.offset_s
        if self._newest is None or self._newest[0] is not picture or self._newest[1] != offset_s:
            self._newest = picture, offset_s, asyncio.create_task(self._made(picture))
        return await asyncio.shield(self._newest[2])

    async def _made(self, picture: Picture) -> bytes:
        tracks, parts = list(picture.tracks.values()), []
        async with Pace(self._turn) as pace:
            for first in range(0, len(tracks), _AT_ONCE):
                some = [threat_out(track, self._mission) for track in tracks[first : first + _AT_ONCE]]
                parts.append(_THREATS.dump_json(some)[1:-1])
                await pace.breathe()
        return b"[" + b",".join(parts) + b"]"
