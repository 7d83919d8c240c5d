"""A disk that takes nothing, or takes its time, stops nothing that flies; what was promised outlasts it.

Whole missions in virtual time with three hosts; the journal's write is made to fail in flight.
"""

import errno
import os
import threading
from pathlib import Path

import pytest

from hsop_gcs.disk import DiskWatch
from hsop_gcs.errors import Unavailable
from hsop_gcs.journal import GIVEN_UP, SNAPSHOT, Journal, read
from hsop_gcs.link.events import CommandFinished
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.inputs import HostsHeld, HostStopped
from hsop_gcs.mission.notices import JournalFailed, JournalResumed
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.replay import replay
from hsop_gcs.simulator.battery import BatteryConfig
from tests.mission.headless import Moment
from tests.mission.test_safety import flown, kinds
from tests.service import wait_until

FULL_FROM_S = 6.0


class Disk:
    """Takes what it is given until it has a problem, and again afterwards."""

    def __init__(self) -> None:
        self.problem: int | None = None
        self.open = threading.Event()
        self.open.set()

    def write(self, file: int, data: bytes) -> int:
        self.open.wait(20)
        if self.problem is not None:
            raise OSError(self.problem, os.strerror(self.problem))
        return os.write(file, data)


def at(time_s: float, moment: Moment) -> bool:
    return moment.time_s == pytest.approx(time_s, abs=0.01)


def test_a_battery_under_its_reserve_stops_its_host_within_a_second_whatever_the_disk_says(tmp_path: Path) -> None:
    disk = Disk()
    low_since_s: dict[str, float] = {}
    problems = {6.0: errno.ENOSPC, 6.5: errno.EIO, 7.0: errno.EDQUOT, 7.5: errno.EROFS}
    with Journal(tmp_path / "journal", write=disk.write) as journal:

        def watch(moment: Moment) -> None:
            mission = moment.mission
            disk.problem = next((each for time_s, each in problems.items() if at(time_s, moment)), disk.problem)
            for host in mission.fleet.hosts:
                percent = mission.vehicle(host).state.battery_percent
                if percent is not None and percent < 20:
                    low_since_s.setdefault(host.id, mission.clock())

        battery = BatteryConfig(percent=19.8, endurance_s=1000.0)
        mission = flown(watch, duration_s=11.0, hosts=3, battery=battery, journal=journal)
        assert "kept in memory" in (journal.status.fault or "")
        assert kinds(mission).count("JournalFailed") == 1
        stops = {each.event.host: each for each in mission.events if isinstance(each.event, HostStopped)}
        assert sorted(stops) == ["h1", "h2"]
        for host, stop in stops.items():
            assert stop.time_s - low_since_s[host] < 1.0
        assert mission.reports_accepted > 5
        disk.problem = None
    with resumed(tmp_path / "journal") as (_, recovered):
        assert recovered == mission.state


def held_on_a_full_disk(path: Path, disk: Disk, *, backlog_bytes: int) -> Mission:
    """Fly on a disk that is full from one time on, hold everybody, and have space again."""
    sent: list[int] = []
    with Journal(path, write=disk.write, backlog_bytes=backlog_bytes) as journal:

        def watch(moment: Moment) -> None:
            if at(FULL_FROM_S, moment):
                disk.problem = errno.ENOSPC
            elif at(9.0, moment):
                assert moment.mission.hold() == ["h1", "h2", "h3"]
            elif at(12.0, moment):
                sent.append(kinds(moment.mission).count("HostDeparted"))
                disk.problem = None
                # the disk is looked at again in its own time, which is not the mission's
                assert journal.flush(10.0)
            elif at(13.0, moment):
                assert journal.status.fault is None

        mission = flown(watch, duration_s=16.0, hosts=3, journal=journal)
    assert mission.state.held
    assert mission.state.autonomy is Autonomy.CONFIRM
    assert [kinds(mission).count("HostDeparted")] == sent, "nothing flies again when the space is back"
    confirmed = [each.host for each in mission.events if isinstance(each.event, CommandFinished)]
    assert {"h1", "h2", "h3"} <= set(confirmed)
    told = [type(each.event) for each in mission.events if isinstance(each.event, JournalFailed | JournalResumed)]
    assert told == [JournalFailed, JournalResumed]
    return mission


