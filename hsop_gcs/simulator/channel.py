"""A link that loses, doubles and delays datagrams, by chance that is passed in."""

import heapq
import math
from dataclasses import dataclass
from itertools import count
from typing import Generic, TypeVar

import numpy as np

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True, kw_only=True)
class Impairment:
    """How bad a link is. Jitter is uniform on top of the delay, so that datagrams overtake each other."""

    loss: float = 0.0
    duplication: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0


class Channel(Generic[Item]):
    """One direction of a link: what goes in at one time comes out later, twice or never."""

    def __init__(self, impairment: Impairment, rng: np.random.Generator) -> None:
        self._impairment = impairment
        self._rng = rng
        self._order = count()
        self._under_way: list[tuple[float, int, Item]] = []

    @property
    def next_due(self) -> float:
        """When the next item arrives; infinity if none is under way."""
        return self._under_way[0][0] if self._under_way else math.inf

    def put(self, item: Item, now: float) -> None:
        """Send one item."""
        chances = self._rng.random(3)
        if chances[0] < self._impairment.loss:
            return
        for copy in range(2 if chances[1] < self._impairment.duplication else 1):
            jitter = self._impairment.jitter_s * float(chances[2] if copy == 0 else self._rng.random())
            heapq.heappush(self._under_way, (now + self._impairment.delay_s + jitter, next(self._order), item))

    def take_due(self, now: float) -> list[Item]:
        """Return what has arrived by ``now``, in the order of arrival."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived
