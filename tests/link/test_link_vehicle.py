"""Two real ends over a seeded line: our vehicle machine and a simulated autopilot, in simulated time."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import Aim, GeodeticPoint, LocalFrame
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import (
    AimClipped,
    Arrived,
    CommandFinished,
    Drifted,
    Event,
    GimbalControlLost,
    GimbalFailed,
    GimbalOffTarget,
    GimbalOnTarget,
    LinkLost,
    LinkUp,
    OnStation,
    OrderAccepted,
    OrderEvent,
    OrderFailed,
    OrderSuperseded,
    TookOff,
)
from hsop_gcs.link.messages import CommandInt, CommandLong, Message, SetPositionTargetGlobalInt
from hsop_gcs.link.protocol.gimbal import separation_deg
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.vehicle import Vehicle
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.channel import Channel, Impairment
from hsop_gcs.simulator.gimbal import GimbalLimits
from hsop_gcs.simulator.px4 import Px4

HOME = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
LOCAL = LocalFrame(HOME)
METRE = 1.0
DEGREE = 1.0
Stack = Literal["px4", "ardupilot"]
BOTH = pytest.mark.parametrize("stack", ["px4", "ardupilot"])
PERFECT = Impairment(delay_s=0.02)
BAD = Impairment(loss=0.25, duplication=0.1, delay_s=0.05, jitter_s=0.2)


class TwoEnds:
    """A vehicle of ours and a simulated one with a line between them."""

    def __init__(
        self,
        stack: Stack,
        *,
        airborne_m: float = 20.0,
        impairment: Impairment = PERFECT,
        seed: int = 1,
        gimbal: GimbalLimits | None = None,
    ) -> None:
        seeds = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3)]
        config = VehicleConfig(
            system=1,
            home=HOME,
            airborne_m=airborne_m,
            ready_after_s=0.0 if airborne_m else 8.0,
            gimbal=gimbal or GimbalLimits(),
        )
        self.sim = Px4(config, now=0.0, rng=seeds[0]) if stack == "px4" else ArduCopter(config, now=0.0, rng=seeds[0])
        self.vehicle = Vehicle(1)
        self.now = 0.0
        self.cut = False
        self.events: list[tuple[float, Event]] = []
        self.heard: list[tuple[float, Frame]] = []
        self._to_sim = Channel[bytes](impairment, seeds[1])
        self._to_us = Channel[bytes](impairment, seeds[2])
        self._our_encoder, self._its_encoder = Encoder(system=255, component=190), Encoder(system=1, component=1)
        self._our_decoder, self._its_decoder = Decoder(), Decoder()

    def until(self, condition: Callable[[], bool], *, within_s: float = 120.0) -> None:
        """Let time pass until something is so; it is an error if it takes too long."""
        end = self.now + within_s
        while not condition():
            assert self.now < end, f"not so within {within_s} s: {[event for _, event in self.events[-5:]]}"
            self._step()

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        end = self.now + duration_s
        self.until(lambda: self.now >= end, within_s=duration_s + 1.0)

    def ready(self) -> "TwoEnds":
        """Let time pass until the vehicle can take a hover order."""
        self.until(lambda: self.vehicle.why_not_ready(self.now) is None)
        return self

    def order(
        self,
        order_id: str = "o1",
        *,
        east_m: float = 30.0,
        north_m: float = 20.0,
        up_m: float = 25.0,
        heading_deg: float = 200.0,
        aim: Aim | None = None,
        speed_mps: float | None = None,
    ) -> HoverOrder:
        order = HoverOrder(
            order_id=order_id,
            point=LOCAL.to_geodetic(np.array([east_m, north_m, up_m])),
            heading_deg=heading_deg,
            aim=aim,
            deadline_s=self.now + 20.0,
            speed_mps=speed_mps,
        )
        self.vehicle.hover(order, self.now)
        return order

    def send(self, message: Message) -> None:
        """Put a message of another ground station on the simulated vehicle's desk."""
        raw = Encoder(system=200, component=190).encode(message)
        for frame in Decoder().feed_datagram(raw):
            self.sim.receive(frame, self.now)

    def of(self, kind: type[Event]) -> list[Event]:
        return [event for _, event in self.events if isinstance(event, kind)]

    def saw(self, kind: type[Event], order_id: str | None = None) -> bool:
        return any(
            order_id is None or (isinstance(event, OrderEvent) and event.order_id == order_id)
            for event in self.of(kind)
        )

    def sent(self, command: int) -> list[tuple[float, CommandLong | CommandInt]]:
        return [
            (at, frame.message)
            for at, frame in self.heard
            if isinstance(frame.message, CommandLong | CommandInt) and frame.message.command == command
        ]

    def error_m(self) -> float:
        """How far the simulated vehicle really is from the current order."""
        progress = self.vehicle.progress
        assert progress is not None
        return float(np.linalg.norm(LOCAL.to_enu(progress.order.point) - np.array(self.sim.state.position_m)))

    def _step(self) -> None:
        wake_ats = [self.sim.wake_at, self._to_sim.next_due, self._to_us.next_due, self.now + 0.5]
        wake_at = self.vehicle.wake_at
        self.now = max(self.now, min([*wake_ats, wake_at if wake_at is not None else math.inf]))
        for raw in self._to_sim.take_due(self.now):
            for frame in self._its_decoder.feed_datagram(raw):
                self.heard.append((self.now, frame))
                self.sim.receive(frame, self.now)
        for raw in self._to_us.take_due(self.now):
            for frame in self._our_decoder.feed_datagram(raw):
                self.vehicle.receive(frame.message, self.now, component=frame.component)
        self.sim.advance(self.now)
        self.vehicle.advance(self.now)
        for message in self.sim.take_outgoing():
            if not self.cut:
                self._to_us.put(self._its_encoder.encode(message), self.now)
        for message in self.vehicle.take_outgoing():
            if not self.cut:
                self._to_sim.put(self._our_encoder.encode(message), self.now)
        self.events += [(self.now, event) for event in self.vehicle.take_events()]


