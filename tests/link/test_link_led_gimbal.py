"""Several gimbals on one vehicle, and gimbals that are their own managers: which one is led, and whose word counts."""

import math
from dataclasses import fields, replace

import pytest

from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.codec import Frame
from hsop_gcs.link.enums import GimbalFlags, MavAutopilot, MavCmd, MavResult, MavType
from hsop_gcs.link.events import GimbalFailed, GimbalOffTarget, OnStation
from hsop_gcs.link.messages import (
    Attitude,
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerStatus,
    Heartbeat,
    Message,
)
from hsop_gcs.link.protocol.gimbal import separation_deg
from hsop_gcs.link.protocol.telemetry import Telemetry
from tests.link.two_ends import DEGREE, Stack, TwoEnds

DOWN = (math.cos(-math.pi / 4), 0.0, math.sin(-math.pi / 4), 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
IN_VEHICLE_FRAME = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME
GIMBAL_BEAT = Heartbeat(type=MavType.GIMBAL, autopilot=MavAutopilot.INVALID)
AIM = Aim(pan_deg=80.0, tilt_deg=-10.0)


def looks_down(device_id: int = 0, time_boot_ms: int = 0) -> GimbalDeviceAttitudeStatus:
    return GimbalDeviceAttitudeStatus(
        time_boot_ms=time_boot_ms, flags=IN_VEHICLE_FRAME, q=DOWN, gimbal_device_id=device_id
    )


class SecondGimbal(TwoEnds):
    """Two ends, and after every report of the gimbal one of another that looks down."""

    def __init__(self, stack: Stack, *, component: int, device_id: int, clock_ms: int = 0) -> None:
        super().__init__(stack)
        self._second = (component, device_id, clock_ms)
        self.tilts_deg: set[float] = set()

    def hear(self, message: Message, component: int) -> None:
        super().hear(message, component)
        if isinstance(message, GimbalDeviceAttitudeStatus):
            second, device_id, clock_ms = self._second
            super().hear(looks_down(device_id, clock_ms and message.time_boot_ms + clock_ms), second)
            if self.vehicle.state.gimbal is not None:
                self.tilts_deg.add(round(self.vehicle.state.gimbal.tilt_deg, -1))


SECONDS = pytest.mark.parametrize(
    ("component", "device_id", "clock_ms"),
    [(171, 0, 0), (171, 171, 0), (1, 2, 0), (154, 0, 3_600_000), (1, 172, 0)],
    ids=[
        "a second component",
        "that names itself",
        "another output of the autopilot",
        "with a clock an hour ahead",
        "passed on by the autopilot",
    ],
)


@SECONDS
def test_a_second_gimbal_that_looks_elsewhere_changes_nothing(component: int, device_id: int, clock_ms: int) -> None:
    ends = SecondGimbal("ardupilot", component=component, device_id=device_id, clock_ms=clock_ms)
    ends.ready()
    ends.order(east_m=0.0, north_m=0.0, up_m=20.0, aim=AIM)
    ends.until(lambda: ends.saw(OnStation))
    ends.run(2.0)
    assert not ends.saw(GimbalOffTarget)
    assert -90.0 not in ends.tilts_deg
    state = ends.vehicle.state
    assert state.gimbal is not None
    assert separation_deg(state.gimbal, AIM) < 2 * DEGREE
    assert state.gimbal_heard_s == pytest.approx(ends.now, abs=1.0)


def test_a_second_manager_does_not_take_the_place_of_the_one_that_is_led() -> None:
    ends = TwoEnds("ardupilot").ready()
    ends.run(3.0)
    ends.hear(GimbalManagerInformation(gimbal_device_id=172), 171)
    ends.hear(GimbalManagerInformation(gimbal_device_id=2), 1)
    ends.hear(GimbalManagerStatus(gimbal_device_id=172, primary_control_sysid=77), 171)
    ends.order(aim=AIM)
    ends.until(lambda: ends.saw(OnStation))
    aimed = [message for _, message in ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW)]
    assert {(each.target_component, each.z if isinstance(each, CommandInt) else each.param7) for each in aimed} == {
        (1, 1.0)
    }


