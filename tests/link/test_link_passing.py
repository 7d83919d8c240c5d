"""What other programs may tell a vehicle over our link."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link.codec import Decoder, Encoder, is_signed
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavResult, MavType
from hsop_gcs.link.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    FileTransferProtocol,
    Heartbeat,
    Message,
    MissionCount,
    ParamSet,
    SetMode,
    SetPositionTargetGlobalInt,
    Timesync,
)
from hsop_gcs.link.router import Router
from hsop_gcs.link.signing import Signing, SigningClock

HERE = Peer(0, "127.0.0.1", 14541)
GUEST = Encoder(system=245, component=190)


def heard_router(*, signed: bool = False) -> Router:
    """A router that has heard vehicles 1 and 2 behind one radio, with nothing left to send."""
    sign = Signing(bytes(32), clock=SigningClock(lambda: 1.8e9))
    router = Router([1, 2, 3], signing={0: Signing(bytes(32), clock=SigningClock(lambda: 1.8e9))} if signed else {})
    for system in (1, 2):
        vehicle = Encoder(system=system, component=1, sign=sign.sign if signed else None)
        router.receive(vehicle.encode(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)), HERE, 0.0)
    router.take_outgoing()
    return router


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize(
    "message",
    [
        ParamSet(target_system=1, param_id="A"),
        MissionCount(target_system=1, count=3, mission_type=1),
        FileTransferProtocol(target_system=1),
        CommandLong(target_system=1, command=MavCmd.REQUEST_CAMERA_INFORMATION),
        CommandLong(target_system=1, command=MavCmd.REQUEST_MESSAGE),
        Timesync(ts1=5),
    ],
)
def test_parameters_fences_files_and_cameras_pass_signed_as_our_link_is(message: Message, signed: bool) -> None:
    router = heard_router(signed=signed)
    router.forward(1, GUEST.encode(message))
    ((peer, raw),) = router.take_outgoing()
    (frame,) = Decoder().feed_datagram(raw)
    assert (peer, frame.message, frame.system, is_signed(raw)) == (HERE, message, 245, signed)
    assert router.vehicle_link(1, 0.0).withheld == {}


@pytest.mark.parametrize(
    ("message", "why_not"),
    [
        (Heartbeat(), "message 0"),
        (SetMode(target_system=1), "message 11"),
        (SetPositionTargetGlobalInt(target_system=1), "message 86"),
        (CommandLong(target_system=1, command=MavCmd.COMPONENT_ARM_DISARM), "command 400"),
        (CommandInt(target_system=1, command=MavCmd.DO_REPOSITION), "command 192"),
        (CommandLong(target_system=1, command=MavCmd.SET_MESSAGE_INTERVAL), "command 511"),
        (ParamSet(target_system=2, param_id="A"), "to another system"),
        (CommandLong(target_system=2, command=MavCmd.REQUEST_MESSAGE), "to another system"),
    ],
)
def test_what_flies_a_vehicle_is_withheld_and_counted(message: Message, why_not: str) -> None:
    router = heard_router()
    router.forward(1, GUEST.encode(message) + GUEST.encode(message))
    assert router.take_outgoing() == []
    assert router.vehicle_link(1, 0.0).withheld == {why_not: 2}


@pytest.mark.parametrize("kind", [CommandLong, CommandInt])
@pytest.mark.parametrize(
    ("system", "target", "component", "command", "result"),
    [
        (1, 1, 1, MavCmd.COMPONENT_ARM_DISARM, MavResult.DENIED),
        (1, 0, 0, MavCmd.NAV_TAKEOFF, MavResult.DENIED),
        (1, 1, 154, MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, MavResult.DENIED),
        (3, 3, 1, MavCmd.REQUEST_MESSAGE, MavResult.TEMPORARILY_REJECTED),
    ],
)
def test_a_command_that_does_not_pass_is_answered_to_its_sender_by_its_addressee(
    kind: type[CommandLong | CommandInt], system: int, target: int, component: int, command: int, result: int
) -> None:
    router = heard_router()
    message = kind(target_system=target, target_component=component, command=command)
    (raw,) = router.forward(system, GUEST.encode(message))
    (frame,) = Decoder().feed_datagram(raw)
    assert (frame.system, frame.component) == (system, component or 1)
    assert frame.message == CommandAck(command=command, result=result, target_system=245, target_component=190)


@pytest.mark.parametrize(
    "message",
    [
        CommandLong(target_system=2, command=MavCmd.COMPONENT_ARM_DISARM),
        CommandLong(target_system=1, command=MavCmd.REQUEST_MESSAGE),
        SetMode(target_system=1),
    ],
)
def test_what_passes_or_is_another_systems_or_no_command_is_not_answered(message: Message) -> None:
    assert heard_router().forward(1, GUEST.encode(message)) == []


@pytest.mark.parametrize("signed", [False, True])
def test_what_we_could_not_sign_is_withheld(signed: bool) -> None:
    router = heard_router(signed=signed)
    old = dialect.MAVLink(None, srcSystem=245, srcComponent=190)
    router.forward(1, dialect.MAVLink_param_request_list_message(1, 1).pack(old, force_mavlink1=True))
    sign = Signing(bytes(32), clock=SigningClock(lambda: 1.8e9)).sign
    router.forward(1, Encoder(system=245, component=190, sign=sign).encode(ParamSet(target_system=1, param_id="A")))
    assert router.take_outgoing() == []
    assert router.vehicle_link(1, 0.0).withheld == {"signed already, or MAVLink 1": 2}


def test_to_a_vehicle_that_was_not_heard_nothing_is_sent_and_that_is_counted() -> None:
    router = heard_router()
    router.forward(3, GUEST.encode(ParamSet(target_system=3, param_id="A")))
    assert router.take_outgoing() == []
    assert router.vehicle_link(3, 0.0).withheld == {"vehicle not heard yet": 1}
