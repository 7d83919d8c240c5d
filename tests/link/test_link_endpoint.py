"""Connection strings."""

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.link.endpoint import Endpoint, parse_endpoint


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udpin:0.0.0.0:14550", Endpoint("udpin", "0.0.0.0", 14550)),
        ("udpin:[::1]:0", Endpoint("udpin", "::1", 0)),
        ("udpout:vehicle.local:14540", Endpoint("udpout", "vehicle.local", 14540)),
        ("tcp:127.0.0.1:5760", Endpoint("tcp", "127.0.0.1", 5760)),
        ("serial:/dev/ttyUSB0:57600", Endpoint("serial", "/dev/ttyUSB0", 57600)),
        ("serial:/dev/serial/by-id/usb-3D:R:921600", Endpoint("serial", "/dev/serial/by-id/usb-3D:R", 921600)),
    ],
)
def test_an_endpoint_is_read_from_its_text_and_written_back(text: str, endpoint: Endpoint) -> None:
    assert parse_endpoint(text) == endpoint
    assert str(endpoint) == text


def test_the_form_that_mavsdk_has_is_the_same_endpoint() -> None:
    assert parse_endpoint("udpin://127.0.0.1:14550") == parse_endpoint("udpin:127.0.0.1:14550")
    assert str(parse_endpoint("tcp://127.0.0.1:5760")) == "tcp:127.0.0.1:5760"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "none of udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"),
        ("udp:1.2.3.4:1", "'udp:1.2.3.4:1' is none of"),
        ("udpin:14550", "none of"),
        ("udpin::14550", "none of"),
        ("udpin:a host:1", "none of"),
        ("udpin:a\x00host:1", "none of"),
        ("udpout:north..mast:1", "'north..mast' in 'udpout:north..mast:1' is not the name of a host"),
        ("udpin:h:65536", "'65536' in 'udpin:h:65536' is not a port"),
        ("udpin:h:x", "'x' in 'udpin:h:x' is not a port"),
        ("udpin:h:٣", "not a port"),
        ("udpout:h:0", "not a port"),
        ("tcp:127.0.0.1", "none of"),
        ("tcp:h:0", "not a port"),
        ("tcp:::1:5760", "IPv6 address needs brackets"),
        ("serial:/dev/ttyUSB0", "none of"),
        ("serial:/dev/ttyUSB0:fast", "'fast' in 'serial:/dev/ttyUSB0:fast' is not a baud rate"),
        ("serial:/dev/ttyUSB0:300", "baud rate 300"),
    ],
)
def test_an_endpoint_that_is_none_is_refused_with_what_is_wrong(text: str, problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_endpoint(text)
    assert caught.value.field == "connection"
    assert problem in caught.value.problem


@pytest.mark.parametrize(
    ("one", "other", "excludes"),
    [
        ("udpin:0.0.0.0:14550", "udpin:127.0.0.1:14550", True),
        ("udpin:[::]:14550", "udpin:10.0.0.1:14550", True),
        ("udpin:localhost:14550", "udpin:127.0.0.1:14550", True),
        ("serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:115200", True),
        ("udpin://127.0.0.1:14550", "udpin:127.0.0.1:14550", False),
        ("udpin:10.0.0.1:14550", "udpin:10.0.0.2:14550", False),
        ("udpin:0.0.0.0:14550", "udpin:127.0.0.1:14551", False),
        ("udpin:0.0.0.0:0", "udpin:127.0.0.1:0", False),
        ("udpin:0.0.0.0:14550", "udpout:127.0.0.1:14550", False),
        ("tcp:127.0.0.1:5760", "tcp:localhost:5760", False),
        ("serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB1:115200", False),
    ],
)
def test_two_names_of_one_port_or_device_cannot_both_be_open(one: str, other: str, excludes: bool) -> None:
    first, second = parse_endpoint(one), parse_endpoint(other)
    assert first.excludes(second) is second.excludes(first) is excludes
