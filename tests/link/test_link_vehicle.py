"""Hover orders and the link, our vehicle machine against simulated autopilots in simulated time."""

import math

import numpy as np
import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import (
    Arrived,
    CommandFinished,
    Drifted,
    LinkLost,
    LinkUp,
    OnStation,
    OrderAccepted,
    OrderEvent,
    OrderFailed,
    OrderSuperseded,
    TookOff,
)
from hsop_gcs.link.messages import CommandInt, CommandLong, SetPositionTargetGlobalInt
from hsop_gcs.link.protocol.gimbal import separation_deg
from tests.link.two_ends import BAD, BOTH, DEGREE, LOCAL, METRE, Stack, TwoEnds


@BOTH
def test_a_vehicle_takes_off_flies_to_its_point_looks_and_returns(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0).standing()
    ends.vehicle.take_off(20.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))
    assert ends.sim.state.position_m[2] == pytest.approx(20.0, abs=1.5 * METRE)
    order = ends.order(aim=Aim(pan_deg=310.0, tilt_deg=-15.0))
    ends.until(lambda: ends.saw(OnStation))
    kinds = [type(event) for event in ends.of(OrderEvent)]
    assert kinds.index(OrderAccepted) < kinds.index(Arrived) < kinds.index(OnStation)
    assert ends.error_m() < 1.0 * METRE
    assert ends.vehicle.state.heading_deg == pytest.approx(order.heading_deg, abs=3 * DEGREE)
    gimbal = ends.vehicle.state.gimbal
    assert gimbal is not None
    assert separation_deg(gimbal, Aim(pan_deg=310.0, tilt_deg=-15.0)) < 2 * DEGREE
    progress = ends.vehicle.progress
    assert progress is not None
    assert progress.on_station
    ends.vehicle.return_to_launch(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="return to launch", problem=None)]
    ends.until(lambda: ends.vehicle.state.in_air is False, within_s=300.0)
    assert ends.vehicle.progress is None


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_over_a_bad_line_a_hover_order_ends_exactly_once(stack: Stack, seed: int) -> None:
    ends = TwoEnds(stack, impairment=BAD, seed=seed).ready()
    ends.order(aim=Aim(pan_deg=10.0, tilt_deg=-5.0))
    ends.until(lambda: ends.saw(OnStation) or ends.saw(OrderFailed))
    assert len(ends.of(Arrived)) + len(ends.of(OrderFailed)) == 1
    if ends.saw(Arrived):
        assert ends.error_m() < 1.5 * METRE


@BOTH
def test_a_fresh_link_brings_the_messages_we_live_on(stack: Stack) -> None:
    ends = TwoEnds(stack)
    ends.run(10.0)
    state = ends.vehicle.state
    assert state.link_up
    assert None not in (
        state.position,
        state.heading_deg,
        state.home,
        state.in_air,
        state.gimbal,
        state.battery_percent,
        state.gps_fix,
        state.firmware,
    )
    assert state.autopilot == stack
    assert ends.sent(MavCmd.SET_MESSAGE_INTERVAL)


