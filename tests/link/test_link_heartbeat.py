"""Our heartbeat and theirs."""

import pytest

from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import LinkLost, LinkUp
from hsop_gcs.link.messages import Attitude, Heartbeat
from hsop_gcs.link.protocol.heartbeat import OwnHeartbeat, Presence

MILLISECOND = 1e-3


def test_our_heartbeat_says_ground_station_once_a_second() -> None:
    ours = OwnHeartbeat()
    beats, now = 0, 0.0
    ours.advance(now)
    while now <= 10.0:
        for message in ours.take_outgoing():
            assert isinstance(message, Heartbeat)
            assert (message.type, message.autopilot) == (MavType.GCS, MavAutopilot.INVALID)
            beats += 1
        assert ours.wake_at is not None
        now = ours.wake_at
        ours.advance(now)
    assert beats == 11


def test_after_a_stall_one_heartbeat_is_sent_and_not_the_missed_ones() -> None:
    ours = OwnHeartbeat()
    ours.advance(0.0)
    ours.take_outgoing()
    ours.advance(60.0)
    assert len(ours.take_outgoing()) == 1


def test_a_watched_heartbeat_is_withheld_until_fed_and_as_soon_as_nobody_feeds_it() -> None:
    ours = OwnHeartbeat(watchdog_s=3.0)
    sent_at_s = []
    for step in range(200):
        now = step / 10
        if 5.0 <= now <= 10.0:
            ours.keep_alive(now)
        ours.advance(now)
        sent_at_s += [now for _ in ours.take_outgoing()]
        assert ours.wake_at is not None
        assert ours.wake_at > now
    assert (sent_at_s[0], sent_at_s[-1]) == (5.0, 13.0)
    assert ours.withheld


def test_a_link_is_up_at_the_first_heartbeat_and_not_before() -> None:
    presence = Presence(7)
    presence.receive(Attitude(), 0.0)
    assert (presence.up, presence.take_events()) == (False, [])
    presence.receive(Heartbeat(), 1.0)
    assert presence.take_events() == [LinkUp(system=7)]


def test_a_link_is_lost_after_silence_and_up_again_with_a_heartbeat() -> None:
    presence = Presence(7, lost_after_s=3.5)
    presence.receive(Heartbeat(), 10.0)
    presence.advance(13.4)
    assert presence.up
    assert presence.wake_at == pytest.approx(13.5, abs=MILLISECOND)
    presence.advance(13.5)
    presence.receive(Attitude(), 14.0)
    presence.receive(Heartbeat(), 20.0)
    assert presence.take_events() == [LinkUp(system=7), LinkLost(system=7, silent_s=3.5), LinkUp(system=7)]


def test_silence_is_noticed_even_if_nobody_looked_before_the_next_heartbeat() -> None:
    presence = Presence(7)
    presence.receive(Heartbeat(), 0.0)
    presence.receive(Heartbeat(), 100.0)
    assert [type(event) for event in presence.take_events()] == [LinkUp, LinkLost, LinkUp]


def test_other_messages_keep_a_link_whose_heartbeats_get_lost() -> None:
    presence = Presence(7)
    presence.receive(Heartbeat(), 0.0)
    for second in range(1, 60):
        presence.receive(Attitude(), float(second))
    assert presence.take_events() == [LinkUp(system=7)]
