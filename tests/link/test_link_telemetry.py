"""What is known of a vehicle, from single messages and from recordings of real autopilots."""

import math
from pathlib import Path

import pytest

from hsop_gcs.geometry.frames import Aim, GeodeticPoint
from hsop_gcs.link.adapters import ARDUPILOT, PX4, adapter_for
from hsop_gcs.link.enums import GimbalFlags, MavAutopilot, MavLandedState, MavModeFlag, MavType
from hsop_gcs.link.events import Event, ModeChanged, StatusTextReceived
from hsop_gcs.link.messages import (
    Attitude,
    BatteryStatus,
    CommandLong,
    EkfStatusReport,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    StatusText,
    SysStatus,
)
from hsop_gcs.link.protocol.gimbal import separation_deg
from hsop_gcs.link.protocol.telemetry import Telemetry, VehicleState, gimbal_aim
from hsop_gcs.link.tlog import read_tlog

DATA = Path(__file__).parent.parent / "data"
DEGREE = 1.0
METRE = 1.0
E7_DEGREE = 1e-7


def rotation(yaw_deg: float, pitch_deg: float) -> tuple[float, ...]:
    """Quaternion (w, x, y, z) of a turn to the right and then a tilt up."""
    yaw, pitch = math.radians(yaw_deg) / 2, math.radians(pitch_deg) / 2
    return (
        math.cos(yaw) * math.cos(pitch),
        -math.sin(yaw) * math.sin(pitch),
        math.cos(yaw) * math.sin(pitch),
        math.sin(yaw) * math.cos(pitch),
    )


def test_nothing_heard_is_nothing_known() -> None:
    assert Telemetry(1).state == VehicleState(system=1)
    assert VehicleState(system=1).battery_percent is None


def test_latitude_and_longitude_zero_are_unknown() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(GlobalPositionInt(lat=500000000, lon=80000000, alt=100000), 0.0)
    telemetry.receive(GlobalPositionInt(lat=0, lon=0, alt=100000), 1.0)
    telemetry.receive(HomePosition(), 1.0)
    assert telemetry.state.position is None
    assert telemetry.state.home is None


def dated(times: list[tuple[float, float]]) -> list[float]:
    """When attitudes were sent as the telemetry has it, from the vehicle's clock and the arrival of each, seconds."""
    telemetry, heard = Telemetry(1), []
    for sent_s, arrived_s in times:
        telemetry.receive(Attitude(time_boot_ms=round(sent_s * 1e3)), arrived_s)
        assert telemetry.state.attitude_heard_s is not None
        heard.append(telemetry.state.attitude_heard_s)
    return heard


def test_a_message_that_waited_is_dated_by_the_vehicle_s_clock() -> None:
    arrivals = [(10.0, 110.1), (10.5, 110.5), (11.0, 111.9), (11.5, 111.9), (12.0, 112.0)]
    assert dated(arrivals) == pytest.approx([110.1, 110.5, 111.0, 111.5, 112.0])


def test_a_vehicle_whose_clock_runs_slow_stays_fresh() -> None:
    """As a simulated one's does that is short of processor time."""
    arrivals = [(0.1 * n * 0.7, 100 + 0.1 * n) for n in range(1, 400)]
    ages_s = [arrived_s - heard_s for (_, arrived_s), heard_s in zip(arrivals, dated(arrivals), strict=True)]
    assert max(ages_s) < 0.7


def test_a_vehicle_that_restarts_is_dated_by_its_new_clock() -> None:
    assert dated([(500.0, 100.0), (500.5, 100.5), (2.0, 110.0), (2.5, 110.5)])[2:] == [110.0, 110.5]


def test_integers_of_the_wire_become_degrees_metres_and_east_north_up() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(
        GlobalPositionInt(
            lat=-353632610, lon=1491652299, alt=584090, relative_alt=-5, vx=100, vy=-200, vz=50, hdg=27700
        ),
        3.0,
    )
    state = telemetry.state
    assert state.position is not None
    assert state.position.lat_deg == pytest.approx(-35.3632610, abs=E7_DEGREE)
    assert state.position.lon_deg == pytest.approx(149.1652299, abs=E7_DEGREE)
    assert state.position.altitude_amsl_m == pytest.approx(584.09, abs=0.001 * METRE)
    assert state.altitude_above_home_m == pytest.approx(-0.005, abs=0.0001 * METRE)
    assert state.velocity_enu_mps == pytest.approx((-2.0, 1.0, -0.5))
    assert state.heading_deg == pytest.approx(277.0, abs=0.01 * DEGREE)
    assert state.position_heard_s == 3.0


