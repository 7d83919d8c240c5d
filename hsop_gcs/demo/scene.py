"""What is made up for the demonstration: the threats, where they truly are, and the service's settings."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from hsop_gcs.loopback import ORIGIN
from hsop_gcs.reports import Vector3
from hsop_gcs.settings import Settings
from hsop_gcs.simulator.truth import Truth

HOSTS = 4
HORIZON_S = 14.0
"""A little longer than the letter's 10 s: these threats are slow, and a plan should outlast the flight to it."""
TRUTH: dict[str, Any] = {
    "threats": [
        {"id": "t1", "position_m": [-10.0, 110.0, 40.0], "velocity_mps": [0.6, -1.0, 0.0]},
        {"id": "t2", "position_m": [60.0, 125.0, 40.0], "velocity_mps": [-0.8, -0.7, 0.0]},
    ]
}
"""A truth file without its epoch."""


def true_positions(truth: Truth, time_s: float) -> dict[str, Vector3]:
    """Return where threats are, by id, ENU metres. time_s: since the Unix epoch, like the truth's own epoch."""
    return {state.id: state.position_m for state in truth.at(time_s - (truth.epoch_s or 0.0))}


def service_settings(udp_port: int, journal: Path) -> Settings:
    """Return the settings of a service whose hosts all call one port of this machine."""
    hosts = [
        {"id": f"h{number}", "system_id": number, "connection": f"udpin:127.0.0.1:{udp_port}"}
        for number in range(1, HOSTS + 1)
    ]
    return Settings.model_validate(
        {
            "site": {"origin": asdict(ORIGIN)},
            "service": {"port": 0, "journal": str(journal)},
            "planning": {"hosts": "all", "horizon_s": HORIZON_S},
            "tracks": {"acceleration_psd_m2ps3": 0.02},
            "hosts": hosts,
        }
    )
