"""Faults of our own, put into every part of the link in flight: one frame costs itself, one vehicle costs itself."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.events import Arrived, OrderFailed, VehicleFault
from hsop_gcs.link.messages import CommandAck
from tests.link.three_hosts import FAULTY, LONGEST_GAP_S, SYSTEMS, Hosts, fly
from tests.link.two_ends import TwoEnds

MACHINES = (
    *("presence", "telemetry", "commands", "subscriptions", "hover", "gimbal", "take_off", "round_trip"),
    "failsafes",
)
LISTENERS = ("speaker", "one_aircraft")
"""Machines with nothing that falls due."""


class Broken(Exception):
    """What is thrown into the works."""


def fails(inner: Callable[..., Any], times: float) -> Callable[..., Any]:
    """Return what fails so many times, and then works as before."""
    left = times

    def call(*args: Any, **named: Any) -> Any:
        nonlocal left
        if left > 0:
            left -= 1
            raise Broken("thrown in by a test")
        return inner(*args, **named)

    return call


def break_machine(hosts: Hosts, machine: str, method: str, times: float) -> Callable[[], None]:
    """Make a method of a host's machine fail, also of the machines that come after it; returns how to end that."""
    kind = type(getattr(hosts.faulty, f"_{machine}"))
    inner = getattr(kind, method)
    broken = fails(inner, times)
    system = hosts.faulty.system

    def of_one(self: Any, *args: Any, **named: Any) -> Any:
        mine = self is getattr(hosts.link.vehicles[system], f"_{machine}")
        return broken(self, *args, **named) if mine else inner(self, *args, **named)

    setattr(kind, method, of_one)
    return lambda: setattr(kind, method, inner)


async def hold_and_recall(hosts: Hosts, who: Sequence[int] = SYSTEMS) -> None:
    """Stop all hosts, then send them home, and see that they do."""
    for order, where in ((hosts.link.hold, "Brake"), (hosts.link.return_to_launch, "RTL")):
        for system in SYSTEMS:
            order(system)
        await asyncio.sleep(2.5)
        assert [hosts.mode(system) for system in who] == [where] * len(who)


ONCE, ALWAYS = 1, float("inf")


@pytest.mark.parametrize("times", [ONCE, ALWAYS], ids=["once", "from now on"])
@pytest.mark.parametrize("machine", [*MACHINES, *LISTENERS])
def test_a_machine_that_fails_costs_its_vehicle_the_order_and_nobody_else_anything(machine: str, times: float) -> None:
    async def story(hosts: Hosts) -> None:
        mend = [break_machine(hosts, machine, "receive", times)]
        try:
            await asyncio.sleep(1.0)
            assert hosts.faulty.faults >= 1
            assert [event.order_id for event in hosts.of(OrderFailed) if isinstance(event, OrderFailed)] == ["o2"]
            why_not = hosts.faulty.why_not_ready(hosts.link.now()) or ""
            assert ("the service failed" in why_not) == (times == ALWAYS), why_not
            before = hosts.faulty.faults
            if machine in MACHINES:
                mend.append(break_machine(hosts, machine, "advance", times))
                hosts.faulty.advance(hosts.link.now())
                assert hosts.faulty.faults > before or machine not in ("presence", "telemetry", "commands")
            await hold_and_recall(hosts)
        finally:
            for undo in reversed(mend):
                undo()

    hosts = fly(story)
    assert hosts.unharmed()
    assert hosts.longest_gap_s() <= LONGEST_GAP_S
    assert len(hosts.of(VehicleFault)) == 1
    expected = [system for system in SYSTEMS if times == ONCE or system != FAULTY]
    assert set(expected) <= set(hosts.obeyed("hold"))
    assert set(expected) <= set(hosts.obeyed("return to launch"))


