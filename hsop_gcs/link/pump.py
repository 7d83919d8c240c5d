"""The link as the service holds it: sockets, clock and machines, driven by one task.

Nothing else awaits a socket. Our heartbeat comes out of the same loop that reads, decides and sends, so that a hung
ground station falls silent and the vehicles' failsafes notice.

    open ──► running ──a fault──► running again, at once ──the fifth time in five seconds──► ended: wait_ended raises

Faults of a frame, a vehicle, a socket, a recording or a listener do not get that far: they are counted, told and gone
on from. Once the pump has ended, orders raise Unavailable: nothing is said to be sent that is not.
"""

import asyncio
import logging
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType
from typing import Self

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.account import LinkCounters, Stranger, VehicleLink
from hsop_gcs.link.backlog import Backlog, Lag
from hsop_gcs.link.endpoint import Address, Peer, Pin, parse_endpoint
from hsop_gcs.link.events import Event, VehicleFault
from hsop_gcs.link.faults import Faults, describe, trace_of
from hsop_gcs.link.identity import GROUND_STATION, Identity
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.router import Router
from hsop_gcs.link.signing import Signing
from hsop_gcs.link.transports import transport_for
from hsop_gcs.link.vehicle import Vehicle, VehicleLimits

_LONGEST_SLEEP_S = 0.1
_GATHER_S = 0.002
_MOST_RESTARTS = 4
_RESTARTS_WITHIN_S = 5.0

log = logging.getLogger(__name__)


