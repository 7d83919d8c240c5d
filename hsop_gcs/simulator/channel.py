"""A link that loses, doubles, delays and reorders datagrams, by chance that is passed in."""

import heapq
import math
from dataclasses import dataclass
from itertools import count
from typing import Generic, TypeVar

import numpy as np

Item = TypeVar("Item")

_HELD_BACK_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Impairment:
    """How bad a link is, in each direction: shares of the datagrams, and delay ± jitter, uniform."""

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    """Held back for another tenth of a second, behind those that were sent after them."""
    delay_s: float = 0.0
    jitter_s: float = 0.0


class Channel(Generic[Item]):
    """One direction of a link: what goes in at one time comes out later, twice or never."""

    def __init__(self, impairment: Impairment, rng: np.random.Generator) -> None:
        self._impairment = impairment
        self._shares = np.array([impairment.loss, impairment.duplication, impairment.reordering])
        self._rng = rng
        self._order = count()
        self.lost = 0
        self._under_way: list[tuple[float, int, Item]] = []

    @property
    def next_due(self) -> float:
        """When the next item arrives; infinity if none is under way."""
        return self._under_way[0][0] if self._under_way else math.inf

    def put(self, item: Item, now: float) -> None:
        """Send one item."""
        lost, doubled, held_back = (self._rng.random(3) < self._shares).tolist()
        if lost:
            self.lost += 1
            return
        for _ in range(2 if doubled else 1):
            delay_s = self._impairment.delay_s + self._impairment.jitter_s * float(self._rng.uniform(-1.0, 1.0))
            late_s = _HELD_BACK_S if held_back else 0.0
            heapq.heappush(self._under_way, (now + max(0.0, delay_s) + late_s, next(self._order), item))

    def take_due(self, now: float) -> list[Item]:
        """Return what has arrived by ``now``, in the order of arrival."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived
