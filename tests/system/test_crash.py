"""The service killed in the middle of a mission: what it accepted is kept, what it ordered is not ordered again."""

import json
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import httpx2

from hsop_gcs.journal import read
from hsop_gcs.replay import replay
from tests.service import ORIGIN, free_udp_port, position, report, simulated_fleet, wait_until

KILLS = 4
LONGEST_LIFE_S = 8.0


def fleet_file(folder: Path, udp_port: int) -> Path:
    origin = ", ".join(f"{name} = {value}" for name, value in ORIGIN.items())
    hosts = "\n".join(
        f'[[hosts]]\nid = "h{n}"\nsystem_id = {n}\nconnection = "udpin:127.0.0.1:{udp_port}"' for n in (1, 2)
    )
    path = folder / "FLEET.toml"
    path.write_text(
        f"[site]\norigin = {{ {origin} }}\n[service]\nautonomy = 'auto'\njournal = '{folder / 'journal'}'\n"
        f"[planning]\ntime_limit_s = 0.3\n{hosts}\n"
    )
    return path


def start(config: Path) -> tuple[subprocess.Popen[str], str]:
    """Start the service on a free port; return it with its address."""
    command = [sys.executable, "-m", "hsop_gcs", "serve", "--config", str(config), "--port", "0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if " at http://" in line:
            return process, line.split(" at ")[1].split()[0]
    raise AssertionError("the service did not start")


def post(address: str, body: dict[str, Any]) -> bool:
    """Whether the service said that it accepted the report."""
    try:
        return httpx2.post(f"{address}/api/v1/reports", json=body, timeout=5).status_code == 200
    except httpx2.TransportError:
        return False


def test_nothing_accepted_is_lost_and_nothing_is_ordered_twice(tmp_path: Path) -> None:
    chance = random.Random(0)
    port = free_udp_port()
    config = fleet_file(tmp_path, port)
    accepted: list[str] = []
    with simulated_fleet(port, 2):
        for _ in range(KILLS):
            process, address = start(config)
            dies_at = time.monotonic() + chance.uniform(1.0, LONGEST_LIFE_S)
            while time.monotonic() < dies_at:
                body = report("t1", position=position(lat_deg=47.398642 + chance.gauss(0, 1e-6)))
                if post(address, body):
                    accepted.append(body["time"])
                time.sleep(0.05)
            process.send_signal(signal.SIGKILL)
            process.communicate()
        process, address = start(config)
        try:

            def flies() -> bool:
                post(address, report("t1"))
                return bool(httpx2.get(f"{address}/api/v1/plan", timeout=5).json()["flying"])

            wait_until(flies, limit_s=60)
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=20)
    entries = list(read(tmp_path / "journal"))
    kept = Counter(
        measurement["time_s"]
        for entry in entries
        if entry.kind == "ReportsArrived"
        for measurement in entry.data["measurements"]
    )
    assert len(kept) >= len(accepted) > 20
    flown = Counter(entry.data["plan_id"] for entry in entries if entry.kind == "PlanFlew")
    assert flown
    assert set(flown.values()) == {1}
    answered = Counter(
        json.dumps(entry.data["details"]["order_id"])
        for entry in entries
        if entry.kind == "HostSpoke" and entry.data["event"] == "OrderAccepted"
    )
    assert set(answered.values()) <= {1}
    assert replay(tmp_path / "journal").differences == ()
