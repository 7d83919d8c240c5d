"""What kinds of vehicles are flown, and under which component ids their autopilots are taken."""

from dataclasses import replace

import pytest

from hsop_gcs.link.codec import Encoder, Frame
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavModeFlag, MavType, MavVtolState
from hsop_gcs.link.events import Arrived, CommandFinished, OnStation, OrderFailed, TookOff
from hsop_gcs.link.kinds import MULTICOPTERS, VTOLS, type_name
from hsop_gcs.link.messages import (
    Attitude,
    CommandInt,
    CommandLong,
    ExtendedSysState,
    Heartbeat,
    Message,
    SetPositionTargetGlobalInt,
)
from hsop_gcs.link.protocol.speaker import VEHICLE_TYPES
from hsop_gcs.link.protocol.telemetry import Telemetry
from hsop_gcs.link.router import Router
from tests.link.test_link_led_gimbal import AIM
from tests.link.two_ends import BOTH, Stack, TwoEnds

HERE = Peer(0, "127.0.0.1", 14541)
FLYING_COMMANDS = (
    MavCmd.DO_REPOSITION,
    MavCmd.NAV_TAKEOFF,
    MavCmd.COMPONENT_ARM_DISARM,
    MavCmd.DO_SET_MODE,
    MavCmd.NAV_RETURN_TO_LAUNCH,
)


class OfType(TwoEnds):
    """Two ends whose simulated autopilot says that it flies something else."""

    def __init__(self, stack: Stack, vehicle_type: int, *, airborne_m: float = 20.0) -> None:
        super().__init__(stack, airborne_m=airborne_m)
        self.type = vehicle_type
        self.vtol_state = MavVtolState.UNDEFINED

    def hear(self, message: Message, component: int) -> None:
        if isinstance(message, Heartbeat):
            message = replace(message, type=self.type)
        elif isinstance(message, ExtendedSysState):
            message = replace(message, vtol_state=self.vtol_state)
        super().hear(message, component)

    def orders(self) -> list[object]:
        flown = [message for command in FLYING_COMMANDS for _, message in self.sent(command)]
        return flown + [frame for _, frame in self.heard if isinstance(frame.message, SetPositionTargetGlobalInt)]


@pytest.mark.parametrize("vehicle_type", sorted(MULTICOPTERS))
def test_multicopters_are_flown(vehicle_type: int) -> None:
    ends = OfType("ardupilot", vehicle_type).ready()
    ends.order(east_m=0.0, north_m=0.0, up_m=20.0)
    ends.run(1.0)
    assert not ends.saw(OrderFailed)
    assert ends.sent(MavCmd.DO_REPOSITION)


@pytest.mark.parametrize("vehicle_type", sorted(VEHICLE_TYPES - MULTICOPTERS), ids=type_name)
def test_everything_else_is_heard_and_never_ordered(vehicle_type: int) -> None:
    """An ArduPilot in all of them: its VTOLs fly to a hover point as planes do."""
    ends = OfType("ardupilot", vehicle_type)
    ends.vtol_state = MavVtolState.MC
    ends.until(lambda: ends.vehicle.state.home is not None)
    ends.order()
    ends.vehicle.take_off(20.0, ends.now)
    ends.vehicle.hold(ends.now)
    ends.vehicle.return_to_launch(ends.now)
    ends.run(2.0)
    assert ends.orders() == []
    assert ends.vehicle.state.link_up
    assert ends.vehicle.state.position is not None
    assert ends.vehicle.state.vehicle_type == type_name(vehicle_type)
    reason = ends.vehicle.why_not_ready(ends.now)
    assert reason is not None
    assert type_name(vehicle_type) in reason
    failed, done = ends.of(OrderFailed), ends.of(CommandFinished)
    assert [event.reason for event in failed if isinstance(event, OrderFailed)] == [reason] * 2
    assert [event.problem for event in done if isinstance(event, CommandFinished)] == [reason] * 2


@pytest.mark.parametrize("vehicle_type", sorted(VTOLS), ids=type_name)
def test_a_vtol_is_flown_only_while_it_says_that_it_hovers(vehicle_type: int) -> None:
    ends = OfType("px4", vehicle_type)
    ends.until(lambda: ends.vehicle.state.home is not None)
    reason = ends.vehicle.why_not_ready(ends.now)
    assert reason is not None
    assert "does not say whether it hovers" in reason
    ends.vtol_state = MavVtolState.MC
    ends.ready()


