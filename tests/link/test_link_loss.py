"""Loss is of what is sent to us: real loss is seen, and what a router keeps, renumbers or thins out is none."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hsop_gcs.fleet import FlightLimits
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Heartbeat, Message
from hsop_gcs.link.router import Router
from hsop_gcs.link.timed_loss import TimedLoss
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.simulator.channel import Channel, Impairment

DATA = Path(__file__).parent.parent / "data"
HERE = Peer(0, "127.0.0.1", 14541)
SHARE = 1.0
Sent = tuple[float, Message]
"""When it was sent, and what."""


def stream(kind: type[Message], rate_hz: float, *, from_s: float = 0.0, to_s: float = 20.0) -> Iterator[Sent]:
    """A message as an autopilot sends it: not quite evenly, by its own steps of 4 ms."""
    rng = np.random.default_rng(7)
    for number in range(int(from_s * rate_hz), int(to_s * rate_hz)):
        sent_s = number / rate_hz + rng.uniform(0.0, 0.15) / rate_hz
        yield sent_s, kind(time_boot_ms=4 * round(250 * (sent_s + 10)))  # type: ignore[call-arg]


def both(attitude_hz: float = 20.0, position_hz: float = 10.0, **span: float) -> list[Sent]:
    return [*stream(Attitude, attitude_hz, **span), *stream(GlobalPositionInt, position_hz, **span)]


def losses(sent: list[Sent], line: Impairment, *, seed: int = 1) -> list[float]:
    """The loss as it is told each second, from the sixth on, of what went over a line."""
    channel = Channel[Sent](line, np.random.default_rng(seed))
    timed, told, queue = TimedLoss(), [], sorted(sent, key=lambda each: each[0])
    for step in range(2000):
        now = step / 100
        while queue and queue[0][0] <= now:
            channel.put(queue.pop(0), now)
        for _, message in channel.take_due(now):
            timed.receive(message, now)
        if step % 100 == 99 and now > 6.0:
            loss = timed.loss(now)
            told += [] if loss is None else [loss]
    return told


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("attitude_hz", [20.0, 50.0])
def test_the_loss_of_a_line_is_told(share: float, attitude_hz: float) -> None:
    told = losses(both(attitude_hz), Impairment(loss=share))
    assert float(np.mean(told)) == pytest.approx(share, abs=0.1 * SHARE)
    if share == 0.0:
        assert set(told) == {0.0}


def test_a_line_that_loses_nearly_all_closes_the_gate() -> None:
    assert float(np.mean(losses(both(), Impairment(loss=0.8)))) > FlightLimits().link_loss_max


def test_copies_delays_and_frames_out_of_order_are_no_loss() -> None:
    told = losses(both(), Impairment(duplication=0.3, reordering=0.2, delay_s=0.3, jitter_s=0.3))
    assert max(told) < 0.1 * SHARE


@pytest.mark.parametrize(
    "name", ["arducopter-4.7.0-dev.tlog", "arducopter-4.7.0-dev-flight.tlog", "px4-1.17.0-alpha1-flight.tlog"]
)
def test_real_autopilots_send_evenly_enough(name: str) -> None:
    timed, told, last = TimedLoss(), [], 0
    with (DATA / name).open("rb") as file:
        for time_s, frame in read_tlog(file):
            if frame.component == 1:
                timed.receive(frame.message, time_s)
            if int(time_s) != last:
                last = int(time_s)
                told.append(timed.loss(time_s))
    assert max(loss for loss in told if loss is not None) < 0.1 * SHARE


@pytest.mark.parametrize(("before_hz", "after_hz"), [(20.0, 1.0), (20.0, 4.0), (1.0, 20.0), (50.0, 20.0)])
def test_a_rate_that_somebody_changes_is_no_loss_that_closes_the_gate(before_hz: float, after_hz: float) -> None:
    changed = [
        *stream(Attitude, before_hz, to_s=10.0),
        *stream(Attitude, after_hz, from_s=10.0),
        *stream(GlobalPositionInt, before_hz / 2, to_s=10.0),
        *stream(GlobalPositionInt, after_hz / 2, from_s=10.0),
    ]
    assert max(losses(changed, Impairment())) < FlightLimits().link_loss_max


def test_a_clock_that_begins_anew_is_no_loss() -> None:
    timed = TimedLoss()
    for tenth in range(60):
        boot_ms = 900_000 + 100 * tenth if tenth < 30 else 100 * tenth
        timed.receive(Attitude(time_boot_ms=boot_ms), tenth / 10)
    assert timed.loss(6.0) == 0.0


class Hop:
    """A router between vehicle and service: every frame that it passes on has a number, of its own or the vehicle's."""

    def __init__(self, *, hidden: int = 0, renumbers: bool = False, loss: float = 0.0) -> None:
        self._hidden, self._renumbers, self._loss = hidden, renumbers, loss
        self._rng = np.random.default_rng(3)
        self._encoder = Encoder(system=1, component=1)
        self.service = Router([1])

    def carry(self, sent: list[Sent]) -> None:
        self._pass(0.0, Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4))
        for now, message in sorted(sent, key=lambda each: each[0]):
            for _ in range(self._hidden):
                self._encoder.encode(message)  # it is for another station
            if self._rng.random() >= self._loss:
                self._pass(now, message)
            elif not self._renumbers:
                self._encoder.encode(message)

    def _pass(self, now: float, message: Message) -> None:
        self.service.receive(self._encoder.encode(message), HERE, now)


@pytest.mark.parametrize("hidden", [1, 3, 20])
def test_what_a_router_keeps_for_another_station_is_no_loss(hidden: int) -> None:
    hop = Hop(hidden=hidden)
    hop.carry(both())
    link = hop.service.vehicle_link(1, 20.0)
    assert link.loss == 0.0
    assert link.lost > 500


def test_what_is_lost_before_a_router_that_numbers_anew_is_loss() -> None:
    hop = Hop(renumbers=True, loss=0.3)
    hop.carry(both())
    link = hop.service.vehicle_link(1, 20.0)
    assert link.lost == 0
    assert link.loss == pytest.approx(0.3 * SHARE, abs=0.12)


def test_of_a_vehicle_without_a_clock_sequence_numbers_tell_the_loss() -> None:
    hop = Hop(loss=0.3)
    hop.carry([(number / 20, Attitude()) for number in range(400)])
    assert hop.service.vehicle_link(1, 20.0).loss == pytest.approx(0.3 * SHARE, abs=0.12)
