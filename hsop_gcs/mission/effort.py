"""How far the stages of a decision go in its time, counted, so that the same decision can be made again."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_TO_THE_END = -1


class Stages:
    """Gives each stage of a decision a word for "it is late", and remembers after how many looks it was."""

    def __init__(self, now: Callable[[], float], counts: tuple[int, ...] | None) -> None:
        """counts: those of the same decision before, in place of the deadline."""
        self._now = now
        self.deadline = math.inf
        """When stages that begin from now on are late, on the clock ``now``."""
        self._counts = None if counts is None else list(counts)
        self._looks: list[int] = []
        self._late: list[bool] = []
        self.least_s = 0.0
        """What carrying a placement out may take at least."""
        self.longest_s = 0.0
        """What the longest of the pieces of work took that were measured."""

    @property
    def counts(self) -> tuple[int, ...]:
        """After how many looks each stage was late; -1: never."""
        return tuple(looks if late else _TO_THE_END for looks, late in zip(self._looks, self._late, strict=True))

    @property
    def was_late(self) -> bool:
        """Whether any stage so far was."""
        return any(self._late)

    def stage(self) -> Callable[[], bool]:
        """Begin a stage; it ends when what is returned says that it is late."""
        number = len(self._looks)
        self._looks.append(0)
        self._late.append(False)
        most, deadline = None, self.deadline
        if self._counts is not None:
            most = self._counts[number] if number < len(self._counts) else _TO_THE_END

        def late() -> bool:
            if not self._late[number]:
                over = self._now() > deadline if most is None else self._looks[number] == most
                self._late[number] = over
                self._looks[number] += not over
            return self._late[number]

        return late

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Measure a piece of work."""
        began = self._now()
        yield
        self.longest_s = max(self.longest_s, self._now() - began)