@pytest.mark.parametrize(
    ("state", "doing"),
    [
        (MavVtolState.TRANSITION_TO_FW, "it is changing to a plane"),
        (MavVtolState.FW, "it flies as a plane"),
        (MavVtolState.TRANSITION_TO_MC, "it is changing from a plane"),
        (MavVtolState.UNDEFINED, "it does not say whether it hovers"),
    ],
)
def test_a_vtol_that_stops_hovering_in_flight_gives_its_order_up_and_can_be_held(
    state: MavVtolState, doing: str
) -> None:
    ends = OfType("px4", MavType.VTOL_TILTROTOR)
    ends.vtol_state = MavVtolState.MC
    ends.ready()
    ends.order(east_m=200.0)
    ends.run(3.0)
    ends.vtol_state = state
    ends.until(lambda: ends.saw(OrderFailed))
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert failed.reason == f"a VTOL tiltrotor is flown only while it hovers as a multicopter: {doing}"
    ends.vehicle.hold(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="hold", problem=None)]


@BOTH
@pytest.mark.parametrize("after", [MavType.FIXED_WING, MavType.HEXAROTOR], ids=type_name)
def test_an_order_whose_vehicle_changes_its_type_is_given_up(stack: Stack, after: int) -> None:
    ends = OfType(stack, MavType.QUADROTOR).ready()
    ends.order(east_m=200.0)
    ends.run(3.0)
    ends.type = after
    ends.until(lambda: ends.saw(OrderFailed))
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert failed.reason.endswith(f"ordered: {stack} on a {type_name(after)}")


def test_a_take_off_whose_vehicle_changes_its_type_is_given_up() -> None:
    ends = OfType("px4", MavType.QUADROTOR, airborne_m=0.0).standing()
    ends.vehicle.take_off(20.0, ends.now)
    ends.run(0.5)
    ends.type = MavType.OCTOROTOR
    ends.until(lambda: ends.saw(OrderFailed))
    assert not ends.saw(TookOff)


@pytest.mark.parametrize(
    ("vehicle_type", "custom_mode", "name"),
    [
        (MavType.QUADROTOR, 4, "Guided"),
        (MavType.HELICOPTER, 17, "Brake"),
        (MavType.FIXED_WING, 4, "Acro"),
        (MavType.FIXED_WING, 15, "Guided"),
        (MavType.VTOL_FIXEDROTOR, 19, "QLoiter"),
        (MavType.GROUND_ROVER, 4, "Hold"),
        (MavType.SURFACE_BOAT, 15, "Guided"),
        (MavType.SUBMARINE, 9, "Surface"),
        (MavType.FIXED_WING, 99, "mode 99"),
    ],
)
def test_ardupilot_s_mode_numbers_are_read_by_what_it_flies(vehicle_type: int, custom_mode: int, name: str) -> None:
    telemetry = Telemetry(1)
    beat = Heartbeat(type=vehicle_type, autopilot=MavAutopilot.ARDUPILOTMEGA, custom_mode=custom_mode)
    telemetry.receive(beat, 0.0)
    assert telemetry.state.mode == name


class AsComponent(TwoEnds):
    """Two ends whose simulated autopilot speaks as another component, and hears only what is addressed to that."""

    def __init__(self, stack: Stack, component: int, *, airborne_m: float = 20.0) -> None:
        super().__init__(stack, airborne_m=airborne_m)
        self._component = component

    def reach(self, frame: Frame) -> None:
        target = getattr(frame.message, "target_component", 0)
        if target not in (0, self._component):
            return
        if isinstance(frame.message, CommandLong | CommandInt | SetPositionTargetGlobalInt):
            frame = replace(frame, message=replace(frame.message, target_component=1))
        super().reach(frame)

    def hear(self, message: Message, component: int) -> None:
        super().hear(message, self._component if component == 1 else component)


@pytest.mark.parametrize(("stack", "component"), [("px4", 50), ("ardupilot", 50), ("ardupilot", 191)])
def test_an_autopilot_that_speaks_as_another_component_is_flown(stack: Stack, component: int) -> None:
    ends = AsComponent(stack, component).ready()
    assert ends.vehicle.state.component == component
    ends.order(east_m=5.0, north_m=0.0, up_m=20.0, aim=AIM, speed_mps=2.0)
    ends.until(lambda: ends.saw(OnStation))
    ends.vehicle.hold(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="hold", problem=None)]


