"""A recorded mission comes out the same when it is run again, and a service goes on where its journal ended."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink import mavutil

from hsop_gcs.journal import Journal, read
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.messages import Heartbeat
from hsop_gcs.link.tlog import TlogWriter
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.replay import replay
from hsop_gcs.replay.telemetry import retell
from hsop_gcs.settings import Settings
from tests.service import free_udp_port, position, report, service, settings, simulated_fleet, wait_until

DATA = Path(__file__).parent.parent / "data"


def with_journal(path: Path, udp_port: int) -> Settings:
    """Settings of a service that also writes telemetry logs, next to its journal."""
    wanted = settings(2, udp_port, time_limit_s=0.3)
    recorded = {"journal": str(path), "tlog": str(path.parent)}
    return wanted.model_copy(update={"service": wanted.service.model_copy(update=recorded)})


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of a short mission: a plan approved and flown, a threat that moves, one that is dismissed."""
    path = tmp_path_factory.mktemp("mission") / "journal"
    port = free_udp_port()
    with service(with_journal(path, port)) as client, simulated_fleet(port, 2):
        wait_until(lambda: client.get("/api/v1/health").json()["planning"]["ready"], limit_s=150)
        wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == 2)
        client.post("/api/v1/reports", json=report("t1")).raise_for_status()
        plan = wait_until(lambda: client.get("/api/v1/plan").json()["proposed"])
        client.post("/api/v1/plan/approve", json={"plan_id": plan["id"]}).raise_for_status()
        client.post("/api/v1/reports", json=report("t2", position=position(lon_deg=8.5459))).raise_for_status()
        made = client.get("/api/v1/health").json()["planning"]["plans_made"]
        wait_until(lambda: client.get("/api/v1/health").json()["planning"]["plans_made"] > made)
        client.delete("/api/v1/threats/t2").raise_for_status()
        wait_until(lambda: not client.get("/api/v1/threats").json())
    return path


@pytest.fixture(scope="module")
def forged(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same mission with other orders than were given."""
    path = tmp_path_factory.mktemp("forged") / "journal"
    with Journal(path) as journal:
        for entry in read(recorded):
            data = json.loads(json.dumps(entry.data))
            if entry.kind == "DecisionMade" and data["decision"]["orders"]:
                data["decision"]["orders"][0]["heading_deg"] += 1.0
            journal.append(entry.kind, data, time_s=entry.time_s)
    return path


def test_a_mission_replays_to_the_bit(recorded: Path) -> None:
    outcome = replay(recorded)
    assert outcome.differences == ()
    assert outcome.decisions >= 2
    assert outcome.reports == 2


def test_the_telemetry_log_of_a_mission_is_retold_and_read_by_pymavlink(recorded: Path) -> None:
    (path,) = recorded.parent.glob("*.tlog")
    story = [str(line) for line in retell(path)]
    assert any("DO_REPOSITION to" in line for line in story)
    assert any("DO_REPOSITION: ACCEPTED" in line for line in story)
    frames = mavutil.mavlink_connection(str(path))
    kinds = set()
    while (message := frames.recv_msg()) is not None:
        kinds.add((message.get_type(), message.get_srcSystem()))
    frames.close()
    assert {("HEARTBEAT", 1), ("HEARTBEAT", 255), ("COMMAND_ACK", 1), ("ATTITUDE", 2)} <= kinds


def test_a_journal_that_was_tampered_with_is_told_apart(forged: Path) -> None:
    differences = replay(forged).differences
    assert {each.what for each in differences} == {"decision.orders[0].heading_deg"}


def test_only_decisions_from_one_time_to_another_are_made_again(forged: Path) -> None:
    entries = list(read(forged))
    made_s = [entry.time_s - entries[0].time_s for entry in entries if entry.kind == "DecisionMade"]
    before = command("--to", str(made_s[0] - 0.01), "--json", str(forged))
    assert (before.returncode, json.loads(before.stdout)["decisions"]) == (0, 0)
    first = command("--to", str(made_s[0] + 0.001), "--json", str(forged))
    assert (first.returncode, json.loads(first.stdout)["decisions"]) == (1, 1)
    rest = command("--from", str(made_s[0] + 0.001), str(forged))
    assert f"{len(made_s) - 1} decisions" in rest.stdout


def command(*options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "hsop_gcs", "replay", *options], capture_output=True, text=True)


def test_a_service_goes_on_where_its_journal_ended_and_sends_nothing_twice(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "journal"
    shutil.copy(recorded, path)
    with path.open("ab") as file:
        file.write(b'{"n": 1000, "t": 17')
    with resumed(recorded) as (_, before):
        assert before.progress
    port = free_udp_port()
    with service(with_journal(path, port)) as client, simulated_fleet(port, 2):
        wait_until(lambda: client.get("/api/v1/health").json()["hosts_available"] == 2)
        assert {host["order"]["order_id"] for host in client.get("/api/v1/hosts").json()} == {
            progress.order_id for progress in before.progress.values()
        }
        kinds = {event["kind"] for event in client.get("/api/v1/events").json()}
        assert "OrderAccepted" not in kinds
    assert [entry.number for entry in read(path)] == list(range(1, len(list(read(path))) + 1))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("arducopter-4.7.0-dev.tlog", ["Arm: Need Position Estimate", "DO_REPOSITION: DENIED", "in the air"]),
        ("px4-1.16.0-sih.tlog", ["DO_REPOSITION: UNSUPPORTED", "Takeoff detected", "Returning to launch"]),
    ],
)
def test_the_command_retells_a_telemetry_log(name: str, words: list[str]) -> None:
    told = command("--tlog", str(DATA / name))
    assert told.returncode == 0, told.stderr
    for word in words:
        assert word in told.stdout


@pytest.mark.parametrize(
    ("component", "vehicle_type", "told"),
    [(1, MavType.QUADROTOR, "Guided"), (1, MavType.FIXED_WING, "Acro"), (50, MavType.GROUND_ROVER, "Hold")],
)
def test_a_log_tells_the_modes_of_planes_and_rovers_and_of_any_component(
    tmp_path: Path, component: int, vehicle_type: int, told: str
) -> None:
    path = tmp_path / "flight.tlog"
    encoder = Encoder(system=1, component=component)
    with path.open("wb") as file, TlogWriter(file) as writer:
        for second, mode in enumerate((11, 4)):
            beat = Heartbeat(type=vehicle_type, autopilot=MavAutopilot.ARDUPILOTMEGA, custom_mode=mode)
            writer.write(1_790_000_000.0 + second, encoder.encode(beat))
    assert [line.what for line in retell(path) if line.kind == "mode"][-1:] == [told]
