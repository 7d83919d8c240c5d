"""``hsop-gcs serve`` on a terminal: how it ends."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx2
import pytest
import typer
from typer.testing import CliRunner

from hsop_gcs.cli.serve import register
from hsop_gcs.errors import BadInput
from tests.service import ORIGIN, wait_until


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


@pytest.mark.parametrize(
    ("option", "problem"),
    [
        (["--port", "65536"], "--port: 65536 is not between 0 and 65535"),
        (["--port", "-1"], "--port: -1 is not between 0 and 65535"),
        (["--journal", ""], "--journal: is empty"),
        (["--host", ""], "--host: is empty"),
    ],
)
def test_an_option_that_cannot_be_used_is_one_line(tmp_path: Path, option: list[str], problem: str) -> None:
    app = typer.Typer()
    register(app)
    config = fleet_file(tmp_path, "udpin:127.0.0.1:0")
    error = CliRunner().invoke(app, ["--config", str(config), *option]).exception
    assert isinstance(error, BadInput)
    assert str(error) == problem


def test_the_port_answers_before_the_service_is_ready_and_a_hangup_signal_changes_nothing(tmp_path: Path) -> None:
    config = fleet_file(tmp_path, "udpin:127.0.0.1:0")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    config.write_text(config.read_text().replace("port = 0", f"port = {port}"))
    process = serve(config)
    answers: list[tuple[int, Any]] = []

    def ready() -> bool:
        try:
            answer = httpx2.get(f"http://127.0.0.1:{port}/api/v1/ready", timeout=10)
        except httpx2.TransportError:
            assert not answers, "a port that has answered goes on answering"
            return False
        answers.append((answer.status_code, answer.json()))
        return answer.status_code == 200

    try:
        wait_until(ready, limit_s=150)  # compiling the kernels takes a minute
        assert answers[0][0] == 503
        assert all(body["ready"] is (not body["awaited"]) is (status == 200) for status, body in answers)
        assert {what for _, body in answers for what in body["awaited"]} <= {"mission", "kernels", "planner"}
        process.send_signal(signal.SIGHUP)
        assert httpx2.get(f"http://127.0.0.1:{port}/api/v1/health", timeout=10).status_code == 200
    finally:
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "SIGHUP" in err
