"""The simulator as its users run it: a process of its own, reached over loopback UDP."""

import re
import select
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

START_TIMEOUT_S = 60.0
_LINE = re.compile(r"system (\d+): 127\.0\.0\.1:(\d+) -> 127\.0\.0\.1:\d+")


@dataclass(frozen=True)
class RunningSimulator:
    """Where each simulated vehicle listens, by its system id."""

    ports: dict[int, int]


@contextmanager
def simulator(*options: str, vehicles: int = 1) -> Iterator[RunningSimulator]:
    """Run ``hsop-gcs simulate`` on ports the system chooses; it ends with the block, or with this process."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unasked:
        unasked.bind(("127.0.0.1", 0))
        command = [sys.executable, "-m", "hsop_gcs", "simulate", "--vehicles", str(vehicles), "--local-port", "0"]
        command += ["--shared-port", "--target", f"127.0.0.1:{unasked.getsockname()[1]}", "--exit-with-stdin", *options]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdin is not None
            try:
                # The vehicles are listed in one breath once all sockets are open.
                ready, _, _ = select.select([process.stdout], [], [], START_TIMEOUT_S)
                assert ready, "the simulator did not start"
                lines = [process.stdout.readline() for _ in range(vehicles)]
                found = [_LINE.fullmatch(line.strip()) for line in lines]
                assert all(found), lines
                yield RunningSimulator({int(match[1]): int(match[2]) for match in found if match})
            finally:
                process.stdin.close()
                try:
                    process.wait(timeout=10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        assert process.returncode == 0
