"""Real autopilots as the tests start them: one process a vehicle, each in a folder of its own, all on loopback.

The binaries are the user's own: HSOP_ARDUCOPTER_BIN, HSOP_PX4_BIN (with its ``etc`` folder beside its ``bin``).
Parameters come from ``sitl_configs``. PX4's ports follow from its instance, ArduCopter's are free ones.
"""

import os
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from tests.service import free_udp_port

ARDUCOPTER, PX4 = (os.environ.get(f"HSOP_{name}_BIN", "") for name in ("ARDUCOPTER", "PX4"))
CONFIGS = Path(__file__).parents[2] / "sitl_configs"
ORIGIN = GeodeticPoint(lat_deg=-35.363261, lon_deg=149.16523, altitude_amsl_m=584.0)
FRAME = LocalFrame(ORIGIN)
_SPACING_M = 15.0
_FIRST_PX4_PORT = 14540


@dataclass(frozen=True, slots=True, kw_only=True)
class RealVehicle:
    """A running autopilot and where it sends to."""

    id: str
    system_id: int
    port: int
    process: subprocess.Popen[bytes]
    output: Path

    def kill(self) -> None:
        """End it without a word, as a crash does."""
        self.process.kill()
        self.process.wait()


@contextmanager
def real_vehicles(folder: Path, *, arducopters: int, px4s: int) -> Iterator[list[RealVehicle]]:
    """Run that many autopilots in a row east of the origin; they end with the block."""
    started: list[RealVehicle] = []
    with ExitStack() as stack:
        for number in range(arducopters + px4s):
            if number < arducopters:
                vehicle = _arducopter(folder / f"arducopter-{number}", number, _home(number))
            else:
                vehicle = _px4(folder / f"px4-{number}", number - arducopters, _home(number))
            stack.callback(vehicle.kill)
            started.append(vehicle)
        yield started


def _home(number: int) -> GeodeticPoint:
    return FRAME.to_geodetic(np.array([_SPACING_M * number, 0.0, 0.0]))


def _arducopter(folder: Path, number: int, home: GeodeticPoint) -> RealVehicle:
    port, system_id = free_udp_port(), 11 + number
    files = [str(CONFIGS / "ardupilot" / f"{name}.parm") for name in ("sitl", "link", "failsafe", "gimbal")]
    command = [ARDUCOPTER, "--model", "+", "--speedup", "1", "--defaults", ",".join(files)]
    command += ["--home", f"{home.lat_deg:.7f},{home.lon_deg:.7f},{home.altitude_amsl_m},0"]
    command += ["--instance", str(number), "--sysid", str(system_id)]
    command += ["--serial0", "none", "--serial1", f"udpclient:127.0.0.1:{port}"]
    return _start(command, folder, f"a{number + 1}", system_id, port)


def _px4(folder: Path, number: int, home: GeodeticPoint) -> RealVehicle:
    binary = Path(PX4).resolve()
    etc = Path(os.environ.get("HSOP_PX4_ETC", binary.parent.parent / "etc"))
    environment = {
        "PX4_SIM_MODEL": "sihsim_quadx",
        "PX4_HOME_LAT": f"{home.lat_deg:.7f}",
        "PX4_HOME_LON": f"{home.lon_deg:.7f}",
        "PX4_HOME_ALT": f"{home.altitude_amsl_m}",
    }
    for name in ("sitl", "failsafe", "gimbal-sih"):
        rows = [line.split("\t") for line in (CONFIGS / "px4" / f"{name}.params").read_text().splitlines()]
        environment |= {f"PX4_PARAM_{row[2]}": row[3] for row in rows if len(row) == 5 and not row[0].startswith("#")}
    command = [str(binary), "-d", "-i", str(number), "-w", str(folder), str(etc)]
    return _start(command, folder, f"p{number + 1}", number + 1, _FIRST_PX4_PORT + number, environment)


def _start(
    command: list[str], folder: Path, name: str, system_id: int, port: int, environment: dict[str, str] | None = None
) -> RealVehicle:
    folder.mkdir(parents=True)
    output = folder / "output.txt"
    with output.open("wb") as file:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | (environment or {}),
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
        )
    return RealVehicle(id=name, system_id=system_id, port=port, process=process, output=output)
