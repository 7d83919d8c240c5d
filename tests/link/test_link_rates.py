"""Rates are watched as rates: whatever ends what was asked for is seen, told, and asked for again without a race."""

from itertools import pairwise

import pytest

from hsop_gcs.link.codec import Encoder, Frame
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavResult, MavType
from hsop_gcs.link.events import AutopilotRestarted, OrderFailed, StreamRateFell, StreamRateNotKept
from hsop_gcs.link.messages import (
    Attitude,
    CommandAck,
    CommandLong,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    Message,
)
from hsop_gcs.link.protocol.command import CommandSender
from hsop_gcs.link.protocol.subscriptions import RATES_HZ, Subscriptions
from hsop_gcs.link.router import Router
from tests.link.two_ends import BOTH, Stack, TwoEnds

HZ = 1.0


class Stream:
    """Our subscriptions against a vehicle that sends at rates of its own; whoever asks may set them, or may not."""

    def __init__(self, *, obeys: bool = True) -> None:
        self.commands = CommandSender()
        self.subscriptions = Subscriptions(1, self.commands)
        self.rates_hz = dict(RATES_HZ)
        self.now = 0.0
        self.obeys = obeys
        self.asked: list[tuple[float, int]] = []
        self.events: list[object] = []
        self._credit = dict.fromkeys(RATES_HZ, 0.0)
        self.subscriptions.link_up(0.0)

    def run(self, duration_s: float, *, other_station_every_s: float | None = None) -> None:
        step_s, end = 0.05, self.now + duration_s
        other_at = self.now
        while self.now < end:
            self.now += step_s
            if other_station_every_s is not None and self.now >= other_at:
                other_at += other_station_every_s
                self.rates_hz[Attitude] = 1 * HZ
            for message in self.commands.take_outgoing():
                self._take(message)
            for kind, rate_hz in self.rates_hz.items():
                self._credit[kind] += rate_hz * step_s
                while self._credit[kind] >= 1.0 - 1e-9:
                    self._credit[kind] -= 1.0
                    self.subscriptions.receive(kind(), self.now)
            self.commands.advance(self.now)
            self.subscriptions.advance(self.now)
            for outcome in self.commands.take_outcomes():
                self.subscriptions.settle(outcome)
            self.events += self.subscriptions.take_events()

    def _take(self, message: Message) -> None:
        assert isinstance(message, CommandLong)
        if message.command == MavCmd.SET_MESSAGE_INTERVAL:
            self.asked.append((self.now, round(message.param1)))
            kind = next(kind for kind in RATES_HZ if message.param1 == kind.ID)
            if self.obeys:
                self.rates_hz[kind] = RATES_HZ[kind]
        self.commands.receive(CommandAck(command=message.command, result=MavResult.ACCEPTED), self.now)

    def asked_for(self, kind: type[Message], since_s: float) -> list[float]:
        return [at for at, number in self.asked if number == kind.ID and at > since_s]


def test_rates_that_hold_are_asked_for_once() -> None:
    stream = Stream()
    stream.run(120.0)
    assert len(stream.asked) == len(RATES_HZ)
    assert stream.events == []


@pytest.mark.parametrize(
    ("kind", "rate_hz"), [(Attitude, 1.0), (Attitude, 0.0), (GlobalPositionInt, 3.0), (HomePosition, 0.1)]
)
def test_a_rate_that_fell_is_told_and_asked_for_again(kind: type[Message], rate_hz: float) -> None:
    stream = Stream()
    stream.run(31.0)
    stream.rates_hz[kind] = rate_hz
    stream.run(31.0)
    assert len(stream.asked_for(kind, 31.0)) == 1
    (told,) = stream.events
    assert isinstance(told, StreamRateFell)
    (rate,) = told.rates
    assert rate.startswith(kind.NAME)
    assert stream.rates_hz == RATES_HZ


def test_all_rates_that_fall_at_once_are_one_event() -> None:
    stream = Stream()
    stream.run(30.0)
    stream.rates_hz = dict.fromkeys(RATES_HZ, 0.0)
    stream.run(6.0)
    (told,) = stream.events
    assert isinstance(told, StreamRateFell)
    assert len(told.rates) > 5


def test_half_the_rate_that_was_asked_for_will_do() -> None:
    stream = Stream(obeys=False)
    stream.rates_hz = {kind: rate_hz / 2 for kind, rate_hz in RATES_HZ.items()}
    stream.run(120.0)
    assert len(stream.asked) == len(RATES_HZ)
    assert stream.events == []


