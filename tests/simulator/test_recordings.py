"""The ground station's side of two recorded flights is replayed: the simulator must answer as the autopilots did."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame, wrap_deg
from hsop_gcs.link.codec import Frame
from hsop_gcs.link.messages import (
    Attitude,
    AutopilotVersion,
    CommandAck,
    CommandLong,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerStatus,
    GlobalPositionInt,
    GpsGlobalOrigin,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    Message,
    ParamValue,
    PositionTargetGlobalInt,
    StatusText,
    SysStatus,
    Timesync,
    Unknown,
)
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.gimbal import GimbalLimits, pitch_yaw
from hsop_gcs.simulator.px4 import Px4
from tests.simulator.station import Station

DATA = Path(__file__).parents[1] / "data"
GROUND_STATION = 255
METRE = 1.0
DEGREE = 1.0
E7_DEGREES = 1
"""A centimetre, about."""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A recorded flight, and what about it is known not to be simulated."""

    file: str
    build: Callable[..., Any]
    system: int
    home: GeodeticPoint
    first_command_s: float
    booted_before_s: float
    """How long before the first record the autopilot had started."""
    ready_after_s: float
    gimbal: GimbalLimits
    gimbal_settled_at_s: tuple[float, ...]
    hovers_at_s: tuple[float, ...]
    """When the recorded vehicle stood at its goal, within 1.5 m."""
    heading_settled_at_s: tuple[float, ...]
    target_form: tuple[int, int]
    """Frame and type mask of POSITION_TARGET_GLOBAL_INT."""
    flags_not_simulated: int = 0
    """Estimator flags that come and go with a sensor which the simulator does not have."""
    not_simulated: dict[int, str] = field(default_factory=dict)
    """Message id -> why the simulator does not send it."""


ARDUCOPTER = Flight(
    file="arducopter-4.7.0-dev.tlog",
    build=ArduCopter,
    system=1,
    home=GeodeticPoint(lat_deg=-35.3632610, lon_deg=149.1652299, altitude_amsl_m=584.08),
    first_command_s=0.668,
    booted_before_s=35.367,
    ready_after_s=41.6,
    gimbal=GimbalLimits(
        pitch_min_rad=math.radians(-90),
        pitch_max_rad=math.radians(45),
        yaw_min_rad=math.radians(-170),
        yaw_max_rad=math.radians(170),
        slew_rad_s=math.inf,
    ),
    # Later the vehicle tilts, and the servo mount of the recording reports joint angles, not the stabilized aim.
    gimbal_settled_at_s=(35.5, 40.9, 43.9, 47.0, 50.0),
    hovers_at_s=(35.5, 40.9, 50.0, 62.0),
    heading_settled_at_s=(31.0, 35.0, 40.9, 50.0, 61.0),
    target_form=(0, 65016),
    not_simulated={ParamValue.ID: "STAT_FLTTIME, told every half minute of flight; the simulator keeps no statistics"},
)

NO_CONTROLLER = "comes from control loops and sensors that the simulator does not have"
NOT_IN_DIALECT = "not in the codec's dialect, so no ground station built on it can hear it"
PX4 = Flight(
    file="px4-1.16.0-sih.tlog",
    build=Px4,
    system=11,
    home=GeodeticPoint(lat_deg=-35.3632625, lon_deg=149.1679847, altitude_amsl_m=584.048),
    first_command_s=0.216,
    booted_before_s=33.94,
    ready_after_s=5.0,
    gimbal=GimbalLimits(pitch_min_rad=math.radians(-45), pitch_max_rad=math.radians(45), slew_rad_s=math.inf),
    gimbal_settled_at_s=(30.0, 33.1, 36.2, 39.2, 42.2, 50.0, 57.0),
    hovers_at_s=(33.0, 42.0),
    heading_settled_at_s=(28.0, 33.0, 42.0, 52.0),
    target_form=(5, 0),
    flags_not_simulated=64,  # height above ground, from the distance sensor: lost above some 22 m
    not_simulated={
        29: NO_CONTROLLER,  # SCALED_PRESSURE
        36: NO_CONTROLLER,  # SERVO_OUTPUT_RAW
        83: NO_CONTROLLER,  # ATTITUDE_TARGET
        85: NO_CONTROLLER,  # POSITION_TARGET_LOCAL_NED
        132: NO_CONTROLLER,  # DISTANCE_SENSOR
        241: NO_CONTROLLER,  # VIBRATION
        265: "MOUNT_ORIENTATION: the gimbal protocol before version 2, which nothing here listens to",
        12901: "OPEN_DRONE_ID_LOCATION: remote identification is not simulated",
        12904: "OPEN_DRONE_ID_SYSTEM: remote identification is not simulated",
        **dict.fromkeys((8, 380, 410, 411, 436), NOT_IN_DIALECT),
    },
)

