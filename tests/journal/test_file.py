"""The journal's file: nothing written is lost, and a torn end is repaired and told."""

import json
import resource
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal import Entry, Journal, read

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
        assert journal.append("anything", value, time_s=1e9 / 3) == 1
    (entry,) = read(path)
    assert (entry.number, entry.time_s, entry.kind) == (1, 1e9 / 3, "anything")
    assert json.dumps(entry.data) == json.dumps(value)


def test_a_journal_goes_on_where_it_ended(tmp_path: Path) -> None:
    written(tmp_path / "j", 3)
    with Journal(tmp_path / "j") as journal:
        assert journal.bytes_cut == 0
        assert journal.append("plan", None, time_s=0.0) == 4
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
    third = whole.index(b"\n", whole.index(b"\n") + 1) + 1
    for size in range(third + 1, len(whole)):
        path.write_bytes(whole[:size])
        assert [entry.number for entry in read(path)] == [1, 2]
        with Journal(path) as journal:
            assert journal.bytes_cut == size - third
            assert journal.append("report", {"k": 2}, time_s=1.0) == 3
        assert [entry.number for entry in read(path)] == [1, 2, 3]


def test_damage_in_the_middle_is_not_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "j"
    whole = written(path, 3)
    path.write_bytes(whole.replace(b'"k":1', b'"k":9'))
    with pytest.raises(BadInput, match="line 2 is damaged"):
        list(read(path))
    with pytest.raises(BadInput, match="line 2 is damaged"):
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


@pytest.mark.parametrize("size", [0, 1, 5, 7, 30])
def test_a_first_line_that_is_torn_is_cut_off(tmp_path: Path, size: int) -> None:
    path = tmp_path / "j"
    path.write_bytes(written(path, 1)[:size])
    with Journal(path) as journal:
        assert journal.bytes_cut == size
        assert journal.append("report", None, time_s=0.0) == 1
    assert [entry.number for entry in read(path)] == [1]


def test_a_missing_line_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "j"
    lines = written(path, 3).splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[2])
    with pytest.raises(BadInput, match="line 2 is damaged"):
        list(read(path))


def test_a_disk_that_was_full_costs_only_what_was_refused(tmp_path: Path) -> None:
    path, unlimited = tmp_path / "j", resource.getrlimit(resource.RLIMIT_FSIZE)
    whole = len(written(path, 2))
    with Journal(path) as journal:
        for room in (0, 10, 30):
            resource.setrlimit(resource.RLIMIT_FSIZE, (whole + room, unlimited[1]))
            try:
                with pytest.raises(OSError, match=r"No space left|File too large"):
                    journal.append("report", {"k": "refused"}, time_s=1.0)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
            assert path.stat().st_size == whole + room
        assert journal.append("report", {"k": "accepted"}, time_s=2.0) == 3
    assert [entry.data["k"] for entry in read(path)] == [0, 1, "accepted"]


def test_two_processes_do_not_write_one_journal(tmp_path: Path) -> None:
    path = tmp_path / "j"
    with Journal(path) as journal:
        with pytest.raises(Unavailable, match="another process writes it"):
            Journal(path)
        journal.append("report", 1, time_s=0.0)
    with Journal(path) as journal:
        assert journal.append("report", 2, time_s=0.0) == 2


def test_a_place_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(Unavailable, match="journal"):
        Journal(tmp_path / "no" / "such" / "place")
    with pytest.raises(BadInput, match="No such file"):
        list(read(tmp_path / "none"))
