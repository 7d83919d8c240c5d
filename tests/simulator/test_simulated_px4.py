"""What the recordings do not contain, as far as it is known of PX4 v1.16."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hsop_gcs.link.enums import MavCmd, MavLandedState, MavResult
from hsop_gcs.link.messages import (
    CommandAck,
    CommandLong,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerSetAttitude,
    GimbalManagerSetPitchyaw,
    GimbalManagerStatus,
    GlobalPositionInt,
    Heartbeat,
    MessageInterval,
    ParamRequestList,
    ParamSet,
    ParamValue,
    SetPositionTargetGlobalInt,
    StatusText,
)
from hsop_gcs.simulator.gimbal import pitch_yaw, quaternion
from hsop_gcs.simulator.px4 import Mode
from tests.simulator.station import CONFIG, HOME, OPERATOR, STRANGER, Station, px4

METRE = 1.0
TAKE_CONTROL: dict[str, Any] = {"param1": 255.0, "param2": 190.0, "param3": -1.0, "param4": -1.0}
AIM: dict[str, Any] = {"param1": -20.0, "param2": 30.0, "param3": math.nan, "param4": math.nan, "param5": 12.0}


@pytest.fixture
def hovering() -> Station:
    return px4(replace(CONFIG, airborne_m=20.0, ready_after_s=0.0))


def aim(station: Station) -> tuple[float, float]:
    station.wait(3.0)
    pitch, yaw = pitch_yaw(station.last(GimbalDeviceAttitudeStatus).q)
    return math.degrees(pitch), math.degrees(yaw)


def test_a_vehicle_started_in_the_air_is_armed_and_hovers_where_it_was_put(hovering: Station) -> None:
    hovering.wait(3.0)
    position = hovering.last(GlobalPositionInt)
    assert position.alt * 1e-3 == pytest.approx(HOME.altitude_amsl_m + 20.0, abs=0.1 * METRE)
    assert position.relative_alt * 1e-3 == pytest.approx(20.0, abs=0.1 * METRE)
    assert hovering.last(Heartbeat).base_mode & 128
    assert hovering.last(Heartbeat).custom_mode == Mode.HOLD


def test_an_altitude_above_home_is_taken_as_amsl_and_the_vehicle_lands_and_disarms(hovering: Station) -> None:
    assert hovering.reposition(0.0, 0.0, 0.0, frame=6, z=20.0) == MavResult.ACCEPTED
    hovering.wait(25.0)
    assert hovering.vehicle.state.on_ground
    assert not hovering.vehicle.armed
    assert hovering.texts[-2:] == ["Landing detected\t", "Disarmed by landing\t"]


def test_a_reposition_without_the_flag_is_unsupported_and_flown_all_the_same(hovering: Station) -> None:
    assert hovering.reposition(30.0, 0.0, 20.0, param2=0.0) == MavResult.UNSUPPORTED
    hovering.wait(12.0)
    assert hovering.vehicle.state.position_m == pytest.approx((30.0, 0.0, 20.0), abs=0.3 * METRE)


def test_a_reposition_works_as_command_long_too(hovering: Station) -> None:
    place = hovering.vehicle.local.to_geodetic(np.array([30.0, 10.0, 20.0]))
    where: dict[str, Any] = {
        "param1": -1.0,
        "param2": 1.0,
        "param4": 1.0,
        "param5": place.lat_deg,
        "param6": place.lon_deg,
        "param7": place.altitude_amsl_m,
    }
    assert hovering.command_long(MavCmd.DO_REPOSITION, **where) == MavResult.ACCEPTED
    hovering.wait(12.0)
    # Single precision degrees are good to a metre, which is why COMMAND_INT exists.
    assert hovering.vehicle.state.position_m == pytest.approx((30.0, 10.0, 20.0), abs=1.0 * METRE)
    assert hovering.vehicle.state.heading_rad == pytest.approx(1.0, abs=0.01)


def test_a_nan_altitude_keeps_the_present_one_and_int32_max_the_present_place(hovering: Station) -> None:
    assert hovering.reposition(0.0, 40.0, 0.0, z=math.nan) == MavResult.ACCEPTED
    hovering.wait(12.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 40.0, 20.0), abs=0.3 * METRE)
    unset = 2**31 - 1
    assert hovering.reposition(0.0, 0.0, 30.0, x=unset, y=unset) == MavResult.ACCEPTED
    hovering.wait(10.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 40.0, 30.0), abs=0.3 * METRE)


def test_a_point_outside_the_fence_is_accepted_told_and_not_flown(hovering: Station) -> None:
    fence = ParamSet(target_system=1, target_component=1, param_id="GF_MAX_HOR_DIST", param_value=50.0, param_type=9)
    hovering.send(fence)
    assert hovering.reposition(60.0, 0.0, 20.0) == MavResult.ACCEPTED
    assert "Reposition is outside geofence\t" in hovering.texts
    hovering.wait(10.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.3 * METRE)


def test_a_disarmed_vehicle_accepts_a_reposition_and_stays() -> None:
    station = px4()
    station.wait(3.0)
    assert station.reposition(30.0, 0.0, 20.0) == MavResult.ACCEPTED
    station.wait(5.0)
    assert station.vehicle.state.position_m == (0.0, 0.0, 0.0)


def test_what_is_not_in_its_table_is_unsupported_and_changes_nothing(hovering: Station) -> None:
    hovering.reposition(60.0, 0.0, 20.0)
    assert hovering.command_long(MavCmd.DO_PAUSE_CONTINUE, param1=0.0) == MavResult.UNSUPPORTED
    assert hovering.command_long(MavCmd.CONDITION_YAW, param1=90.0) == MavResult.UNSUPPORTED
    hovering.wait(15.0)
    assert hovering.vehicle.state.position_m == pytest.approx((60.0, 0.0, 20.0), abs=0.3 * METRE)


def test_position_targets_are_silently_ignored_outside_offboard(hovering: Station) -> None:
    target = SetPositionTargetGlobalInt(
        target_system=1,
        target_component=1,
        coordinate_frame=5,
        type_mask=2552,
        lat_int=-353630000,
        lon_int=1491652300,
        alt=604,
    )
    unheard = hovering.vehicle.unheard
    answers = hovering.send(target)
    assert not [answer for answer in answers if isinstance(answer, CommandAck | StatusText)]
    assert hovering.vehicle.unheard == unheard + 1
    hovering.wait(5.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.1 * METRE)


def test_offboard_without_a_stream_of_setpoints_is_acknowledged_early_and_then_refused(hovering: Station) -> None:
    hovering.command_long(MavCmd.DO_SET_MODE, param1=1.0, param2=6.0)
    results = [ack.result for ack in hovering.all(CommandAck) if ack.command == MavCmd.DO_SET_MODE]
    assert results == [MavResult.ACCEPTED, MavResult.TEMPORARILY_REJECTED]
    assert hovering.vehicle.custom_mode() == Mode.HOLD


def test_take_off_altitude_is_amsl_and_without_one_it_is_the_parameter_above_home() -> None:
    for altitude, height_m in ((HOME.altitude_amsl_m + 12.0, 12.0), (math.nan, 2.5)):
        station = px4()
        station.wait(3.0)
        assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.ACCEPTED
        assert station.command_long(MavCmd.NAV_TAKEOFF, param7=altitude) == MavResult.ACCEPTED
        station.wait(1.0)
        assert station.vehicle.landed == MavLandedState.ON_GROUND
        station.wait(14.0)
        assert station.vehicle.state.position_m[2] == pytest.approx(height_m, abs=0.3 * METRE)
        assert station.vehicle.custom_mode() == Mode.HOLD


def test_arming_before_the_estimator_is_ready_is_rejected_for_now() -> None:
    station = px4()
    assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.TEMPORARILY_REJECTED
    assert "".join(station.texts) == "Arming denied: Resolve system health failures first\t"
    station.wait(CONFIG.ready_after_s + 0.1)
    assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.ACCEPTED


def test_a_vehicle_that_stays_on_the_ground_disarms_itself() -> None:
    station = px4()
    station.wait(3.0)
    station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
    station.wait(9.0)
    assert station.vehicle.armed
    station.wait(2.0)
    assert not station.vehicle.armed


def test_disarming_in_the_air_is_refused_unless_forced(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.COMPONENT_ARM_DISARM) == MavResult.TEMPORARILY_REJECTED
    assert hovering.vehicle.armed
    assert hovering.command_long(MavCmd.COMPONENT_ARM_DISARM, param2=21196.0) == MavResult.ACCEPTED
    hovering.wait(15.0)
    assert hovering.vehicle.state.on_ground


def test_the_gimbal_obeys_its_primary_controller_alone(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **AIM) == MavResult.DENIED
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **TAKE_CONTROL) == MavResult.ACCEPTED
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **AIM) == MavResult.ACCEPTED
    assert aim(hovering) == pytest.approx((-20.0, 30.0), abs=0.1)
    elsewhere = AIM | {"param2": -80.0}
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, sender=STRANGER, **elsewhere) == MavResult.DENIED
    assert aim(hovering) == pytest.approx((-20.0, 30.0), abs=0.1)


def test_taking_control_for_me_gives_it_to_the_autopilot(hovering: Station) -> None:
    for_me = TAKE_CONTROL | {"param1": -2.0, "param2": -2.0}
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **for_me) == MavResult.ACCEPTED
    hovering.wait(2.1)
    status = hovering.last(GimbalManagerStatus)
    assert (status.primary_control_sysid, status.primary_control_compid) == (1, 1)
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **AIM) == MavResult.DENIED


def test_gimbal_orders_as_command_int_lose_their_flags(hovering: Station) -> None:
    hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **TAKE_CONTROL)
    order: dict[str, Any] = {"param1": -20.0, "param2": 30.0, "param3": math.nan, "param4": math.nan, "x": 28}
    assert hovering.command_int(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **order) == MavResult.ACCEPTED
    hovering.wait(2.0)
    assert hovering.last(GimbalDeviceAttitudeStatus).flags == 0


def test_set_attitude_is_obeyed_from_the_controller_alone_and_set_pitchyaw_from_nobody(hovering: Station) -> None:
    hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **TAKE_CONTROL)
    q = quaternion(pitch_rad=math.radians(-15), yaw_rad=math.radians(60))
    rates: dict[str, Any] = dict.fromkeys(("angular_velocity_x", "angular_velocity_y", "angular_velocity_z"), math.nan)
    set_attitude = GimbalManagerSetAttitude(target_system=1, target_component=1, flags=12, q=q, **rates)
    set_pitchyaw = GimbalManagerSetPitchyaw(target_system=1, target_component=1, flags=12, pitch=0.3, yaw=1.0)
    hovering.send(set_attitude, STRANGER)
    hovering.send(set_pitchyaw, OPERATOR)
    assert aim(hovering) == pytest.approx((0.0, 0.0), abs=0.1)
    hovering.send(set_attitude, OPERATOR)
    assert aim(hovering) == pytest.approx((-15.0, 60.0), abs=0.1)


def test_gimbal_limits_are_told_in_degrees_twice_as_far_as_it_turns_and_the_device_tells_nothing(
    hovering: Station,
) -> None:
    assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=280.0) == MavResult.ACCEPTED
    told = hovering.last(GimbalManagerInformation)
    assert (told.pitch_min, told.pitch_max, told.yaw_min, told.yaw_max) == pytest.approx((-180, 180, -360, 360))
    assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=283.0) == MavResult.DENIED


def test_a_region_of_interest_is_looked_at_without_control_and_its_altitude_is_amsl(hovering: Station) -> None:
    place = hovering.vehicle.local.to_geodetic(np.array([20.0, 0.0, 20.0]))
    fields: dict[str, Any] = {
        "x": round(place.lat_deg * 1e7),
        "y": round(place.lon_deg * 1e7),
        "z": place.altitude_amsl_m,
        "frame": 3,
    }
    assert hovering.command_int(MavCmd.DO_SET_ROI_LOCATION, **fields) == MavResult.ACCEPTED
    assert aim(hovering) == pytest.approx((0.0, 90.0), abs=0.5)
    hovering.reposition(20.0, -20.0, 20.0)
    hovering.wait(12.0)
    assert aim(hovering) == pytest.approx((0.0, 0.0), abs=1.0)


def test_returning_takes_the_gimbal_levels_it_and_lets_go(hovering: Station) -> None:
    hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, **TAKE_CONTROL)
    hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **AIM)
    hovering.wait(3.0)
    assert hovering.command_long(MavCmd.NAV_RETURN_TO_LAUNCH) == MavResult.ACCEPTED
    assert [order.command for order in hovering.all(CommandLong)] == [1001, 1000, 1001]
    assert aim(hovering) == pytest.approx((0.0, 0.0), abs=0.1)
    assert hovering.last(GimbalManagerStatus).primary_control_sysid == 0


def test_orders_to_another_system_or_component_are_not_heard(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.NAV_LAND, target_system=2) is None
    assert hovering.command_long(MavCmd.NAV_LAND, target_component=154) is None
    assert hovering.vehicle.custom_mode() == Mode.HOLD


def test_a_stream_can_be_set_stopped_and_reset() -> None:
    station = px4()

    def rate_hz() -> float:
        before = len(station.all(GlobalPositionInt))
        station.wait(4.0)
        return (len(station.all(GlobalPositionInt)) - before) / 4.0

    assert rate_hz() == pytest.approx(50.0, abs=1.0)
    for interval_us, expected_hz in ((200_000.0, 5.0), (-1.0, 0.0), (0.0, 50.0)):
        assert station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=33.0, param2=interval_us) == MavResult.ACCEPTED
        assert rate_hz() == pytest.approx(expected_hz, abs=1.0)
    assert station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=259.0, param2=1e6) == MavResult.FAILED


def test_integer_parameters_travel_as_bits() -> None:
    station = px4(replace(CONFIG, system=9))
    station.send(ParamRequestList(target_system=9, target_component=1))
    listed = {value.param_id: value for value in station.all(ParamValue)}
    assert len(listed) == station.last(ParamValue).param_count
    raw = np.array([listed["MAV_SYS_ID"].param_value], dtype=np.float32)
    assert raw.view(np.int32)[0] == 9


def test_an_interval_that_is_unknown_is_told_as_off_and_cannot_be_set(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.GET_MESSAGE_INTERVAL, param1=9999.0) == MavResult.ACCEPTED
    assert hovering.last(MessageInterval) == MessageInterval(message_id=9999, interval_us=-1)
    assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=244.0, param2=33.0) == MavResult.ACCEPTED
    assert hovering.last(MessageInterval) == MessageInterval(message_id=33, interval_us=20000)
    for message_id, more in ((9999.0, 0.0), (0.0, 0.0), (33.0, 1.0)):
        result = hovering.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=message_id, param2=1e6, param3=more)
        assert result == MavResult.FAILED
    assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=9999.0) == MavResult.DENIED


@pytest.mark.parametrize(("system", "component"), [(1, 154), (1, 100), (0, 0), (0, 1), (2, 1)])
def test_a_command_to_another_component_or_to_everybody_is_ignored_in_silence(
    hovering: Station, system: int, component: int
) -> None:
    targets: dict[str, Any] = {"target_system": system, "target_component": component}
    assert hovering.command_long(MavCmd.NAV_LAND, **targets) is None
    assert hovering.vehicle.custom_mode() == Mode.HOLD
    told = hovering.command_long(MavCmd.REQUEST_AUTOPILOT_CAPABILITIES, **targets)
    assert told == (None if system == 2 else MavResult.ACCEPTED)


def test_a_point_above_the_fence_is_accepted_told_and_not_flown(hovering: Station) -> None:
    hovering.send(
        ParamSet(target_system=1, target_component=1, param_id="GF_MAX_VER_DIST", param_value=40.0, param_type=9)
    )
    assert hovering.reposition(0.0, 0.0, 41.0) == MavResult.ACCEPTED
    assert "Reposition is outside geofence\t" in hovering.texts
    hovering.wait(10.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.3 * METRE)


def stopped(hovering: Station, *, at_speed_mps: float) -> tuple[float, float]:
    """How far a vehicle flies that is told to stop, and how far of that it comes back, metres."""
    hovering.reposition(200.0, 0.0, 20.0)
    while hovering.vehicle.state.ground_speed_mps < at_speed_mps:
        hovering.wait(0.02)
    here_m = hovering.vehicle.state.position_m[0]
    nan = math.nan
    hovering.command_long(MavCmd.DO_REPOSITION, param2=1.0, param4=nan, param5=nan, param6=nan, param7=nan)
    way_m = []
    for _ in range(150):
        hovering.wait(0.1)
        way_m.append(hovering.vehicle.state.position_m[0] - here_m)
    return max(way_m), max(way_m) - way_m[-1]


def test_a_stop_at_speed_takes_as_far_as_the_real_one_takes_and_comes_back_a_little(hovering: Station) -> None:
    """Measured with 1.17.0: 17.3 m at 7.5 m/s, 2.4 of them back."""
    far_m, back_m = stopped(hovering, at_speed_mps=7.9)
    assert 15.0 < far_m < 20.0
    assert 1.0 < back_m < 4.0


def test_a_stop_while_it_gathers_speed_overshoots_and_comes_back_far(hovering: Station) -> None:
    _, back_m = stopped(hovering, at_speed_mps=4.0)
    assert back_m > 5.0


def test_a_take_off_is_as_slow_as_the_real_one() -> None:
    """Measured with 1.17.0: 16 s to 15 m."""
    station = px4()
    station.wait(3.0)
    station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
    station.command_long(MavCmd.NAV_TAKEOFF, param4=math.nan, param5=math.nan, param6=math.nan, param7=599.0)
    station.wait(9.0)
    assert station.vehicle.state.position_m[2] < 12.0
    station.wait(7.0)
    assert station.vehicle.state.position_m[2] == pytest.approx(15.0, abs=0.5 * METRE)
