"""Telemetry logs, read and written."""

import errno
import io
import os
import threading
from pathlib import Path
from typing import Any, BinaryIO

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.errors import Unavailable
from hsop_gcs.link import tlog
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.messages import Attitude, Heartbeat
from hsop_gcs.link.tlog import TlogWriter, create_tlog, open_tlog, read_tlog
from tests.service import wait_until

DATA = Path(__file__).parent.parent / "data"
MICROSECOND = 1e-6


def written() -> bytes:
    encoder, file = Encoder(system=1, component=1), io.BytesIO()
    with TlogWriter(file) as writer:
        writer.write(1_790_000_000.25, encoder.encode(Heartbeat(type=2)))
        writer.write(1_790_000_000.75, encoder.encode(Attitude(yaw=1.5)))
    return file.getvalue()


def test_what_was_written_is_read_back() -> None:
    records = list(read_tlog(io.BytesIO(written())))
    assert [time_s for time_s, _ in records] == pytest.approx([1_790_000_000.25, 1_790_000_000.75], abs=MICROSECOND)
    assert [frame.message for _, frame in records] == [Heartbeat(type=2), Attitude(yaw=1.5)]


def test_a_torn_end_ends_the_reading() -> None:
    whole = written()
    for length in range(len(whole) - 1, 29, -1):
        assert [frame.message for _, frame in read_tlog(io.BytesIO(whole[:length]))] == [Heartbeat(type=2)]


def test_a_damaged_record_costs_only_itself() -> None:
    encoder, file = Encoder(system=1, component=1), io.BytesIO()
    with TlogWriter(file) as writer:
        for number in range(3):
            writer.write(1_790_000_000.0 + number, encoder.encode(Heartbeat(type=2, custom_mode=1000 + number)))
    damaged = bytearray(file.getvalue())
    damaged[len(damaged) // 2] ^= 0xFF
    found = [frame.message for _, frame in read_tlog(io.BytesIO(bytes(damaged)))]
    assert found == [Heartbeat(type=2, custom_mode=1000), Heartbeat(type=2, custom_mode=1002)]


@pytest.mark.parametrize("name", ["arducopter-4.7.0-dev.tlog", "px4-1.16.0-sih.tlog"])
def test_a_recording_is_written_back_byte_for_byte(name: str) -> None:
    original = (DATA / name).read_bytes()
    copy = io.BytesIO()
    with TlogWriter(copy) as writer:
        for time_s, frame in read_tlog(io.BytesIO(original)):
            writer.write(time_s, frame.raw)
    assert copy.getvalue() == original


def beat(number: int) -> bytes:
    return Encoder(system=1, component=1).encode(Heartbeat(type=2, custom_mode=number))


def beats(data: bytes) -> list[int]:
    messages = [frame.message for _, frame in read_tlog(io.BytesIO(data))]
    return [message.custom_mode for message in messages if isinstance(message, Heartbeat)]


class Disk(io.BytesIO):
    """Takes so many bytes, hangs, or takes all again."""

    def __init__(self) -> None:
        super().__init__()
        self.room: int | None = None
        self.problem = errno.ENOSPC
        self.answers = threading.Event()
        self.answers.set()

    def write(self, data: Any) -> int:
        self.answers.wait(20)
        if self.room is None:
            return super().write(data)
        if self.room == 0:
            raise OSError(self.problem, os.strerror(self.problem))
        taken, self.room = super().write(data[: self.room]), 0
        return taken


@pytest.mark.parametrize("problem", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_a_disk_that_takes_no_more_is_told_and_the_log_goes_on_when_it_does(problem: int) -> None:
    disk = Disk()
    disk.problem = problem
    with TlogWriter(disk) as writer:
        writer.write(1_790_000_000.0, beat(0))
        wait_until(lambda: disk.tell() > 0)
        disk.room = 10
        for number in range(1, 5):
            writer.write(1_790_000_000.0 + number, beat(number))
        wait_until(lambda: writer.fault == f"cannot be written: {os.strerror(problem)}")
        disk.room = None
        wait_until(lambda: writer.fault is None)
        writer.write(1_790_000_005.0, beat(5))
    assert beats(disk.getvalue()) == list(range(6))
    assert writer.lost == 0


def test_a_disk_that_does_not_answer_holds_nobody_up_and_what_has_no_room_is_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tlog, "_MOST_WAITING_BYTES", 40 * len(beat(0)))
    disk = Disk()
    disk.answers.clear()
    with TlogWriter(disk) as writer:
        for number in range(100):
            writer.write(1_790_000_000.0 + number, beat(number))
        assert 0 < writer.lost < 100
        disk.answers.set()
    # those that were being written are in the log though others had to make room
    kept = beats(disk.getvalue())
    assert kept == sorted(set(kept))
    assert kept[-1] == 99
    assert len(kept) >= 100 - writer.lost


def test_a_log_that_is_removed_underneath_is_begun_again_also_where_its_folder_is_gone(tmp_path: Path) -> None:
    times = iter(range(1_790_000_000, 1_790_000_100))
    with open_tlog(tmp_path / "logs", lambda: float(next(times))) as writer:
        writer.write(1_790_000_000.0, beat(0))
        (first,) = wait_until(lambda: [each for each in (tmp_path / "logs").iterdir() if each.stat().st_size])
        first.unlink()
        (tmp_path / "logs").rmdir()
        writer.write(1_790_000_001.0, beat(1))
    (second,) = (tmp_path / "logs").iterdir()
    assert second != first
    assert beats(second.read_bytes()) == [1]


def test_a_log_that_cannot_be_begun_on_a_full_disk_is_begun_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = [True]

    def refuse(folder: Path, time_s: float) -> BinaryIO:
        if full[0]:
            raise Unavailable("no") from OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return create_tlog(folder, time_s)

    monkeypatch.setattr(tlog, "create_tlog", refuse)
    with open_tlog(tmp_path, lambda: 1_790_000_000.0) as writer:
        writer.write(1_790_000_000.0, beat(0))
        wait_until(lambda: writer.fault is not None)
        full.clear()
        full.append(False)
        wait_until(lambda: writer.fault is None)
    (path,) = tmp_path.iterdir()
    assert beats(path.read_bytes()) == [0]
    with pytest.raises(Unavailable, match="File exists"):
        open_tlog(path, lambda: 0.0)


def test_a_log_is_named_after_its_time_and_never_overwritten(tmp_path: Path) -> None:
    with create_tlog(tmp_path / "logs", 1_790_000_000.25) as file:
        assert Path(file.name).name == "2026-09-21T14-13-20.250000Z.tlog"
    with pytest.raises(Unavailable, match="File exists"):
        create_tlog(tmp_path / "logs", 1_790_000_000.25)


def test_a_frame_that_hands_over_a_signing_key_is_not_written_down() -> None:
    file = io.BytesIO()
    setup = dialect.MAVLink_setup_signing_message(1, 1, list(range(32)), 0)
    with TlogWriter(file) as writer:
        writer.write(1_790_000_000.0, setup.pack(dialect.MAVLink(None)))
    assert file.getvalue() == b""
