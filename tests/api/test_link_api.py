"""What the API shows of hosts' links, and how a host that changed its address is let in again."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2

from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.key_files import TimestampFile, read_key
from hsop_gcs.link.messages import Heartbeat
from hsop_gcs.link.signing import TICKS_PER_S, Signing, SigningClock
from hsop_gcs.settings import SigningSection
from tests.service import free_udp_port, service, settings, wait_until


@contextmanager
def vehicle(port: int, sign: Callable[[bytes], bytes] | None = None) -> Iterator[tuple[Any, str]]:
    """A function that sends one heartbeat of system 1 to a port of ours, and the address it comes from."""
    encoder = Encoder(system=1, component=1, sign=sign)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.connect(("127.0.0.1", port))
        beat = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)
        yield lambda: radio.send(encoder.encode(beat)), f"127.0.0.1:{radio.getsockname()[1]}"


def first_link(client: httpx2.Client) -> dict[str, Any]:
    link: dict[str, Any] = client.get("/api/v1/hosts").json()[0]["link"]
    return link


def test_a_host_at_another_address_is_shown_and_listened_to_only_once_it_is_registered() -> None:
    port = free_udp_port()
    with (
        service(settings(1, port)) as client,
        vehicle(port) as (first_beat, first_address),
        vehicle(port) as (second_beat, second_address),
    ):
        first_beat()
        wait_until(lambda: first_link(client)["address"] == first_address)
        second_beat()
        wait_until(lambda: first_link(client)["claimants"] == [second_address])
        assert f"host h1: refused at {second_address}, where it is not registered" in str(
            client.get("/api/v1/health").json()["problems"]
        )
        assert client.get("/api/v1/health").json()["link"]["refused"] == 1

        register = "/api/v1/hosts/register"
        wrong = client.post(register, json={"host": "h1", "address": "10.0.0.9:1"})
        assert wrong.status_code == 422
        assert second_address in wrong.json()["detail"]
        assert client.post(register, json={"host": "h9", "address": second_address}).status_code == 404
        assert client.post(register, json={"host": "h1", "address": second_address}).status_code == 204
        assert (first_link(client)["address"], first_link(client)["claimants"]) == (second_address, [])

        second_beat()
        wait_until(lambda: first_link(client)["received"] == 2)
        kinds = [event["kind"] for event in client.get("/api/v1/events").json()]
        assert kinds.count("AddressRefused") == kinds.count("AddressRegistered") == 1


def test_a_host_with_a_key_is_heard_only_if_it_signs_and_our_dates_are_kept(tmp_path: Path) -> None:
    port, key = free_udp_port(), tmp_path / "fleet.key"
    key.touch(mode=0o600)
    key.write_text("ab" * 32)
    signed = settings(1, port).model_copy(update={"signing": SigningSection(key_file=str(key))})
    signing = Signing(read_key(key), clock=SigningClock(time.time))
    with service(signed) as client, vehicle(port) as (unsigned_beat, _), vehicle(port, signing.sign) as (beat, address):
        unsigned_beat()
        wait_until(lambda: first_link(client)["signature_refused"] == {"unsigned": 1})
        health = client.get("/api/v1/health").json()
        assert "host h1: frames refused by signature: 1 unsigned" in health["problems"]
        assert health["link"]["signature_refused"] == {"unsigned": 1}
        beat()
        wait_until(lambda: first_link(client)["address"] == address)
    kept = TimestampFile(tmp_path / "fleet.key.timestamp").load()
    assert kept > SigningClock(time.time).wall() - 100 * TICKS_PER_S
