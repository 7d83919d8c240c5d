"""What the recordings do not contain, as far as it is known of ArduPilot Copter 4.7."""

import math
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
import pytest

from hsop_gcs.link.enums import MavCmd, MavLandedState, MavResult
from hsop_gcs.link.messages import (
    AutopilotVersion,
    CommandAck,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerSetAttitude,
    GimbalManagerSetPitchyaw,
    GimbalManagerStatus,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    Message,
    MessageInterval,
    MissionCount,
    MissionRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    PositionTargetGlobalInt,
    RequestDataStream,
    SetMode,
    SetPositionTargetGlobalInt,
    Timesync,
)
from hsop_gcs.simulator.ardupilot_modes import Mode
from hsop_gcs.simulator.gimbal import GimbalLimits, pitch_yaw, quaternion
from tests.simulator.station import CONFIG, HOME, OPERATOR, STRANGER, Station, ardupilot

METRE = 1.0
SERVO = GimbalLimits(
    pitch_min_rad=math.radians(-90),
    pitch_max_rad=math.radians(45),
    yaw_min_rad=math.radians(-170),
    yaw_max_rad=math.radians(170),
)
AIM: dict[str, Any] = {"param1": -20.0, "param2": 30.0, "param3": math.nan, "param4": math.nan, "param5": 12.0}


@pytest.fixture
def hovering() -> Station:
    return ardupilot(replace(CONFIG, airborne_m=20.0, ready_after_s=0.0, gimbal=SERVO))


def position_target(station: Station, east_m: float, north_m: float, up_m: float, **fields: Any) -> Message:
    place = station.vehicle.local.to_geodetic(np.array([east_m, north_m, up_m]))
    target = SetPositionTargetGlobalInt(
        target_system=1,
        target_component=1,
        coordinate_frame=5,
        type_mask=2552,
        lat_int=round(place.lat_deg * 1e7),
        lon_int=round(place.lon_deg * 1e7),
        alt=place.altitude_amsl_m,
    )
    return replace(target, **fields)


def set_parameter(station: Station, name: str, value: float) -> None:
    station.send(ParamSet(target_system=1, target_component=1, param_id=name, param_value=value))
    assert station.last(ParamValue).param_value == value


def aim(station: Station) -> tuple[float, float]:
    station.wait(3.0)
    assert station.command_long(MavCmd.REQUEST_MESSAGE, param1=285.0) == MavResult.ACCEPTED
    pitch, yaw = pitch_yaw(station.last(GimbalDeviceAttitudeStatus).q)
    return math.degrees(pitch), math.degrees(yaw)


def test_a_fresh_link_carries_only_heartbeats_and_timesync() -> None:
    station = ardupilot(replace(CONFIG, ready_after_s=100.0))
    station.wait(6.0)
    assert {type(message) for _, message in station.heard} == {Heartbeat, Timesync}


def test_after_power_up_there_is_no_position_first_and_no_home_for_longer() -> None:
    station = ardupilot(replace(CONFIG, ready_after_s=10.0))
    known = []
    for _ in range(10):
        for kind in (GlobalPositionInt, HomePosition):
            assert station.command_long(MavCmd.REQUEST_MESSAGE, param1=float(kind.ID)) == MavResult.ACCEPTED
        known.append((station.last(GlobalPositionInt).lat != 0, bool(station.all(HomePosition))))
        station.wait(1.0)
    assert known == [(False, False)] * 2 + [(True, False)] * 3 + [(True, True)] * 5


def test_arming_fails_with_a_text_until_the_estimator_has_a_position() -> None:
    station = ardupilot()
    station.command_long(MavCmd.DO_SET_MODE, param1=1.0, param2=4.0)
    assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.FAILED
    assert station.texts == ["Arm: Need Position Estimate"]
    station.wait(CONFIG.ready_after_s + 0.1)
    assert station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.ACCEPTED


