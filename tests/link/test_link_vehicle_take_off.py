"""Take-offs, our vehicle machine against simulated autopilots."""

import pytest

from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import OrderFailed, TookOff
from hsop_gcs.link.messages import CommandLong
from hsop_gcs.simulator.faults import Faults, parse_fault
from tests.link.two_ends import BAD, BOTH, METRE, Stack, TwoEnds


def test_an_ardupilot_that_is_not_ready_is_asked_to_arm_until_it_is() -> None:
    ends = TwoEnds("ardupilot", airborne_m=0.0).standing()
    assert ends.now < 5.0
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))
    assert len(ends.sent(MavCmd.COMPONENT_ARM_DISARM)) > 1
    (((_, message)),) = ends.sent(MavCmd.NAV_TAKEOFF)
    assert message == CommandLong(target_system=1, target_component=1, command=MavCmd.NAV_TAKEOFF, param7=15.0)


def test_a_take_off_ordered_as_soon_as_the_link_is_up_waits_for_what_it_must_know() -> None:
    ends = TwoEnds("ardupilot", airborne_m=0.0)
    ends.until(lambda: ends.vehicle.state.link_up)
    assert ends.vehicle.state.in_air is None
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))
    assert not ends.saw(OrderFailed)


def test_a_take_off_of_a_vehicle_that_turns_out_to_fly_is_refused() -> None:
    ends = TwoEnds("ardupilot")
    ends.until(lambda: ends.vehicle.state.link_up)
    assert ends.vehicle.state.in_air is None
    ends.vehicle.take_off(15.0, ends.now)
    ends.run(5.0)
    assert ends.of(OrderFailed) == [OrderFailed(system=1, order_id="take off", reason="the vehicle is in the air")]
    assert ends.sent(MavCmd.COMPONENT_ARM_DISARM) == []


def test_px4_is_told_the_altitude_above_the_sea() -> None:
    ends = TwoEnds("px4", airborne_m=0.0).standing()
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))
    ((_, message),) = ends.sent(MavCmd.NAV_TAKEOFF)
    assert isinstance(message, CommandLong)
    assert message.param7 == pytest.approx(515.0, abs=0.2 * METRE)


@BOTH
def test_a_vehicle_left_in_a_mode_that_does_not_arm_takes_off_all_the_same(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0).standing()
    ends.run(8.0)
    ends.vehicle.return_to_launch(ends.now)
    ends.until(lambda: ends.vehicle.state.mode in ("Return", "RTL"))
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff), within_s=40.0)


@BOTH
def test_a_mode_that_is_acknowledged_and_not_taken_is_asked_for_again_before_arming(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0).standing()
    ends.run(8.0)
    ends.vehicle.return_to_launch(ends.now)
    ends.until(lambda: ends.vehicle.state.mode in ("Return", "RTL"))
    ends.sim.faults = Faults([parse_fault("reject=DO_SET_MODE,result=ACCEPTED,count=1", 1)])
    ends.vehicle.take_off(15.0, ends.now)
    ends.run(2.5)
    assert len(ends.sent(MavCmd.DO_SET_MODE)) == 1
    assert ends.sent(MavCmd.COMPONENT_ARM_DISARM) == []
    ends.until(lambda: ends.saw(TookOff), within_s=40.0)
    assert len(ends.sent(MavCmd.DO_SET_MODE)) == 2


@BOTH
@pytest.mark.parametrize("seed", range(3))
def test_a_take_off_over_a_bad_line_ends_exactly_once(stack: Stack, seed: int) -> None:
    ends = TwoEnds(stack, airborne_m=0.0, impairment=BAD, seed=seed).standing()
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff) or ends.saw(OrderFailed), within_s=200.0)
    assert len(ends.of(TookOff)) + len(ends.of(OrderFailed)) == 1


@BOTH
def test_a_vehicle_in_the_air_takes_off_no_second_time(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.vehicle.take_off(15.0, ends.now)
    ends.run(1.0)
    assert ends.of(OrderFailed) == [OrderFailed(system=1, order_id="take off", reason="the vehicle is in the air")]
    assert ends.sent(MavCmd.COMPONENT_ARM_DISARM) == []
