"""A study gives the same numbers wherever its trials run, and after whatever interrupts it."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.study.assumptions import Assumptions
from hsop_gcs.study.engine import run
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.results import Results
from hsop_gcs.study.trial import Record, Study
from tests.service import wait_until

STUDY = Study(threats=(2,), scenarios=6, draws=200, rounds=1, seed=5, kinds=(Kind.HSOP, Kind.COVERAGE_ONLY))


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return run(Results(STUDY, None))


def test_two_processes_give_the_numbers_of_one_to_the_last_bit(records: list[Record]) -> None:
    assert run(Results(STUDY, None), jobs=2) == records


def test_another_seed_gives_other_scenarios(records: list[Record]) -> None:
    other = Study(threats=(2,), scenarios=1, draws=200, rounds=1, seed=6, kinds=(Kind.COVERAGE_ONLY,))
    assert run(Results(other, None))[0]["results"] != records[0]["results"][-3:]


def test_a_longer_study_begins_with_the_shorter_one(records: list[Record]) -> None:
    shorter = Study(threats=(2,), scenarios=2, draws=200, rounds=1, seed=5, kinds=STUDY.kinds)
    assert run(Results(shorter, None)) == records[:2]


def test_an_interrupted_study_goes_on_where_it_stopped(tmp_path: Path, records: list[Record]) -> None:
    path = tmp_path / "trials.jsonl"

    def interrupt(done: int, _: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    first = Results(STUDY, path)
    first.begin(resume=False)
    with pytest.raises(KeyboardInterrupt):
        run(first, progress=interrupt)
    with path.open("a") as file:
        file.write('{"threats": 2, "index": 3, "resu')
    told: list[int] = []
    again = Results(STUDY, path)
    again.begin(resume=True)
    assert run(again, progress=lambda done, _: told.append(done)) == records
    assert told == [3, 4, 5, 6]
    finished = Results(STUDY, path)
    finished.begin(resume=True)
    assert finished.records == records


def test_a_study_that_was_killed_leaves_no_process_and_goes_on_to_the_same_numbers(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    command = [sys.executable, "-m", "hsop_gcs", "study", "letter", "--threats", "2", "--scenarios", "16"]
    command += ["--draws", "200", "--rounds", "1", "--seed", "5", "--placement", "hsop,coverage-only"]
    with subprocess.Popen([*command, "--jobs", "2", "--out", str(tmp_path)], stdout=subprocess.PIPE) as process:
        # workers may compile first
        wait_until(lambda: path.exists() and len(path.read_bytes().splitlines()) > 2, limit_s=120)
        process.kill()
        assert process.communicate(timeout=60)[0] == b""  # the pipe ends with the last worker that holds it
    assert process.returncode == -signal.SIGKILL
    whole = replace(STUDY, scenarios=16)
    again = Results(whole, path)
    again.begin(resume=True)
    assert 0 < len(again.missing) < 16
    assert run(again) == run(Results(whole, None))


def test_a_process_that_is_killed_is_told_of_and_what_is_finished_stays(records: list[Record]) -> None:
    results = Results(replace(STUDY, scenarios=40), None)

    def kill_one(done: int, _: int) -> None:
        if done == 1:
            active_children()[0].kill()

    with pytest.raises(Unavailable, match="--resume goes on"):
        run(results, jobs=2, progress=kill_one)
    assert 0 < len(results.records) < 40
    assert all(record in records for record in results.records if record["index"] < STUDY.scenarios)


def test_results_of_other_assumptions_are_not_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    Results(STUDY, path).begin(resume=False)
    other = Study(threats=(2,), scenarios=6, assumptions=Assumptions(size_m=2.0))
    with pytest.raises(BadInput, match="another study"):
        Results(other, path).begin(resume=True)


def test_results_are_not_written_over_unasked(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    Results(STUDY, path).begin(resume=False)
    with pytest.raises(BadInput, match="resume"):
        Results(STUDY, path).begin(resume=False)


@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_that_loses_a_worker_gives_the_same_numbers(records: list[Record]) -> None:
    distributed: Any = pytest.importorskip("distributed")
    killed: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            workers = sorted(client.run(os.getpid).values())

        def kill_one(done: int, _: int) -> None:
            if done == 1:
                os.kill(workers[0], signal.SIGKILL)
                killed.append(workers[0])

        found = run(Results(STUDY, None), dask=cluster.scheduler_address, progress=kill_one)
    assert found == records
    assert len(killed) == 1


def test_a_scheduler_that_is_not_there_is_named(unused_address: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(Unavailable, match=unused_address):
        run(Results(STUDY, None), dask=unused_address, dask_timeout_s=0.2)


@pytest.fixture
def unused_address() -> str:
    import socket

    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{held.getsockname()[1]}"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"threats": ()}, "threats"),
        ({"threats": (2, 2)}, "twice"),
        ({"threats": (9,)}, "threats"),
        ({"scenarios": 0}, "scenarios"),
        ({"draws": 1}, "draws"),
        ({"seed": -1}, "seed"),
        ({"rounds": 0}, "rounds"),
    ],
)
def test_a_study_that_makes_no_sense_is_refused(change: dict[str, Any], named: str) -> None:
    with pytest.raises(BadInput, match=named):
        Study(**change)


@pytest.mark.parametrize("change", [{"size_m": 0.0}, {"area_m": float("nan")}, {"slowest_mps": 6.0}])
def test_assumptions_that_make_no_sense_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        Assumptions(**change)  # type: ignore[arg-type]
