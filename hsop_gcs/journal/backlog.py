"""Entries on their way to the disk, in order. They are kept in memory while the disk takes none, within a bound.

    add ─▶ [ entry entry GAP entry entry entry ] ─▶ take ─▶ the disk
                     ▲ what was given up for room       └──▶ put_back, if it refused

What is given up leaves one ``EntriesGivenUp`` where the first of it stood, which tells how many of what.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from hsop_gcs.journal.entry import Worth, body_of

GIVEN_UP = "EntriesGivenUp"
"""The kind of the entry that stands for those that were given up; its data: how many of which kinds, and when."""


@dataclass(slots=True, kw_only=True)
class Waiting:
    """An entry that is not written yet."""

    sequence: int
    """Rises by one with every entry that is added."""
    time_s: float
    kind: str
    body: bytes
    worth: Worth
    since_s: float
    """Since when it waits, on a monotonic clock."""


@dataclass(slots=True, kw_only=True)
class _Gap:
    """Entries that were given up, and where the first of them stood."""

    sequence: int
    since_s: float
    from_s: float
    to_s: float
    kinds: Counter[str] = field(default_factory=Counter)

    def add(self, entry: Waiting) -> None:
        self.sequence = min(self.sequence, entry.sequence)
        self.from_s, self.to_s = min(self.from_s, entry.time_s), max(self.to_s, entry.time_s)
        self.kinds[entry.kind] += 1

    def join(self, other: "_Gap") -> None:
        self.sequence, self.since_s = min(self.sequence, other.sequence), min(self.since_s, other.since_s)
        self.from_s, self.to_s = min(self.from_s, other.from_s), max(self.to_s, other.to_s)
        self.kinds += other.kinds

    def to_entry(self) -> Waiting:
        data = {"kinds": dict(self.kinds), "from_s": self.from_s, "to_s": self.to_s}
        body = body_of(GIVEN_UP, data, self.to_s)
        return Waiting(
            sequence=self.sequence,
            time_s=self.to_s,
            kind=GIVEN_UP,
            body=body,
            worth=Worth.PROMISED,
            since_s=self.since_s,
        )


class Backlog:
    """A queue of at most ``most_bytes`` of entries. No threads, no disk: its owner locks it."""

    def __init__(self, most_bytes: int) -> None:
        self.bytes = 0
        """What the waiting entries take."""
        self.given_up: Counter[str] = Counter()
        """How many entries of each kind were given up for room, ever."""
        self.sequence = 0
        """The number of the newest entry that was added."""
        self._most_bytes = most_bytes
        self._waiting: dict[Worth, deque[Waiting]] = {worth: deque() for worth in Worth}
        """In order, each worth by itself: what is to be given up next is at the beginning."""
        self._kinds = Counter[str]()
        """How many entries of each kind wait."""
        self._gap: _Gap | None = None
        self._gap_taken: _Gap | None = None
        """The newest gap that was taken out, in case it is put back."""

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values())) + (self._gap is not None)

    @property
    def since_s(self) -> float | None:
        """Since when the entry that waits longest does, on its monotonic clock."""
        return min((waiting[0].since_s for waiting in self._waiting.values() if waiting), default=None)

    def add(self, *, time_s: float, kind: str, body: bytes, worth: Worth, now_s: float) -> int:
        """Put an entry at the end; return its sequence number. now_s: on a monotonic clock."""
        self.sequence += 1
        entry = Waiting(sequence=self.sequence, time_s=time_s, kind=kind, body=body, worth=worth, since_s=now_s)
        self._waiting[worth].append(entry)
        self._count(entry, 1)
        self._make_room()
        return self.sequence

    def holds(self, kind: str) -> bool:
        """Return whether an entry of a kind waits."""
        return self._kinds[kind] > 0

    def remove(self, kind: str) -> None:
        """Take out the entries of a kind that a newer one makes needless."""
        if not self.holds(kind):
            return
        for worth, waiting in self._waiting.items():
            for each in waiting:
                if each.kind == kind:
                    self._count(each, -1)
            self._waiting[worth] = deque(each for each in waiting if each.kind != kind)

    def take(self, most_bytes: int, *, alone: str | None = None) -> list[Waiting]:
        """Take the next entries out, at least one if there are any, the gap among them.

        alone: the kind of entries that are taken out by themselves.
        """
        taken: list[Waiting] = []
        size = 0
        while len(self) and (not taken or size < most_bytes):
            queues = [waiting for waiting in self._waiting.values() if waiting]
            queue = min(queues, key=lambda waiting: waiting[0].sequence, default=None)
            if self._gap is not None and (queue is None or self._gap.sequence <= queue[0].sequence):
                entry, self._gap_taken, self._gap = self._gap.to_entry(), self._gap, None
            else:
                assert queue is not None, "there is an entry or a gap"
                if queue[0].kind == alone and taken:
                    break
                entry = queue.popleft()
                self._count(entry, -1)
            taken.append(entry)
            size += len(entry.body)
            if entry.kind == alone:
                break
        return taken

    def put_back(self, entries: Sequence[Waiting]) -> None:
        """Put entries that could not be written back to where they came from."""
        for each in reversed(entries):
            if each.kind == GIVEN_UP and self._gap_taken is not None:
                if self._gap is not None:
                    self._gap_taken.join(self._gap)
                self._gap, self._gap_taken = self._gap_taken, None
                continue
            self._waiting[each.worth].appendleft(each)
            self._count(each, 1)
        self._make_room()

    def _count(self, entry: Waiting, by: int) -> None:
        self.bytes += by * len(entry.body)
        self._kinds[entry.kind] += by

    def _make_room(self) -> None:
        """Give up the oldest entries of the least worth, then those of more."""
        for waiting in self._waiting.values():
            while waiting and self.bytes > self._most_bytes:
                entry = waiting.popleft()
                self._count(entry, -1)
                self._give_up(entry)

    def lose(self, kind: str, *, time_s: float, now_s: float) -> None:
        """Leave a gap where an entry would have stood that cannot be written down at all."""
        self.sequence += 1
        lost = Waiting(sequence=self.sequence, time_s=time_s, kind=kind, body=b"", worth=Worth.PLAIN, since_s=now_s)
        self._give_up(lost)

    def _give_up(self, entry: Waiting) -> None:
        self.given_up[entry.kind] += 1
        if self._gap is None:
            self._gap = _Gap(sequence=entry.sequence, since_s=entry.since_s, from_s=entry.time_s, to_s=entry.time_s)
        self._gap.add(entry)
