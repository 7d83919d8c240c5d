"""hsop-gcs study letter, as it is typed."""

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from hsop_gcs.cli import app, study


def test_the_command_writes_rows_and_resumes(tmp_path: Path) -> None:
    if "study" not in {group.name for group in app.registered_groups}:
        study.register(app)
    command = ["study", "letter", "--scenarios", "2", "--draws", "100", "--threats", "2", "--jobs", "1"]
    command += ["--rounds", "1", "--placement", "hsop,coverage-only", "--out", str(tmp_path / "out")]
    command += ["--json", str(tmp_path / "rows.json")]
    first = CliRunner().invoke(app, command)
    assert first.exit_code == 0, first.output
    content = json.loads((tmp_path / "rows.json").read_text())
    assert {(row["threats"], row["placement"], row["estimator"]) for row in content["rows"]} == {
        (2, placement, estimator)
        for placement in ("hsop", "coverage-only")
        for estimator in ("eq5", "ml", "ml-all-views")
    }
    named = {"threats", "hosts", "placement", "estimator", "mean_error_m", "scenarios"}
    assert all(named <= row.keys() and row["mean_error_m"] > 0 for row in content["rows"])
    assert all(row["scenarios"] == 2 for row in content["rows"] if row["hosts"] == 4)
    again = CliRunner().invoke(app, [*command, "--resume"])
    assert again.exit_code == 0, again.output
    assert json.loads((tmp_path / "rows.json").read_text()) == content


def test_a_terminal_is_shown_the_progress_and_the_time_left() -> None:
    ours, theirs = pty.openpty()
    command = ["study", "letter", "--scenarios", "6", "--draws", "100", "--threats", "2", "--jobs", "1"]
    with subprocess.Popen(
        [sys.executable, "-m", "hsop_gcs", *command, "--placement", "coverage-only"],
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env=os.environ | {"TERM": "xterm"},
    ) as process:
        os.close(theirs)
        shown = b""
        try:
            while piece := os.read(ours, 4096):
                shown += piece
        except OSError:  # Linux tells the end of a terminal so
            pass
    os.close(ours)
    assert process.returncode == 0
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
    assert re.search(r"scenarios \S+ 6/6 \d:\d\d:\d\d", plain)
