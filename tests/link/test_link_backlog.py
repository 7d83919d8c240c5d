"""What waits to be worked off, and what a service that falls behind loses: what is worth least."""

import asyncio

import pytest

from hsop_gcs.link.backlog import MOST_WAITING, Backlog, Lag
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import LinkLost, OrderFailed
from hsop_gcs.link.messages import (
    Attitude,
    BatteryStatus,
    CommandAck,
    GimbalDeviceAttitudeStatus,
    GlobalPositionInt,
    Heartbeat,
    Message,
    StatusText,
)
from hsop_gcs.link.router import Router
from tests.link.three_hosts import SYSTEMS, Hosts, fly

HERE, THERE = Peer(0, "10.0.0.1", 14550), Peer(0, "10.0.0.2", 14550)
BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)


def frame(message: Message, *, system: int = 1, component: int = 1) -> bytes:
    return Encoder(system=system, component=component).encode(message)


def test_of_an_old_backlog_only_the_newest_state_of_each_vehicle_is_read() -> None:
    backlog = Backlog()
    for tenth in range(10):
        for system, peer in ((1, HERE), (2, THERE)):
            for message in (Attitude(time_boot_ms=tenth), GlobalPositionInt(time_boot_ms=tenth)):
                backlog.put(frame(message, system=system), peer, tenth / 10)
    read = [arrived for arrived in backlog.take(2.0) if not arrived.superseded]
    assert [(arrived.peer, arrived.at_s) for arrived in read] == [(HERE, 0.9)] * 2 + [(THERE, 0.9)] * 2
    assert backlog.superseded == 36


def test_of_a_backlog_that_is_not_old_everything_is_read() -> None:
    backlog = Backlog()
    for _ in range(10):
        backlog.put(frame(Attitude()), HERE, 1.0)
    assert not any(arrived.superseded for arrived in backlog.take(1.4))


@pytest.mark.parametrize("message", [BEAT, CommandAck(), StatusText(text="fence"), BatteryStatus()])
def test_what_is_no_state_is_never_passed_over(message: Message) -> None:
    backlog = Backlog()
    for second in range(10):
        backlog.put(frame(message), HERE, float(second))
    assert [arrived.superseded for arrived in backlog.take(100.0)] == [False] * 10


def test_the_reports_of_two_gimbals_do_not_supersede_each_other() -> None:
    backlog = Backlog()
    for number in (1, 2):
        backlog.put(frame(GimbalDeviceAttitudeStatus(gimbal_device_id=number)), HERE, 0.0)
    backlog.put(frame(GimbalDeviceAttitudeStatus(), component=154), HERE, 0.0)
    assert not any(arrived.superseded for arrived in backlog.take(10.0))


def test_two_frames_in_one_datagram_and_pieces_of_a_stream_are_read() -> None:
    backlog = Backlog()
    for _ in range(3):
        backlog.put(frame(Attitude()) * 2, HERE, 0.0)
        backlog.put(frame(Attitude())[:-3], HERE, 0.0)
    assert not any(arrived.superseded for arrived in backlog.take(10.0))


def test_without_room_states_go_first_and_then_the_oldest() -> None:
    backlog = Backlog()
    acknowledged = frame(CommandAck())
    for number in range(MOST_WAITING // 2):
        backlog.put(acknowledged, HERE, float(number))
        backlog.put(frame(Attitude()), HERE, float(number))
    for number in range(MOST_WAITING // 2):
        backlog.put(acknowledged, HERE, 1e4 + number)
    read = list(backlog.take(2e4))
    assert len(read) <= MOST_WAITING
    assert read[-1].at_s == 1e4 + MOST_WAITING // 2 - 1
    assert sum(arrived.data == acknowledged for arrived in read) + backlog.dropped == MOST_WAITING
    assert backlog.dropped <= 1


def test_a_state_that_is_passed_over_came_and_is_no_loss() -> None:
    router, vehicle = Router([1]), Encoder(system=1, component=1)
    router.receive(vehicle.encode(BEAT), HERE, 0.0)
    for tenth in range(1, 61):
        raw = vehicle.encode(Attitude(time_boot_ms=100 * tenth))
        if tenth % 5:
            router.pass_over(raw, HERE, tenth / 10)
        else:
            router.receive(raw, HERE, tenth / 10)
    link = router.vehicle_link(1, 6.0)
    assert (link.received, link.lost, link.loss) == (61, 0, 0.0)
    router.pass_over(vehicle.encode(Attitude()), THERE, 6.0)
    assert router.vehicle_link(1, 6.0).received == 61


def test_a_lag_begins_at_one_and_a_half_seconds_and_ends_after_three_in_time() -> None:
    lag = Lag()
    lag.note(1.4, 0.0)
    assert not lag.behind
    lag.note(1.6, 1.0)
    assert lag.behind
    for tenth in range(11, 40):
        lag.note(0.2, tenth / 10)
        assert (lag.behind, lag.longest_s) == (True, 1.6)
    lag.note(0.0, 4.1)
    assert (lag.behind, lag.longest_s) == (False, 0.0)


def test_a_pump_that_comes_late_reads_the_newest_and_nobody_is_taken_for_lost() -> None:
    async def story(hosts: Hosts) -> None:
        link, turn = hosts.link, hosts.link._turn
        works_at = link.now()

        def seldom() -> None:
            nonlocal works_at
            if link.now() >= works_at:
                works_at = link.now() + 2.8
                turn()

        link._turn = seldom  # type: ignore[method-assign]
        for _ in range(200):
            await asyncio.sleep(0.05)
            reasons = [link.vehicles[system].why_not_ready(link.read_until()) for system in SYSTEMS]
            assert reasons == [None] * len(SYSTEMS)
        assert link.behind
        assert link.lag_s == pytest.approx(2.8, abs=0.2)
        assert link.superseded > 50
        assert "behind" in " ".join(link.problems)
        link._turn = turn  # type: ignore[method-assign]
        await asyncio.sleep(4.0)
        assert not link.behind

    hosts = fly(story)
    assert not hosts.of(LinkLost)
    assert not hosts.of(OrderFailed)