@BOTH
def test_a_vehicle_takes_off_flies_to_its_point_looks_and_returns(stack: Stack) -> None:
    ends = TwoEnds(stack, airborne_m=0.0)
    ends.until(lambda: ends.vehicle.state.home is not None and ends.vehicle.state.in_air is False)
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


@BOTH
def test_the_gimbal_stays_on_its_target_while_the_vehicle_turns(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    aim = Aim(pan_deg=80.0, tilt_deg=-10.0)
    ends.order("one", east_m=0.0, north_m=0.0, up_m=20.0, heading_deg=0.0, aim=aim)
    ends.until(lambda: ends.saw(OnStation, "one"))
    ends.order("two", east_m=0.0, north_m=0.0, up_m=20.0, heading_deg=170.0, aim=aim)
    ends.until(lambda: ends.saw(OnStation, "two"))
    gimbal = ends.vehicle.state.gimbal
    assert gimbal is not None
    assert separation_deg(gimbal, aim) < 2 * DEGREE


@BOTH
def test_the_gimbal_is_spoken_to_at_most_five_times_a_second(stack: Stack) -> None:
    ends = TwoEnds(stack).ready()
    ends.order(heading_deg=180.0, aim=Aim(pan_deg=80.0, tilt_deg=-10.0))
    ends.until(lambda: ends.saw(OnStation))
    times = [at for at, _ in ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW)]
    assert (len(times) > 1) == (stack == "px4"), "only an aim that counts from the nose is renewed as it turns"
    assert min(np.diff(times), default=math.inf) >= 0.2 - 1e-6


def test_control_of_the_gimbal_is_taken_with_our_own_ids_and_taken_back() -> None:
    ends = TwoEnds("px4").ready()
    ends.order(aim=Aim(pan_deg=80.0, tilt_deg=-10.0))
    ends.until(lambda: ends.saw(OnStation))
    ((_, message), *_) = ends.sent(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE)
    assert (message.param1, message.param2, message.param3, message.param4) == (255.0, 190.0, -1.0, -1.0)
    thief = CommandLong(
        target_system=1,
        target_component=1,
        command=MavCmd.DO_GIMBAL_MANAGER_CONFIGURE,
        param1=200.0,
        param2=190.0,
        param3=-1.0,
        param4=-1.0,
    )
    ends.send(thief)
    away = CommandLong(
        target_system=1,
        target_component=1,
        command=MavCmd.DO_GIMBAL_MANAGER_PITCHYAW,
        param1=40.0,
        param2=-100.0,
        param3=math.nan,
        param4=math.nan,
        param5=12.0,
    )
    ends.send(away)
    ends.until(lambda: ends.saw(GimbalOffTarget))
    ends.until(lambda: len(ends.of(GimbalOnTarget)) == 2)
    (lost,) = ends.of(GimbalControlLost)
    assert isinstance(lost, GimbalControlLost)
    assert (lost.owner_system, lost.owner_component) in ((200, 190), (0, 0)), "the thief, or nobody in a denial"
    assert len(ends.of(OnStation)) == 2


@BOTH
def test_an_aim_beyond_the_gimbals_reach_is_clipped_and_said(stack: Stack) -> None:
    limits = GimbalLimits(pitch_min_rad=math.radians(-45.0), pitch_max_rad=math.radians(20.0))
    ends = TwoEnds(stack, gimbal=limits).ready()
    ends.run(5.0)
    ends.order(aim=Aim(pan_deg=80.0, tilt_deg=60.0))
    ends.until(lambda: ends.saw(AimClipped), within_s=10.0)
    (event,) = ends.of(AimClipped)
    assert isinstance(event, AimClipped)
    assert event.given.tilt_deg == pytest.approx(20.0, abs=0.01 * DEGREE) or stack == "px4"
    ends.until(lambda: ends.saw(GimbalFailed))
    assert not ends.saw(OnStation)


def test_nothing_is_sent_to_a_gimbal_nobody_aims() -> None:
    ends = TwoEnds("px4").ready()
    ends.order(aim=None)
    ends.until(lambda: ends.saw(OnStation))
    assert ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW) == []
    assert ends.sent(MavCmd.DO_GIMBAL_MANAGER_CONFIGURE) == []


def test_an_ardupilot_that_is_not_ready_is_asked_to_arm_until_it_is() -> None:
    ends = TwoEnds("ardupilot", airborne_m=0.0)
    ends.until(lambda: ends.vehicle.state.home is not None and ends.vehicle.state.in_air is False)
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
    ends = TwoEnds("px4", airborne_m=0.0)
    ends.until(lambda: ends.vehicle.state.home is not None and ends.vehicle.state.in_air is False)
    ends.vehicle.take_off(15.0, ends.now)
    ends.until(lambda: ends.saw(TookOff))
    ((_, message),) = ends.sent(MavCmd.NAV_TAKEOFF)
    assert isinstance(message, CommandLong)
    assert message.param7 == pytest.approx(515.0, abs=0.2 * METRE)


@BOTH
@pytest.mark.parametrize("seed", range(3))
def test_a_take_off_over_a_bad_line_ends_exactly_once(stack: Stack, seed: int) -> None:
    ends = TwoEnds(stack, airborne_m=0.0, impairment=BAD, seed=seed)
    ends.until(lambda: ends.vehicle.state.home is not None and ends.vehicle.state.in_air is False)
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