def test_the_attitude_is_believed_more_than_the_heading_of_a_position() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(Attitude(yaw=-0.5 * math.pi, roll=0.1, pitch=-0.2), 0.0)
    telemetry.receive(GlobalPositionInt(lat=1, lon=1, hdg=1000), 0.1)
    assert telemetry.state.heading_deg == pytest.approx(270.0, abs=0.01 * DEGREE)
    assert telemetry.state.roll_deg == pytest.approx(math.degrees(0.1))
    assert telemetry.state.pitch_deg == pytest.approx(math.degrees(-0.2))


def test_an_unknown_heading_stays_unknown() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(GlobalPositionInt(lat=1, lon=1, hdg=65535), 0.1)
    assert telemetry.state.heading_deg is None


@pytest.mark.parametrize(
    ("landed_state", "in_air"),
    [
        (MavLandedState.UNDEFINED, None),
        (MavLandedState.ON_GROUND, False),
        (MavLandedState.TAKEOFF, True),
        (MavLandedState.IN_AIR, True),
        (MavLandedState.LANDING, True),
    ],
)
def test_a_vehicle_that_takes_off_or_lands_is_in_the_air(landed_state: int, in_air: bool | None) -> None:
    telemetry = Telemetry(1)
    telemetry.receive(ExtendedSysState(landed_state=landed_state), 0.0)
    assert telemetry.state.in_air is in_air


def test_the_heartbeat_tells_autopilot_mode_and_arming() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4, custom_mode=50593792), 0.0)
    assert (telemetry.state.autopilot, telemetry.state.mode, telemetry.state.armed) == ("px4", "Hold", False)
    telemetry.receive(
        Heartbeat(
            type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4, custom_mode=84148224, base_mode=MavModeFlag.SAFETY_ARMED
        ),
        1.0,
    )
    assert telemetry.state.armed is True
    assert telemetry.take_events() == [ModeChanged(system=1, before="Hold", after="Return")]


def test_an_autopilot_we_do_not_know_has_no_adapter() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.GENERIC, custom_mode=4), 0.0)
    assert (telemetry.state.autopilot, telemetry.adapter) == ("other", None)
    assert adapter_for(MavAutopilot.PX4, MavType.QUADROTOR) is PX4
    assert adapter_for(MavAutopilot.ARDUPILOTMEGA, MavType.HEXAROTOR) is ARDUPILOT


def test_a_battery_that_says_minus_one_says_nothing() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(SysStatus(battery_remaining=-1), 0.0)
    assert telemetry.state.battery_percent is None
    telemetry.receive(BatteryStatus(battery_remaining=80), 0.0)
    telemetry.receive(SysStatus(battery_remaining=-1), 0.0)
    assert telemetry.state.battery_percent == 80.0


@pytest.mark.parametrize(
    ("flags", "landed_state", "healthy"),
    [
        (895, MavLandedState.IN_AIR, True),
        (1023, MavLandedState.ON_GROUND, True),
        (1023, MavLandedState.IN_AIR, False),
        (167, MavLandedState.ON_GROUND, False),
    ],
    ids=["flying", "px4 at rest", "holding a position it made up", "ardupilot without satellites"],
)
def test_a_constant_position_is_no_fault_of_an_estimator_that_rests_on_the_ground(
    flags: int, landed_state: MavLandedState, healthy: bool
) -> None:
    telemetry = Telemetry(1)
    telemetry.receive(ExtendedSysState(landed_state=landed_state), 0.0)
    telemetry.receive(EkfStatusReport(flags=flags), 0.0)
    assert telemetry.state.estimator_healthy is healthy


def test_what_another_component_says_of_itself_is_not_the_vehicle() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.INVALID), 0.0, component=154)
    telemetry.receive(Attitude(yaw=1.0), 0.0, component=154)
    assert telemetry.state == VehicleState(system=1)


def texts(telemetry: Telemetry) -> list[str]:
    return [event.text for event in telemetry.take_events() if isinstance(event, StatusTextReceived)]


def test_a_text_in_two_parts_is_one_line() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(StatusText(text="x" * 50, id=3, chunk_seq=0), 0.0)
    assert texts(telemetry) == []
    telemetry.receive(StatusText(text=")\t", id=3, chunk_seq=1), 0.1)
    assert texts(telemetry) == ["x" * 50 + ")"]


def test_a_text_whose_end_never_comes_is_told_after_a_while() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(StatusText(text="x" * 50, id=3, chunk_seq=0), 0.0)
    assert telemetry.wake_at is not None
    telemetry.advance(telemetry.wake_at)
    assert texts(telemetry) == ["x" * 50]
    assert telemetry.wake_at is None


def test_a_new_text_ends_an_unfinished_one() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(StatusText(text="x" * 50, id=3, chunk_seq=0), 0.0)
    telemetry.receive(StatusText(text="short", id=4, chunk_seq=0), 0.1)
    assert texts(telemetry) == ["x" * 50, "short"]


