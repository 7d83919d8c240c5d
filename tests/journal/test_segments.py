"""Segments: a start reads one of them, whatever was taken away or left half done."""

import errno
import gzip
import os
import shutil
from pathlib import Path

import pytest

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal import GIVEN_UP, SNAPSHOT, Entry, Journal, read
from hsop_gcs.journal.entry import body_of
from hsop_gcs.journal.file import JournalFile
from hsop_gcs.journal.retention import Retention
from hsop_gcs.journal.segments import segments
from tests.service import wait_until


def fill(path: Path, rounds: int = 4, *, segment_bytes: int = 2_000) -> None:
    """Write a journal whose entries count, and whose snapshots hold how far."""
    with Journal(path, segment_bytes=segment_bytes, raw=["report"]) as journal:
        count(journal, 40 * rounds)


def count(journal: Journal, to: int, *, start: int = 0) -> None:
    for k in range(start, to):
        if journal.wants_snapshot:
            journal.save(k, time_s=float(k))
        journal.append("hold" if k % 20 == 0 else "report", k + 1, time_s=float(k))
    assert journal.flush(10.0)


def recovered(path: Path) -> int:
    """What a start makes of a journal: the last count."""
    state = []
    with Journal(path, lambda entry: state.append(entry.data)) as journal:
        assert journal.status.fault is None
    return int(state[-1])


def numbers(path: Path) -> list[int]:
    return [entry.number for entry in read(path)]


def test_a_journal_is_parted_into_segments_and_a_start_reads_the_newest(tmp_path: Path) -> None:
    path = tmp_path / "j"
    fill(path)
    names = [each.path.name for each in segments(path)]
    assert len(names) > 2
    assert names[-2:] == [f"j.{len(names) - 1:06d}", "j"]
    told: list[Entry] = []
    with Journal(path, told.append):
        assert told[0].kind == SNAPSHOT
        assert [entry.data for entry in told[1:]] == list(range(told[0].data + 1, 161))
    assert numbers(path) == list(range(1, len(numbers(path)) + 1))
    assert [entry.data for entry in read(path) if entry.kind != SNAPSHOT] == list(range(1, 161))


def test_closed_segments_are_compressed_and_the_oldest_lose_their_raw_entries_when_they_take_too_much(
    tmp_path: Path,
) -> None:
    path = tmp_path / "j"
    fill(path)
    before = numbers(path)
    Retention(path, raw=frozenset({"report", SNAPSHOT})).tidy()
    suffixes = [each.path.suffix for each in segments(path)]
    assert set(suffixes[:-2]) == {".gz"}
    assert ".gz" not in suffixes[-2:]
    assert numbers(path) == before
    Retention(path, raw=frozenset({"report", SNAPSHOT}), keep_bytes=0).tidy()
    first, *_, newest, now = segments(path)
    assert (first.kept, newest.kept, now.kept) == (True, False, False)
    with gzip.open(first.path) as file:
        kinds = {line.split(b'"kind":"')[1].split(b'"')[0] for line in file.readlines()[1:]}
    assert kinds == {b"hold"}
    assert recovered(path) == 160
    assert next(read(path)).kind == SNAPSHOT, "what has lost its raw entries cannot be repeated"


@pytest.mark.parametrize("step", ["begun", "begun half", "closed", "closed half", "compressed half"])
def test_a_process_that_ends_while_segments_change_loses_nothing(tmp_path: Path, step: str) -> None:
    path, begun = tmp_path / "j", tmp_path / "j.next"
    fill(path)
    *_, newest, _ = segments(path)
    whole = path.read_bytes()
    match step:
        case "begun":
            shutil.copy(path, begun)
        case "begun half":
            begun.write_bytes(whole[:40])
        case "closed":
            path.rename(begun)
        case "closed half":
            # as after a loss of power: the names are there, what was in the new file is not
            path.write_bytes(b"")
        case "compressed half":
            shutil.copy(newest.path, newest.path.with_name(newest.path.name + ".gz.part"))
    assert recovered(path) == (160 if step != "closed half" else [e.data for e in read(path)][-1])
    assert recovered(path) > 80
    assert not begun.exists()
    with Journal(path, segment_bytes=2_000) as journal:
        count(journal, 300, start=200)
    assert recovered(path) == 300
    assert numbers(path) == list(range(1, len(numbers(path)) + 1))


