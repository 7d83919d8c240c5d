"""Commands: the one loop that sends, waits and sends again.

MAVLink's acknowledgements carry no sequence number, so only one command of an id may be under way to a component.
Each (target component, command id) is a lane; the commands of one lane pass through it in turn:

    queued ──lane free──► waiting ──accepted, refused──────────────► finished
      │                     │  ▲ ▲
      │                     │  │ └─ no answer, tries left: sent again, COMMAND_LONG with a higher ``confirmation``
      │                     │  └─── temporarily rejected: backing off, then sent again
      │                     ├─ in progress ──► running ──final answer, or silence──► finished, never sent again
      │                     └─ no answer, no tries left ───────────► finished
      └─ superseded, withdrawn, past its deadline ─────────────────► finished

A lane stays closed for a moment after a command with fewer answers than sends: the missing ones may still arrive and
would be taken for answers to the next command. What arrives in that time, or without any command, is noise.

Every submitted command ends in exactly one ``Outcome``.  Source: MAVLink developer guide, "Command protocol".
"""

from collections import deque
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum, auto

from hsop_gcs.link.enums import MavComponent, MavResult
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.messages import CommandAck, CommandInt, CommandLong, Message

ONCE = 1
"""Tries of a command whose late second copy could do harm: arming, taking off."""
REPEATABLE = 3
"""Tries of a command that says the same however often it arrives: absolute targets, modes, requests."""
INSISTENT = 12
"""Tries of such a command where not knowing is worst: is the vehicle on its way, or not? With 30 % of all frames lost
each way six tries stay without an answer 18 times in 1000, twelve less than once; its deadline ends it before, mostly.
"""


class Verdict(StrEnum):
    """How a command ended."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    NO_REPLY = "no reply"
    EXPIRED = "its deadline passed before it could be sent"
    SUPERSEDED = "a newer command took its place"


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A command to be sent.

    key: what it is for; a newer request of the same lane and key takes the place of one that still waits its turn.
    deadline_s: nothing is sent at or after this time.
    """

    message: CommandLong | CommandInt
    key: str
    tries: int
    deadline_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The end of one request; ``result`` is the autopilot's own number if it gave one (it may be none of MavResult)."""

    ticket: int
    request: Request
    verdict: Verdict
    result: int | None = None

    @property
    def accepted(self) -> bool:
        """Whether the autopilot took the command; it says nothing about what the vehicle then does."""
        return self.verdict is Verdict.ACCEPTED

    @property
    def problem(self) -> str:
        """Why it was not accepted, for a person."""
        if self.verdict is not Verdict.REFUSED or self.result is None:
            return self.verdict.value
        try:
            return MavResult(self.result).name
        except ValueError:
            return f"result {self.result}"


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandLimits:
    """Patience, seconds and counts."""

    reply_s: float = 1.2
    in_progress_s: float = 10.0
    back_off_s: float = 1.0
    rejections: int = 5
    """How often a temporary rejection is answered with another try."""
    settle_s: float = 1.0
    """How long answers to earlier sends may still be on their way."""


class _Phase(Enum):
    QUEUED = auto()
    WAITING = auto()
    RUNNING = auto()
    BACKING_OFF = auto()


@dataclass(slots=True, kw_only=True)
class _Entry:
    ticket: int
    request: Request
    phase: _Phase = _Phase.QUEUED
    sends: int = 0
    answers: int = 0
    rejections: int = 0
    unanswered_tries: int = 0
    resend: bool = True
    wake_at_s: float = 0.0


@dataclass(slots=True)
class _Lane:
    queue: deque[_Entry] = field(default_factory=deque)
    current: _Entry | None = None
    closed_until_s: float | None = None


_LaneKey = tuple[int, int]