def test_take_off_needs_guided_armed_and_an_altitude_above_home() -> None:
    station = ardupilot()
    station.wait(3.0)
    take_off: dict[str, Any] = {"z": 10.0}
    assert station.command_long(MavCmd.NAV_TAKEOFF, param7=10.0) == MavResult.FAILED
    station.command_long(MavCmd.DO_SET_MODE, param1=1.0, param2=4.0)
    assert station.command_long(MavCmd.NAV_TAKEOFF, param7=10.0) == MavResult.FAILED
    station.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
    assert station.command_int(MavCmd.NAV_TAKEOFF, frame=0, **take_off) == MavResult.DENIED
    assert station.command_int(MavCmd.NAV_TAKEOFF, frame=3, **take_off) == MavResult.ACCEPTED
    station.wait(12.0)
    assert station.vehicle.state.position_m[2] == pytest.approx(10.0, abs=0.3 * METRE)
    assert station.command_long(MavCmd.NAV_TAKEOFF, param7=30.0) == MavResult.FAILED


def test_a_reposition_honours_its_frame_and_ignores_yaw_and_speed(hovering: Station) -> None:
    for frame, up_m, z in ((0, 30.0, HOME.altitude_amsl_m + 30.0), (6, 24.0, 24.0), (3, 28.0, 28.0), (5, 22.0, 606.0)):
        assert hovering.reposition(0.0, 0.0, up_m, frame=frame, z=z, param4=2.0, param1=1.0) == MavResult.ACCEPTED
        hovering.wait(9.0)
        assert hovering.vehicle.state.position_m[2] == pytest.approx(up_m, abs=0.3 * METRE)
    assert hovering.vehicle.state.heading_rad == 0.0


def test_the_nose_turns_to_the_next_point_unless_told_never_to(hovering: Station) -> None:
    hovering.reposition(40.0, 0.0, 20.0, param4=0.0)
    hovering.wait(12.0)
    assert math.degrees(hovering.vehicle.state.heading_rad) == pytest.approx(90.0, abs=1.0)
    set_parameter(hovering, "WP_YAW_BEHAVIOR", 0)
    hovering.reposition(0.0, 0.0, 20.0, param4=0.0)
    hovering.wait(12.0)
    assert math.degrees(hovering.vehicle.state.heading_rad) == pytest.approx(90.0, abs=1.0)


def test_a_reposition_outside_guided_needs_the_flag_and_then_changes_the_mode_even_disarmed() -> None:
    station = ardupilot()
    station.wait(3.0)
    assert station.reposition(10.0, 0.0, 20.0, param2=0.0) == MavResult.DENIED
    assert station.vehicle.custom_mode() == Mode.STABILIZE
    assert station.reposition(10.0, 0.0, 20.0) == MavResult.ACCEPTED
    assert station.last(Heartbeat).custom_mode == Mode.GUIDED
    assert station.vehicle.state.position_m == (0.0, 0.0, 0.0)


def test_a_reposition_as_command_long_is_unsupported(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.DO_REPOSITION, param1=-1.0, param2=1.0, param7=600.0) == MavResult.UNSUPPORTED


@pytest.mark.parametrize(
    "bad", [{"x": 950000000}, {"x": 2**31 - 1}, {"y": 2**31 - 1}, {"frame": 1}, {"frame": 8}, {"z": math.nan}]
)
def test_a_reposition_to_no_place_is_denied_and_not_flown(hovering: Station, bad: dict[str, Any]) -> None:
    assert hovering.reposition(30.0, 0.0, 20.0, **bad) == MavResult.DENIED
    hovering.wait(3.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.1 * METRE)


def test_a_reposition_outside_the_fence_fails(hovering: Station) -> None:
    set_parameter(hovering, "FENCE_RADIUS", 50.0)
    assert hovering.reposition(60.0, 0.0, 20.0) == MavResult.ACCEPTED
    hovering.reposition(0.0, 0.0, 20.0)
    set_parameter(hovering, "FENCE_ENABLE", 1)
    assert hovering.reposition(60.0, 0.0, 20.0) == MavResult.FAILED
    hovering.wait(5.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.3 * METRE)


def test_a_position_target_sets_place_and_yaw_without_an_answer_and_is_echoed(hovering: Station) -> None:
    hovering.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=87.0, param2=500000.0)
    answers = hovering.send(position_target(hovering, 20.0, 10.0, 25.0, yaw=1.2))
    assert not [answer for answer in answers if isinstance(answer, CommandAck)]
    hovering.wait(9.0)
    assert hovering.vehicle.state.position_m == pytest.approx((20.0, 10.0, 25.0), abs=0.3 * METRE)
    assert hovering.vehicle.state.heading_rad == pytest.approx(1.2, abs=0.01)
    echo = hovering.last(PositionTargetGlobalInt)
    assert (echo.coordinate_frame, echo.type_mask) == (0, 65016)
    assert echo.alt == pytest.approx(HOME.altitude_amsl_m + 25.0, abs=0.01 * METRE)


