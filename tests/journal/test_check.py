"""Damaged journals: what is in them is told, and what can be read of them is saved."""

import json
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hsop_gcs.cli import main
from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.journal import GIVEN_UP, SNAPSHOT, Journal, read
from hsop_gcs.journal.check import check
from hsop_gcs.journal.repair import put_in_place, repair
from hsop_gcs.journal.retention import Retention
from hsop_gcs.journal.segments import segments
from tests.journal.test_segments import fill, numbers, recovered


def damage(path: Path, line: int) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    lines[line - 1] = lines[line - 1].replace(b'"t":', b'"t":1')
    path.write_bytes(b"".join(lines))


def test_a_sound_journal_is_told_with_all_its_segments(tmp_path: Path) -> None:
    path = tmp_path / "j"
    fill(path)
    Retention(path, raw=frozenset({"report", SNAPSHOT}), keep_bytes=0).tidy()
    contents = check(path)
    assert (contents.damages, contents.missing_segments) == ([], [])
    assert [each.file for each in contents.segments] == [each.path.name for each in segments(path)]
    assert contents.segments[0].kept
    assert contents.segments[-1].begins_with_snapshot
    assert contents.segments[-1].last == numbers(path)[-1]
    assert sum(contents.kinds.values()) == sum(each.entries for each in contents.segments)
    assert contents.kinds["hold"] == 8


def test_damage_is_told_by_file_and_line_and_a_torn_end_is_none(tmp_path: Path) -> None:
    path = tmp_path / "j"
    fill(path)
    newest = segments(path)[-2].path
    damage(newest, 4)
    with path.open("ab") as file:
        file.write(b'{"n":99')
    contents = check(path)
    assert [(each.file, each.line) for each in contents.damages] == [(newest.name, 4)]
    assert contents.torn_bytes == 7
    segments(path)[1].path.unlink()
    assert check(path).missing_segments == [2]


def test_what_is_lost_of_a_repaired_journal_is_told_in_its_place_and_the_original_is_left_alone(
    tmp_path: Path,
) -> None:
    path, out = tmp_path / "j", tmp_path / "good"
    fill(path)
    for line in (4, 5, 9):
        damage(path, line)
    before = {each.path: each.path.read_bytes() for each in segments(path)}
    with pytest.raises(BadInput, match=r"line 4 is damaged; hsop-gcs journal repair"):
        recovered(path)
    done = repair(path, out)
    assert [each.lost for each in done] == [0] * (len(done) - 1) + [3]
    assert {each.path: each.path.read_bytes() for each in segments(path)} == before
    assert not check(out).damages
    assert check(out).given_up == {"damaged": 3}
    gaps = [entry.number for entry in read(out) if entry.kind == GIVEN_UP]
    assert len(gaps) == 2
    assert set(numbers(out)) | {gaps[0] + 1} == set(numbers(out)) | set(range(1, numbers(out)[-1] + 1))
    assert recovered(out) == 160
    with pytest.raises(BadInput, match="exists already"):
        repair(path, out)


def test_a_repaired_journal_takes_the_place_of_the_damaged_one_only_when_told_and_when_nobody_writes_it(
    tmp_path: Path,
) -> None:
    path, out = tmp_path / "j", tmp_path / "good"
    fill(path)
    repair(path, out)
    with Journal(path), pytest.raises(Unavailable, match="another process writes it"):
        put_in_place(path, out)
    damage(path, 4)
    put_in_place(path, out)
    assert recovered(path) == 160
    assert check(tmp_path / "j.damaged").damages
    assert not segments(out)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10**6), st.binary(min_size=0, max_size=5), st.integers(0, 60))
def test_whatever_happens_to_a_file_its_repair_is_sound_and_a_service_starts_from_it(
    tmp_path_factory: pytest.TempPathFactory, at: int, by: bytes, cut: int
) -> None:
    path = tmp_path_factory.mktemp("journal") / "j"
    with Journal(path) as journal:
        for k in range(20):
            journal.append("report", k, time_s=float(k))
    data = path.read_bytes()
    at %= len(data)
    path.write_bytes(data[:at] + by + data[at + cut :])
    out = path.with_name("good")
    refused = None
    try:
        repair(path, out)
    except BadInput as error:
        refused = error.problem
    if refused is not None:
        assert "is no journal" in refused or "format" in refused
        return
    contents = check(out)
    assert contents.damages == []
    told: list[object] = []
    with Journal(out, told.append):
        assert len(told) >= 20 - 1 - cut


def command(monkeypatch: pytest.MonkeyPatch, *options: str) -> int:
    """The exit code of a command line."""
    monkeypatch.setattr(sys, "argv", ["hsop-gcs", "journal", *options])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_the_commands_tell_by_their_exit_codes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mission.journal"
    fill(path)
    assert command(monkeypatch, "check", str(path)) == 0
    told = capsys.readouterr().out
    assert "format 2, sound" in told
    assert max(map(len, told.splitlines())) <= 100
    damage(path, 4)
    assert command(monkeypatch, "check", "--json", str(path)) == 1
    assert json.loads(capsys.readouterr().out)["damages"][0]["line"] == 4
    assert command(monkeypatch, "repair", str(path)) == 0
    assert f"is {path}.repaired; {path} is as it was" in capsys.readouterr().out
    assert command(monkeypatch, "check", f"{path}.repaired") == 0
    capsys.readouterr()
    (tmp_path / "old").write_text('{"n":1,"t":0}\n')
    for bad in (tmp_path / "none", tmp_path / "old"):
        assert command(monkeypatch, "check", str(bad)) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