def test_only_the_last_few_texts_are_kept() -> None:
    telemetry = Telemetry(1)
    for number in range(20):
        telemetry.receive(StatusText(text=f"line {number}"), float(number))
    assert [line.text for line in telemetry.state.texts] == [f"line {number}" for number in range(15, 20)]


@pytest.mark.parametrize(
    ("flags", "pan_deg"),
    [
        (GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME, 130.0),
        (GimbalFlags.YAW_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME, 130.0),
        (GimbalFlags.YAW_IN_EARTH_FRAME, 30.0),
        (GimbalFlags.YAW_LOCK, 30.0),
        (GimbalFlags(0), 130.0),
    ],
)
def test_the_frame_bits_say_from_where_the_gimbal_counts_and_else_the_yaw_lock(flags: int, pan_deg: float) -> None:
    status = GimbalDeviceAttitudeStatus(flags=flags, q=rotation(30.0, -20.0))
    aim = gimbal_aim(status, 100.0)
    assert aim is not None
    assert aim.pan_deg == pytest.approx(pan_deg, abs=1e-6 * DEGREE)
    assert aim.tilt_deg == pytest.approx(-20.0, abs=1e-6 * DEGREE)


@pytest.mark.parametrize(("later_ms", "turned_deg"), [(40, 2.4), (-20, -1.2), (900, 0.0)])
def test_while_the_vehicle_turns_its_gimbal_is_told_from_where_the_nose_was_then(
    later_ms: int, turned_deg: float
) -> None:
    telemetry = Telemetry(1)
    attitude = Attitude(time_boot_ms=5000, yaw=math.radians(100.0), yawspeed=math.radians(60.0))
    telemetry.receive(attitude, 5.0)
    flags = GimbalFlags.YAW_IN_VEHICLE_FRAME
    status = GimbalDeviceAttitudeStatus(time_boot_ms=5000 + later_ms, flags=flags, q=rotation(30.0, 0.0))
    telemetry.receive(status, 5.0 + later_ms / 1000)
    assert telemetry.state.gimbal is not None
    assert telemetry.state.gimbal.pan_deg == pytest.approx(130.0 + turned_deg, abs=1e-6 * DEGREE)


def test_a_gimbal_that_counts_from_an_unknown_nose_says_nothing() -> None:
    status = GimbalDeviceAttitudeStatus(flags=GimbalFlags.YAW_IN_VEHICLE_FRAME, q=rotation(30.0, 0.0))
    assert gimbal_aim(status, None) is None
    assert gimbal_aim(GimbalDeviceAttitudeStatus(q=(math.nan,) * 4), 0.0) is None
    assert gimbal_aim(GimbalDeviceAttitudeStatus(q=(0.0,) * 4), 0.0) is None


def test_px4s_gimbal_limits_in_degrees_are_ranges_and_radians_are_limits() -> None:
    degrees = PX4.gimbal_limits(GimbalManagerInformation(pitch_min=-180, pitch_max=180, yaw_min=-720, yaw_max=720))
    assert (degrees.tilt_min_deg, degrees.pan_max_deg) == (-90.0, 360.0)
    two_limits = PX4.gimbal_limits(GimbalManagerInformation(pitch_min=-90, pitch_max=45, yaw_min=-360, yaw_max=360))
    assert (two_limits.tilt_min_deg, two_limits.tilt_max_deg, two_limits.pan_max_deg) == (-90.0, 45.0, 180.0)
    radians = PX4.gimbal_limits(
        GimbalManagerInformation(pitch_min=-1, pitch_max=0.5, yaw_min=-math.pi, yaw_max=math.pi)
    )
    assert radians.tilt_min_deg == pytest.approx(math.degrees(-1))
    assert radians.pan_max_deg == pytest.approx(180.0)


class Replay:
    """The vehicle's side of a recording, played through ``Telemetry``."""

    def __init__(self, name: str, system: int) -> None:
        self.telemetry = Telemetry(system)
        self.events: list[tuple[float, Event]] = []
        self.states: list[tuple[float, VehicleState]] = []
        self.aimed: list[tuple[float, CommandLong]] = []
        start_s = None
        with (DATA / name).open("rb") as file:
            for time_s, frame in read_tlog(file):
                start_s = time_s if start_s is None else start_s
                now = time_s - start_s
                if frame.system == system:
                    self.telemetry.receive(frame.message, now, component=frame.component)
                    self.events += [(now, event) for event in self.telemetry.take_events()]
                    self.states.append((now, self.telemetry.state))
                elif isinstance(frame.message, CommandLong) and frame.message.command == 1000:
                    self.aimed.append((now, frame.message))

    def at(self, time_s: float) -> VehicleState:
        return next(state for now, state in reversed(self.states) if now <= time_s)


