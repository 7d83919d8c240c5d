"""The journal's file: nothing written is lost, and a torn end is repaired and told."""

import errno
import json
import os
import resource
import threading
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal import GIVEN_UP, Entry, Journal, Worth, read
from hsop_gcs.journal.backlog import Backlog
from tests.service import wait_until

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def written(path: Path, count: int) -> bytes:
    with Journal(path) as journal:
        for k in range(count):
            journal.append("report", {"k": k, "text": "näher"}, time_s=100.0 + k / 7)
    return path.read_bytes()


@given(values)
def test_what_is_written_is_read_to_the_bit(tmp_path_factory: pytest.TempPathFactory, value: object) -> None:
    path = tmp_path_factory.mktemp("journal") / "j"
    with Journal(path) as journal:
        journal.append("anything", value, time_s=1e9 / 3)
    (entry,) = read(path)
    assert (entry.number, entry.time_s, entry.kind) == (1, 1e9 / 3, "anything")
    assert json.dumps(entry.data) == json.dumps(value)


def test_a_journal_goes_on_where_it_ended(tmp_path: Path) -> None:
    written(tmp_path / "j", 3)
    with Journal(tmp_path / "j") as journal:
        assert journal.bytes_cut == 0
        journal.append("plan", None, time_s=0.0)
    assert [entry.number for entry in read(tmp_path / "j")] == [1, 2, 3, 4]


def test_opening_tells_what_is_there_and_leaves_it_alone_if_that_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "j"
    torn = written(path, 3)[:-1]
    path.write_bytes(torn)

    def refuse(entry: Entry) -> None:
        raise BadInput(entry.kind, "is of another program")

    with pytest.raises(BadInput, match="another program"):
        Journal(path, refuse)
    assert path.read_bytes() == torn
    told: list[Entry] = []
    with Journal(path, told.append):
        assert [entry.data["k"] for entry in told] == [0, 1]


def test_a_line_torn_at_any_byte_is_cut_off_and_told(tmp_path: Path) -> None:
    path = tmp_path / "j"
    whole = written(path, 3)
    third = whole.rindex(b"\n", 0, -1) + 1
    for size in range(third + 1, len(whole)):
        path.write_bytes(whole[:size])
        assert [entry.number for entry in read(path)] == [1, 2]
        with Journal(path) as journal:
            assert journal.bytes_cut == size - third
            journal.append("report", {"k": 2}, time_s=1.0)
        assert [entry.number for entry in read(path)] == [1, 2, 3]


def test_damage_in_the_middle_is_not_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "j"
    whole = written(path, 3)
    path.write_bytes(whole.replace(b'"k":1', b'"k":9'))
    with pytest.raises(BadInput, match="line 3 is damaged"):
        list(read(path))
    with pytest.raises(BadInput, match="line 3 is damaged"):
        Journal(path)


@pytest.mark.parametrize("text", ['{"kind":1}', '{"kind":1}\n', "a note\n", '{"n":1}\n', '{"n":2,"t":0}\n{"n":3'])
def test_what_is_no_journal_is_refused_and_left_alone(tmp_path: Path, text: str) -> None:
    path = tmp_path / "j"
    path.write_text(text)
    with pytest.raises(BadInput, match="is no journal"):
        list(read(path))
    with pytest.raises(BadInput, match="is no journal"):
        Journal(path)
    assert path.read_text() == text


@pytest.mark.parametrize("number", [b"1", b"3", b"17"])
def test_a_journal_of_another_format_is_refused_by_its_number(tmp_path: Path, number: bytes) -> None:
    path = tmp_path / "j"
    text = b'{"n":1,"t":1.0,"kind":"a","data":0,"crc":"1"}\n'
    if number != b"1":
        text = written(path, 1).replace(b'"format":2', b'"format":' + number)
    path.write_bytes(text)
    for look in (Journal, lambda path: list(read(path))):
        with pytest.raises(BadInput, match=f"is a journal of format {number.decode()}, and format 2 is read here"):
            look(path)
    assert path.read_bytes() == text


@pytest.mark.parametrize("size", [0, 1, 5, 7, 30, 60])
def test_a_first_line_that_is_torn_is_cut_off(tmp_path: Path, size: int) -> None:
    path = tmp_path / "j"
    path.write_bytes(written(path, 1)[:size])
    with Journal(path) as journal:
        assert journal.bytes_cut == size
        journal.append("report", None, time_s=0.0)
    assert [entry.number for entry in read(path)] == [1]


def test_a_missing_line_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "j"
    lines = written(path, 3).splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1] + lines[3] + lines[3])
    with pytest.raises(BadInput, match="line 3 is damaged"):
        list(read(path))


def test_what_is_appended_while_the_disk_is_full_is_written_when_there_is_space_again(tmp_path: Path) -> None:
    path, unlimited = tmp_path / "j", resource.getrlimit(resource.RLIMIT_FSIZE)
    whole = len(written(path, 2))
    with Journal(path) as journal:
        for room in (0, 10, 30):
            resource.setrlimit(resource.RLIMIT_FSIZE, (whole + room, unlimited[1]))
            try:
                journal.append("report", {"k": room}, time_s=1.0)
                wait_until(lambda: journal.failing)
                assert path.stat().st_size == whole + room
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
            assert journal.flush(10.0)
            assert journal.status.fault is None
            whole = path.stat().st_size
        journal.append("report", {"k": "after"}, time_s=2.0)
    assert [entry.data["k"] for entry in read(path)] == [0, 1, 0, 10, 30, "after"]


