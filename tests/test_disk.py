"""Room on disks is watched, and a disk that does not answer stops nobody."""

import errno
import os
import threading
from pathlib import Path

import pytest

from hsop_gcs import disk
from hsop_gcs.disk import DiskWatch, free_bytes
from tests.service import wait_until


def test_less_than_the_reserve_is_told_until_there_is_clearly_more() -> None:
    free = [600]
    watch = DiskWatch([Path("/a")], 500_000_000, free=lambda _folder: free[0] * 1_000_000)
    told = []
    for megabytes in (600, 499, 501, 549, 551, 501, 10):
        free[0] = megabytes
        watch.look()
        told.append(watch.problem)
    assert [each is not None for each in told] == [False, True, True, True, False, False, True]
    assert told[-1] == "/a: 10 MB free, less than the reserve of 500 MB"


@pytest.mark.parametrize("problem", [errno.ENOENT, errno.EIO, errno.ESTALE])
def test_a_disk_that_cannot_be_asked_counts_as_one_without_room(problem: int) -> None:
    def refuse(_folder: Path) -> int:
        raise OSError(problem, os.strerror(problem))

    watch = DiskWatch([Path("/gone")], 1, free=refuse)
    watch.look()
    assert watch.problem == f"/gone: {os.strerror(problem)}"


def test_a_disk_that_does_not_answer_is_told_and_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk, "_EVERY_S", 0.01)
    monkeypatch.setattr(disk, "_SILENT_S", 0.2)
    answers, asked = threading.Event(), threading.Event()
    answers.set()

    def free(_folder: Path) -> int:
        asked.set()
        answers.wait(20)
        return 10

    with DiskWatch([Path("/slow")], 1, free=free) as watch:
        assert watch.problem is None
        answers.clear()
        assert "has not answered" in wait_until(lambda: watch.problem)
        answers.set()
        wait_until(lambda: watch.problem is None)


def test_the_room_of_a_real_disk_is_known(tmp_path: Path) -> None:
    assert free_bytes(tmp_path) > 0
    with pytest.raises(FileNotFoundError):
        free_bytes(tmp_path / "none")
