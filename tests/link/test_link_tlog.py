"""Telemetry logs, read and written."""

import io
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.messages import Attitude, Heartbeat
from hsop_gcs.link.tlog import TlogWriter, create_tlog, read_tlog

DATA = Path(__file__).parent.parent / "data"
MICROSECOND = 1e-6


def written() -> bytes:
    encoder, file = Encoder(system=1, component=1), io.BytesIO()
    writer = TlogWriter(file)
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
    writer = TlogWriter(file)
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
    writer = TlogWriter(copy)
    for time_s, frame in read_tlog(io.BytesIO(original)):
        writer.write(time_s, frame.raw)
    assert copy.getvalue() == original


def test_a_log_that_cannot_be_written_any_more_ends_and_says_why() -> None:
    with Path("/dev/full").open("wb", buffering=0) as file:
        writer = TlogWriter(file)
        for _ in range(2):
            writer.write(1_790_000_000.0, Encoder(system=1, component=1).encode(Heartbeat()))
    assert writer.fault == "cannot be written any more: No space left on device"


def test_a_log_is_named_after_its_time_and_never_overwritten(tmp_path: Path) -> None:
    with create_tlog(tmp_path / "logs", 1_790_000_000.25) as file:
        assert Path(file.name).name == "2026-09-21T14-13-20.250000Z.tlog"
    with pytest.raises(Unavailable, match="File exists"):
        create_tlog(tmp_path / "logs", 1_790_000_000.25)


def test_a_frame_that_hands_over_a_signing_key_is_not_written_down() -> None:
    file = io.BytesIO()
    setup = dialect.MAVLink_setup_signing_message(1, 1, list(range(32)), 0)
    TlogWriter(file).write(1_790_000_000.0, setup.pack(dialect.MAVLink(None)))
    assert file.getvalue() == b""