def test_a_hold_on_a_full_disk_stays_held_when_space_is_back_and_after_a_restart(tmp_path: Path) -> None:
    # with so little room in memory that reports are given up, too: that is told, and the hold is not among them
    path = tmp_path / "journal"
    ended = held_on_a_full_disk(path, Disk(), backlog_bytes=12_000)
    kinds_kept = [entry.kind for entry in read(path)]
    assert kinds_kept.count(GIVEN_UP) == 1
    after = kinds_kept[kinds_kept.index(GIVEN_UP) :]
    assert after.index(HostsHeld.__name__) < after.index(SNAPSHOT)
    assert replay(path, to_s=0.0, jobs=1).given_up > 0
    with resumed(path) as (journal, recovered):
        assert recovered == ended.state, "the mission that was saved behind the gap makes it exact again"
        again = flown(lambda _moment: None, duration_s=5.0, hosts=3, recovered=recovered, journal=journal)
    assert again.state.held
    assert "HostDeparted" not in kinds(again)


def test_a_write_that_takes_for_ever_holds_the_mission_up_once_and_for_a_moment(tmp_path: Path) -> None:
    disk = Disk()
    with Journal(tmp_path / "journal", write=disk.write) as journal:

        def watch(moment: Moment) -> None:
            if at(FULL_FROM_S, moment):
                disk.open.clear()
            elif at(7.0, moment):
                # nothing was written for a second of the mission, which went on all the same
                assert journal.status.waiting > 2
                moment.mission.hold()
            elif at(10.0, moment):
                assert {moment.mission.vehicle(host).state.mode for host in moment.mission.fleet.hosts} == {"Hold"}
                disk.open.set()
                assert journal.flush(10.0)

        mission = flown(watch, duration_s=11.0, hosts=3, journal=journal)
        assert journal.status.late > 5
    with resumed(tmp_path / "journal") as (_, recovered):
        assert recovered == mission.state


@pytest.mark.parametrize("cause", ["little room", "a journal that fails"])
def test_nothing_new_flies_while_a_restart_would_not_know_of_it_and_stops_are_obeyed(
    tmp_path: Path, cause: str
) -> None:
    free, disk, refused = [1_000_000], Disk(), []
    room = DiskWatch([tmp_path], 500_000, free=lambda _folder: free[0])

    def watch(moment: Moment) -> None:
        mission = moment.mission
        room.look()
        if at(2.5, moment):
            if cause == "little room":
                free[0] = 400_000
            else:
                disk.problem = errno.EIO
                mission.release(["h3"])
                wait_until(lambda: journal.failing)
        elif at(7.0, moment):
            assert mission.state.plans.proposed is not None, "plans are made and shown"
            for wish in (lambda: mission.take_off(20.0), lambda: mission.approve(mission.state.plans.proposed.id)):
                with pytest.raises(Unavailable, match="nothing new flies") as error:
                    wish()
                refused.append(str(error.value))
            assert mission.hold(["h1"]) == ["h1"]
            assert mission.recall(["h2"]) == ["h2"]
        elif at(9.0, moment):
            assert "PlanFlew" not in {type(each.event).__name__ for each in mission.events}
            assert mission.state.plans.flying is None
            assert mission.vehicle(mission.fleet.hosts[1]).state.mode == "Return"
            free[0], disk.problem = 510_000, None
            assert journal.flush(10.0)
        elif at(9.5, moment) and cause == "little room":
            assert mission.storage.why_nothing_new is not None, "not back and forth with every line"
            free[0] = 600_000
            mission.release()
        elif at(9.5, moment):
            mission.release()

    with Journal(tmp_path / "journal", write=disk.write) as journal:
        mission = flown(watch, duration_s=13.0, hosts=3, journal=journal, disk=room)
    assert len(refused) == 2
    assert mission.state.plans.flying is not None
    told = [name for name in kinds(mission) if name.startswith(("Disk", "Journal"))]
    assert told == (["DiskLow", "DiskRecovered"] if cause == "little room" else ["JournalFailed", "JournalResumed"])
