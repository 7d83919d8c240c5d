"""How far a search goes: as long as there is time, in steps that are counted, or exactly so many steps again."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class OutOfTime(Exception):
    """The search ends here, with what it has."""


class Effort:
    """Steps until a deadline, or as many as were taken before. Time decides how many there are and nothing else."""

    def __init__(self, deadline: float, now: Callable[[], float], most: int | None = None) -> None:
        """deadline: on the clock ``now``; it counts unless ``most`` steps are to be taken, whatever the time."""
        self.deadline, self._now, self._most = deadline, now, most
        self.taken = 0
        self.least = 0
        """Steps that are taken also when it is late."""

    def late(self) -> bool:
        """Whether the deadline has passed: for long steps to look at, which are then given up as a whole."""
        return self._most is None and self._now() > self.deadline

    def goes_on(self) -> bool:
        """Count one more step if there is one."""
        if self.taken == self._most or (self.late() and self.taken >= self.least):
            return False
        self.taken += 1
        return True

    def ends(self) -> bool:
        """Whether there is no further step; otherwise one is counted."""
        return not self.goes_on()

    def begin(self) -> None:
        """Count one more step. Raises OutOfTime if there is none."""
        if not self.goes_on():
            raise OutOfTime

    @contextmanager
    def set_aside(self) -> Iterator[None]:
        """Leave as much of the time as what is done within takes, and half as much again, for doing it at the end."""
        began = self._now()
        yield
        self.deadline -= 1.5 * (self._now() - began)

    def give_up(self) -> None:
        """Take a step back that was not finished in time. Raises OutOfTime."""
        self.taken -= 1
        raise OutOfTime
