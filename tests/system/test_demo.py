"""The demonstration, as a newcomer runs it: a real service, a real fleet process, real UDP."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hsop_gcs.replay import replay

COMMAND = [sys.executable, "-m", "hsop_gcs", "demo"]
PROGRESS = ("waiting for ", "reporting ")
"""What it may still say between take-off and being stopped."""


def left_of(leader: int) -> list[int]:
    """The processes that are still there a few seconds after their leader has finished: none need be waited for."""
    gone_by = time.monotonic() + 5
    while (left := group_of(leader)) and time.monotonic() < gone_by:
        time.sleep(0.05)
    return left


def group_of(leader: int) -> list[int]:
    """The processes that are still there of the group that a finished process led."""
    members = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except (OSError, ValueError):
            continue
        if entry.name.isdigit() and int(fields[2]) == leader and fields[0] != "Z":
            members.append(int(entry.name))
    return members


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The kernels of the package that the demonstration runs; the first time on a machine they take a while."""
    code = "from hsop_gcs.placement.search import warm_up; warm_up()"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path_factory.mktemp("away"), check=True)


@pytest.mark.timeout(300)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_threats_are_reported_and_hosts_hover_and_look_where_the_plan_says(autopilot: str, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*COMMAND, "--autopilot", autopilot, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        start_new_session=True,
    )
    out, err = process.communicate(timeout=280)
    assert process.returncode == 0, err
    result = json.loads(out)
    assert result["all_arrived"] is True
    assert (result["threats"], result["hosts"]) == (2, 4)
    assert result["hover_error_m"] <= 1.5
    assert result["heading_error_deg"] <= 3.0
    assert result["gimbal_error_deg"] <= 1.5
    assert result["final_error_m"] < 2.0 < result["report_error_m"]
    assert left_of(process.pid) == []
    assert replay(Path(result["journal"])).differences == ()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demonstration_leaves_no_process_behind(number: signal.Signals, tmp_path: Path) -> None:
    process = subprocess.Popen(
        COMMAND, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path, start_new_session=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "take-off" in line:
            break
    assert len(group_of(process.pid)) >= 3, "the demonstration, the fleet and the solver should be running"
    # a terminal's Ctrl-C goes to all of them
    (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    *said, last = err.splitlines()
    assert last == "hsop-gcs: stopped"
    assert all(line.startswith(PROGRESS) for line in said), said
    assert left_of(process.pid) == []


def test_an_unknown_autopilot_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    done = subprocess.run([*COMMAND, "--autopilot", "betaflight"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["hsop-gcs: --autopilot: 'betaflight' is not 'px4' or 'ardupilot'"]
