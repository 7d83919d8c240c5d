"""A real ArduCopter with a signing key, over our own TCP and UDP: it believes what we sign, and we what it signs."""

import asyncio
import socket
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link.pump import Link
from hsop_gcs.link.signing import Signing, SigningClock
from tests.system.autopilots import ARDUCOPTER, real_vehicles

pytestmark = [
    pytest.mark.autopilot,
    pytest.mark.timeout(180),
    pytest.mark.skipif(not ARDUCOPTER, reason="HSOP_ARDUCOPTER_BIN names no ArduCopter"),
]

KEY = bytes(range(32))


def hand_over(port: int, system_id: int) -> None:
    """Give the vehicle that calls this port its key, as a ground station at a trusted cable does."""
    station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    setup = dialect.MAVLink_setup_signing_message(system_id, 1, list(KEY), 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as cable:
        cable.bind(("127.0.0.1", port))
        cable.settimeout(60.0)
        signed, given_at_s = False, 0.0
        while not signed:
            data, address = cable.recvfrom(1000)
            signed = data[0] == 0xFD and bool(data[2] & 1)
            if time.monotonic() - given_at_s > 1.0:
                given_at_s = time.monotonic()
                cable.sendto(setup.pack(station), address)


def test_arducopter_and_we_believe_each_other_with_the_same_key_and_only_then(tmp_path: Path) -> None:
    async def scenario(port: int, system_id: int) -> None:
        endpoint = f"udpin:127.0.0.1:{port}"
        async with Link(
            [endpoint], [system_id], signing={endpoint: Signing(KEY, clock=SigningClock(time.time))}
        ) as link:
            vehicle = link.vehicles[system_id]
            # It streams only what was asked for, and measures only what was answered: our frames are believed.
            async with asyncio.timeout(90):
                while vehicle.state.home is None or vehicle.round_trip_s is None:
                    await asyncio.sleep(0.1)
            # Its clock was never set: it is stale until it takes the date from our heartbeat, which it does only from
            # a signature that it has verified.
            assert set(link.counters.signature_refused) == {"stale"}
        other = {endpoint: Signing(bytes(32), clock=SigningClock(time.time))}
        async with Link([endpoint], [system_id], signing=other) as link:
            async with asyncio.timeout(30):
                while link.counters.signature_refused.get("forged", 0) < 10:
                    await asyncio.sleep(0.1)
            assert not link.vehicles[system_id].state.link_up

    with real_vehicles(tmp_path, arducopters=1, px4s=0) as (vehicle,):
        hand_over(vehicle.port, vehicle.system_id)
        asyncio.run(scenario(vehicle.port, vehicle.system_id))