@pytest.fixture(scope="module")
def px4() -> Replay:
    return Replay("px4-1.16.0-sih.tlog", 11)


@pytest.fixture(scope="module")
def ardupilot() -> Replay:
    return Replay("arducopter-4.7.0-dev.tlog", 1)


def test_the_recorded_px4_took_off_flew_and_returned(px4: Replay) -> None:
    assert [(event.before, event.after) for _, event in px4.events if isinstance(event, ModeChanged)] == [
        ("Hold", "Takeoff"),
        ("Takeoff", "Hold"),
        ("Hold", "Return"),
    ]
    assert px4.at(1.0).in_air is False
    assert px4.at(19.0).in_air is True
    assert px4.at(19.0).altitude_above_home_m == pytest.approx(20.0, abs=1.5 * METRE)
    state = px4.at(33.0)
    assert (state.autopilot, state.firmware, state.armed, state.gps_fix) == ("px4", "1.16.0", True, 3)
    assert state.heading_deg == pytest.approx(45.0, abs=1 * DEGREE)
    home = GeodeticPoint(lat_deg=-35.3632625, lon_deg=149.1679847, altitude_amsl_m=584.048)
    assert state.home == home


def test_the_recorded_px4_text_in_two_parts_is_one_line(px4: Replay) -> None:
    lines = [event.text for _, event in px4.events if isinstance(event, StatusTextReceived)]
    assert lines[-1] == "RTL: start return at 615 m (30 m above destination)"


@pytest.mark.parametrize(
    ("time_s", "aim_from_nose"),
    [(35.8, Aim(pan_deg=30.0, tilt_deg=-20.0)), (41.5, Aim(pan_deg=-60.0, tilt_deg=10.0))],
)
def test_the_recorded_px4_gimbal_followed_the_nose(px4: Replay, time_s: float, aim_from_nose: Aim) -> None:
    state = px4.at(time_s)
    assert state.gimbal is not None
    assert state.heading_deg is not None
    wanted = Aim(pan_deg=aim_from_nose.pan_deg + state.heading_deg, tilt_deg=aim_from_nose.tilt_deg)
    assert separation_deg(state.gimbal, wanted) == pytest.approx(0.0, abs=1 * DEGREE)


def test_the_recorded_px4_gimbal_kept_its_yaw_lock(px4: Replay) -> None:
    gimbal = px4.at(39.0).gimbal
    assert gimbal is not None
    assert separation_deg(gimbal, Aim(pan_deg=90.0, tilt_deg=-35.0)) == pytest.approx(0.0, abs=1 * DEGREE)


def test_the_recorded_ardupilot_took_off_and_turned_when_told_so(ardupilot: Replay) -> None:
    assert ardupilot.at(8.0).in_air is False
    assert ardupilot.at(8.0).armed is False
    assert ardupilot.at(12.0).armed is True
    state = ardupilot.at(21.8)
    assert (state.autopilot, state.mode, state.firmware, state.in_air) == ("ardupilot", "Guided", "4.7.0", True)
    assert state.altitude_above_home_m == pytest.approx(20.0, abs=1.5 * METRE)
    before, after = ardupilot.at(35.9), ardupilot.at(38.5)
    assert before.heading_deg == pytest.approx(18.5, abs=1 * DEGREE)
    assert after.heading_deg == pytest.approx(45.0, abs=1 * DEGREE)


@pytest.mark.parametrize(
    ("time_s", "wanted"),
    [
        (43.9, Aim(pan_deg=45.0 + 30.0, tilt_deg=-20.0)),
        (47.0, Aim(pan_deg=90.0, tilt_deg=-35.0)),
        (50.1, Aim(pan_deg=300.0, tilt_deg=10.0)),
    ],
)
def test_the_recorded_ardupilot_gimbal_is_read_in_the_earth_frame(
    ardupilot: Replay, time_s: float, wanted: Aim
) -> None:
    gimbal = ardupilot.at(time_s).gimbal
    assert gimbal is not None
    assert separation_deg(gimbal, wanted) == pytest.approx(0.0, abs=1 * DEGREE)


def test_the_angle_between_two_aims_is_that_between_their_lines_of_sight() -> None:
    assert separation_deg(Aim(pan_deg=350.0, tilt_deg=0.0), Aim(pan_deg=10.0, tilt_deg=0.0)) == pytest.approx(20.0)
    assert separation_deg(Aim(pan_deg=0.0, tilt_deg=90.0), Aim(pan_deg=123.0, tilt_deg=90.0)) == pytest.approx(
        0.0, abs=1e-6
    )
    assert separation_deg(Aim(pan_deg=0.0, tilt_deg=-30.0), Aim(pan_deg=0.0, tilt_deg=45.0)) == pytest.approx(75.0)
