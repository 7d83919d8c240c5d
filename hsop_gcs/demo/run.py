"""The demonstration from start to end, and the processes that it starts."""

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx2

from hsop_gcs.app import running_service
from hsop_gcs.demo.console import Console
from hsop_gcs.demo.outcome import Outcome, outcome_of
from hsop_gcs.demo.scene import HOSTS, TRUTH, service_settings
from hsop_gcs.demo.screen import Screen
from hsop_gcs.loopback import ORIGIN, free_udp_ports
from hsop_gcs.simulator.truth import truth_from_json
from hsop_gcs.workers import deaf_to_ctrl_c, stop_on_signals

SPACING_M = 15.0
LIMIT_S = 150.0


async def run_demo(autopilot: str) -> Outcome:
    """Run the demonstration; progress goes to stderr. Leaves no process behind, however it ends, only its journal."""
    started_s = time.monotonic()
    task = asyncio.current_task()
    assert task is not None
    stop_on_signals(task.cancel, patience_s=10.0)
    journal = Path(tempfile.mkdtemp(prefix="hsop-gcs-demo-")) / "journal"
    async with AsyncExitStack() as stack:
        (port,) = free_udp_ports(1)
        address = await stack.enter_async_context(running_service(service_settings(port, journal)))
        client = await stack.enter_async_context(httpx2.AsyncClient(base_url=address, timeout=5.0))
        screen = stack.enter_context(Screen())
        show = await stack.enter_async_context(_simulated_fleet(autopilot, port, address))
        console = Console(client, screen)
        problem = ""
        try:
            async with asyncio.timeout(LIMIT_S):
                await console.take_off()
            await console.planner_ready()  # while the hosts climb
            truth = {**TRUTH, "epoch": datetime.now(UTC).isoformat()}
            show(truth)
            async with asyncio.timeout(LIMIT_S):
                await console.localize(truth_from_json(truth, ORIGIN))
        except TimeoutError:
            problem = f"not all hosts were on station within {LIMIT_S:.0f} s: {console.doing}"
        hosts = await console.hosts()
    return outcome_of(
        hosts,
        console.plan,
        console.errors,
        threats=len(console.threats),
        problem=problem,
        duration_s=time.monotonic() - started_s,
        journal=str(journal),
    )


@asynccontextmanager
async def _simulated_fleet(autopilot: str, port: int, service: str) -> AsyncIterator[Callable[[Any], None]]:
    """Run ``hsop-gcs simulate`` as a process that ends when its stdin does; yields what shows it a truth."""
    origin = f"{ORIGIN.lat_deg},{ORIGIN.lon_deg},{ORIGIN.altitude_amsl_m}"
    command = [sys.executable, "-m", "hsop_gcs", "simulate", "--vehicles", str(HOSTS), "--autopilot", autopilot]
    command += ["--origin", origin, "--spacing-m", str(SPACING_M), "--target", f"127.0.0.1:{port}", "--shared-port"]
    command += ["--local-port", "0", "--exit-with-stdin", "--truth", "-", "--detections-to", service]
    with deaf_to_ctrl_c():
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, bufsize=1)
    stdin = process.stdin
    assert stdin is not None
    try:
        yield lambda truth: print(json.dumps(truth), file=stdin)
    finally:
        stdin.close()
        try:
            process.wait(timeout=3)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