class CommandSender:
    """All commands to one vehicle. See the module's diagram."""

    def __init__(self, *, own: Identity = GROUND_STATION, limits: CommandLimits | None = None) -> None:
        self._own = own
        self._limits = limits or CommandLimits()
        self._lanes: dict[_LaneKey, _Lane] = {}
        self._outgoing: list[Message] = []
        self._outcomes: list[Outcome] = []
        self._tickets = 0
        self.noise = 0
        """Acknowledgements that no command was waiting for: duplicates, late ones, other people's."""
        self.resent = 0

    def submit(self, request: Request, now: float) -> int:
        """Queue a command; returns the ticket by which its one outcome is known."""
        self._tickets += 1
        lane = self._lanes.setdefault(_lane_key(request.message), _Lane())
        for entry in [entry for entry in lane.queue if entry.request.key == request.key]:
            lane.queue.remove(entry)
            self._finish(entry, Verdict.SUPERSEDED)
        if lane.current is not None and lane.current.request.key == request.key:
            lane.current.resend = False
            if lane.current.phase is _Phase.BACKING_OFF:
                self._leave(lane, lane.current, Verdict.SUPERSEDED, now)
        lane.queue.append(_Entry(ticket=self._tickets, request=request))
        self._start_next(lane, now)
        return self._tickets

    def withdraw(self, key: str, now: float) -> None:
        """Never send again what was submitted under ``key``; what already waits for its answer still gets it."""
        for lane in self._lanes.values():
            for entry in [entry for entry in lane.queue if entry.request.key == key]:
                lane.queue.remove(entry)
                self._finish(entry, Verdict.SUPERSEDED)
            if lane.current is not None and lane.current.request.key == key:
                lane.current.resend = False
                if lane.current.phase is _Phase.BACKING_OFF:
                    self._leave(lane, lane.current, Verdict.SUPERSEDED, now)

    @property
    def wake_at(self) -> float | None:
        """When ``advance`` has something to do."""
        times = [lane.current.wake_at_s for lane in self._lanes.values() if lane.current is not None]
        times += [
            lane.closed_until_s
            for lane in self._lanes.values()
            if lane.current is None and lane.queue and lane.closed_until_s is not None
        ]
        times += [entry.request.deadline_s for lane in self._lanes.values() for entry in lane.queue]
        return min(times, default=None)

    def receive(self, message: Message, now: float, *, component: int = MavComponent.AUTOPILOT1) -> None:
        """Take an acknowledgement of the vehicle's ``component``.

        Old autopilots leave the target of an acknowledgement at zero; only one that names somebody else is not ours.
        """
        if not isinstance(message, CommandAck):
            return
        if message.target_system not in (0, self._own.system) or message.target_component not in (
            0,
            self._own.component,
        ):
            return
        lane = self._lanes.get((component, message.command))
        if lane is None or lane.current is None:
            # What was asked of all, whoever answers first has answered.
            lane = self._lanes.get((MavComponent.ALL, message.command))
        entry = lane.current if lane is not None else None
        if lane is None or entry is None or entry.phase is _Phase.BACKING_OFF:
            self.noise += 1
            return
        if message.result == MavResult.IN_PROGRESS:
            entry.phase = _Phase.RUNNING
            entry.wake_at_s = now + self._limits.in_progress_s
            return
        entry.answers += 1
        if entry.phase is _Phase.RUNNING and message.result == MavResult.TEMPORARILY_REJECTED and entry.sends > 1:
            self.noise += 1  # the answer to our own second copy: the first one is being carried out
        elif message.result == MavResult.ACCEPTED:
            self._leave(lane, entry, Verdict.ACCEPTED, now, result=message.result)
        elif (
            message.result == MavResult.TEMPORARILY_REJECTED
            and entry.phase is _Phase.WAITING
            and self._may_back_off(entry)
        ):
            entry.rejections += 1
            entry.phase = _Phase.BACKING_OFF
            entry.wake_at_s = now + self._limits.back_off_s * entry.rejections
        else:
            self._leave(lane, entry, Verdict.REFUSED, now, result=message.result)

    def advance(self, now: float) -> None:
        """Send again, give up, or start what waits, as the time demands."""
        for lane in self._lanes.values():
            for entry in [entry for entry in lane.queue if now >= entry.request.deadline_s]:
                lane.queue.remove(entry)
                self._finish(entry, Verdict.EXPIRED)
            entry_or_none = lane.current
            if entry_or_none is not None and now >= entry_or_none.wake_at_s:
                self._overdue(lane, entry_or_none, now)
            self._start_next(lane, now)

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent, once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def take_outcomes(self) -> list[Outcome]:
        """Return what ended, once."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def _may_back_off(self, entry: _Entry) -> bool:
        return entry.resend and entry.rejections < self._limits.rejections

    def _overdue(self, lane: _Lane, entry: _Entry, now: float) -> None:
        if entry.phase is _Phase.RUNNING:
            self._leave(lane, entry, Verdict.NO_REPLY, now)
            return
        if entry.phase is _Phase.WAITING:
            entry.unanswered_tries += 1
        stale = now >= entry.request.deadline_s
        if stale or not entry.resend or entry.unanswered_tries >= entry.request.tries:
            verdict = Verdict.NO_REPLY if entry.phase is _Phase.WAITING else Verdict.REFUSED
            result = None if verdict is Verdict.NO_REPLY else int(MavResult.TEMPORARILY_REJECTED)
            self._leave(lane, entry, verdict, now, result=result)
        else:
            self._send(entry, now)

    def _start_next(self, lane: _Lane, now: float) -> None:
        if lane.current is not None or (lane.closed_until_s is not None and now < lane.closed_until_s):
            return
        while lane.queue:
            entry = lane.queue.popleft()
            if now >= entry.request.deadline_s:
                self._finish(entry, Verdict.EXPIRED)
                continue
            lane.current, lane.closed_until_s = entry, None
            self._send(entry, now)
            return

    def _send(self, entry: _Entry, now: float) -> None:
        message = entry.request.message
        if isinstance(message, CommandLong):
            message = replace(message, confirmation=min(entry.sends, 255))
        self.resent += entry.sends > 0
        entry.sends += 1
        entry.phase = _Phase.WAITING
        entry.wake_at_s = now + self._limits.reply_s
        self._outgoing.append(message)

    def _leave(self, lane: _Lane, entry: _Entry, verdict: Verdict, now: float, *, result: int | None = None) -> None:
        lane.current = None
        lane.closed_until_s = now + self._limits.settle_s if entry.answers < entry.sends else None
        self._finish(entry, verdict, result)
        self._start_next(lane, now)

    def _finish(self, entry: _Entry, verdict: Verdict, result: int | None = None) -> None:
        self._outcomes.append(Outcome(ticket=entry.ticket, request=entry.request, verdict=verdict, result=result))


def _lane_key(message: CommandLong | CommandInt) -> _LaneKey:
    return message.target_component, message.command
