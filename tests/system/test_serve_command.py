"""``hsop-gcs serve`` on a terminal: how it ends."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.service import ORIGIN


def fleet_file(folder: Path, connection: str) -> Path:
    origin = ", ".join(f"{name} = {value}" for name, value in ORIGIN.items())
    path = folder / "FLEET.toml"
    path.write_text(
        f"[site]\norigin = {{ {origin} }}\n[service]\nport = 0\n"
        f'[[hosts]]\nid = "h1"\nsystem_id = 1\nconnection = "{connection}"\n'
    )
    return path


def serve(config: Path) -> subprocess.Popen[str]:
    """Start the service as a terminal does: with a process group of its own."""
    command = [sys.executable, "-m", "hsop_gcs", "serve", "--config", str(config)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)


@pytest.mark.parametrize("late", [False, True])
def test_ctrl_c_which_a_terminal_sends_to_every_process_ends_the_service_without_a_word(
    tmp_path: Path, late: bool
) -> None:
    process = serve(fleet_file(tmp_path, "udpin:127.0.0.1:0"))
    assert process.stderr is not None
    assert "serves 1 hosts at http://" in process.stderr.readline()
    if late:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=3)  # by then the planner's processes have done with starting
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")
