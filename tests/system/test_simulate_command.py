"""The command as a shell sees it."""

import math
import signal
import subprocess
import sys

import pytest
from typer import Typer
from typer.testing import CliRunner

from hsop_gcs.cli import simulate as command
from hsop_gcs.errors import Unavailable
from hsop_gcs.simulator.channel import Impairment
from hsop_gcs.simulator.disturbances import GpsError, Wind
from hsop_gcs.simulator.faults import Fault, FaultKind
from hsop_gcs.simulator.fleet import FleetConfig
from tests.system.simulator_process import START_TIMEOUT_S, simulator

COMMAND = [sys.executable, "-m", "hsop_gcs", "simulate"]


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--vehicles", "0"], "--vehicles: 0"),
        (["--vehicles", "-3"], "--vehicles: -3"),
        (["--autopilot", "betaflight"], "--autopilot: 'betaflight'"),
        (["--origin", "95,0,0"], "--origin: latitude 95.0"),
        (["--origin", "1,2"], "--origin: '1,2'"),
        (["--origin", "1,nan,0"], "--origin: '1,nan,0'"),
        (["--target", "14540"], "--target: '14540'"),
        (["--target", "127.0.0.1:65535", "--vehicles", "2"], "--target: '127.0.0.1:65535'"),
        (["--position", "1,2", "--vehicles", "2"], "--position: 1 given for 2"),
        (["--speed-mps", "0"], "--speed-mps: 0.0"),
        (["--loss", "1.5"], "--loss: 1.5"),
        (["--delay-ms", "100", "--jitter-ms", "200"], "--jitter-ms: 200.0"),
        (["--wind", "5,270"], "--wind: '5,270' is not SPEED,FROM_DEG,GUST"),
        (["--wind", "5,400,0"], "--wind: 400.0"),
        (["--battery", "0"], "--battery: 0.0"),
        (["--fault", "smoke"], "--fault: 'smoke' is none of"),
        (["--truth", "none.json", "--detections-to", "http://127.0.0.1:9"], "--truth: cannot read 'none.json'"),
        (["--truth", "none.json"], "--detections-to: needed with --truth"),
        (["--truth", "none.json", "--detections-to", "127.0.0.1:9"], "--detections-to: '127.0.0.1:9'"),
        (["--vehicles", "2", "--host-id", "h1"], "--host-id: 1 different ones given for 2"),
        (["--detection-rate", "0"], "--detection-rate: 0.0"),
    ],
)
def test_a_bad_option_is_one_line_that_names_it_and_its_value(options: list[str], complaint: str) -> None:
    done = subprocess.run([*COMMAND, *options], capture_output=True, text=True, timeout=START_TIMEOUT_S, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert complaint in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(number: signal.Signals) -> None:
    with subprocess.Popen([*COMMAND, "--local-port", "0"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("system 1: 127.0.0.1:")
        process.send_signal(number)
        assert process.wait(timeout=START_TIMEOUT_S) == 0


def test_it_ends_when_its_parent_closes_standard_input() -> None:
    with simulator("--autopilot", "ardupilot", vehicles=2) as running:
        assert sorted(running.ports) == [1, 2]


def test_true_threats_may_come_on_standard_input_and_nonsense_there_is_named() -> None:
    options = ["--local-port", "0", "--truth", "-", "--detections-to", "http://127.0.0.1:9"]
    with subprocess.Popen(
        [*COMMAND, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("system 1: ")
        _, complaint = process.communicate('{"threats": []}\n', timeout=START_TIMEOUT_S)
        assert (process.returncode, complaint.count("\n")) == (2, 1)
        assert complaint.startswith("hsop-gcs: threats: ")


def test_every_option_of_the_air_and_the_line_reaches_the_fleet(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[FleetConfig] = []

    def no_fleet(config: FleetConfig, **_: object) -> None:
        built.append(config)
        raise Unavailable("built")

    monkeypatch.setattr("hsop_gcs.simulator.fleet.SimulatedFleet", no_fleet)
    app = Typer()
    command.register(app)
    options = (
        "--wind 6,270,2 --gps-offset 3,-4,1 --gps-noise-m 0.7 --battery 55 --endurance-min 12 --gimbal-rate-dps 30"
        " --loss 0.3 --duplication 0.05 --reordering 0.1 --delay-ms 300 --jitter-ms 200 --seed 9 --speed-mps 7"
        " --fault h1:gps-lost@60"
    )
    assert isinstance(CliRunner().invoke(app, options.split()).exception, Unavailable)
    (config,) = built
    assert config.wind == Wind(speed_mps=6.0, from_deg=270.0, gust_mps=2.0)
    assert config.gps == GpsError(offset_m=(3.0, -4.0, 1.0), noise_m=0.7)
    assert (config.battery.percent, config.battery.endurance_s) == (55.0, 720.0)
    assert config.gimbal.slew_rad_s == pytest.approx(math.radians(30.0))
    assert config.impairment == Impairment(loss=0.3, duplication=0.05, reordering=0.1, delay_s=0.3, jitter_s=0.2)
    assert (config.seed, config.flight.cruise_mps) == (9, 7.0)
    assert config.faults == [Fault(kind=FaultKind.GPS_LOST, vehicle=1, start_s=60.0)]
