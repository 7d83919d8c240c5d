"""Whether a vehicle's failsafes are set as the operator's manual relies on: its parameters are read and compared.

    link down ──link up──► asking ──each parameter told, or given up──► watching ──a parameter is set──► compared again
        ▲                  (one at a time, a few tries each)               │
        └───────────────────────────link lost──────────────────────────────┘

Nothing is changed in the vehicle: what deviates is told once, with what to set. What does not answer is told as well.
"""

import struct

from hsop_gcs.link.adapters.adapter import Adapter
from hsop_gcs.link.adapters.failsafes import Relied
from hsop_gcs.link.events import Event, FailsafeNotSet
from hsop_gcs.link.messages import Message, ParamRequestRead, ParamValue
from hsop_gcs.link.protocol.telemetry import Telemetry

_BEGIN_AFTER_S = 4.0
"""What gates an order is asked for first."""
_REPLY_S = 1.0
_PAUSE_S = 0.05
_TRIES = 6
"""With 30 % of all frames lost each way a parameter is not told in one vehicle of a hundred; then it is asked again."""
_AGAIN_S = 60.0
"""Until those that were not told are asked for once more."""
_REAL32 = 9
"""MAV_PARAM_TYPE of a float; all others are integers."""
_BY_NAME = -1


class Failsafes:
    """Reads the parameters that matter of one vehicle. See the module's diagram."""

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._values: dict[str, float] = {}
        self._queue: list[str] = []
        """Names that are still to be asked for."""
        self._silent: set[str] = set()
        """Names that were asked for in vain."""
        self._told: dict[str, str] = {}
        self._asked: str | None = None
        self._tries = 0
        self._next_at: float | None = None
        self._events: list[Event] = []
        self._outgoing: list[Message] = []

    @property
    def checked(self) -> bool:
        """Whether every parameter was told, or given up, since the link came up."""
        return bool(self._relied) and all(self._settled(each) for each in self._relied)

    @property
    def problems(self) -> tuple[str, ...]:
        """What does not work as it should, and what to set; nothing of what is not known yet."""
        return tuple(problem for each in self._relied if (problem := self._problem(each)) is not None)

    @property
    def wake_at(self) -> float | None:
        """When to ask, or to ask again; None while the link is down."""
        return self._next_at

    def link_up(self, now: float) -> None:
        """Read all of them: it may be another vehicle, or have other parameters, than before."""
        self._values.clear()
        self._silent.clear()
        self._queue.clear()
        self._asked, self._tries = None, 0
        self._next_at = now + _BEGIN_AFTER_S

    def link_lost(self) -> None:
        """Cease to ask."""
        self._next_at = None

    def receive(self, message: Message, now: float) -> None:
        """Take a parameter, whoever asked for it or set it."""
        if not isinstance(message, ParamValue) or self._next_at is None:
            return
        if not any(message.param_id in each.names for each in self._relied):
            return
        self._values[message.param_id] = self._number(message)
        self._silent.discard(message.param_id)
        self._tell()
        if message.param_id == self._asked:
            self._asked, self._next_at = None, now + _PAUSE_S

    def advance(self, now: float) -> None:
        """Ask for the next one."""
        if self._next_at is None or now < self._next_at:
            return
        if not self._values and not self._silent and self._asked is None:
            self._queue = self._unknown()
        if self._asked is not None and self._tries >= _TRIES:
            self._silent.add(self._asked)
            self._asked = None
            self._tell()
        if self._asked is None:
            self._asked, self._tries = self._next_name(), 0
        if self._asked is None:
            self._next_at = now + _AGAIN_S
            self._queue = self._unknown()
            return
        state = self._telemetry.state
        ask = ParamRequestRead(
            target_system=state.system,
            target_component=state.component,
            param_id=self._asked,
            param_index=_BY_NAME,
        )
        self._outgoing.append(ask)
        self._tries += 1
        self._next_at = now + _REPLY_S

    def take_outgoing(self) -> list[Message]:
        """Return what is to be sent, once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def take_events(self) -> list[Event]:
        """Return what happened, once."""
        events, self._events = self._events, []
        return events

    @property
    def _adapter(self) -> Adapter | None:
        return self._telemetry.adapter

    @property
    def _relied(self) -> tuple[Relied, ...]:
        return () if self._adapter is None else self._adapter.failsafes

    def _known(self, relied: Relied) -> str | None:
        return next((name for name in relied.names if name in self._values), None)

    def _settled(self, relied: Relied) -> bool:
        return self._known(relied) is not None or all(name in self._silent for name in relied.names)

    def _next_name(self) -> str | None:
        """Take the next name off the queue, but those whose parameter is known by another name."""
        unknown = self._unknown()
        while self._queue:
            name = self._queue.pop(0)
            if name in unknown:
                return name
        return None

    def _unknown(self) -> list[str]:
        return [name for each in self._relied if self._known(each) is None for name in each.names]

    def _number(self, message: ParamValue) -> float:
        """Read a value off the wire: PX4 puts the bits of an integer where ArduPilot puts the number."""
        bytewise = self._adapter is not None and self._adapter.integers_bytewise
        if message.param_type == _REAL32 or not bytewise:
            return message.param_value
        value: int = struct.unpack("<i", struct.pack("<f", message.param_value))[0]
        return float(value)

    def _problem(self, relied: Relied) -> str | None:
        name = self._known(relied)
        if name is None:
            names = " or ".join(relied.names)
            return f"{names} is not told: it may be that {relied.otherwise}" if self._settled(relied) else None
        value = self._values[name]
        if relied.fits(value):
            return None
        return f"{name} is {value:g}: {relied.otherwise}; set it to {relied.set_to:g}"

    def _tell(self) -> None:
        """Tell what is wrong now and was not told before."""
        for each in self._relied:
            problem = self._problem(each)
            if problem is None:
                if self._known(each) is not None:
                    self._told.pop(each.names[0], None)
            elif self._told.get(each.names[0]) != problem:
                self._told[each.names[0]] = problem
                self._events.append(FailsafeNotSet(system=self._telemetry.state.system, problem=problem))
