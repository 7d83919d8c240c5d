"""Which of all that is told of batteries counts: the lowest, told lately, of what keeps the vehicle in the air."""

import pytest

from hsop_gcs.link.enums import MavAutopilot, MavBatteryFunction, MavComponent, MavType
from hsop_gcs.link.messages import BatteryStatus, Heartbeat, SysStatus
from hsop_gcs.link.protocol.batteries import TOLD_WITHIN_S
from hsop_gcs.link.protocol.telemetry import Telemetry

BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)
PERCENT = 1.0


def test_of_two_batteries_the_lowest_counts_whatever_comes_last() -> None:
    telemetry, told = Telemetry(1), []
    for second in range(20):
        for message in (
            SysStatus(battery_remaining=12),
            BatteryStatus(id=1, battery_remaining=12),
            BatteryStatus(id=0, battery_remaining=90),
        ):
            telemetry.receive(message, float(second))
            told.append(telemetry.state.battery_percent)
    assert set(told) == {12 * PERCENT}


def test_ardupilot_tells_the_first_battery_in_its_status_and_the_second_may_be_lower() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(BatteryStatus(id=1, battery_remaining=15), 0.0)
    telemetry.receive(SysStatus(battery_remaining=80), 0.5)
    assert telemetry.state.battery_percent == 15 * PERCENT


def test_a_battery_that_was_changed_counts_no_more_after_a_while() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(BatteryStatus(id=1, battery_remaining=12), 0.0)
    for second in range(int(TOLD_WITHIN_S) + 2):
        telemetry.receive(BatteryStatus(id=0, battery_remaining=90), float(second))
        expected = 12 if second <= TOLD_WITHIN_S else 90
        assert telemetry.state.battery_percent == expected * PERCENT


def test_a_battery_that_is_told_no_more_is_not_known() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(SysStatus(battery_remaining=70), 0.0)
    telemetry.receive(BEAT, TOLD_WITHIN_S)
    assert telemetry.state.battery_percent == 70 * PERCENT
    telemetry.receive(BEAT, TOLD_WITHIN_S + 1.0)
    assert telemetry.state.battery_percent is None


@pytest.mark.parametrize("component", [MavComponent.BATTERY, MavComponent.BATTERY2])
def test_a_smart_battery_tells_from_a_component_of_its_own(component: int) -> None:
    telemetry = Telemetry(1)
    telemetry.receive(BatteryStatus(id=0, battery_remaining=90), 0.0)
    telemetry.receive(BatteryStatus(id=0, battery_remaining=20), 0.1, component=component)
    telemetry.receive(BatteryStatus(id=0, battery_remaining=90), 0.2)
    assert telemetry.state.battery_percent == 20 * PERCENT


def test_the_batteries_of_a_gimbal_and_of_a_payload_do_not_carry_the_vehicle() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(BatteryStatus(battery_remaining=90), 0.0)
    telemetry.receive(BatteryStatus(battery_remaining=3), 0.1, component=MavComponent.GIMBAL)
    telemetry.receive(SysStatus(battery_remaining=3), 0.1, component=MavComponent.GIMBAL)
    payload = BatteryStatus(id=2, battery_function=MavBatteryFunction.PAYLOAD, battery_remaining=3)
    telemetry.receive(payload, 0.2)
    assert telemetry.state.battery_percent == 90 * PERCENT


def test_ids_without_end_take_no_memory_without_end() -> None:
    telemetry = Telemetry(1)
    for number in range(256):
        telemetry.receive(BatteryStatus(id=number, battery_remaining=50), 0.0)
    telemetry.receive(BatteryStatus(id=0, battery_remaining=40), 1.0)
    assert telemetry.state.battery_percent == 40 * PERCENT