FLIGHTS = [pytest.param(ARDUCOPTER, id="arducopter"), pytest.param(PX4, id="px4")]


@dataclass(frozen=True)
class Sides:
    """What the real and the simulated vehicle said to the same ground station. Times count from the first record."""

    flight: Flight
    real: list[tuple[float, Message]]
    simulated: list[tuple[float, Message]]

    def both(self, view: Callable[[list[tuple[float, Message]]], Any]) -> tuple[Any, Any]:
        return view(self.real), view(self.simulated)


_flown: dict[str, Sides] = {}


@pytest.fixture(params=FLIGHTS)
def sides(request: pytest.FixtureRequest) -> Sides:
    """Fly a recording once; every test looks at the same flight."""
    flight: Flight = request.param
    if flight.file not in _flown:
        _flown[flight.file] = _fly(flight)
    return _flown[flight.file]


def _fly(flight: Flight) -> Sides:
    with (DATA / flight.file).open("rb") as file:
        records = list(read_tlog(file))
    start = records[0][0]
    config = VehicleConfig(
        system=flight.system,
        home=flight.home,
        ready_after_s=flight.ready_after_s,
        gimbal=flight.gimbal,
        wander_m=0.0,
        heading_rad=math.radians(2.4 if flight is ARDUCOPTER else 0.0),
    )
    booted_at = -flight.booted_before_s
    station = Station(flight.build(config, now=booted_at, rng=np.random.default_rng(0)), now=booted_at)
    station.wait(flight.booted_before_s)
    station.heard.clear()
    real: list[tuple[float, Message]] = []
    for stamp, frame in records:
        if frame.system == GROUND_STATION:
            station.replay(frame, stamp - start)
        else:
            real.append((stamp - start, _heard(frame)))
    station.wait(records[-1][0] - start - station.now)
    return Sides(flight, real, station.heard)


def _heard(frame: Frame) -> Message:
    return frame.message


def _of(kinds: tuple[type[Message], ...], said: list[tuple[float, Message]]) -> list[Message]:
    return [message for _, message in said if isinstance(message, kinds)]


def _changes(values: list[Any]) -> list[Any]:
    return [value for value, _ in groupby(values)]


def _id(message: Message) -> int:
    return message.message_id if isinstance(message, Unknown) else message.ID


def _at(said: list[tuple[float, Message]], kind: type[Any], at_s: float) -> Any:
    """Return the last message of a kind before a time."""
    return [message for time_s, message in said if isinstance(message, kind) and time_s <= at_s][-1]


def test_every_command_gets_the_recorded_acknowledgement_in_the_recorded_order(sides: Sides) -> None:
    real, simulated = sides.both(lambda said: _of((CommandAck,), said))
    assert len(real) >= 15
    assert simulated == real


def test_requested_messages_stand_on_the_recorded_side_of_their_acknowledgements(sides: Sides) -> None:
    kinds = (CommandAck, AutopilotVersion, GimbalManagerInformation)
    real, simulated = sides.both(lambda said: [type(message) for message in _of(kinds, said)])
    assert simulated == real


