"""How long a message takes to a vehicle and back."""

import pytest

from hsop_gcs.link.messages import Timesync
from hsop_gcs.link.protocol.round_trip import RoundTrip

MILLISECOND = 1e-3


def question(machine: RoundTrip) -> Timesync:
    """Let time come to the next question, and return it."""
    assert machine.wake_at is not None
    machine.advance(machine.wake_at)
    (asked,) = machine.take_outgoing()
    assert isinstance(asked, Timesync)
    assert asked.tc1 == 0
    return asked


def test_the_time_from_question_to_answer_is_measured() -> None:
    machine = RoundTrip()
    machine.link_up(100.0)
    asked = question(machine)
    machine.receive(Timesync(tc1=5, ts1=asked.ts1), asked.ts1 / 1e9 + 0.123)
    assert machine.seconds == pytest.approx(0.123, abs=MILLISECOND)


def test_a_copy_of_an_answer_a_strange_answer_and_the_vehicles_own_question_count_for_nothing() -> None:
    machine = RoundTrip()
    machine.link_up(0.0)
    asked = question(machine)
    sent_s = asked.ts1 / 1e9
    machine.receive(Timesync(tc1=0, ts1=asked.ts1), sent_s + 0.001)
    machine.receive(Timesync(tc1=5, ts1=asked.ts1 + 1), sent_s + 0.002)
    assert machine.seconds is None
    machine.receive(Timesync(tc1=5, ts1=asked.ts1), sent_s + 0.1)
    machine.receive(Timesync(tc1=5, ts1=asked.ts1), sent_s + 1.9)
    assert machine.seconds == pytest.approx(0.1, abs=MILLISECOND)


def test_one_slow_answer_among_five_does_not_show_and_a_lost_link_begins_anew() -> None:
    machine = RoundTrip()
    machine.link_up(0.0)
    for delay_s in (0.1, 0.1, 1.5, 0.1, 0.1):
        asked = question(machine)
        machine.receive(Timesync(tc1=5, ts1=asked.ts1), asked.ts1 / 1e9 + delay_s)
    assert machine.seconds == pytest.approx(0.1, abs=MILLISECOND)
    machine.link_lost()
    assert (machine.seconds, machine.wake_at) == (None, None)