PARTIAL, VELOCITY_ONLY = {"type_mask": 2552 | 4}, {"type_mask": 3527}


@pytest.mark.parametrize("bad", [PARTIAL, VELOCITY_ONLY, {"coordinate_frame": 1}, {"lat_int": 950000000}])
def test_an_invalid_position_target_stops_the_vehicle(hovering: Station, bad: dict[str, Any]) -> None:
    hovering.reposition(200.0, 0.0, 20.0)
    hovering.wait(5.0)
    assert hovering.vehicle.state.ground_speed_mps > 7.0
    hovering.send(position_target(hovering, 300.0, 0.0, 20.0, **bad))
    hovering.wait(8.0)
    assert hovering.vehicle.state.ground_speed_mps < 0.1
    assert hovering.vehicle.state.position_m[0] < 60.0


def test_a_position_target_outside_guided_is_ignored(hovering: Station) -> None:
    hovering.command_long(MavCmd.NAV_LOITER_UNLIM)
    hovering.send(position_target(hovering, 50.0, 0.0, 20.0))
    hovering.wait(5.0)
    assert hovering.vehicle.state.position_m == pytest.approx((0.0, 0.0, 20.0), abs=0.1 * METRE)


def test_pause_holds_and_continue_goes_on(hovering: Station) -> None:
    hovering.reposition(60.0, 0.0, 20.0)
    hovering.wait(3.0)
    assert hovering.command_long(MavCmd.DO_PAUSE_CONTINUE, param1=0.0) == MavResult.ACCEPTED
    hovering.wait(8.0)
    assert hovering.vehicle.state.ground_speed_mps < 0.1
    assert hovering.vehicle.state.position_m[0] < 35.0
    assert hovering.command_long(MavCmd.DO_PAUSE_CONTINUE, param1=1.0) == MavResult.ACCEPTED
    hovering.wait(12.0)
    assert hovering.vehicle.state.position_m[0] == pytest.approx(60.0, abs=0.3 * METRE)


def test_condition_yaw_turns_the_nose_absolutely_or_by_an_angle(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.CONDITION_YAW, param1=90.0) == MavResult.ACCEPTED
    hovering.wait(4.0)
    assert math.degrees(hovering.vehicle.state.heading_rad) == pytest.approx(90.0, abs=0.5)
    assert hovering.command_long(MavCmd.CONDITION_YAW, param1=30.0, param3=-1.0, param4=1.0) == MavResult.ACCEPTED
    hovering.wait(4.0)
    assert math.degrees(hovering.vehicle.state.heading_rad) == pytest.approx(60.0, abs=0.5)
    assert hovering.command_long(MavCmd.CONDITION_YAW, param1=400.0) == MavResult.FAILED


def test_change_speed_holds_for_the_legs_to_come(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.DO_CHANGE_SPEED, param1=1.0, param2=3.0) == MavResult.ACCEPTED
    assert hovering.command_long(MavCmd.DO_CHANGE_SPEED, param1=1.0, param2=-1.0) == MavResult.FAILED
    hovering.reposition(60.0, 0.0, 20.0)
    hovering.wait(5.0)
    assert hovering.vehicle.state.ground_speed_mps == pytest.approx(3.0, abs=0.01)


def test_landing_ends_disarmed_on_the_ground(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.NAV_LAND) == MavResult.ACCEPTED
    hovering.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=245.0, param2=100000.0)
    hovering.wait(20.0)
    states = [state for state, _ in groupby(message.landed_state for message in hovering.all(ExtendedSysState))]
    assert states == [MavLandedState.LANDING, MavLandedState.ON_GROUND]
    assert not hovering.vehicle.armed
    assert hovering.command_long(MavCmd.COMPONENT_ARM_DISARM, param1=1.0) == MavResult.FAILED