class Link:
    """All vehicles of a fleet over their endpoints.

    endpoints: as ``parse_endpoint`` reads them, each shared by any number of vehicles. systems: the MAVLink
    ids of the fleet. clock: seconds, monotonic; by default the event loop's. on_event: called from the pump for every
    event; without it they are put on ``events``. on_frame: called with every raw frame received and sent.
    connections: over which of the endpoints a system must be heard first; one left out may be heard over any.
    signing: of the endpoints over which everything is signed. pins: the only address of each system that has one.
    watchdog_s: our heartbeat stops when ``keep_alive`` is not called for so long; None: it stands for the pump alone.
    Raises BadInput for an endpoint or id that is none.
    """

    def __init__(
        self,
        endpoints: Iterable[str],
        systems: Iterable[int],
        *,
        own: Identity = GROUND_STATION,
        limits: VehicleLimits | None = None,
        clock: Callable[[], float] | None = None,
        on_event: Callable[[Event], None] | None = None,
        on_frame: Callable[[bytes], None] | None = None,
        connections: Mapping[int, str] | None = None,
        signing: Mapping[str, Signing] | None = None,
        pins: Mapping[int, Pin] | None = None,
        watchdog_s: float | None = None,
    ) -> None:
        ids = list(systems)
        for system in ids:
            if not 1 <= system <= 255 or system == own.system:
                raise BadInput("system", f"{system} is no id of a vehicle (1-255, not our own {own.system})")
        if len(set(ids)) != len(ids):
            raise BadInput("system", f"{sorted(ids)} names one vehicle twice")
        self.events: asyncio.Queue[Event] = asyncio.Queue()
        self._transports = [
            transport_for(parse_endpoint(text), self._bytes_handler(number)) for number, text in enumerate(endpoints)
        ]
        streams = {number for number, each in enumerate(self._transports) if each.endpoint.is_stream}
        numbers = {each.endpoint: number for number, each in enumerate(self._transports)}
        transport_of = {system: numbers[parse_endpoint(text)] for system, text in (connections or {}).items()}
        self._signing = {numbers[parse_endpoint(text)]: each for text, each in (signing or {}).items()}
        self._router = Router(
            ids,
            own=own,
            limits=limits,
            streams=streams,
            calling={number for number, each in enumerate(self._transports) if each.endpoint.kind != "udpin"},
            transport_of=transport_of,
            signing=self._signing,
            pins=pins,
            watchdog_s=watchdog_s,
        )
        self._clock = clock
        self._on_event = on_event or self.events.put_nowait
        self._on_frame = on_frame
        self._backlog = Backlog()
        self._lag = Lag()
        self._read_until_s = 0.0
        self._due_s: float | None = None
        self._listeners: dict[int, list[Callable[[bytes], None]]] = defaultdict(list)
        self._faults = Faults()
        self._stir = asyncio.Event()
        self._pump: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Open the sockets and start the pump. Raises Unavailable if a socket cannot be opened."""
        try:
            for number, transport in enumerate(self._transports):
                await transport.open()
                remote = transport.remote
                if remote is not None:
                    self._router.greet(Peer(number, *remote))
        except BaseException:
            await self._close_transports()
            raise
        self._clock = self._clock or asyncio.get_running_loop().time
        self._pump = asyncio.create_task(self._keep_running(), name="link pump")

    async def close(self) -> None:
        """Stop the pump and close the sockets. Raises Unavailable if the pump had ended by itself."""
        pump, self._pump = self._pump, None
        try:
            if pump is not None:
                pump.cancel()
                try:
                    await pump
                except asyncio.CancelledError:
                    current = asyncio.current_task()
                    if current is not None and current.cancelling():
                        raise
        finally:
            await self._close_transports()

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def running(self) -> bool:
        """Whether the pump runs; a pump that failed has stopped our heartbeat with it."""
        return self._pump is not None and not self._pump.done()

    async def wait_ended(self) -> None:
        """Wait until the pump ends by itself, which is a fault: raises Unavailable."""
        if self._pump is not None:
            await asyncio.shield(self._pump)

    def require_running(self) -> None:
        """Raise Unavailable if nothing can be sent to anybody because the pump does not run."""
        if not self.running:
            raise Unavailable(f"nothing can be sent: {self._why_ended()}")

    @property
    def vehicles(self) -> Mapping[int, Vehicle]:
        """The fleet by system id. Give orders through the link: it knows the time and wakes the pump."""
        return self._router.vehicles

    @property
    def counters(self) -> LinkCounters:
        """What went through the link."""
        return self._router.counters

    def vehicle_link(self, system: int) -> VehicleLink:
        """One vehicle's share of the link."""
        return self._router.vehicle_link(system, self.now())

    @property
    def strangers(self) -> tuple[Stranger, ...]:
        """Who is heard and not in the fleet."""
        return self._router.strangers

    @property
    def problems(self) -> tuple[str, ...]:
        """What of the link does not work now, for a person."""
        down = [f"{each.endpoint}: {each.problem}" for each in self._transports if each.problem is not None]
        if self._router.heartbeat.withheld:
            down.append("heartbeat withheld: the mission does not move")
        down += {each.problem for each in self._signing.values() if each.problem is not None}
        if self.behind:
            down.append(
                f"the service is up to {self.lag_s:.1f} s behind its link: no host departs until it has caught up"
            )
        if self._clock is not None:
            down += self._faults.problems(self.now()) + self._router.faults.problems(self.now())
        return tuple(down)

    @property
    def faults(self) -> dict[str, int]:
        """Faults of our own that no vehicle is to be blamed for, by where they happened."""
        return dict(self._faults.counts + self._router.faults.counts)

    @property
    def dropped_datagrams(self) -> int:
        """Datagrams, or pieces of a stream, that came faster than the pump could take them."""
        return self._backlog.dropped

    @property
    def superseded(self) -> int:
        """States of vehicles that were passed over because a newer one had come before they were read."""
        return self._backlog.superseded

    @property
    def lag_s(self) -> float:
        """By how much the pump was late at worst of late; 0 while it is in time."""
        return self._lag.longest_s

    @property
    def behind(self) -> bool:
        """Whether the service is so far behind its link that nothing new is to be begun."""
        return self._lag.behind

    def read_until(self) -> float:
        """The time until which all that arrived has been read: what is not known by then has not been said."""
        return min(self._read_until_s, self.now()) if self._due_s is not None else self.now()

    @property
    def send_errors(self) -> int:
        """Frames that the network refused, or that found a line down or full."""
        return sum(transport.errors for transport in self._transports)

    @property
    def addresses(self) -> tuple[Address, ...]:
        """Our own address of each endpoint, in their order."""
        return tuple(transport.local for transport in self._transports)

    def now(self) -> float:
        """The link's clock, seconds; deadlines of orders are times on it."""
        if self._clock is None:
            raise RuntimeError("the link is not open")
        return self._clock()

    def listen(self, system: int, listener: Callable[[bytes], None]) -> None:
        """Show what we believe of a vehicle to somebody else as well, until ``unlisten``. Raises BadInput."""
        self._check(system)
        self._listeners[system].append(listener)

    def unlisten(self, system: int, listener: Callable[[bytes], None]) -> None:
        """See ``listen``."""
        if listener in self._listeners[system]:
            self._listeners[system].remove(listener)

    def forward(self, system: int, data: bytes) -> None:
        """Send a vehicle what of somebody else's datagram may pass; it is signed and recorded like our own.

        Commands that do not pass are denied before this returns, to all who ``listen``.
        """
        self._check(system)
        for answer in self._router.forward(system, data):
            self._show(system, answer)
        self._stir.set()

    def keep_alive(self) -> None:
        """Say that the work the heartbeat stands for is being done; see ``watchdog_s``."""
        self._router.heartbeat.keep_alive(self.now())

    def register(self, system: int, address: str) -> None:
        """Listen to a vehicle at another address that claims to be it. Raises BadInput for one that does not."""
        self._vehicle(system)
        self._router.register(system, address)
        self._stir.set()

    def hover(self, system: int, order: HoverOrder) -> None:
        """See ``Vehicle.hover``. Raises BadInput for a vehicle that is not in the fleet."""
        self._vehicle(system).hover(order, self.now())
        self._stir.set()

    def follow(self, system: int, aim: Aim) -> None:
        """See ``Vehicle.follow``."""
        self._vehicle(system).follow(aim, self.now())
        self._stir.set()

    def take_off(self, system: int, altitude_above_home_m: float, *, order_id: str = "take off") -> None:
        """See ``Vehicle.take_off``."""
        self._vehicle(system).take_off(altitude_above_home_m, self.now(), order_id=order_id)
        self._stir.set()

    def hold(self, system: int) -> None:
        """See ``Vehicle.hold``."""
        self._vehicle(system).hold(self.now())
        self._stir.set()

    def return_to_launch(self, system: int) -> None:
        """See ``Vehicle.return_to_launch``."""
        self._vehicle(system).return_to_launch(self.now())
        self._stir.set()

    def leave_alone(self, system: int) -> None:
        """See ``Vehicle.leave_alone``."""
        self._vehicle(system).leave_alone(self.now())

    def _vehicle(self, system: int) -> Vehicle:
        """Return a vehicle that is about to be ordered something. Raises BadInput, and Unavailable without a pump."""
        self._check(system)
        self.require_running()
        return self._router.touch(system)

    def _check(self, system: int) -> None:
        if system not in self._router.vehicles:
            raise BadInput("system", f"{system} is not in the fleet {sorted(self._router.vehicles)}")

    def _bytes_handler(self, number: int) -> Callable[[bytes, Address], None]:
        def on_bytes(data: bytes, address: Address) -> None:
            self._backlog.put(data, Peer(number, *address), self.now())
            self._stir.set()

        return on_bytes

    async def _keep_running(self) -> None:
        """Run the pump, and again at once if it fails. Raises Unavailable if it fails again and again."""
        failed_s: deque[float] = deque(maxlen=_MOST_RESTARTS)
        while True:
            try:
                await self._run()
            except Exception as error:
                now = self.now()
                self._faults.note("the pump", error, now)
                if len(failed_s) == _MOST_RESTARTS and now - failed_s[0] <= _RESTARTS_WITHIN_S:
                    raise Unavailable(
                        f"the link has ended, its pump fails again and again: {describe(error)}"
                    ) from error
                failed_s.append(now)
                log.exception("the link's pump has failed; it is started again")

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._stir.clear()
            self._turn()
            wake_at = self._router.wake_at
            pause_s = _LONGEST_SLEEP_S if wake_at is None else min(max(wake_at - self.now(), 0.0), _LONGEST_SLEEP_S)
            self._due_s = self.now() + pause_s + _GATHER_S
            alarm = loop.call_later(pause_s, self._stir.set)
            await self._stir.wait()
            alarm.cancel()
            # What comes within a moment is worked off together: half the work with a hundred vehicles.
            await asyncio.sleep(_GATHER_S)

    def _turn(self) -> None:
        """Read what came, let the machines work, send what they made."""
        now = self.now()
        late_s = 0.0 if self._due_s is None else now - self._due_s
        self._lag.note(max(late_s, self._backlog.age_s(now)), now)
        for arrived in self._backlog.take(now):
            peer = arrived.peer
            if arrived.superseded:
                self._router.pass_over(arrived.data, peer, arrived.at_s)
                self._record(arrived.data)
                continue
            for frame in self._router.receive(arrived.data, peer, arrived.at_s):
                self._record(frame.raw)
                if frame.system in self._listeners and peer == self._router.peer_of(frame.system):
                    self._show(frame.system, frame.raw)
        self._read_until_s = now
        self._router.advance(self.now())
        for peer, raw in self._router.take_outgoing():
            self._send(raw, peer)
            self._record(raw)
        for event in self._router.take_events():
            self._tell(event)

    def _send(self, raw: bytes, peer: Peer) -> None:
        for _ in range(2):  # a heartbeat is not to be missed for a fault that has passed
            try:
                self._transports[peer.transport].send(raw, (peer.host, peer.port))
            except Exception as error:
                self._note(f"sending to {peer.address}", error)
            else:
                return

    def _record(self, raw: bytes) -> None:
        if self._on_frame is None:
            return
        try:
            self._on_frame(raw)
        except Exception as error:
            self._note("the recording", error)

    def _show(self, system: int, raw: bytes) -> None:
        for listener in tuple(self._listeners[system]):
            try:
                listener(raw)
            except Exception as error:
                self._note(f"what listens to system {system}", error)

    def _tell(self, event: Event) -> None:
        if isinstance(event, VehicleFault):
            trace = self._router.vehicles[event.system].trace
            at = "" if event.frame is None else f" at the frame {event.frame}"
            log.error("system %d: %s failed%s: %s\n%s", event.system, event.where, at, event.problem, trace)
        try:
            self._on_event(event)
        except Exception as error:
            self._note("telling an event", error)

    def _note(self, where: str, error: Exception) -> None:
        if self._faults.note(where, error, self.now()):
            log.error("%s failed: %s\n%s", where, describe(error), trace_of(error))

    def _why_ended(self) -> str:
        pump = self._pump
        error = pump.exception() if pump is not None and pump.done() and not pump.cancelled() else None
        return "the link is not open" if error is None else str(error)

    async def _close_transports(self) -> None:
        for transport in self._transports:
            await transport.close()