def test_while_it_is_not_known_which_gimbal_is_led_two_say_nothing_and_one_says_where_it_looks() -> None:
    telemetry = Telemetry(1)
    telemetry.receive(Attitude(yaw=0.0), 0.0)
    telemetry.receive(GimbalDeviceAttitudeStatus(flags=IN_VEHICLE_FRAME, q=LEVEL), 0.1, component=154)
    assert telemetry.state.gimbal == Aim(pan_deg=0.0, tilt_deg=0.0)
    telemetry.receive(looks_down(), 0.2, component=171)
    assert telemetry.state.gimbal is None
    telemetry.receive(looks_down(), 2.3, component=171)
    assert telemetry.state.gimbal is not None, "the other one is not heard any more"


def test_a_gimbal_s_clock_is_not_the_autopilot_s() -> None:
    """One that began two seconds after the autopilot's: taken for one clock, either would seem to be late."""
    telemetry = Telemetry(1)
    for tenth in range(50):
        now = 100.0 + tenth / 10
        telemetry.receive(Attitude(time_boot_ms=50_000 + 100 * tenth), now)
        status = GimbalDeviceAttitudeStatus(time_boot_ms=48_000 + 100 * tenth, flags=IN_VEHICLE_FRAME, q=LEVEL)
        telemetry.receive(status, now, component=154)
        assert telemetry.state.attitude_heard_s == pytest.approx(now, abs=1e-6)
        assert telemetry.state.gimbal_heard_s == pytest.approx(now, abs=1e-6)


class OwnManager(TwoEnds):
    """Two ends whose gimbal is its own manager, as a component that heartbeats; the autopilot has none and says so."""

    def __init__(self, stack: Stack, *, component: int = 154, device_id: int = 154, beats: bool = True) -> None:
        super().__init__(stack)
        self._component, self._device_id, self._beats = component, device_id, beats
        self.answers_all = True
        """Whether it also answers what is asked of every component."""
        self._due_s = 0.0
        self._asked: list[tuple[int, bool]] = []
        """Commands under way, and whether the gimbal was asked."""

    def reach(self, frame: Frame) -> None:
        message = frame.message
        if not isinstance(message, CommandLong):
            return super().reach(frame)
        of_gimbal = message.target_component == self._component
        if not _is_gimbal_manager_s(message):
            self._asked.append((message.command, False))
            return None if of_gimbal else super().reach(frame)
        if not of_gimbal:
            super().hear(CommandAck(command=message.command, result=MavResult.UNSUPPORTED), 1)
        if not of_gimbal and not (self.answers_all and message.target_component == 0):
            return None
        self._asked.append((message.command, True))
        its_id = 1.0 if message.command >= MavCmd.DO_GIMBAL_MANAGER_PITCHYAW else message.param7
        return super().reach(replace(frame, message=replace(message, target_component=1, param7=its_id)))

    def hear(self, message: Message, component: int) -> None:
        if isinstance(message, CommandAck):
            entry = next((each for each in self._asked if each[0] == message.command), None)
            if entry is not None:
                self._asked.remove(entry)
                component = self._component if entry[1] else component
        elif isinstance(message, GimbalManagerInformation | GimbalManagerStatus):
            component, message = self._component, replace(message, gimbal_device_id=self._device_id)
        elif isinstance(message, GimbalDeviceAttitudeStatus):
            component, message = self._component, replace(message, gimbal_device_id=0)
        super().hear(message, component)

    def _step(self) -> None:
        super()._step()
        if self._beats and self.now >= self._due_s:
            self._due_s = self.now + 1.0
            super().hear(GIMBAL_BEAT, self._component)


