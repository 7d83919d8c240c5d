"""A real service in a process of its own, and what it costs: processor time and memory, from /proc."""

import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from hsop_gcs.errors import Unavailable

_START_S = 120.0
"""Long enough for a first compilation of the planner's kernels."""
_STOP_S = 15.0
_ADDRESS = re.compile(r"serves \d+ hosts at (http://\S+) ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """What a process has used up to now: its own, its children's processor time, and its own memory."""

    time_s: float
    own_cpu_s: float
    workers_cpu_s: float
    resident_mib: float


@dataclass(frozen=True, slots=True)
class Service:
    """A running service."""

    address: str
    pid: int

    def usage(self) -> Usage:
        """Look at the process. Raises Unavailable where there is no /proc, or no process any more."""
        try:
            workers_s = sum(_cpu_s(child) for child in _children(self.pid))
            pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
            own_s = _cpu_s(self.pid)
        except OSError as error:
            raise Unavailable(f"process {self.pid} cannot be looked at: {error}") from None
        return Usage(
            time_s=time.monotonic(),
            own_cpu_s=own_s,
            workers_cpu_s=workers_s,
            resident_mib=pages * os.sysconf("SC_PAGE_SIZE") / 2**20,
        )


@contextmanager
def running(config: Path, log: Path) -> Iterator[Service]:
    """Run ``hsop-gcs serve`` until the block ends; what it says goes to ``log``. Raises Unavailable if it will not."""
    command = [sys.executable, "-m", "hsop_gcs", "serve", "--config", str(config), "--port", "0"]
    with log.open("w") as said, subprocess.Popen(command, stderr=said, stdin=subprocess.DEVNULL) as process:
        try:
            yield Service(_address(process, log), process.pid)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _address(process: "subprocess.Popen[bytes]", log: Path) -> str:
    give_up_at = time.monotonic() + _START_S
    while time.monotonic() < give_up_at:
        found = _ADDRESS.search(log.read_text())
        if found is not None:
            return found[1]
        if process.poll() is not None:
            break
        select.select([], [], [], 0.1)
    raise Unavailable(f"the service did not start: {log.read_text().strip()[-500:]}")


def _cpu_s(pid: int) -> float:
    # The second field is the command in brackets and may hold spaces; what follows does not.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
