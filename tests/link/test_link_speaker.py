"""Heartbeats under an autopilot's ids that are not the autopilot's, and autopilots that change their kind."""

from itertools import cycle

import pytest

from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavModeFlag, MavType
from hsop_gcs.link.events import Arrived, CommandFinished, LinkLost, LinkUp, OrderFailed, TookOff
from hsop_gcs.link.messages import Attitude, Heartbeat
from hsop_gcs.link.protocol.heartbeat import Presence
from hsop_gcs.link.protocol.speaker import VEHICLE_TYPES, is_autopilots
from hsop_gcs.link.router import Router
from tests.link.two_ends import BOTH, Stack, TwoEnds

HERE = Peer(0, "127.0.0.1", 14541)
AUTOPILOT = Heartbeat(type=MavType.HEXAROTOR, autopilot=MavAutopilot.PX4)
FOREIGN = {
    "a companion computer, armed": Heartbeat(
        type=MavType.ONBOARD_CONTROLLER,
        autopilot=MavAutopilot.INVALID,
        base_mode=MavModeFlag.SAFETY_ARMED | MavModeFlag.MANUAL_INPUT_ENABLED,
    ),
    "a companion computer": Heartbeat(type=MavType.ONBOARD_CONTROLLER, autopilot=MavAutopilot.INVALID),
    "a companion computer that says it is a quadrotor": Heartbeat(
        type=MavType.QUADROTOR, autopilot=MavAutopilot.INVALID
    ),
    "an antenna tracker": Heartbeat(type=MavType.ANTENNA_TRACKER, autopilot=MavAutopilot.ARDUPILOTMEGA, custom_mode=10),
    "a gimbal": Heartbeat(type=MavType.GIMBAL, autopilot=MavAutopilot.GENERIC),
    "another ground station": Heartbeat(type=MavType.GCS, autopilot=MavAutopilot.INVALID),
    "a kind that is in no enumeration": Heartbeat(type=255, autopilot=255),
}
EACH = pytest.mark.parametrize("beat", FOREIGN.values(), ids=FOREIGN)


class Beside(TwoEnds):
    """Two ends, and twice a second somebody else's heartbeat as component 1 of the vehicle."""

    def __init__(self, stack: Stack, *beats: Heartbeat, airborne_m: float = 20.0) -> None:
        super().__init__(stack, airborne_m=airborne_m)
        self._beats = cycle(beats)
        self.speaks = False
        self._due_s = 0.0

    def _step(self) -> None:
        super()._step()
        if self.speaks and self.now >= self._due_s:
            self._due_s = self.now + 0.5
            self.vehicle.receive(next(self._beats), self.now)


@BOTH
def test_foreign_heartbeats_change_nothing_in_flight(stack: Stack) -> None:
    ends = Beside(stack, *FOREIGN.values())
    ends.ready()
    ends.order()
    ends.run(1.0)
    ends.speaks = True
    ends.until(lambda: ends.saw(Arrived))
    assert ends.vehicle.why_not_ready(ends.now) is None
    ends.vehicle.hold(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="hold", problem=None)]
    assert ends.vehicle.foreign_heartbeats > len(FOREIGN)
    assert not ends.saw(OrderFailed)
    assert ends.vehicle.state.autopilot == stack


@BOTH
def test_a_foreign_heartbeat_changes_nothing_at_take_off(stack: Stack) -> None:
    ends = Beside(stack, FOREIGN["a companion computer"], airborne_m=0.0)
    ends.standing()
    ends.speaks = True
    ends.vehicle.take_off(20.0, ends.now)
    ends.until(lambda: ends.saw(TookOff) or ends.saw(OrderFailed))
    assert ends.saw(TookOff)


@EACH
def test_a_foreign_heartbeat_begins_no_link_and_registers_nobody(beat: Heartbeat) -> None:
    router = Router([1])
    companion = Encoder(system=1, component=1)
    router.receive(companion.encode(beat), HERE, 0.0)
    router.receive(companion.encode(Attitude()), HERE, 0.1)
    assert router.peer_of(1) is None
    assert not router.vehicles[1].state.link_up
    router.receive(Encoder(system=1, component=1).encode(AUTOPILOT), HERE, 0.2)
    assert router.peer_of(1) == HERE
    assert router.vehicles[1].state.link_up


@EACH
def test_a_foreign_heartbeat_keeps_no_link_and_brings_none_back(beat: Heartbeat) -> None:
    router = Router([1])
    router.receive(Encoder(system=1, component=1).encode(AUTOPILOT), HERE, 0.0)
    companion = Encoder(system=1, component=1)
    for second in range(1, 10):
        router.receive(companion.encode(beat), HERE, float(second))
        router.advance(second + 0.5)
    assert [type(event) for event in router.take_events()] == [LinkUp, LinkLost]
    assert router.vehicle_link(1, 10.0).foreign_heartbeats == 9


@EACH
def test_the_sequence_numbers_of_a_foreign_heartbeat_are_no_loss(beat: Heartbeat) -> None:
    router = Router([1])
    autopilot, companion = Encoder(system=1, component=1), Encoder(system=1, component=1)
    for _ in range(100):
        companion.encode(beat)
    router.receive(autopilot.encode(AUTOPILOT), HERE, 0.0)
    for tenth in range(1, 61):
        router.receive(autopilot.encode(Attitude()), HERE, tenth / 10)
        if tenth % 10 == 0:
            router.receive(companion.encode(beat), HERE, tenth / 10)
    assert router.vehicle_link(1, 6.0).loss == 0.0


@BOTH
def test_an_order_whose_autopilot_changes_its_kind_is_given_up(stack: Stack) -> None:
    other = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.GENERIC, base_mode=MavModeFlag.SAFETY_ARMED)
    ends = TwoEnds(stack).ready()
    ends.order(east_m=200.0)
    ends.run(3.0)
    ends.vehicle.receive(other, ends.now)
    ends.run(0.1)
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert failed.reason == "its autopilot is of another kind than when it was ordered: other on a quadrotor"
    assert ends.vehicle.progress is None


@BOTH
def test_a_take_off_whose_autopilot_changes_its_kind_is_given_up(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0).standing()
    ends.vehicle.take_off(20.0, ends.now)
    ends.run(0.5)
    ends.vehicle.receive(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.GENERIC), ends.now)
    ends.run(0.1)
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert "of another kind" in failed.reason


def test_every_kind_that_flies_is_a_vehicle_and_no_part_of_one_is() -> None:
    presence = Presence(1)
    for number in range(256):
        beat = Heartbeat(type=number, autopilot=MavAutopilot.ARDUPILOTMEGA)
        assert is_autopilots(beat) == (number in VEHICLE_TYPES)
    assert {1, 2, 3, 4, 13, 14, 15, 19, 20, 21, 22, 23, 24, 29, 35, 43} <= VEHICLE_TYPES
    assert not {5, 6, 18, 26, 27, 30, 31, 34, 36} & VEHICLE_TYPES
    presence.receive(Heartbeat(type=MavType.CAMERA, autopilot=MavAutopilot.PX4), 0.0)
    assert not presence.up