def _is_gimbal_manager_s(message: CommandLong) -> bool:
    if message.command in (MavCmd.REQUEST_MESSAGE, MavCmd.SET_MESSAGE_INTERVAL):
        kinds = (GimbalManagerInformation, GimbalManagerStatus, GimbalDeviceAttitudeStatus)
        return message.param1 in [kind.ID for kind in kinds]
    return message.command in (MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, MavCmd.DO_GIMBAL_MANAGER_PITCHYAW)


@pytest.mark.parametrize(
    ("component", "device_id", "beats"),
    [(154, 154, True), (171, 1, True), (60, 60, True), (154, 154, False)],
    ids=["of the usual component", "that names itself 1", "of another component", "that sends no heartbeat"],
)
def test_a_gimbal_that_is_its_own_manager_is_found_and_led(component: int, device_id: int, beats: bool) -> None:
    ends = OwnManager("ardupilot", component=component, device_id=device_id, beats=beats).ready()
    ends.order(aim=AIM)
    ends.until(lambda: ends.saw(OnStation) or ends.saw(GimbalFailed))
    assert ends.saw(OnStation)
    aimed = [message for _, message in ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW)]
    assert {each.target_component for each in aimed} == {component}
    gimbal = ends.vehicle.state.gimbal
    assert gimbal is not None
    assert separation_deg(gimbal, AIM) < 2 * DEGREE


def test_a_gimbal_that_comes_late_is_asked_at_once() -> None:
    ends = OwnManager("ardupilot", beats=False)
    ends.answers_all = False
    ends.run(15.0)
    late_s = ends.now
    ends._beats = True
    ends.run(3.0)
    asked = [at for at, message in ends.sent(MavCmd.REQUEST_MESSAGE) if message.target_component == 154]
    assert asked
    assert asked[0] - late_s < 2.0


def test_a_vehicle_without_a_gimbal_is_not_asked_without_end() -> None:
    ends = OwnManager("ardupilot", beats=False)
    ends._component = 99  # asks nobody reaches: there is no such component
    ends.run(60.0)
    asked = [
        message
        for _, message in ends.sent(MavCmd.REQUEST_MESSAGE)
        if isinstance(message, CommandLong) and message.param1 == GimbalManagerInformation.ID
    ]
    assert len(asked) <= 12


def test_a_gimbal_that_falls_silent_is_not_on_target_any_more() -> None:
    ends = SilentGimbal("ardupilot").ready()
    ends.order(east_m=0.0, north_m=0.0, up_m=20.0, aim=AIM)
    ends.until(lambda: ends.saw(OnStation))
    ends.silent = True
    ends.until(lambda: ends.saw(GimbalOffTarget), within_s=5.0)
    progress = ends.vehicle.progress
    assert progress is not None
    assert not progress.on_station
    ends.silent = False
    ends.until(lambda: len(ends.of(OnStation)) == 2, within_s=10.0)


class SilentGimbal(TwoEnds):
    """Two ends whose gimbal may cease to report."""

    silent = False

    def hear(self, message: Message, component: int) -> None:
        if not (self.silent and isinstance(message, GimbalDeviceAttitudeStatus)):
            super().hear(message, component)


OTHERS = [
    kind for kind in Message.__subclasses__() if kind not in (GimbalDeviceAttitudeStatus, GimbalManagerInformation)
]


@pytest.mark.parametrize("component", [100, 154, 171, 180, 191, 240])
def test_what_other_components_say_of_themselves_is_not_the_vehicle_s(component: int) -> None:
    """Every message there is but those of gimbals and batteries, with zeros and with ones in all its fields."""
    ends = TwoEnds("ardupilot").ready()
    before, seen = ends.vehicle.state, ends.vehicle.take_events()
    for kind in OTHERS:
        if kind is BatteryStatus and component in (180, 181):
            continue
        ones = {field.name: 1 for field in fields(kind) if field.type in (int, float, "int", "float")}
        for message in (kind(), kind(**ones)):
            ends.vehicle.receive(message, ends.now, component=component)
    assert ends.vehicle.state == before
    assert ends.vehicle.take_events() == seen == []
