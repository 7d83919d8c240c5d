"""Which address is a vehicle's: pinned ones, vehicles that were started again, and who merely spoke first."""

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.endpoint import Peer, parse_pin
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import AddressRefused, AddressRegistered
from hsop_gcs.link.messages import Heartbeat
from hsop_gcs.link.router import Router
from hsop_gcs.link.signing import Signing, SigningClock

BEAT = Encoder(system=1, component=1).encode(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4))
HERE, OTHER_PORT, ELSEWHERE = Peer(0, "10.0.0.5", 14550), Peer(0, "10.0.0.5", 18570), Peer(0, "10.0.0.6", 14550)


def heard(router: Router, *peers: Peer, at_s: float) -> Peer | None:
    router.advance(at_s)
    for peer in peers:
        router.receive(BEAT, peer, at_s)
    return router.peer_of(1)


@pytest.mark.parametrize(
    ("pin", "admitted"),
    [
        ("10.0.0.5", {HERE, OTHER_PORT}),
        ("10.0.0.5:14550", {HERE}),
        ("10.0.0.6", {ELSEWHERE}),
        ("::ffff:10.0.0.5", {HERE, OTHER_PORT}),
    ],
)
def test_who_speaks_first_from_anywhere_but_the_pinned_address_is_refused(pin: str, admitted: set[Peer]) -> None:
    for peer in (HERE, OTHER_PORT, ELSEWHERE):
        router = Router([1], pins={1: parse_pin(pin)})
        assert heard(router, peer, at_s=0.0) == (peer if peer in admitted else None)
        refused = [] if peer in admitted else [AddressRefused(system=1, address=peer.address, registered=None)]
        assert [event for event in router.take_events() if isinstance(event, AddressRefused)] == refused


def test_an_ipv4_address_that_comes_over_an_ipv6_socket_is_the_pinned_one() -> None:
    assert parse_pin("10.0.0.5").admits(Peer(0, "::ffff:10.0.0.5", 1))
    assert parse_pin("[fd00::5]:14550").admits(Peer(0, "fd00:0::5", 14550))
    assert not parse_pin("fd00::5").admits(Peer(0, "fd00::6", 14550))


@pytest.mark.parametrize(
    "text", ["", "drone", "10.0.0", "10.0.0.5:", "10.0.0.5:0", "10.0.0.5:70000", "[fd00::5]", ":1"]
)
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(BadInput):
        parse_pin(text)


def test_a_vehicle_that_is_started_again_is_taken_from_another_port_after_silence_and_not_before() -> None:
    router = Router([1])
    assert heard(router, HERE, OTHER_PORT, at_s=0.0) == HERE
    assert heard(router, OTHER_PORT, at_s=3.0) == HERE
    assert heard(router, ELSEWHERE, at_s=4.0) == HERE
    assert heard(router, OTHER_PORT, at_s=4.1) == OTHER_PORT
    assert router.vehicle_link(1, 4.1).claimants == ()
    again = [event for event in router.take_events() if isinstance(event, AddressRegistered)]
    assert again == [AddressRegistered(system=1, address="10.0.0.5:18570", before="10.0.0.5:14550", by="same host")]
    assert heard(router, HERE, at_s=5.0) == OTHER_PORT


def test_a_pinned_port_stays_the_only_one_after_silence_and_for_an_operator_too() -> None:
    router = Router([1], pins={1: parse_pin("10.0.0.5:14550")})
    heard(router, HERE, at_s=0.0)
    assert heard(router, OTHER_PORT, at_s=10.0) == HERE
    with pytest.raises(BadInput, match=r"pinned to 10\.0\.0\.5:14550"):
        router.register(1, "10.0.0.5:18570")


def test_over_a_signed_link_an_unsigned_heartbeat_from_the_same_host_changes_nothing() -> None:
    signing = Signing(bytes(32), clock=SigningClock(lambda: 1.8e9), allow_unsigned=(Heartbeat.ID,))
    router = Router([1], signing={0: signing})
    heard(router, HERE, at_s=0.0)
    assert heard(router, OTHER_PORT, at_s=10.0) == HERE


def test_why_a_vehicle_is_believed_is_told() -> None:
    signing = Signing(bytes(32), clock=SigningClock(lambda: 1.8e9))
    router = Router(
        [1, 2, 3, 4], pins={2: parse_pin("10.0.0.5")}, transport_of={3: 1, 4: 2}, signing={1: signing}, calling={2}
    )
    trust = [router.vehicle_link(system, 0.0).trust for system in (1, 2, 3, 4)]
    assert trust == ["spoke first", "pinned", "signed", "we call it"]
