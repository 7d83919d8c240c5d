"""One hover point, message by message, with a clock moved by hand."""

import math

import numpy as np
import pytest

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.link.adapters import ARDUPILOT, PX4, Adapter
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavLandedState, MavModeFlag, MavResult, MavType
from hsop_gcs.link.events import Arrived, Drifted, Event, OrderAccepted, OrderFailed
from hsop_gcs.link.messages import (
    Attitude,
    CommandAck,
    CommandInt,
    ExtendedSysState,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    Message,
    SetPositionTargetGlobalInt,
    StatusText,
)
from hsop_gcs.link.protocol.command import INSISTENT, CommandLimits
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.vehicle import Vehicle

POINT = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=525.0)
LOCAL = LocalFrame(POINT)
TAKEOFF_MODE = 33816576


class Bench:
    """A vehicle of ours that hears what the test says, ten times a second."""

    def __init__(self, adapter: Adapter = PX4) -> None:
        self.vehicle = Vehicle(1)
        self.autopilot = MavAutopilot.PX4 if adapter is PX4 else MavAutopilot.ARDUPILOTMEGA
        self.mode = adapter.hover_mode.custom_mode
        self.now = 0.0
        self.events: list[Event] = []
        self.sent: list[Message] = []
        self.place_m = (30.0, 0.0, 0.0)
        self.heading_deg = 90.0
        self.armed = True
        self.hear(HomePosition(latitude=470000000, longitude=80000000, altitude=500000))
        self.hear(ExtendedSysState(landed_state=MavLandedState.IN_AIR))
        self.run(1.0)

    def hear(self, *messages: Message) -> None:
        for message in messages:
            self.vehicle.receive(message, self.now)
        self.sent += self.vehicle.take_outgoing()
        self.events += self.vehicle.take_events()

    def telemetry(self) -> None:
        place = LOCAL.to_geodetic(np.array(self.place_m))
        lat, lon = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
        base_mode = MavModeFlag.SAFETY_ARMED if self.armed else MavModeFlag.CUSTOM_MODE_ENABLED
        self.hear(
            Heartbeat(type=MavType.QUADROTOR, autopilot=self.autopilot, custom_mode=self.mode, base_mode=base_mode),
            Attitude(yaw=math.radians(self.heading_deg)),
            GlobalPositionInt(
                lat=lat, lon=lon, alt=round(place.altitude_amsl_m * 1000), hdg=round(self.heading_deg * 100)
            ),
        )

    def run(self, duration_s: float) -> None:
        """Let time pass with telemetry."""
        for _ in range(round(duration_s * 10)):
            self.now += 0.1
            self.vehicle.advance(self.now)
            self.telemetry()

    def silence(self, duration_s: float) -> None:
        """Let time pass without any."""
        end = self.now + duration_s
        while (wake_at := self.vehicle.wake_at) is not None and wake_at <= end:
            self.now = max(self.now, wake_at)
            self.vehicle.advance(self.now)
            self.hear()
        self.now = end

    def order(self, *, deadline_s: float = 100.0) -> None:
        order = HoverOrder(order_id="o", point=POINT, heading_deg=90.0, aim=None, deadline_s=deadline_s)
        self.vehicle.hover(order, self.now)
        self.hear()

    def ack(self, result: int = MavResult.ACCEPTED) -> None:
        self.hear(CommandAck(command=MavCmd.DO_REPOSITION, result=result))

    def saw(self, kind: type[Event]) -> int:
        return sum(isinstance(event, kind) for event in self.events)

    def reason(self) -> str:
        (event,) = [event for event in self.events if isinstance(event, OrderFailed)]
        return event.reason


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_an_acknowledgement_is_no_arrival(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.run(10.0)
    assert bench.saw(OrderAccepted) == 1
    assert bench.saw(Arrived) == 0


def test_arrival_is_rest_at_the_point_for_two_seconds(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.place_m = (1.0, 0.5, 0.5)
    bench.run(1.9)
    assert bench.saw(Arrived) == 0
    bench.run(0.4)
    assert bench.saw(Arrived) == 1


@pytest.mark.parametrize(
    ("place_m", "heading_deg"),
    [((1.6, 0.0, 0.0), 90.0), ((0.0, 0.0, 1.1), 90.0), ((0.0, 0.0, -1.1), 90.0), ((0.0, 0.0, 0.0), 93.5)],
)
def test_beside_above_below_or_askew_is_not_there(
    bench: Bench, place_m: tuple[float, float, float], heading_deg: float
) -> None:
    bench.order()
    bench.ack()
    bench.place_m, bench.heading_deg = place_m, heading_deg
    bench.run(10.0)
    assert bench.saw(Arrived) == 0


def test_passing_slowly_through_the_point_is_not_arrival(bench: Bench) -> None:
    bench.order()
    bench.ack()
    for step in range(30):
        bench.place_m = (-1.4 + 0.1 * step, 0.0, 0.0)
        bench.run(0.2)
    assert bench.saw(Arrived) == 0


def test_rest_seen_across_a_gap_in_telemetry_does_not_count(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.place_m = (0.0, 0.0, 0.0)
    bench.run(0.5)
    bench.silence(3.0)
    bench.run(1.5)
    assert bench.saw(Arrived) == 0
    bench.run(1.0)
    assert bench.saw(Arrived) == 1


@pytest.mark.parametrize("result", [MavResult.DENIED, MavResult.UNSUPPORTED, MavResult.FAILED, 200])
def test_a_refusal_ends_the_order_and_names_the_result(bench: Bench, result: int) -> None:
    bench.order()
    bench.ack(result)
    assert (MavResult(result).name if result in list(MavResult) else "result 200") in bench.reason()
    assert bench.vehicle.progress is None


def test_a_fence_text_soon_after_the_acceptance_is_a_refusal(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.run(1.0)
    bench.hear(StatusText(text="Reposition is outside geofence\t"))
    assert bench.reason() == "the autopilot says: Reposition is outside geofence"


def test_a_fence_text_just_before_the_acceptance_is_a_refusal(bench: Bench) -> None:
    bench.order()
    bench.hear(StatusText(text="Reposition is outside geofence\t"))
    bench.ack()
    assert "geofence" in bench.reason()
    assert bench.saw(OrderAccepted) == 0


def test_a_fence_text_long_after_is_about_something_else(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.run(2.5)
    bench.hear(StatusText(text="Geofence loaded"))
    bench.run(0.5)
    assert bench.saw(OrderFailed) == 0


def test_no_answer_at_all_is_a_failure(bench: Bench) -> None:
    bench.order()
    bench.run(INSISTENT * (CommandLimits().reply_s + 0.1) + 0.5)
    assert "no reply" in bench.reason()
    assert len([message for message in bench.sent if isinstance(message, CommandInt)]) == INSISTENT


def test_a_stale_order_is_not_sent(bench: Bench) -> None:
    bench.order(deadline_s=bench.now)
    bench.run(1.0)
    assert [message for message in bench.sent if isinstance(message, CommandInt)] == []
    assert bench.saw(OrderFailed) == 1


def test_an_order_accepted_in_time_is_flown_past_its_deadline(bench: Bench) -> None:
    bench.order(deadline_s=bench.now + 1.0)
    bench.ack()
    bench.run(8.0)
    bench.place_m = (0.0, 0.0, 0.0)
    bench.run(3.0)
    assert bench.saw(Arrived) == 1


def test_a_vehicle_that_does_not_come_is_late(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.run(34.0)
    assert bench.saw(OrderFailed) == 0
    bench.run(2.0)
    assert "30.0 m away" in bench.reason()


def test_a_mode_that_was_ours_and_changes_ends_the_order(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.run(1.0)
    bench.mode = 84148224
    bench.run(0.1)
    assert bench.reason() == "the vehicle is in mode Return, which is not ours"


def test_the_mode_may_take_a_moment_to_become_ours(bench: Bench) -> None:
    bench.mode = TAKEOFF_MODE
    bench.run(0.1)
    bench.order()
    bench.ack()
    bench.run(4.0)
    bench.mode = PX4.hover_mode.custom_mode
    bench.run(4.0)
    assert bench.saw(OrderFailed) == 0


def test_a_mode_that_never_becomes_ours_ends_the_order(bench: Bench) -> None:
    bench.mode = TAKEOFF_MODE
    bench.run(0.1)
    bench.order()
    bench.ack()
    bench.run(6.0)
    assert "Takeoff" in bench.reason()


def test_disarming_ends_the_order(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.armed = False
    bench.run(0.1)
    assert bench.reason() == "the vehicle disarmed"


def test_landing_ends_the_order_also_after_arrival(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.place_m = (0.0, 0.0, 0.0)
    bench.run(3.0)
    bench.hear(ExtendedSysState(landed_state=MavLandedState.ON_GROUND))
    assert bench.saw(Arrived) == 1
    assert bench.reason() == "the vehicle landed"


def test_a_gust_is_no_drift_and_leaving_is(bench: Bench) -> None:
    bench.order()
    bench.ack()
    bench.place_m = (0.0, 0.0, 0.0)
    bench.run(3.0)
    bench.place_m = (4.0, 0.0, 0.0)
    bench.run(1.0)
    bench.place_m = (2.0, 0.0, 0.0)
    bench.run(5.0)
    assert bench.saw(Drifted) == 0
    bench.place_m = (4.0, 0.0, 0.0)
    bench.run(3.0)
    assert bench.saw(Drifted) == 1
    bench.place_m = (0.0, 0.0, 0.0)
    bench.run(3.0)
    assert bench.saw(Arrived) == 2


def test_an_old_position_takes_no_order(bench: Bench) -> None:
    bench.silence(3.0)
    bench.hear(
        Heartbeat(
            type=MavType.QUADROTOR,
            autopilot=MavAutopilot.PX4,
            custom_mode=bench.mode,
            base_mode=MavModeFlag.SAFETY_ARMED,
        )
    )
    bench.order()
    assert bench.reason() == "the vehicle's position is not known"


def test_an_autopilot_we_do_not_know_takes_no_order() -> None:
    bench = Bench()
    bench.autopilot = MavAutopilot.GENERIC
    bench.run(0.1)
    bench.order()
    assert bench.reason() == "no orders are given to an autopilot of kind other"


def test_ardupilots_heading_waits_for_the_acceptance_and_stops_when_it_agrees() -> None:
    bench = Bench(ARDUPILOT)
    bench.heading_deg = 0.0
    bench.run(0.1)
    bench.order()

    def targets() -> int:
        return sum(isinstance(message, SetPositionTargetGlobalInt) for message in bench.sent)

    bench.run(0.5)
    assert targets() == 0
    bench.ack()
    bench.run(5.0)
    assert targets() == 3
    bench.heading_deg = 90.0
    bench.run(10.0)
    assert targets() == 3
    bench.heading_deg = 100.0
    bench.run(1.0)
    assert targets() == 4


def test_the_point_goes_out_rounded_to_the_nearest_unit(bench: Bench) -> None:
    point = GeodeticPoint(lat_deg=-35.36329916, lon_deg=149.16534009, altitude_amsl_m=606.0)
    order = HoverOrder(order_id="o", point=point, heading_deg=270.0, aim=None, deadline_s=100.0)
    bench.vehicle.hover(order, bench.now)
    bench.hear()
    message = next(message for message in bench.sent if isinstance(message, CommandInt))
    assert (message.x, message.y) == (-353632992, 1491653401)
    assert message.param4 == pytest.approx(-math.pi / 2)
