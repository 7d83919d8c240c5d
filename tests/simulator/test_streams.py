import math

from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.simulator.streams import Streams


def test_defaults_are_due_at_once_in_their_order() -> None:
    assert Streams({5: 1.0, 3: 0.5}, now=10.0).take_due(10.0) == [5, 3]


def test_a_new_stream_begins_one_interval_later() -> None:
    streams = Streams({}, now=0.0)
    streams.set(7, 0.2, now=1.0)
    assert streams.next_due == 1.2
    assert streams.take_due(1.1) == []
    assert streams.take_due(1.2) == [7]


def test_stopping_the_last_stream_leaves_nothing_due() -> None:
    streams = Streams({7: 1.0}, now=0.0)
    streams.stop(7)
    assert streams.next_due == math.inf
    assert streams.interval_s(7) is None


def test_reset_returns_to_the_default_or_to_silence() -> None:
    streams = Streams({7: 1.0}, now=0.0)
    streams.set(7, 0.1, now=0.0)
    streams.set(8, 0.1, now=0.0)
    streams.reset(7, now=0.0)
    streams.reset(8, now=0.0)
    assert (streams.interval_s(7), streams.interval_s(8)) == (1.0, None)


@given(st.lists(st.floats(0.001, 3.0), min_size=1, max_size=60))
def test_however_late_it_is_asked_a_message_comes_once_and_keeps_its_rhythm(naps_s: list[float]) -> None:
    streams, now = Streams({7: 0.25}, now=0.0), 0.0
    streams.take_due(now)
    for nap_s in naps_s:
        expected_due = streams.next_due
        now += nap_s
        assert streams.take_due(now) == ([7] if expected_due <= now else [])
        assert now < streams.next_due <= now + 0.25 + 1e-9
        assert abs(streams.next_due / 0.25 - round(streams.next_due / 0.25)) < 1e-6
