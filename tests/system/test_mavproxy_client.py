"""MAVProxy, the ArduPilot developers' ground station, meets simulated vehicles and flies one."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import pytest

from hsop_gcs.link.codec import Decoder, Frame
from hsop_gcs.link.enums import MavSysStatusSensor
from hsop_gcs.link.messages import GlobalPositionInt, Heartbeat, SysStatus
from tests.system.simulator_process import simulator

pytestmark = pytest.mark.timeout(60)

PATIENCE_S = 25.0
ARMED = 128
GUIDED = 4
TAKE_OFF_M = 6.0
MAVPROXY = Path(sys.executable).with_name("mavproxy.py")


def may_arm(status: SysStatus) -> bool:
    return bool(status.onboard_control_sensors_health & MavSysStatusSensor.PREARM_CHECK)


class Forwarded:
    """What MAVProxy passes on from the vehicle, and its console."""

    def __init__(self, process: subprocess.Popen[bytes], listener: socket.socket, console: Path) -> None:
        self._process = process
        self._listener = listener
        self._console = console
        self._decoder = Decoder()

    def type(self, line: str) -> None:
        """Type a line at its prompt."""
        assert self._process.stdin is not None
        self._process.stdin.write(line.encode() + b"\n")
        self._process.stdin.flush()

    def wait_for(self, wanted: Callable[[Frame], bool]) -> Frame:
        """Return the first forwarded frame that is wanted."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            assert self._process.poll() is None, self.console()
            try:
                datagram = self._listener.recv(65536)
            except TimeoutError:
                continue
            for frame in self._decoder.feed_datagram(datagram):
                if wanted(frame):
                    return frame
        raise AssertionError(f"MAVProxy did not pass on what was waited for; it said:\n{self.console()}")

    def wait_for_console(self, text: str) -> None:
        """Wait until MAVProxy has printed a text."""
        self.wait_for(lambda _: text in self.console())

    def go_online(self) -> None:
        """Wait for the vehicle; MAVProxy asks for streams every 15 s, or at once when their rate is changed."""
        self.wait_for_console("online system 1")
        self.type("set streamrate 5")

    def console(self) -> str:
        return self._console.read_text(errors="replace")


@contextmanager
def mavproxy(port: int, home: Path) -> Iterator[Forwarded]:
    """Run MAVProxy against a vehicle's port, with everything that it writes under ``home``."""
    console = home / "console.txt"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener, console.open("wb") as output:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(0.5)
        command = [sys.executable, str(MAVPROXY), f"--master=udpout:127.0.0.1:{port}"]
        command += [f"--out=udpout:127.0.0.1:{listener.getsockname()[1]}", f"--state-basedir={home}"]
        command += [
            f"--logfile={home / 'flight.tlog'}",
            "--default-modules=link,log,param,mode,arm,cmdlong,output,signing",
        ]
        environment = {**os.environ, "HOME": str(home), "MPLCONFIGDIR": str(home), "PYTHONWARNINGS": "ignore"}
        with subprocess.Popen(
            command, cwd=home, env=environment, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT
        ) as process:
            try:
                yield Forwarded(process, listener, console)
            finally:
                process.terminate()
                try:
                    process.wait(timeout=5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


@pytest.mark.parametrize(("autopilot", "mode"), [("px4", "LOITER"), ("ardupilot", "STABILIZE")])
def test_mavproxy_sees_the_heartbeat_the_position_and_the_parameters(autopilot: str, mode: str, tmp_path: Path) -> None:
    with simulator("--autopilot", autopilot) as running, mavproxy(running.ports[1], tmp_path) as ground:
        beat = ground.wait_for(lambda frame: isinstance(frame.message, Heartbeat) and frame.component == 1)
        assert beat.system == 1
        ground.go_online()
        position = ground.wait_for(lambda frame: isinstance(frame.message, GlobalPositionInt)).message
        assert isinstance(position, GlobalPositionInt)
        assert (position.lat, position.lon) == pytest.approx((-353632610, 1491652300), abs=20)
        assert position.alt == pytest.approx(584_000, abs=200)
        ground.wait_for_console(f"Mode {mode}")
        ground.wait_for_console(" parameters to ")


def test_mavproxy_arms_takes_off_and_returns_an_ardupilot_vehicle(tmp_path: Path) -> None:
    with (
        simulator("--autopilot", "ardupilot", "--speed", "4") as running,
        mavproxy(running.ports[1], tmp_path) as ground,
    ):
        ground.go_online()
        ground.wait_for(lambda frame: isinstance(frame.message, SysStatus) and may_arm(frame.message))
        ground.type("mode GUIDED")
        ground.wait_for(lambda frame: isinstance(frame.message, Heartbeat) and frame.message.custom_mode == GUIDED)
        ground.type("arm throttle")
        ground.wait_for(lambda frame: isinstance(frame.message, Heartbeat) and bool(frame.message.base_mode & ARMED))
        ground.type(f"takeoff {TAKE_OFF_M}")
        ground.wait_for(
            lambda frame: isinstance(frame.message, GlobalPositionInt) and frame.message.relative_alt > 5700
        )
        ground.type("mode RTL")
        ground.wait_for_console("Disarming motors")


def test_mavproxy_and_a_vehicle_that_signs_understand_each_other_once_they_share_the_key(tmp_path: Path) -> None:
    key_file = tmp_path / "fleet.key"
    key_file.touch(mode=0o600)
    key_file.write_bytes(sha256(b"sesame").digest())
    with (
        simulator("--autopilot", "ardupilot", "--signing-key", str(key_file)) as running,
        mavproxy(running.ports[1], tmp_path) as ground,
    ):
        ground.type("signing key sesame")
        ground.go_online()
        # ArduPilot streams nothing but its heartbeat unasked: the request was believed, and so is the answer.
        ground.wait_for(lambda frame: isinstance(frame.message, GlobalPositionInt))