def test_home_follows_its_request_on_the_recorded_side_of_the_acknowledgement(sides: Sides) -> None:
    # The third request: by then the fresh link's own HOME_POSITION of PX4 has passed.
    def around(said: list[tuple[float, Message]]) -> list[type[Message]]:
        messages = _of((CommandAck, HomePosition, AutopilotVersion, GimbalManagerInformation), said)
        version = next(index for index, message in enumerate(messages) if isinstance(message, AutopilotVersion))
        return [type(message) for message in messages[version : version + 5]]

    real, simulated = sides.both(around)
    assert HomePosition in real
    assert simulated == real


def test_status_texts_are_the_recorded_ones_word_for_word(sides: Sides) -> None:
    real, simulated = sides.both(lambda said: _of((StatusText,), said))
    assert len(real) >= 5
    assert simulated == real


def test_heartbeats_go_through_the_recorded_modes_and_states(sides: Sides) -> None:
    def modes(said: list[tuple[float, Message]]) -> list[tuple[int, int, int]]:
        beats = [message for _, message in said if isinstance(message, Heartbeat)]
        assert {(beat.type, beat.autopilot) for beat in beats} == {(2, 3 if sides.flight is ARDUCOPTER else 12)}
        return _changes([(beat.base_mode, beat.custom_mode, beat.system_status) for beat in beats])

    real, simulated = sides.both(modes)
    assert len(real) >= 4
    assert simulated == real


def test_landed_state_and_vtol_state_change_as_recorded(sides: Sides) -> None:
    def states(said: list[tuple[float, Message]]) -> list[tuple[int, int]]:
        return _changes([(m.landed_state, m.vtol_state) for _, m in said if isinstance(m, ExtendedSysState)])

    real, simulated = sides.both(states)
    assert len(real) == 3
    assert simulated == real


def test_health_of_the_estimator_is_told_as_recorded(sides: Sides) -> None:
    def flags(said: list[tuple[float, Message]]) -> list[int]:
        reports = [m for _, m in said if isinstance(m, EkfStatusReport | EstimatorStatus)]
        return _changes([m.flags & ~sides.flight.flags_not_simulated for m in reports])

    def health(said: list[tuple[float, Message]]) -> list[int]:
        return _changes([m.onboard_control_sensors_health for _, m in said if isinstance(m, SysStatus)])

    for view in (flags, health):
        real, simulated = sides.both(view)
        assert simulated == real


def test_the_simulator_sends_every_recorded_kind_of_message_but_the_stated_ones_and_no_other(sides: Sides) -> None:
    real, simulated = sides.both(lambda said: {_id(message) for _, message in said})
    assert real - simulated == set(sides.flight.not_simulated)
    assert simulated <= real


def test_every_stream_has_the_recorded_rate(sides: Sides) -> None:
    real, simulated = sides.both(lambda said: Counter(_id(message) for _, message in said))
    slower = {StatusText.ID, CommandAck.ID, CommandLong.ID, GpsGlobalOrigin.ID, PositionTargetGlobalInt.ID}
    for message_id, count in real.items():
        if message_id not in slower | set(sides.flight.not_simulated):
            assert simulated[message_id] == pytest.approx(count, abs=2 + 0.02 * count), message_id


def test_a_fresh_link_is_as_silent_or_talkative_as_recorded(sides: Sides) -> None:
    def early(said: list[tuple[float, Message]]) -> set[int]:
        """Return what was heard before the first command."""
        return {_id(message) for time_s, message in said if time_s < sides.flight.first_command_s}

    real, simulated = sides.both(early)
    if sides.flight is ARDUCOPTER:
        # Heartbeats come once a second, and the recording begins between two of them.
        assert real | simulated <= {Heartbeat.ID, Timesync.ID}
    else:
        assert len(simulated) >= 4
        assert {Attitude.ID, GlobalPositionInt.ID, GpsRawInt.ID, LocalPositionNed.ID} <= real & simulated


