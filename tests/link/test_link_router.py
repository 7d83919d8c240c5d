"""Who sent this frame, and whose is it."""

import numpy as np
import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.link.codec import Decoder, Encoder
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import AddressRefused, AddressRegistered, LinkLost, LinkUp
from hsop_gcs.link.messages import Attitude, CommandLong, Heartbeat, Message
from hsop_gcs.link.router import Router
from hsop_gcs.simulator.channel import Channel, Impairment

HERE = Peer(0, "127.0.0.1", 14541)
THERE = Peer(0, "127.0.0.1", 14542)
FAR = Peer(0, "127.0.0.2", 14541)
BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)


class Sender:
    """A vehicle's radio."""

    def __init__(self, system: int, *, component: int = 1) -> None:
        self._encoder = Encoder(system=system, component=component)

    def __call__(self, message: Message = BEAT) -> bytes:
        return self._encoder.encode(message)


def destinations(router: Router, kind: type[Message]) -> list[Peer]:
    return [
        peer
        for peer, raw in router.take_outgoing()
        for frame in Decoder().feed_datagram(raw)
        if isinstance(frame.message, kind)
    ]


def test_our_heartbeat_goes_to_every_peer_once_and_to_nobody_else() -> None:
    router = Router([1, 2, 3])
    for system, peer in ((1, HERE), (2, HERE), (3, THERE)):
        router.receive(Sender(system)(), peer, 0.0)
    router.receive(Sender(77)(), Peer(0, "10.0.0.1", 1), 0.0)
    router.advance(0.0)
    assert sorted(destinations(router, Heartbeat)) == [HERE, THERE]


def test_a_peer_we_call_hears_us_before_it_says_anything() -> None:
    router = Router([1])
    router.greet(THERE)
    router.advance(0.0)
    assert destinations(router, Heartbeat) == [THERE]


def test_commands_go_to_the_peer_of_their_vehicle_only() -> None:
    router = Router([1, 2])
    router.receive(Sender(1)(), HERE, 0.0)
    router.receive(Sender(2)(), THERE, 0.0)
    for peer, raw in router.take_outgoing():
        for frame in Decoder().feed_datagram(raw):
            if isinstance(frame.message, CommandLong):
                assert (frame.message.target_system == 1) == (peer == HERE)


def test_a_vehicle_is_bound_to_the_peer_of_its_first_heartbeat() -> None:
    router = Router([1])
    router.receive(Sender(1)(Attitude(yaw=1.0)), THERE, 0.0)
    assert router.vehicle_link(1, 1.0).peer is None
    router.receive(Sender(1)(), HERE, 0.1)
    assert router.vehicle_link(1, 1.0).peer == HERE
    assert router.take_events() == [LinkUp(system=1)]


def test_a_vehicle_that_changes_its_address_is_refused_told_and_counted_until_an_operator_registers_it() -> None:
    router = Router([1])
    router.receive(Sender(1)(), HERE, 0.0)
    elsewhere = Sender(1)
    router.receive(elsewhere(), FAR, 0.5)
    router.receive(elsewhere(Attitude(yaw=2.0)), FAR, 0.6)
    router.receive(elsewhere(), FAR, 60.0)
    assert [type(event) for event in router.take_events()] == [AddressRefused, LinkUp, LinkLost]
    link = router.vehicle_link(1, 60.0)
    assert (link.peer, link.refused, link.claimants) == (HERE, 3, ("127.0.0.2:14541",))
    assert router.counters.refused == 3
    assert router.vehicles[1].state.heading_deg is None

    with pytest.raises(BadInput, match=r"address: nothing was heard of system 1 from '10\.0\.0\.9:1'.*127.0.0.2:14541"):
        router.register(1, "10.0.0.9:1")
    router.register(1, "127.0.0.2:14541")
    router.receive(elsewhere(), FAR, 61.0)
    router.receive(Sender(1)(), HERE, 61.1)
    registered, refused, up = router.take_events()
    assert registered == AddressRegistered(system=1, address="127.0.0.2:14541", before="127.0.0.1:14541", by="operator")
    assert refused == AddressRefused(system=1, address="127.0.0.1:14541", registered="127.0.0.2:14541")
    assert up == LinkUp(system=1)
    router.advance(61.2)
    assert set(destinations(router, Heartbeat)) == {FAR}


def test_a_flood_of_claims_tells_of_a_few_and_counts_all() -> None:
    router, sender = Router([1]), Sender(1)
    router.receive(sender(), HERE, 0.0)
    for port in range(1000):
        router.receive(sender(), Peer(0, "10.0.0.1", port), 0.0)
    assert sum(isinstance(event, AddressRefused) for event in router.take_events()) == 8
    assert router.vehicle_link(1, 0.0).refused == 1000


