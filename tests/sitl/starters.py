"""The start scripts of sitl_configs/, run with a program in the autopilot's place that says how it was called."""

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.service import wait_until
from tests.sitl.parameters import CONFIGS

_STAND_IN = """#!/bin/sh
{ pwd; printf '%s\\0' "$@"; echo; env; } >"$CALLS/$$.new"
mv "$CALLS/$$.new" "$CALLS/$$"
exec sleep 600
"""
_LINE = re.compile(r"system (\d+): home (-?[\d.]+),(-?[\d.]+) -> 127\.0\.0\.1:(\d+), output in (\S+)")


@dataclass(frozen=True)
class Call:
    """How one autopilot was started."""

    pid: int
    folder: Path
    arguments: list[str]
    environment: dict[str, str]


@dataclass(frozen=True)
class Vehicle:
    """What the script told its user of one vehicle."""

    system_id: int
    lat_deg: float
    lon_deg: float
    port: int
    output: Path


@dataclass(frozen=True)
class Started:
    """A running start script."""

    process: subprocess.Popen[str]
    vehicles: list[Vehicle]
    calls: list[Call]


def shells() -> list[str]:
    """Return the POSIX shells of this machine; dash is the strictest of the common ones."""
    return [shell for shell in ("dash", "sh") if shutil.which(shell)][:1]


@contextmanager
def started(script: str, count: int, folder: Path, **environment: str) -> Iterator[Started]:
    """Run a start script for ``count`` vehicles; it is interrupted at the end, as by Ctrl-C, and must end them all."""
    calls, program = folder / "calls", stand_in(folder)
    calls.mkdir()
    variables = {"HSOP_PX4_BIN": str(program), "HSOP_ARDUCOPTER_BIN": str(program), "TMPDIR": str(folder)}
    command = [*shells(), str(CONFIGS / script), str(count)]
    env = os.environ | {"CALLS": str(calls)} | variables | environment
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env, cwd=folder) as process:
        assert process.stdout is not None
        try:
            told = [_LINE.fullmatch(process.stdout.readline().strip()) for _ in range(count)]
            assert all(told)
            assert "Ctrl-C" in process.stdout.readline()
            wait_until(lambda: len(list(calls.glob("*[0-9]"))) == count)
            vehicles = [
                Vehicle(int(one[1]), float(one[2]), float(one[3]), int(one[4]), Path(one[5])) for one in told if one
            ]
            yield Started(process, vehicles, [_call(path) for path in calls.iterdir()])
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=30)


def stand_in(folder: Path) -> Path:
    """Put the stand-in where a PX4 build tree has its binary."""
    program = folder / "build" / "bin" / "autopilot"
    program.parent.mkdir(parents=True)
    program.write_text(_STAND_IN)
    program.chmod(0o755)
    (folder / "build" / "etc" / "init.d-posix").mkdir(parents=True)
    (folder / "build" / "etc" / "init.d-posix" / "rcS").touch()
    return program


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def refused(script: str, *arguments: str, **environment: str) -> str:
    """Return the complaint of a script that will not start; it must be an exit with code 2."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("HSOP_")} | environment
    command = [*shells(), str(CONFIGS / script), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=30, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    return done.stderr


def _call(path: Path) -> Call:
    folder, arguments, *variables = path.read_text().split("\n")
    pairs = (line.partition("=") for line in variables if "=" in line)
    return Call(int(path.name), Path(folder), arguments.split("\0")[:-1], {name: value for name, _, value in pairs})


requires_shell = pytest.mark.skipif(not shells(), reason="no POSIX shell here")