@pytest.mark.parametrize("machine", MACHINES)
def test_a_machine_that_fails_at_what_is_due_is_begun_anew(machine: str) -> None:
    ends = TwoEnds("ardupilot").ready()
    ends.order()
    ends.run(2.0)
    kind = type(getattr(ends.vehicle, f"_{machine}"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kind, "advance", fails(kind.advance, ONCE))
        ends.vehicle.advance(ends.now)
        assert ends.vehicle.faults == 1
        ends.run(1.0)
    assert ends.saw(OrderFailed, "o1")
    assert ends.vehicle.why_not_ready(ends.now) is None
    ends.order("o2", east_m=5.0)
    ends.until(lambda: ends.saw(Arrived, "o2"))


@pytest.mark.parametrize("method", ["_collect", "receive", "advance", "take_outgoing", "take_events", "wake_at"])
def test_a_vehicle_that_fails_as_a_whole_costs_nobody_else_anything(method: str) -> None:
    async def story(hosts: Hosts) -> None:
        kind, whole = type(hosts.faulty), hosts.faulty
        inner = getattr(kind, method)
        work: Any = inner.fget if isinstance(inner, property) else inner
        broken = fails(work, ALWAYS)

        def of_one(self: Any, *args: Any, **named: Any) -> Any:
            return (broken if self is whole else work)(self, *args, **named)

        setattr(kind, method, property(of_one) if isinstance(inner, property) else of_one)
        try:
            await asyncio.sleep(1.0)
            assert hosts.link.counters.faults >= 1
            await hold_and_recall(hosts, [system for system in SYSTEMS if system != FAULTY])
        finally:
            setattr(kind, method, inner)

    hosts = fly(story)
    assert hosts.unharmed()
    assert hosts.longest_gap_s() <= LONGEST_GAP_S


PARTS: dict[str, Callable[[Hosts], tuple[object, str]]] = {
    "a turn of the pump": lambda hosts: (hosts.link, "_turn"),
    "the socket": lambda hosts: (hosts.link._transports[0], "send"),
    "the decoder": lambda hosts: (next(iter(hosts.link._router._decoders.values())), "feed_datagram"),
    "the account": lambda hosts: (hosts.link._router._accounts[FAULTY], "take"),
    "the encoder": lambda hosts: (next(iter(hosts.link._router._encoders.values())), "encode"),
    "our own heartbeat": lambda hosts: (hosts.link._router.heartbeat, "advance"),
    "what counts the missing": lambda hosts: (hosts.link._router, "_missing_before"),
    "who is told of events": lambda hosts: (hosts.link, "_on_event"),
}


@pytest.mark.parametrize("part", PARTS)
def test_a_part_of_the_link_that_fails_for_a_moment_costs_that_moment(part: str) -> None:
    async def story(hosts: Hosts) -> None:
        owner, name = PARTS[part](hosts)
        setattr(owner, name, fails(getattr(owner, name), 1 if part == "the socket" else 3))
        await asyncio.sleep(3.0)
        await hold_and_recall(hosts)
        assert hosts.link.running

    hosts = fly(story)
    assert hosts.longest_gap_s() <= LONGEST_GAP_S


def test_a_recording_that_fails_and_a_listener_that_fails_are_told_and_nothing_else_happens() -> None:
    def record(_: bytes) -> None:
        raise Broken("no recording")

    def listen(_: bytes) -> None:
        raise Broken("no listening")

    async def story(hosts: Hosts) -> None:
        hosts.link.listen(1, listen)
        await asyncio.sleep(2.0)
        await hold_and_recall(hosts)
        problems = " ".join(hosts.link.problems)
        assert "a fault in the recording" in problems
        assert "a fault in what listens to system 1" in problems
        assert set(hosts.link.faults) == {"the recording", "what listens to system 1"}

    hosts = fly(story, on_frame=record)
    assert hosts.unharmed()
    assert hosts.longest_gap_s() <= LONGEST_GAP_S
    assert sorted(hosts.obeyed("hold")) == list(SYSTEMS)


def test_the_frame_at_which_a_machine_fails_is_told_in_hexadecimal() -> None:
    async def story(hosts: Hosts) -> None:
        mend = break_machine(hosts, "telemetry", "receive", 1)
        await asyncio.sleep(1.0)
        mend()

    (event,) = fly(story).of(VehicleFault)
    assert isinstance(event, VehicleFault)
    assert (event.system, event.where, event.problem) == (FAULTY, "telemetry", "Broken: thrown in by a test")
    assert event.frame is not None
    assert bytes.fromhex(event.frame)[0] == 0xFD


def test_a_pump_that_fails_again_and_again_has_ended_and_no_order_is_said_to_be_sent() -> None:
    async def story(hosts: Hosts) -> None:
        hosts.link._turn = fails(hosts.link._turn, ALWAYS)  # type: ignore[method-assign]
        with pytest.raises(Unavailable, match="again and again: Broken: thrown in by a test"):
            await asyncio.wait_for(hosts.link.wait_ended(), 10.0)
        assert not hosts.link.running
        for order in (hosts.link.hold, hosts.link.return_to_launch):
            with pytest.raises(Unavailable, match="nothing can be sent: the link has ended"):
                order(1)
        with pytest.raises(Unavailable, match="nothing can be sent"):
            hosts.link.take_off(1, 20.0)
        hosts.link._pump = None

    fly(story)


def test_a_heartbeat_that_can_be_made_for_nobody_ends_the_link() -> None:
    async def story(hosts: Hosts) -> None:
        hosts.link._router._encode = fails(hosts.link._router._encode, ALWAYS)  # type: ignore[method-assign]
        with pytest.raises(Unavailable, match="our heartbeat can be encoded for nobody"):
            await asyncio.wait_for(hosts.link.wait_ended(), 20.0)
        hosts.link._pump = None

    fly(story)


def test_an_order_that_cannot_be_begun_has_failed_and_a_hold_that_cannot_is_sent_all_the_same() -> None:
    async def story(hosts: Hosts) -> None:
        mend = break_machine(hosts, "commands", "submit", ALWAYS)
        try:
            hosts.depart()
            await asyncio.sleep(0.5)
            failed = [event for event in hosts.of(OrderFailed, FAULTY) if isinstance(event, OrderFailed)]
            assert any("the service failed" in event.reason for event in failed)
            await hold_and_recall(hosts)
        finally:
            mend()

    hosts = fly(story)
    assert hosts.unharmed()
    assert FAULTY not in hosts.obeyed("hold")


def test_acknowledgements_that_cannot_be_taken_end_no_pump() -> None:
    async def story(hosts: Hosts) -> None:
        inner = type(hosts.faulty._commands).receive

        def receive(self: Any, message: Any, now: float, **named: Any) -> None:
            if isinstance(message, CommandAck):
                raise Broken("no acknowledgement")
            inner(self, message, now, **named)

        type(hosts.faulty._commands).receive = receive  # type: ignore[method-assign]
        try:
            await hold_and_recall(hosts)
        finally:
            type(hosts.faulty._commands).receive = inner  # type: ignore[method-assign]

    assert fly(story).longest_gap_s() <= LONGEST_GAP_S


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    """What is logged of faults that are thrown in is no news."""
    caplog.set_level("CRITICAL")