def test_an_autopilot_that_speaks_as_another_component_takes_off() -> None:
    ends = AsComponent("ardupilot", 50, airborne_m=0.0).standing()
    ends.vehicle.take_off(10.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))


AUTOPILOT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4, base_mode=MavModeFlag.SAFETY_ARMED)
ALL_ZERO = Heartbeat(type=MavType.GENERIC, autopilot=MavAutopilot.GENERIC)
COMPANION = Heartbeat(type=MavType.ONBOARD_CONTROLLER, autopilot=MavAutopilot.INVALID)


def test_a_camera_whose_heartbeat_is_all_zero_is_no_autopilot_though_it_is_heard_first() -> None:
    router = Router([1])
    router.receive(Encoder(system=1, component=100).encode(ALL_ZERO), HERE, 0.0)
    assert router.peer_of(1) is None
    assert router.vehicle_link(1, 0.0).not_taken == {"camera": 1}
    router.receive(Encoder(system=1, component=1).encode(AUTOPILOT), HERE, 0.1)
    assert (router.vehicles[1].state.component, router.vehicles[1].state.autopilot) == (1, "px4")


def test_others_of_a_fleets_id_are_no_longer_heard_once_they_are_silent_though_their_count_stays() -> None:
    router = Router([1])
    assert not router.vehicle_link(1, 0.0).hears_others
    router.receive(Encoder(system=1, component=1).encode(Attitude()), HERE, 0.0)
    router.receive(Encoder(system=1, component=1).encode(AUTOPILOT), HERE, 0.1)
    router.receive(Encoder(system=1, component=100).encode(ALL_ZERO), HERE, 5.0)
    told = {at: router.vehicle_link(1, at) for at in (5.0, 8.0, 9.0)}
    assert [link.hears_others for link in told.values()] == [True, True, False]
    assert told[5.0].not_taken == told[9.0].not_taken == {"autopilot's component": 1, "camera": 1}


def test_an_autopilot_that_we_speak_to_takes_the_place_of_one_that_we_do_not() -> None:
    router = Router([1])
    router.receive(Encoder(system=1, component=1).encode(ALL_ZERO), HERE, 0.0)
    assert router.vehicles[1].state.autopilot == "other"
    router.receive(Encoder(system=1, component=50).encode(AUTOPILOT), HERE, 0.1)
    assert (router.vehicles[1].state.component, router.vehicles[1].state.autopilot) == (50, "px4")


def test_a_second_autopilot_under_one_id_is_told_and_changes_nothing() -> None:
    router = Router([1])
    first, second = Encoder(system=1, component=1), Encoder(system=1, component=2)
    for tenth in range(50):
        now = tenth / 10
        router.receive(first.encode(AUTOPILOT if tenth % 10 == 0 else Attitude(yaw=0.0)), HERE, now)
        other = replace(AUTOPILOT, base_mode=0) if tenth % 10 == 5 else Attitude(yaw=1.0)
        router.receive(second.encode(other), HERE, now)
    state, link = router.vehicles[1].state, router.vehicle_link(1, 5.0)
    assert (state.component, state.armed, state.heading_deg) == (1, True, 0.0)
    assert link.other_autopilots == (2,)
    assert link.not_taken["another autopilot"] > 40


def test_frames_of_a_fleets_id_that_are_not_taken_are_counted_by_few_kinds() -> None:
    router = Router([1])
    for component in range(2, 256):
        router.receive(Encoder(system=1, component=component).encode(COMPANION), HERE, 0.0)
        router.receive(Encoder(system=1, component=component).encode(Attitude()), HERE, 0.0)
    router.receive(Encoder(system=1, component=1).encode(AUTOPILOT), HERE, 0.1)
    for component in range(2, 256):
        router.receive(Encoder(system=1, component=component).encode(Attitude()), HERE, 0.2)
    counts = router.vehicle_link(1, 1.0).not_taken
    assert sum(counts.values()) == 3 * 254
    assert len(counts) <= 8


@BOTH
def test_an_autopilot_that_changes_its_component_is_taken_again_after_silence_and_its_order_is_gone(
    stack: Stack,
) -> None:
    ends = AsComponent(stack, 1).ready()
    ends.order(east_m=400.0)
    ends.run(3.0)
    ends._component = 7
    ends.until(lambda: ends.vehicle.state.component == 7, within_s=15.0)
    assert not ends.saw(Arrived)
    assert ends.saw(OrderFailed)
    ends.ready()