def test_gimbal_information_and_version_are_the_recorded_ones(sides: Sides) -> None:
    limits = ("roll_min", "roll_max", "pitch_min", "pitch_max", "yaw_min", "yaw_max")

    def information(said: list[tuple[float, Message]]) -> list[tuple[float, ...]]:
        return [
            (m.cap_flags, m.gimbal_device_id, *(round(float(getattr(m, name)), 6) for name in limits))
            for _, m in said
            if isinstance(m, GimbalManagerInformation)
        ]

    def version(said: list[tuple[float, Message]]) -> list[tuple[int, int]]:
        return [(m.capabilities, m.flight_sw_version) for _, m in said if isinstance(m, AutopilotVersion)]

    for view in (information, version):
        real, simulated = sides.both(view)
        assert len(real) == 1
        assert simulated == real


def test_gimbal_ownership_and_flags_change_as_recorded(sides: Sides) -> None:
    def owners(said: list[tuple[float, Message]]) -> list[tuple[int, ...]]:
        status = [m for _, m in said if isinstance(m, GimbalManagerStatus)]
        return _changes([(m.flags, m.primary_control_sysid, m.primary_control_compid) for m in status])

    def flags(said: list[tuple[float, Message]]) -> list[int]:
        return _changes([m.flags for _, m in said if isinstance(m, GimbalDeviceAttitudeStatus)])

    for view in (owners, flags):
        real, simulated = sides.both(view)
        assert len(real) >= 2
        assert simulated == real


def test_gimbal_reaches_the_recorded_attitude_in_the_recorded_frame(sides: Sides) -> None:
    for at_s in sides.flight.gimbal_settled_at_s:
        real, simulated = (_at(said, GimbalDeviceAttitudeStatus, at_s) for said in (sides.real, sides.simulated))
        assert simulated.flags == real.flags
        for there, here in zip(pitch_yaw(real.q), pitch_yaw(simulated.q), strict=True):
            assert wrap_deg(math.degrees(here - there)) == pytest.approx(0.0, abs=0.5 * DEGREE), at_s


def test_nose_points_where_the_recorded_one_did(sides: Sides) -> None:
    for at_s in sides.flight.heading_settled_at_s:
        real, simulated = (_at(said, GlobalPositionInt, at_s) for said in (sides.real, sides.simulated))
        assert wrap_deg((simulated.hdg - real.hdg) / 100) == pytest.approx(0.0, abs=2 * DEGREE), at_s


def test_hover_points_are_reached_where_the_recorded_vehicle_reached_them(sides: Sides) -> None:
    local = LocalFrame(sides.flight.home)
    for at_s in sides.flight.hovers_at_s:
        real, simulated = (_at(said, GlobalPositionInt, at_s) for said in (sides.real, sides.simulated))
        places = [
            local.to_enu(GeodeticPoint(lat_deg=m.lat * 1e-7, lon_deg=m.lon * 1e-7, altitude_amsl_m=m.alt * 1e-3))
            for m in (real, simulated)
        ]
        assert np.linalg.norm(places[0] - places[1]) < 1.5 * METRE, at_s
        assert simulated.relative_alt * 1e-3 == pytest.approx(real.relative_alt * 1e-3, abs=0.4 * METRE)


def test_targets_are_echoed_as_recorded(sides: Sides) -> None:
    def targets(said: list[tuple[float, Message]]) -> list[tuple[int, int, float]]:
        echoes = [m for t, m in said if isinstance(m, PositionTargetGlobalInt) and t < 54]
        assert {(m.coordinate_frame, m.type_mask) for m in echoes} == {sides.flight.target_form}
        return _changes([(m.lat_int, m.lon_int, m.alt) for m in echoes])

    real, simulated = sides.both(targets)
    assert len(real) >= 2
    assert len(simulated) == len(real)
    for there, here in zip(real, simulated, strict=True):
        # The real ones differ from what was ordered by rounding through single precision, and where PX4 took off by its
        # estimate's error on the ground.
        assert here[:2] == pytest.approx(there[:2], abs=10 * E7_DEGREES)
        assert here[2] == pytest.approx(there[2], abs=0.1 * METRE)
