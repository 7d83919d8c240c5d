"""``hsop-gcs fleet``: the same fleet from its links and from its service, for machines and in 80 columns."""

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.service import ORIGIN, free_udp_port, service, settings, simulated_fleet, wait_until


def fleet(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hsop_gcs", "fleet", *arguments]
    environment = os.environ | {"COLUMNS": "80"}
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=environment)


def config(tmp_path: Path, udp_port: int) -> str:
    origin = ", ".join(f"{name} = {value}" for name, value in ORIGIN.items())
    hosts = "".join(
        f'[[hosts]]\nid = "h{n}"\nsystem_id = {n}\nconnection = "udpin:127.0.0.1:{udp_port}"\n' for n in (1, 2)
    )
    path = tmp_path / "FLEET.toml"
    path.write_text(f"[site]\norigin = {{ {origin} }}\n{hosts}")
    return str(path)


def test_links_tell_who_is_heard_and_who_is_not_in_the_fleet(tmp_path: Path) -> None:
    port = free_udp_port()
    with simulated_fleet(port, 3):

        def heard() -> list[dict[str, Any]] | None:
            rows: list[dict[str, Any]] = json.loads(
                fleet("--config", config(tmp_path, port), "--once", "--json").stdout
            )
            return rows if len(rows) == 3 and all(row["mode"] for row in rows[:2]) else None

        rows = wait_until(heard, limit_s=60)
    assert [(row["host"], row["system_id"]) for row in rows] == [("h1", 1), ("h2", 2), (None, 3)]
    assert [row["autopilot"] for row in rows[:2]] == ["px4", "px4"]
    assert "not in the fleet" in rows[2]["note"]


def test_a_service_is_asked_and_the_table_fits_80_columns() -> None:
    port = free_udp_port()
    with service(settings(2, port)) as client, simulated_fleet(port, 2):
        wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == 2)
        shown = fleet("--url", str(client.base_url), "--once")
    assert (shown.returncode, shown.stderr) == (0, "")
    lines = shown.stdout.splitlines()
    assert max(len(line) for line in lines) <= 80
    (h1,) = [line for line in lines if line.startswith("h1")]
    assert "px4" in h1
    assert "Hold" in h1
    assert "air" in h1
    assert "…" not in h1


class Screen:
    """A terminal of 80 columns that shows a live ``hsop-gcs fleet``."""

    def __init__(self, *arguments: str) -> None:
        self._ours, theirs = pty.openpty()
        environment = os.environ | {"COLUMNS": "80", "TERM": "xterm"}
        command = [sys.executable, "-m", "hsop_gcs", "fleet", *arguments]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=subprocess.PIPE, env=environment
        )
        os.close(theirs)
        self.output = ""

    def row(self, host: str) -> str:
        """Read on for a moment; return what the newest table says of a host, empty before there is one."""
        if select.select([self._ours], [], [], 0.5)[0]:
            self.output += os.read(self._ours, 65536).decode()
        lines = [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", line).strip() for line in self.output.split("\n")]
        return next((line for line in reversed(lines) if line.startswith(f"{host} ")), "")

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C; return the exit code and what was complained of."""
        self.process.send_signal(signal.SIGINT)
        _, complaints = self.process.communicate(timeout=30)
        self.row("")
        os.close(self._ours)
        return self.process.returncode, complaints.decode()


def test_the_table_of_a_terminal_is_drawn_again_as_hosts_come_and_go(tmp_path: Path) -> None:
    port = free_udp_port()
    screen = Screen("--config", config(tmp_path, port))
    try:
        wait_until(lambda: "silent" in screen.row("h1"))
        with simulated_fleet(port, 1):
            in_air = wait_until(lambda: row if "air" in (row := screen.row("h1")) else None)
            assert re.search(r"h1 +1 +px4 1\.16\.0 +\d+/s .*100% +Hold +air +47\.397\d 8\.545\d 528", in_air)
            assert "silent" in screen.row("h2")
        wait_until(lambda: "silent" in screen.row("h1"))
    finally:
        assert screen.interrupt() == (130, "")
    assert screen.output.count("\x1b[1A") > 10, "each table is drawn over the one before"
    assert screen.output.count("\x1b[?25h") == screen.output.count("\x1b[?25l") == 1, "the cursor is given back"


def test_nothing_to_ask_is_one_line() -> None:
    assert fleet().returncode == 2
    silent = fleet("--url", "http://127.0.0.1:9", "--once")
    assert (silent.returncode, len(silent.stderr.splitlines())) == (1, 1)
