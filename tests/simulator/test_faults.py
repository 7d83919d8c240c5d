"""Faults on demand, and what each stack makes of them."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.link.enums import MavCmd, MavResult
from hsop_gcs.link.messages import GimbalManagerStatus, GlobalPositionInt, GpsRawInt, Heartbeat
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.faults import Fault, FaultKind, parse_fault
from tests.simulator.station import CONFIG, OPERATOR, Station, ardupilot, px4

STACKS = [pytest.param(px4, id="px4"), pytest.param(ardupilot, id="ardupilot")]
Stack = Callable[[VehicleConfig], Station]


def with_fault(stack: Stack, text: str, *, airborne_m: float = 30.0) -> Station:
    return stack(replace(CONFIG, airborne_m=airborne_m, faults=(parse_fault(text, 1),)))


def test_every_part_of_a_fault_is_read() -> None:
    assert parse_fault("h2:reject=DO_REPOSITION,count=3,result=DENIED@30.5+10", 4) == Fault(
        kind=FaultKind.REJECT,
        vehicle=2,
        command=MavCmd.DO_REPOSITION,
        count=3,
        result=MavResult.DENIED,
        start_s=30.5,
        length_s=10.0,
    )
    assert parse_fault("3:ignore=192", 4) == Fault(kind=FaultKind.IGNORE, vehicle=3, command=192)
    assert parse_fault("gps-lost@60", 1).end_s == math.inf


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "'' is not [VEHICLE:]KIND"),
        ("smoke", "'smoke' is none of reject"),
        ("h5:deny-arm", "vehicle 5 is not one of 4"),
        ("h0:deny-arm", "vehicle 0 is not one of 4"),
        ("reject", "reject needs a command"),
        ("deny-arm=DO_REPOSITION", "deny-arm takes no command"),
        ("reject=FLY", "command 'FLY'"),
        ("reject=99999", "command '99999'"),
        ("reject=192,count=0", "count '0'"),
        ("reject=192,result=MAYBE", "result 'MAYBE'"),
        ("ignore=192,result=DENIED", "ignore takes no 'result'"),
        ("link-cut@1.2.3", "a time is not a number"),
        ("link-cut@", "is not [VEHICLE:]KIND"),
        ("link-cut+10", "is not [VEHICLE:]KIND"),
    ],
)
def test_a_fault_that_means_nothing_is_refused_by_its_part(text: str, complaint: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_fault(text, 4)
    assert caught.value.field == "--fault"
    assert complaint in caught.value.problem


@pytest.mark.parametrize("stack", STACKS)
def test_so_many_commands_are_rejected_and_not_obeyed(stack: Stack) -> None:
    station = with_fault(stack, "reject=DO_REPOSITION,count=2")
    station.wait(1.0)
    for result in (MavResult.TEMPORARILY_REJECTED, MavResult.TEMPORARILY_REJECTED, MavResult.ACCEPTED):
        before = station.vehicle.goal
        assert station.reposition(20.0, 0.0, 30.0) == result
        assert (station.vehicle.goal != before) == (result == MavResult.ACCEPTED)


@pytest.mark.parametrize("stack", STACKS)
def test_an_ignored_command_is_answered_with_silence_until_the_fault_ends(stack: Stack) -> None:
    station = with_fault(stack, "ignore=DO_REPOSITION@0+5")
    assert station.reposition(20.0, 0.0, 30.0) is None
    station.wait(5.1)
    assert station.reposition(20.0, 0.0, 30.0) == MavResult.ACCEPTED


@pytest.mark.parametrize(("stack", "result"), [(px4, MavResult.TEMPORARILY_REJECTED), (ardupilot, MavResult.FAILED)])
def test_arming_is_denied_with_a_reason(stack: Stack, result: MavResult) -> None:
    station = with_fault(stack, "deny-arm", airborne_m=0.0)
    station.wait(CONFIG.ready_after_s + 0.1)
    station.command_long(MavCmd.DO_SET_MODE, param1=1.0, param2=4.0, param3=3.0)
    assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == result
    assert not station.vehicle.armed
    assert "Arm" in "".join(station.texts)


@pytest.mark.parametrize("stack", STACKS)
def test_a_stuck_gimbal_accepts_and_does_not_move(stack: Stack) -> None:
    station = with_fault(stack, "gimbal-stuck@0+5")
    take, aim = MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, MavCmd.DO_GIMBAL_MANAGER_PITCHYAW
    ids: dict[str, Any] = {"param1": 255.0, "param2": 190.0, "param3": -1.0, "param4": -1.0}
    assert station.command_long(take, **ids) == MavResult.ACCEPTED
    before = station.vehicle.gimbal.pitch_rad
    down: dict[str, Any] = {"param1": -40.0, "param2": 0.0, "param3": math.nan, "param4": math.nan, "param5": 12.0}
    assert station.command_long(aim, **down) == MavResult.ACCEPTED
    station.wait(4.0)
    assert station.vehicle.gimbal.pitch_rad == before
    station.wait(2.0)
    assert math.degrees(station.vehicle.gimbal.pitch_rad) == pytest.approx(-40.0, abs=0.1)


@pytest.mark.parametrize("stack", STACKS)
def test_a_taken_gimbal_looks_down_and_names_its_owner(stack: Stack) -> None:
    station = with_fault(stack, "gimbal-taken@2")
    station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=float(GimbalManagerStatus.ID), param2=2e5)
    ids: dict[str, Any] = {"param1": 255.0, "param2": 190.0, "param3": -1.0, "param4": -1.0}
    station.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **ids)
    station.wait(1.0)
    assert station.last(GimbalManagerStatus).primary_control_sysid == OPERATOR[0]
    station.wait(3.0)
    assert station.last(GimbalManagerStatus).primary_control_sysid not in (0, OPERATOR[0])
    assert math.degrees(station.vehicle.gimbal.pitch_rad) == pytest.approx(-90.0, abs=0.1)
    # Taken once: it can be taken back.
    station.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **ids)
    station.wait(1.0)
    assert station.last(GimbalManagerStatus).primary_control_sysid == OPERATOR[0]


@pytest.mark.parametrize(
    ("stack", "text"),
    [
        (px4, "Failsafe activated: Autopilot disengaged, switching to Descend"),
        (ardupilot, "EKF Failsafe: changed to Land Mode"),
    ],
)
def test_without_satellites_the_position_goes_and_the_vehicle_comes_down(stack: Stack, text: str) -> None:
    station = with_fault(stack, "gps-lost@3", airborne_m=10.0)
    for message in (GpsRawInt, GlobalPositionInt, Heartbeat):
        station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=float(message.ID), param2=2e5)
    station.wait(2.0)
    assert station.last(GpsRawInt).fix_type >= 3
    station.wait(3.0)
    assert station.last(GpsRawInt).fix_type < 3
    assert text in "".join(station.texts)
    assert station.reposition(20.0, 0.0, 30.0) in (MavResult.FAILED, MavResult.TEMPORARILY_REJECTED)
    positions = {(m.lat, m.lon) for t, m in station.heard if isinstance(m, GlobalPositionInt) and t > 3.1}
    assert len(positions) <= 1  # PX4 publishes none, ArduPilot the last one there was
    station.wait(20.0)
    assert not station.vehicle.in_air


@pytest.mark.parametrize("stack", STACKS)
def test_a_gale_carries_the_vehicle_away_until_it_ends(stack: Stack) -> None:
    station = with_fault(stack, "gale@3+20")
    station.wait(3.0)
    east_m, north_m, _ = station.vehicle.state.position_m
    station.wait(20.0)
    carried_m = station.vehicle.state.position_m[0] - east_m
    assert carried_m > 30.0
    assert abs(station.vehicle.state.position_m[1] - north_m) < 2.0
    station.wait(30.0)
    assert abs(station.vehicle.state.position_m[0] - east_m) < 2.0