def test_a_vehicle_is_first_heard_at_its_own_endpoint_or_waits_for_an_operator() -> None:
    router, elsewhere = Router([1], transport_of={1: 1}), Peer(0, "127.0.0.1", 14541)
    router.receive(Sender(1)(), elsewhere, 0.0)
    assert router.take_events() == [AddressRefused(system=1, address="127.0.0.1:14541", registered=None)]
    router.receive(Sender(1)(), Peer(1, "127.0.0.1", 14541), 0.0)
    assert router.take_events() == [LinkUp(system=1)]


def test_a_system_outside_the_fleet_is_listed_and_not_listened_to() -> None:
    router = Router([1])
    stranger = Sender(9, component=2)
    for second in range(3):
        router.receive(stranger(), THERE, float(second))
    (heard,) = router.strangers
    assert (heard.system, heard.component, heard.frames, heard.last_heard_s, heard.peer) == (9, 2, 3, 2.0, THERE)
    assert router.counters.not_in_fleet == 3
    assert router.take_events() == []


def test_gaps_in_the_sequence_are_counted_as_lost() -> None:
    router, sender = Router([1]), Sender(1)
    for number in range(600):
        raw = sender()
        if number % 10:
            router.receive(raw, HERE, 0.0)
    assert router.counters.lost == 59
    assert router.vehicle_link(1, 1.0).lost == 59


def test_frames_that_overtook_each_other_or_came_twice_are_not_lost() -> None:
    router, sender = Router([1]), Sender(1)
    first, second, third = sender(), sender(), sender()
    for raw, missing in ((first, 0), (third, 1), (second, 0), (third, 0), (second, 0), (first, 0)):
        router.receive(raw, HERE, 0.0)
        assert router.counters.lost == router.vehicle_link(1, 0.0).lost == missing


def test_the_loss_of_a_line_that_delays_and_doubles_is_that_of_its_frames() -> None:
    """A fifth of a second more or less is eighty frames of full telemetry that overtake each other."""
    line = Channel[bytes](Impairment(loss=0.3, duplication=0.05, delay_s=0.3, jitter_s=0.2), np.random.default_rng(1))
    router, sender = Router([1]), Sender(1)
    told = []
    for number in range(4000):
        now = number / 200
        line.put(sender(), now)
        for raw in line.take_due(now):
            router.receive(raw, HERE, now)
        if number >= 1200 and number % 200 == 0:
            told.append(router.vehicle_link(1, now).loss)
    assert told == pytest.approx([0.3] * len(told), abs=0.06)
    assert router.counters.lost == pytest.approx(0.3 * 4000, rel=0.1)


def test_two_vehicles_on_one_peer_have_sequences_of_their_own() -> None:
    router, one, two = Router([1, 2]), Sender(1), Sender(2)
    for number in range(50):
        router.receive(one(), HERE, 0.0)
        if number % 7 == 0:
            router.receive(two(), HERE, 0.0)
    assert router.counters.lost == 0


def test_bad_bytes_are_counted() -> None:
    router = Router([1])
    damaged = bytearray(Sender(1)())
    damaged[12] ^= 0xFF
    router.receive(bytes(damaged), HERE, 0.0)
    assert router.counters.bad_frames == 1
    router.receive(b"another protocol", HERE, 0.1)
    assert router.counters.skipped_bytes >= len(b"another protocol")
    assert not router.vehicles[1].state.link_up


def test_a_flood_of_addresses_locks_nobody_out() -> None:
    router, vehicle, late, flood = Router([1, 3]), Sender(1), Sender(3), Sender(2)
    router.receive(vehicle(), HERE, 0.0)
    for port in range(1, 2000):
        router.receive(flood(), Peer(0, "10.0.0.1", port), 0.0)
    router.receive(vehicle(Attitude(yaw=1.0)), HERE, 1.0)
    router.receive(late(), THERE, 1.0)
    assert router.vehicles[1].state.heading_deg == pytest.approx(57.3, abs=0.1)
    assert router.vehicles[3].state.link_up
    assert router.counters.received == 2002
    assert len(router.strangers) == 1


def test_a_gimbal_component_speaks_for_itself_and_not_for_the_vehicle() -> None:
    router = Router([1])
    router.receive(Sender(1, component=154)(), HERE, 0.0)
    assert not router.vehicles[1].state.link_up


def test_rate_and_loss_are_those_of_the_last_seconds() -> None:
    router, sender = Router([1]), Sender(1)
    for number in range(1000):
        raw = sender()
        if number >= 500 or number % 2:
            router.receive(raw, HERE, number / 50)
    link = router.vehicle_link(1, 20.0)
    assert (link.rate_hz, link.loss, link.lost) == (50.0, 0.0, 249)
    link = router.vehicle_link(1, 60.0)
    assert (link.rate_hz, link.loss) == (0.0, None)


def test_every_second_frame_missing_is_half_lost() -> None:
    router, sender = Router([1]), Sender(1)
    for number in range(500):
        raw = sender()
        if number % 2:
            router.receive(raw, HERE, number / 50)
    link = router.vehicle_link(1, 10.0)
    assert (link.rate_hz, link.loss) == (25.0, 0.5)