def test_a_requested_message_follows_its_acknowledgement(hovering: Station) -> None:
    hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=148.0)
    kinds = [type(message) for _, message in hovering.heard if isinstance(message, CommandAck | AutopilotVersion)]
    assert kinds == [CommandAck, AutopilotVersion]
    for message_id, result in ((259.0, MavResult.ACCEPTED), (283.0, MavResult.FAILED), (9999.0, MavResult.FAILED)):
        assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=message_id) == result


def test_an_unknown_message_has_no_interval_and_the_vehicle_says_so(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=9999.0, param2=1e6) == MavResult.DENIED
    assert "No ap_message for mavlink id (9999)" in hovering.texts
    assert hovering.command_long(MavCmd.GET_MESSAGE_INTERVAL, param1=9999.0) == MavResult.FAILED
    assert hovering.last(MessageInterval) == MessageInterval(message_id=9999, interval_us=0)
    assert hovering.command_long(MavCmd.REQUEST_MESSAGE, param1=244.0, param2=33.0) == MavResult.ACCEPTED
    assert hovering.last(MessageInterval) == MessageInterval(message_id=33, interval_us=-1)
    for interval_us, more in ((-2.0, 0.0), (1e6, 1.0)):
        result = hovering.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=33.0, param2=interval_us, param3=more)
        assert result == MavResult.DENIED


@pytest.mark.parametrize(("system", "component"), [(1, 154), (1, 100), (0, 0), (0, 1)])
def test_a_command_to_a_component_that_is_not_there_is_carried_out_by_the_autopilot(
    hovering: Station, system: int, component: int
) -> None:
    targets: dict[str, Any] = {"target_system": system, "target_component": component}
    assert hovering.command_long(MavCmd.NAV_LAND, **targets) == MavResult.ACCEPTED
    assert hovering.command_long(MavCmd.NAV_LAND, target_system=2) is None


@pytest.mark.parametrize(("name", "value", "up_m"), [("FENCE_ALT_MAX", 40.0, 41.0), ("FENCE_ALT_MIN", 15.0, 14.0)])
def test_a_point_above_or_below_the_fence_is_refused_if_that_kind_of_fence_counts(
    hovering: Station, name: str, value: float, up_m: float
) -> None:
    def set_to(name: str, value: float) -> None:
        hovering.send(ParamSet(target_system=1, target_component=1, param_id=name, param_value=value))

    set_to(name, value)
    assert hovering.reposition(0.0, 0.0, up_m) == MavResult.ACCEPTED
    set_to("FENCE_ENABLE", 1.0)
    set_to("FENCE_TYPE", 1.0 + 8.0)
    assert hovering.reposition(0.0, 0.0, up_m) == MavResult.FAILED
    set_to("FENCE_TYPE", 2.0)
    assert hovering.reposition(0.0, 0.0, up_m) == MavResult.ACCEPTED


def test_a_stop_at_speed_takes_as_far_as_the_real_one_takes_and_ends_there(hovering: Station) -> None:
    """Measured with 4.7.0-dev: Brake at 7.8 m/s takes 15.7 m."""
    hovering.reposition(200.0, 0.0, 20.0)
    hovering.wait(8.0)
    here_m = hovering.vehicle.state.position_m[0]
    hovering.command_long(MavCmd.DO_SET_MODE, param1=1.0, param2=17.0)
    way_m = []
    for _ in range(100):
        hovering.wait(0.1)
        way_m.append(hovering.vehicle.state.position_m[0] - here_m)
    assert 13.0 < max(way_m) < 18.0
    assert max(way_m) - way_m[-1] < 0.5


def test_the_old_set_mode_is_acknowledged_under_its_message_id(hovering: Station) -> None:
    hovering.send(SetMode(target_system=1, base_mode=1, custom_mode=Mode.LOITER))
    ack = hovering.last(CommandAck)
    assert (ack.command, ack.result) == (SetMode.ID, MavResult.ACCEPTED)
    assert hovering.last(Heartbeat).custom_mode == Mode.LOITER


def test_data_streams_start_and_stop_groups_of_messages() -> None:
    station = ardupilot()
    everything = RequestDataStream(target_system=1, target_component=1, req_message_rate=5, start_stop=1)
    station.send(everything)
    station.wait(2.0)
    assert len(station.all(GlobalPositionInt)) == pytest.approx(10, abs=1)
    station.send(replace(everything, start_stop=0))
    before = len(station.heard)
    station.wait(1.5)
    assert {type(message) for _, message in station.heard[before:]} == {Heartbeat}