class Disk:
    """Takes so many writes, then has a problem, or hangs, until it is mended."""

    def __init__(self, problem: int | None = None) -> None:
        self.problem = problem
        self.hangs = False
        self.mended = threading.Event()

    def write(self, file: int, data: bytes) -> int:
        if self.hangs:
            self.mended.wait(20)
        elif self.problem is not None and not self.mended.is_set():
            raise OSError(self.problem, os.strerror(self.problem))
        return os.write(file, data)


@pytest.mark.parametrize("problem", [errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT, errno.ESTALE])
def test_no_problem_of_the_disk_reaches_who_appends(tmp_path: Path, problem: int) -> None:
    path, disk = tmp_path / "j", Disk(problem)
    with Journal(path, write=disk.write) as journal:
        for k in range(3):
            journal.append("report", k, time_s=float(k))
        assert journal.status.waiting == 3
        assert os.strerror(problem) in (journal.status.fault or "")
        disk.mended.set()
        assert journal.flush(10.0)
    assert [entry.data for entry in read(path)] == [0, 1, 2]


def test_a_write_that_hangs_is_waited_for_once(tmp_path: Path) -> None:
    path, disk = tmp_path / "j", Disk()
    with Journal(path, write=disk.write) as journal:
        disk.hangs = True
        for k in range(1000):
            journal.append("report", k, time_s=float(k))
        status = journal.status
        assert status.waiting == status.late == 1000
        wait_until(lambda: "the disk is slow" in (journal.status.fault or ""))
        disk.mended.set()
        assert journal.flush(10.0)
        assert journal.status.fault is None
    assert [entry.data for entry in read(path)] == list(range(1000))


def test_entries_of_least_worth_are_given_up_first_and_the_gap_is_told_in_its_place(tmp_path: Path) -> None:
    path, disk = tmp_path / "j", Disk(errno.ENOSPC)
    with Journal(path, write=disk.write, backlog_bytes=5_000) as journal:
        for k in range(100):
            journal.append("report", {"k": k, "text": 50 * "x"}, time_s=100.0 + k, worth=Worth.RAW)
            if k % 10 == 0:
                journal.append("hold", k, time_s=100.0 + k, worth=Worth.PROMISED)
        assert journal.status.waiting_bytes < 5_000
        disk.mended.set()
    entries = list(read(path))
    assert [entry.number for entry in entries] == list(range(1, len(entries) + 1))
    assert [entry.data for entry in entries if entry.kind == "hold"] == list(range(0, 100, 10))
    kept = [entry.data["k"] for entry in entries if entry.kind == "report"]
    assert kept == list(range(100 - len(kept), 100))
    (gap,) = [entry for entry in entries if entry.kind == GIVEN_UP]
    assert entries[0] == gap
    assert gap.data == {"kinds": {"report": 100 - len(kept)}, "from_s": 100.0, "to_s": 199.0 - len(kept)}


@given(st.lists(st.tuples(st.sampled_from(Worth), st.integers(1, 400), st.sampled_from(["add", "take", "fail"]))))
def test_a_backlog_loses_nothing_in_silence_and_keeps_the_order(steps: list[tuple[Worth, int, str]]) -> None:
    backlog, out = Backlog(1_000), []
    for k, (worth, size, step) in enumerate(steps):
        if step == "add":
            backlog.add(time_s=float(k), kind=worth.name, body=bytes(size), worth=worth, now_s=float(k))
        batch = [] if step == "add" else backlog.take(size)
        done = batch if step == "take" else batch[: len(batch) // 2]
        out += done
        backlog.put_back(batch[len(done) :])
        assert backlog.bytes <= 1_000
    while batch := backlog.take(100):
        out += batch
    lost = Counter[str]()
    for each in out:
        if each.kind == GIVEN_UP:
            lost.update(json.loads(b"{" + each.body)["data"]["kinds"])
    assert lost == backlog.given_up
    added = sum(step == "add" for _, _, step in steps)
    sequences = [each.sequence for each in out if each.kind != GIVEN_UP]
    assert sequences == sorted(set(sequences))
    assert len(sequences) + lost.total() == backlog.sequence == added


def test_two_processes_do_not_write_one_journal(tmp_path: Path) -> None:
    path = tmp_path / "j"
    with Journal(path) as journal:
        with pytest.raises(Unavailable, match="another process writes it"):
            Journal(path)
        journal.append("report", 1, time_s=0.0)
    with Journal(path) as journal:
        journal.append("report", 2, time_s=0.0)


def test_a_place_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(Unavailable, match="journal"):
        Journal(tmp_path / "no" / "such" / "place")
    with pytest.raises(BadInput, match="No such file"):
        list(read(tmp_path / "none"))
