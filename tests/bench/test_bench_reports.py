"""The benchmark of reports on a little: three threats, two single reports.

pytest tests/bench --override-ini addopts=
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest


def test_the_command_measures_and_writes_what_it_prints(tmp_path: Path) -> None:
    written = tmp_path / "reports.json"
    options = ["--threats", "3", "--duration", "4", "--single", "2", "--json", str(written)]
    command = [sys.executable, "-m", "hsop_gcs", "bench", "reports", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(written.read_text())
    assert [(load["one_by_one"], load["ids"]) for load in result["loads"]] == [
        (False, True),
        (True, True),
        (False, False),
        (True, False),
    ]
    for load in result["loads"]:
        assert load["reports_per_s"] == pytest.approx(30, rel=0.2)
        assert load["tracks"] >= 3
        assert load["service_cores"] > 0
    assert result["new_in_picture"]["count"] == result["known_in_picture"]["count"] == 2
    assert "3 threats at 10 Hz" in done.stdout
