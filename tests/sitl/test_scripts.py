"""The start scripts are plain POSIX shell."""

import subprocess
import sys
from pathlib import Path

from tests.sitl.parameters import CONFIGS

SHELLCHECK = Path(sys.executable).with_name("shellcheck")


def test_shellcheck_finds_nothing() -> None:
    scripts = sorted(CONFIGS.glob("*.sh"))
    assert len(scripts) == 3
    command = [str(SHELLCHECK), "--shell=sh", "--external-sources", f"--source-path={CONFIGS.parent}"]
    done = subprocess.run([*command, *map(str, scripts)], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "")
