"""The link that FLEET.toml describes: how each of its connections signs, and what it lets in unsigned."""

import asyncio
import socket
import time
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.app import link_of
from hsop_gcs.link.codec import Encoder, is_signed
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.key_files import read_key
from hsop_gcs.link.messages import Attitude, Heartbeat
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.settings import Settings
from tests.link.test_link_udp import until
from tests.service import free_udp_port, settings

_SIGNATURE_BYTES = 13


def key_file(path: Path, digits: str) -> str:
    path.touch(mode=0o600)
    path.write_text(digits * 32)
    return str(path)


def test_connections_sign_with_their_keys_and_link_ids_that_count_up_and_radios_need_not_sign(tmp_path: Path) -> None:
    keys = [key_file(tmp_path / "fleet.key", "ab"), key_file(tmp_path / "h2.key", "cd")]
    ports = sorted(free_udp_port() for _ in keys)
    document = settings(2).model_dump(mode="json", exclude_unset=True)
    document["signing"] = {"key_file": keys[0], "link_id": 255, "allow_unsigned": ["RADIO_STATUS"]}
    for host, port in zip(document["hosts"], ports, strict=True):
        host["connection"] = f"udpin:127.0.0.1:{port}"
    document["hosts"][1]["key_file"] = keys[1]
    wanted = Settings.model_validate(document)

    async def scenario() -> None:
        async with link_of(wanted) as link:
            radios = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in keys]
            for system, (radio, port, key) in enumerate(zip(radios, ports, keys, strict=True), start=1):
                radio.connect(("127.0.0.1", port))
                radio.settimeout(10)
                ends = Signing(read_key(Path(key)), clock=SigningClock(time.time))
                radio.send(
                    Encoder(system=system, component=1, sign=ends.sign).encode(
                        Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)
                    )
                )
                raw = await asyncio.to_thread(radio.recv, 1000)
                assert is_signed(raw)
                assert ends.judge(raw).accepted
                assert raw[-_SIGNATURE_BYTES] == (255 + system - 1) % 256
            sik = dialect.MAVLink(None, srcSystem=51, srcComponent=68)
            radios[0].send(dialect.MAVLink_radio_status_message(9, 9, 100, 9, 9, 0, 0).pack(sik))
            await until(lambda: [each.system for each in link.strangers] == [51])
            assert link.counters.signature_refused == {}
            radios[0].send(Encoder(system=1, component=1).encode(Attitude()))
            await until(lambda: link.counters.signature_refused == {"unsigned": 1})
            for radio in radios:
                radio.close()

    asyncio.run(scenario())
