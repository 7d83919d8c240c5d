"""What it takes to try the service on one machine: a site, free ports, and reports as a radar would post them."""

import socket
from datetime import UTC, datetime
from typing import Any

from hsop_gcs.geometry.frames import GeodeticPoint

ORIGIN = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)


def free_udp_ports(count: int) -> list[int]:
    """Return ports of this machine that nothing is bound to yet."""
    probes = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()


def report(source: str, threat_id: str, time_s: float, place: GeodeticPoint, *, sigma_m: float) -> dict[str, Any]:
    """Return a report as the service's API takes it. time_s: since the Unix epoch; sigma_m: of each axis."""
    return {
        "source": source,
        "threat_id": threat_id,
        "time": datetime.fromtimestamp(time_s, UTC).isoformat(),
        "position": {
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "altitude_m": place.altitude_amsl_m,
            "altitude_datum": "amsl",
        },
        "sigma_m": sigma_m,
    }
