"""Presence: our heartbeat to the vehicles, and theirs to us.

Ours is a safety signal: autopilots return home when it stops. So it is emitted by the loop that does the work.

    peer:   unheard ──heartbeat──► up ──silence──► lost ──heartbeat──► up
"""

from hsop_gcs.link.enums import MavAutopilot, MavState, MavType
from hsop_gcs.link.events import Event, LinkLost, LinkUp
from hsop_gcs.link.messages import Heartbeat, Message
from hsop_gcs.link.protocol.speaker import is_autopilots

HEARTBEAT_PERIOD_S = 1.0


class OwnHeartbeat:
    """A ground station's heartbeat at 1 Hz.

    watchdog_s: withhold it when ``keep_alive`` was not called for so long; None: nobody is watched.
    """

    def __init__(self, *, watchdog_s: float | None = None) -> None:
        self._watchdog_s = watchdog_s
        self._alive_s: float | None = None
        self._withheld = False
        self._outgoing: list[Message] = []
        self._due_s: float | None = None

    @property
    def withheld(self) -> bool:
        """Whether the newest heartbeat was not sent because whoever should feed it does not."""
        return self._withheld

    def keep_alive(self, now: float) -> None:
        """Called by the loop whose life the heartbeat stands for, every time it has done its work."""
        self._alive_s = now

    @property
    def wake_at(self) -> float | None:
        """When the next heartbeat is due; None before the first ``advance``."""
        return self._due_s

    def receive(self, message: Message, now: float) -> None:
        """Nothing that arrives changes our heartbeat."""

    def advance(self, now: float) -> None:
        """Emit what is due. After a long stall one heartbeat is sent, not a burst of the missed ones."""
        if self._due_s is None or now >= self._due_s:
            self._due_s = now + HEARTBEAT_PERIOD_S
            self._withheld = self._watchdog_s is not None and (
                self._alive_s is None or now - self._alive_s > self._watchdog_s
            )
            if self._withheld:
                return
            self._outgoing.append(
                Heartbeat(type=MavType.GCS, autopilot=MavAutopilot.INVALID, system_status=MavState.ACTIVE)
            )

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent, once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def take_events(self) -> list[Event]:
        """Our own heartbeat has no events."""
        return []


class Presence:
    """Whether one vehicle is heard. A heartbeat begins a link, whatever its autopilot says keeps it."""

    def __init__(self, system: int, *, lost_after_s: float = 3.5) -> None:
        self.system = system
        self.up = False
        self.last_heard_s: float | None = None
        self._lost_after_s = lost_after_s
        self._events: list[Event] = []

    @property
    def wake_at(self) -> float | None:
        """When silence becomes a lost link; None while there is no link to lose."""
        return self.last_heard_s + self._lost_after_s if self.up and self.last_heard_s is not None else None

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the vehicle's autopilot."""
        self.advance(now)
        if not self.up and is_autopilots(message):
            self.up = True
            self._events.append(LinkUp(system=self.system))
        if self.up:
            self.last_heard_s = now

    def advance(self, now: float) -> None:
        """Notice silence."""
        wake_at = self.wake_at
        if wake_at is not None and now >= wake_at:
            self.up = False
            self._events.append(LinkLost(system=self.system, silent_s=now - wake_at + self._lost_after_s))

    def take_outgoing(self) -> list[Message]:
        """Listening sends nothing."""
        return []

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events