@BOTH
def test_after_a_lost_link_everything_is_asked_for_again_and_the_order_lives_on(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.order(east_m=60.0)
    ends.until(lambda: ends.saw(OrderAccepted))
    ends.cut = True
    ends.until(lambda: ends.saw(LinkLost))
    assert not ends.vehicle.state.link_up
    ends.heard.clear()
    ends.cut = False
    ends.until(lambda: len(ends.of(LinkUp)) == 2)
    ends.until(lambda: ends.saw(Arrived, "o1"))
    assert ends.sent(MavCmd.SET_MESSAGE_INTERVAL)


@BOTH
def test_an_order_without_a_link_fails_and_says_so(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.cut = True
    ends.until(lambda: ends.saw(LinkLost))
    ends.order()
    ends.run(0.1)
    assert ends.of(OrderFailed) == [OrderFailed(system=1, order_id="o1", reason="no link to the vehicle")]
    assert ends.sent(MavCmd.DO_REPOSITION) == []


@BOTH
def test_a_vehicle_on_the_ground_takes_no_hover_order(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0)
    ends.until(lambda: ends.vehicle.state.in_air is False)
    ends.order()
    ends.run(1.0)
    (event,) = ends.of(OrderFailed)
    assert isinstance(event, OrderFailed)
    assert event.reason == "the vehicle is not armed"
    assert ends.sent(MavCmd.DO_REPOSITION) == []


@BOTH
def test_a_point_outside_the_autopilots_fence_is_refused_in_words(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    if stack == "px4":
        ends.sim.parameters.set("GF_MAX_HOR_DIST", 50.0)
    else:
        ends.sim.parameters.set("FENCE_ENABLE", 1.0)
        ends.sim.parameters.set("FENCE_RADIUS", 50.0)
    ends.order(east_m=200.0)
    ends.until(lambda: ends.saw(OrderFailed), within_s=5.0)
    (event,) = ends.of(OrderFailed)
    assert isinstance(event, OrderFailed)
    assert "fence" in event.reason.lower() or "FAILED" in event.reason
    assert not ends.saw(OrderAccepted) or stack == "px4"


@BOTH
def test_a_newer_order_takes_over_in_mid_flight(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.order("old", east_m=80.0)
    ends.until(lambda: ends.saw(OrderAccepted, "old"))
    ends.run(3.0)
    ends.order("new", east_m=-30.0, heading_deg=90.0)
    ends.until(lambda: ends.saw(Arrived, "new"))
    assert ends.saw(OrderSuperseded, "old")
    assert not ends.saw(Arrived, "old")
    assert ends.error_m() < 1.0 * METRE


@BOTH
def test_of_orders_in_quick_succession_the_last_is_flown(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    for number in range(10):
        ends.order(f"o{number}", east_m=10.0 * number)
    ends.until(lambda: ends.saw(Arrived))
    assert [event.order_id for event in ends.of(Arrived) if isinstance(event, Arrived)] == ["o9"]
    assert len(ends.of(OrderSuperseded)) == 9
    assert ends.error_m() < 1.0 * METRE


@BOTH
def test_hold_stops_the_vehicle_and_a_later_order_moves_it_again(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.order("far", east_m=150.0)
    ends.until(lambda: ends.saw(OrderAccepted, "far"))
    ends.run(5.0)
    ends.vehicle.hold(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    ends.run(10.0)
    stopped_m = np.array(ends.sim.state.position_m)
    ends.run(5.0)
    assert np.linalg.norm(np.array(ends.sim.state.position_m) - stopped_m) < 0.5 * METRE
    assert stopped_m[0] < 140.0
    ends.order("near", east_m=0.0)
    ends.until(lambda: ends.saw(Arrived, "near"))
    assert ends.error_m() < 1.0 * METRE


@BOTH
def test_an_order_ends_when_a_pilot_takes_the_vehicle_over(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.order(east_m=100.0)
    ends.until(lambda: ends.saw(OrderAccepted))
    ends.run(3.0)
    ends.send(CommandLong(target_system=1, target_component=1, command=MavCmd.NAV_RETURN_TO_LAUNCH))
    ends.until(lambda: ends.saw(OrderFailed), within_s=5.0)
    (event,) = ends.of(OrderFailed)
    assert isinstance(event, OrderFailed)
    assert "not ours" in event.reason
    assert ends.vehicle.progress is None


def test_a_vehicle_that_leaves_its_point_has_drifted_and_arrives_again() -> None:
    ends = TwoEnds("px4").ready()
    order = ends.order()
    ends.until(lambda: ends.saw(Arrived))
    elsewhere = LOCAL.to_geodetic(np.array([45.0, 20.0, 25.0]))
    for point in (elsewhere, order.point):
        ends.send(
            CommandInt(
                target_system=1,
                target_component=1,
                command=MavCmd.DO_REPOSITION,
                param1=-1.0,
                param2=1.0,
                param4=math.radians(order.heading_deg),
                x=round(point.lat_deg * 1e7),
                y=round(point.lon_deg * 1e7),
                z=point.altitude_amsl_m,
            )
        )
        ends.run(12.0)
    ends.until(lambda: len(ends.of(Arrived)) == 2)
    assert len(ends.of(Drifted)) == 1


def test_ardupilots_heading_is_sent_until_the_nose_agrees() -> None:
    ends = TwoEnds("ardupilot").ready()
    ends.order(heading_deg=123.0)
    ends.until(lambda: ends.saw(Arrived))
    targets = [frame.message for _, frame in ends.heard if isinstance(frame.message, SetPositionTargetGlobalInt)]
    assert targets
    assert {(target.type_mask, target.coordinate_frame) for target in targets} == {(2552, 5)}
    assert ends.vehicle.state.heading_deg == pytest.approx(123.0, abs=3 * DEGREE)
    before = len(targets)
    ends.run(20.0)
    assert len([frame for _, frame in ends.heard if isinstance(frame.message, SetPositionTargetGlobalInt)]) == before


def test_px4_gets_its_heading_with_the_point_and_nothing_else() -> None:
    ends = TwoEnds("px4").ready()
    ends.order(heading_deg=270.0, speed_mps=3.0)
    ends.until(lambda: ends.saw(Arrived))
    ((_, message),) = ends.sent(MavCmd.DO_REPOSITION)
    assert isinstance(message, CommandInt)
    assert (message.frame, message.param1, message.param2) == (0, 3.0, 1.0)
    assert message.param4 == pytest.approx(-math.pi / 2)
    assert message.z == pytest.approx(525.0, abs=0.01 * METRE)
    assert not [frame for _, frame in ends.heard if isinstance(frame.message, SetPositionTargetGlobalInt)]


def test_ardupilot_gets_its_speed_after_the_point() -> None:
    ends = TwoEnds("ardupilot").ready()
    ends.order(speed_mps=3.0)
    ends.until(lambda: ends.saw(Arrived))
    ((point_at, _),) = ends.sent(MavCmd.DO_REPOSITION)
    ((speed_at, message),) = ends.sent(MavCmd.DO_CHANGE_SPEED)
    assert point_at < speed_at
    assert (message.param1, message.param2) == (1.0, 3.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("heading_deg", math.nan),
        ("heading_deg", -1.0),
        ("speed_mps", 0.0),
        ("up_m", 1e6),
        ("aim", Aim(pan_deg=0.0, tilt_deg=91.0)),
    ],
)
def test_an_order_that_means_no_place_or_direction_is_refused_by_name(field: str, value: object) -> None:
    ends = TwoEnds("px4")
    with pytest.raises(BadInput) as caught:
        ends.order(**{field: value})  # type: ignore[arg-type]
    assert caught.value.field in (field, "point", "point.altitude_amsl_m")