def test_anybody_may_steer_the_gimbal_and_the_owner_is_only_told(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, sender=STRANGER, **AIM) == MavResult.ACCEPTED
    assert aim(hovering) == pytest.approx((-20.0, 30.0), abs=0.1)
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, param1=-2.0, param2=-2.0) == MavResult.ACCEPTED
    status = hovering.last(GimbalManagerStatus)
    assert (status.primary_control_sysid, status.primary_control_compid) == OPERATOR
    order: dict[str, Any] = {"param1": 10.0, "param2": -40.0, "param3": math.nan, "param4": math.nan, "x": 12}
    assert hovering.command_int(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, sender=STRANGER, **order) == MavResult.ACCEPTED
    assert aim(hovering) == pytest.approx((10.0, -40.0), abs=0.1)


def test_gimbal_attitude_is_always_against_the_nose_and_its_flags_say_so(hovering: Station) -> None:
    hovering.command_long(MavCmd.CONDITION_YAW, param1=50.0)
    hovering.wait(3.0)
    for flags, expected_flags, expected_yaw in ((16.0, 60, -20.0), (0.0, 44, 30.0), (64.0, 44, 30.0)):
        hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **(AIM | {"param5": flags}))
        assert aim(hovering) == pytest.approx((-20.0, expected_yaw), abs=0.1)
        assert hovering.last(GimbalDeviceAttitudeStatus).flags == expected_flags


def test_an_angle_beyond_the_range_is_accepted_and_clamped_and_an_absent_gimbal_fails(hovering: Station) -> None:
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **(AIM | {"param1": -120.0})) == MavResult.ACCEPTED
    assert aim(hovering)[0] == pytest.approx(-90.0, abs=0.1)
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **(AIM | {"param7": 2.0})) == MavResult.FAILED
    half = AIM | {"param1": math.nan}
    assert hovering.command_long(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, **half) == MavResult.FAILED


def test_both_streaming_gimbal_messages_steer(hovering: Station) -> None:
    hovering.send(
        GimbalManagerSetPitchyaw(
            target_system=1, target_component=1, flags=12, pitch=0.2, yaw=0.5, pitch_rate=math.nan, yaw_rate=math.nan
        )
    )
    assert aim(hovering) == pytest.approx((math.degrees(0.2), math.degrees(0.5)), abs=0.1)
    q = quaternion(pitch_rad=-0.3, yaw_rad=-0.6)
    hovering.send(GimbalManagerSetAttitude(target_system=1, target_component=1, flags=12, q=q))
    assert aim(hovering) == pytest.approx((math.degrees(-0.3), math.degrees(-0.6)), abs=0.1)


def test_a_region_of_interest_is_kept_in_view_in_the_frame_it_was_given(hovering: Station) -> None:
    place = hovering.vehicle.local.to_geodetic(np.array([20.0, 0.0, 0.0]))
    fields: dict[str, Any] = {"x": round(place.lat_deg * 1e7), "y": round(place.lon_deg * 1e7)}
    for frame, z in ((3, 20.0), (0, HOME.altitude_amsl_m + 20.0)):
        assert hovering.command_int(MavCmd.DO_SET_ROI_LOCATION, frame=frame, z=z, **fields) == MavResult.ACCEPTED
        assert aim(hovering) == pytest.approx((0.0, 90.0), abs=0.5)
        assert hovering.command_long(MavCmd.DO_SET_ROI_NONE) == MavResult.ACCEPTED
        assert aim(hovering) == pytest.approx((-22.5, 0.0), abs=0.1)


def test_parameters_and_the_empty_mission_content_a_ground_station() -> None:
    station = ardupilot()
    station.send(ParamRequestRead(target_system=1, target_component=1, param_id="RTL_ALT", param_index=-1))
    assert (station.last(ParamValue).param_id, station.last(ParamValue).param_value) == ("RTL_ALT", 1500.0)
    before = len(station.heard)
    station.send(ParamRequestRead(target_system=1, target_component=1, param_id="NO_SUCH", param_index=-1))
    assert len(station.heard) == before
    station.send(MissionRequestList(target_system=1, target_component=1), STRANGER)
    count = station.last(MissionCount)
    assert (count.count, count.target_system) == (0, STRANGER[0])