def test_a_moment_without_a_link_is_no_fallen_rate() -> None:
    stream = Stream()
    stream.run(31.0)
    stream.rates_hz = dict.fromkeys(RATES_HZ, 0.0)
    stream.run(3.4)
    stream.rates_hz = dict(RATES_HZ)
    stream.run(30.0)
    assert stream.events == []


def test_two_stations_that_both_insist_do_not_race() -> None:
    """Another station that sets the attitudes back every three seconds is told, and asked against less and less."""
    stream = Stream()
    stream.run(30.0)
    stream.run(1200.0, other_station_every_s=3.0)
    asked = stream.asked_for(Attitude, 30.0)
    pauses = [after - before for before, after in pairwise(asked)]
    assert len(asked) <= 9
    assert all(later >= sooner for sooner, later in pairwise(pauses))
    assert [type(event) for event in stream.events] == [StreamRateFell, StreamRateNotKept]


def test_a_link_too_slow_for_what_is_asked_is_told_once_and_not_flooded() -> None:
    stream = Stream(obeys=False)
    stream.run(30.0)
    stream.rates_hz = {kind: rate_hz / 5 for kind, rate_hz in RATES_HZ.items()}
    stream.run(600.0)
    assert [type(event) for event in stream.events].count(StreamRateNotKept) <= 2
    assert len(stream.asked_for(Attitude, 30.0)) <= 7


def test_a_rate_that_fell_again_long_after_is_asked_for_at_once() -> None:
    stream = Stream()
    stream.run(30.0)
    for _ in range(3):
        since_s = stream.now
        stream.rates_hz[Attitude] = 1 * HZ
        stream.run(300.0)
        (asked_s,) = stream.asked_for(Attitude, since_s)
        assert asked_s - since_s < 16.0
    assert [type(event) for event in stream.events] == [StreamRateFell] * 3


class Shifted:
    """A simulated vehicle that was switched on later."""

    def __init__(self, sim: object, shift_s: float) -> None:
        self._sim, self._shift_s = sim, shift_s

    def __getattr__(self, name: str) -> object:
        return getattr(self._sim, name)

    @property
    def wake_at(self) -> float:
        return self._sim.wake_at + self._shift_s  # type: ignore[attr-defined, no-any-return]

    def receive(self, frame: Frame, now: float) -> None:
        self._sim.receive(frame, now - self._shift_s)  # type: ignore[attr-defined]

    def advance(self, now: float) -> None:
        self._sim.advance(now - self._shift_s + 1e-9)  # type: ignore[attr-defined]


@BOTH
def test_an_autopilot_that_restarts_within_a_moment_is_told_and_asked_anew(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.run(20.0)
    ends.order(east_m=200.0)
    ends.run(3.0)
    fresh = TwoEnds(stack, seed=2)
    shift_s = ends.now
    ends.sim = Shifted(fresh.sim, shift_s)  # type: ignore[assignment]
    ends.run(20.0)
    assert ends.of(AutopilotRestarted) == [AutopilotRestarted(system=1)]
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert failed.reason == "the autopilot restarted"
    heard = [0, 0]

    def count(message: Message, component: int) -> None:
        heard[isinstance(message, Attitude)] += 1
        ends.vehicle.receive(message, ends.now, component=component)

    ends.hear = count  # type: ignore[method-assign]
    ends.run(5.0)
    assert heard[1] == pytest.approx(5.0 * RATES_HZ[Attitude], abs=5)
    ends.ready()


def test_what_a_service_that_is_behind_does_not_read_is_no_fallen_rate() -> None:
    router, peer = Router([1]), Peer(0, "127.0.0.1", 14541)
    vehicle = Encoder(system=1, component=1)
    for tick in range(20 * 60):
        now = tick / 20
        if tick % 20 == 0:
            beat = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)
            router.receive(vehicle.encode(beat), peer, now)
        raw = vehicle.encode(Attitude(time_boot_ms=1000 + 50 * tick))
        if now > 30.0 and tick % 20:
            router.pass_over(raw, peer, now)
        else:
            router.receive(raw, peer, now)
        router.advance(now)
        router.take_outgoing()
    assert [event for event in router.take_events() if isinstance(event, StreamRateFell)] == []
