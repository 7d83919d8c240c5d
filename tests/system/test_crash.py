"""The service killed in the middle of a mission: what it accepted is kept, what it ordered is not ordered again."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.journal import read
from hsop_gcs.link.enums import MavCmd, MavLandedState
from hsop_gcs.link.messages import CommandInt, ExtendedSysState
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.mission.core import MissionState, apply
from hsop_gcs.mission.inputs import HostDeparted, HostGaveWay, LegFlown, PlanFlew
from hsop_gcs.mission.records import read_inputs
from hsop_gcs.replay import replay
from tests.service import ORIGIN, free_udp_port, position, report, simulated_fleet, wait_until

KILLS = int(os.environ.get("HSOP_GCS_KILLS", "4"))
"""A handful in the suite; fifty once in a while: HSOP_GCS_KILLS=50 pytest tests/system/test_crash.py"""
LONGEST_LIFE_S = 14.0
"""Loading the planner takes about half of it: a service is killed with and without a plan, and while hosts fly."""


def fleet_file(folder: Path, udp_port: int) -> Path:
    origin = ", ".join(f"{name} = {value}" for name, value in ORIGIN.items())
    hosts = "\n".join(
        f'[[hosts]]\nid = "h{n}"\nsystem_id = {n}\nconnection = "udpin:127.0.0.1:{udp_port}"' for n in (1, 2)
    )
    path = folder / "FLEET.toml"
    path.write_text(
        f"[site]\norigin = {{ {origin} }}\n[service]\nautonomy = 'auto'\njournal = '{folder / 'journal'}'\n"
        f"tlog = '{folder}'\n"
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


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A point that a host was to be sent to: the journal says when the service decided so."""

    time_s: float
    leg_id: str
    point: tuple[int, int]
    """Latitude and longitude, 1e-7 degrees."""


def legs_of(journal: Path) -> dict[int, list[Leg]]:
    """Return every leg by system id, in order of time."""
    frame, state = LocalFrame(GeodeticPoint(**ORIGIN)), MissionState()
    legs: dict[int, list[Leg]] = {}
    for _, given in read_inputs(journal):
        before, state = state, apply(state, given)
        if isinstance(given, HostGaveWay):
            place = frame.to_geodetic(np.array(state.ways_given[given.host].goal_m))
            point = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7))
            leg = Leg(time_s=given.time_s, leg_id=f"gave way at {given.time_s}", point=point)
            legs.setdefault(int(given.host.removeprefix("h")), []).append(leg)
        if isinstance(given, PlanFlew | HostDeparted | LegFlown):
            for host, progress in state.progress.items():
                if progress != before.progress.get(host):
                    place = frame.to_geodetic(np.array(progress.goal_m))
                    point = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7))
                    leg = Leg(time_s=given.time_s, leg_id=progress.leg_id, point=point)
                    legs.setdefault(int(host.removeprefix("h")), []).append(leg)
    return legs


def check_orders(folder: Path, legs: dict[int, list[Leg]]) -> int:
    """Check every order on the wire against the journal; return how many legs were sent."""
    sent_in: dict[tuple[int, str], Path] = {}
    for log in sorted(folder.glob("*.tlog")):
        with log.open("rb") as file:
            for time_s, frame in read_tlog(file):
                message = frame.message
                if isinstance(message, ExtendedSysState):
                    assert message.landed_state == MavLandedState.IN_AIR, "a host came down"
                if not isinstance(message, CommandInt) or message.command != MavCmd.DO_REPOSITION:
                    continue
                decided = [leg for leg in legs[message.target_system] if leg.time_s <= time_s]
                assert decided, "an order is on the wire before it is in the journal"
                assert decided[-1].point == (message.x, message.y), "a stale order"
                first = sent_in.setdefault((message.target_system, decided[-1].leg_id), log)
                assert first == log, "an order that was sent before the service was killed is sent again after it"
    return len(sent_in)


@pytest.mark.timeout(150 + 40 * KILLS)
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

            def on_station() -> bool:
                post(address, report("t1"))
                orders = [host["order"] for host in httpx2.get(f"{address}/api/v1/hosts", timeout=5).json()]
                return all(order is not None and order["status"] == "on station" for order in orders)

            wait_until(on_station, limit_s=100)
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=20)
    entries = list(read(tmp_path / "journal"))
    kept = {
        measurement["time_s"]
        for entry in entries
        if entry.kind == "ReportsArrived"
        for measurement in entry.data["measurements"]
    }
    assert len(accepted) > 20
    assert {datetime.fromisoformat(time).timestamp() for time in accepted} <= kept
    flown = Counter(entry.data["plan_id"] for entry in entries if entry.kind == "PlanFlew")
    assert set(flown.values()) == {1}
    assert check_orders(tmp_path, legs_of(tmp_path / "journal")) >= 2
    assert replay(tmp_path / "journal").differences == ()