@pytest.mark.parametrize("how", ["removed", "renamed", "emptied by another", "folder removed"])
def test_a_file_that_is_taken_away_underneath_is_begun_again_and_what_is_missing_is_told(
    tmp_path: Path, how: str
) -> None:
    path = tmp_path / "logs" / "j"
    path.parent.mkdir()
    with Journal(path) as journal:
        count(journal, 10)
        match how:
            case "removed":
                path.unlink()
            case "renamed":
                path.rename(path.with_name("old"))
            case "emptied by another":
                path.rename(path.with_name("old"))
                path.touch()
            case "folder removed":
                shutil.rmtree(path.parent)
        # this one meets no file: it is not lost
        journal.append("hold", 11, time_s=11.0)
        if how == "folder removed":
            assert "No such file" in (journal.status.fault or "")
            path.parent.mkdir()
        wait_until(lambda: journal.wants_snapshot)
        journal.save(11, time_s=11.0)
        journal.append("hold", 12, time_s=12.0)
        assert journal.flush(10.0)
        assert not journal.wants_snapshot
    kinds = [entry.kind for entry in read(path)]
    assert kinds == [GIVEN_UP, "hold", SNAPSHOT, "hold"]
    assert recovered(path) == 12


def test_another_file_in_its_place_is_left_alone_and_entries_wait(tmp_path: Path) -> None:
    path = tmp_path / "j"
    with Journal(path) as journal:
        count(journal, 3)
        path.rename(tmp_path / "old")
        path.write_text("somebody's notes")
        journal.append("hold", 4, time_s=4.0)
        wait_until(lambda: "another file has taken its place" in (journal.status.fault or ""))
        assert path.read_text() == "somebody's notes"
        path.unlink()
        assert journal.flush(10.0)
    assert [entry.data for entry in read(path) if entry.kind == "hold"] == [4]


def test_where_no_new_file_can_be_made_the_snapshot_goes_into_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, create = tmp_path / "j", os.open

    def refuse(name: object, flags: int, *mode: int, **more: int) -> int:
        if str(name).endswith(".next"):
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return create(str(name), flags, *mode, **more)

    monkeypatch.setattr(os, "open", refuse)
    fill(path)
    assert [each.path for each in segments(path)] == [path]
    assert SNAPSHOT in [entry.kind for entry in read(path)]
    assert recovered(path) == 160


def test_a_disk_that_is_read_only_at_the_start_is_no_reason_not_to_start(tmp_path: Path) -> None:
    path = tmp_path / "j"
    fill(path, rounds=1)

    def refuse(_file: int, _data: bytes) -> int:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    told: list[Entry] = []
    with Journal(path, told.append, write=refuse) as journal:
        assert told[-1].data == 40
        journal.append("hold", 41, time_s=41.0)
        assert "Read-only file system" in (journal.status.fault or "")
    fresh = tmp_path / "fresh"
    with Journal(fresh, write=refuse) as journal:
        assert not fresh.exists()
        journal.append("hold", 1, time_s=1.0)
        assert journal.status.waiting == 1


def test_a_damaged_closed_segment_does_not_keep_a_service_from_starting(tmp_path: Path) -> None:
    path = tmp_path / "j"
    fill(path)
    newest = segments(path)[-2].path
    lines = newest.read_bytes().splitlines(keepends=True)
    newest.write_bytes(b"".join([*lines[:3], lines[3].replace(b'"t":', b'"t":1'), *lines[4:]]))
    assert recovered(path) == 160
    with pytest.raises(BadInput, match=rf"{newest.name}: line 4 is damaged"):
        list(read(path))


def test_two_processes_do_not_write_one_journal_though_its_file_was_renamed(tmp_path: Path) -> None:
    path = tmp_path / "j"
    with Journal(path) as journal:
        journal.append("hold", 1, time_s=1.0)
        path.rename(tmp_path / "old")
        with pytest.raises(Unavailable, match="another process writes it"):
            Journal(path)


@pytest.mark.parametrize("folder_too", [False, True])
def test_two_processes_do_not_write_one_journal_though_all_its_files_were_removed(
    tmp_path: Path, folder_too: bool
) -> None:
    path = tmp_path / "logs" / "j"
    path.parent.mkdir()
    with Journal(path) as journal:
        journal.append("hold", 1, time_s=1.0)
        assert journal.flush(10.0)
        shutil.rmtree(path.parent)
        if folder_too:
            journal.append("hold", 3, time_s=1.5)
            wait_until(lambda: "No such file" in (journal.status.fault or ""))
        path.parent.mkdir()
        journal.append("hold", 2, time_s=2.0)
        assert journal.flush(10.0)
        with pytest.raises(Unavailable, match="another process writes it"):
            Journal(path)
    with Journal(path):
        pass


def test_what_another_process_has_begun_where_the_files_were_removed_is_left_to_it(tmp_path: Path) -> None:
    path = tmp_path / "j"
    file = JournalFile(path, lambda _: None)
    file.append([body_of("hold", 1, 1.0)], time_s=1.0)
    for each in tmp_path.iterdir():
        each.unlink()
    with Journal(path) as journal:
        journal.append("hold", 7, time_s=1.5)
        assert journal.flush(10.0)
        with pytest.raises(OSError, match="another process writes it"):
            file.append([body_of("hold", 2, 2.0)], time_s=2.0)
    file.close()
    assert [entry.data for entry in read(path)] == [7]
