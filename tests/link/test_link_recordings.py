"""Our orders against what real autopilots answered: recordings of ArduCopter 4.7.0-dev and PX4 1.16.0."""

import math
from pathlib import Path

import pytest

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.events import Arrived, Event, OrderAccepted, OrderFailed
from hsop_gcs.link.messages import CommandInt, GimbalManagerInformation, SetPositionTargetGlobalInt
from hsop_gcs.link.protocol.hover import HoverOrder
from hsop_gcs.link.router import Router
from hsop_gcs.link.tlog import read_tlog
from hsop_gcs.link.vehicle import Vehicle

DATA = Path(__file__).parent.parent / "data"
PX4_LOG, ARDUPILOT_LOG = DATA / "px4-1.16.0-sih.tlog", DATA / "arducopter-4.7.0-dev.tlog"


def fly_along(
    path: Path, system: int, *, flags: float
) -> tuple[list[tuple[float, Event]], list[SetPositionTargetGlobalInt]]:
    """Order what the recorded ground station ordered, when it did, and hear what the autopilot then said."""
    vehicle = Vehicle(system)
    events: list[tuple[float, Event]] = []
    targets: list[SetPositionTargetGlobalInt] = []
    start_s = None
    with path.open("rb") as file:
        for time_s, frame in read_tlog(file):
            start_s = time_s if start_s is None else start_s
            now, message = time_s - start_s, frame.message
            vehicle.advance(now)
            if frame.system == system:
                vehicle.receive(message, now, component=frame.component)
            elif isinstance(message, CommandInt) and message.param2 == flags and abs(message.x) < 900_000_000:
                point = GeodeticPoint(lat_deg=message.x / 1e7, lon_deg=message.y / 1e7, altitude_amsl_m=message.z)
                heading_deg = math.degrees(message.param4)
                vehicle.hover(
                    HoverOrder(
                        order_id=f"{now:.0f}", point=point, heading_deg=heading_deg, aim=None, deadline_s=now + 5
                    ),
                    now,
                )
            targets += [sent for sent in vehicle.take_outgoing() if isinstance(sent, SetPositionTargetGlobalInt)]
            events += [(now, event) for event in vehicle.take_events()]
    return events, targets


def test_the_recorded_px4_arrives_although_it_reports_speed_while_it_rests() -> None:
    events, targets = fly_along(PX4_LOG, 11, flags=1.0)
    arrived = [(now, event.order_id) for now, event in events if isinstance(event, Arrived)]
    assert [order_id for _, order_id in arrived] == ["19"]
    assert 30.0 < arrived[0][0] < 40.0
    assert targets == []


def test_the_recorded_return_ends_the_order_on_its_way() -> None:
    events, _ = fly_along(PX4_LOG, 11, flags=1.0)
    assert [event.reason for _, event in events if isinstance(event, OrderFailed)] == [
        "the vehicle is in mode Return, which is not ours"
    ]


def test_the_recorded_ardupilot_arrives_only_once_its_nose_was_turned() -> None:
    events, targets = fly_along(ARDUPILOT_LOG, 1, flags=0.0)
    arrived = [now for now, event in events if isinstance(event, Arrived)]
    assert len(arrived) == 1
    assert 36.0 < arrived[0] < 42.0
    assert len(targets) > 5
    assert {target.type_mask for target in targets} == {2552}


@pytest.mark.parametrize(("path", "system"), [(PX4_LOG, 11), (ARDUPILOT_LOG, 1)])
def test_a_recording_goes_through_the_router_without_a_bad_or_refused_frame(path: Path, system: int) -> None:
    router = Router([system])
    peer = Peer(0, "127.0.0.1", 14550)
    with path.open("rb") as file:
        for time_s, frame in read_tlog(file):
            if frame.system != 255:
                router.receive(frame.raw, peer, time_s)
                router.advance(time_s)
                router.take_outgoing()
    counters = router.counters
    assert counters.received > 1000
    assert (counters.bad_frames, counters.refused, counters.peers_turned_away) == (0, 0, 0)
    assert router.vehicles[system].state.link_up


def test_the_recorded_px4_is_accepted_with_the_change_mode_flag() -> None:
    events, _ = fly_along(PX4_LOG, 11, flags=1.0)
    assert sum(isinstance(event, OrderAccepted) for _, event in events) == 2


def test_the_recorded_gimbal_limits_are_degrees_in_one_and_radians_in_the_other() -> None:
    spans = {}
    for path, system in ((PX4_LOG, 11), (ARDUPILOT_LOG, 1)):
        vehicle = Vehicle(system)
        with path.open("rb") as file:
            for time_s, frame in read_tlog(file):
                if frame.system == system:
                    vehicle.receive(frame.message, time_s, component=frame.component)
                if isinstance(frame.message, GimbalManagerInformation):
                    adapter = vehicle.adapter
                    assert adapter is not None
                    limits = adapter.gimbal_limits(frame.message)
                    spans[system] = (round(limits.tilt_min_deg), round(limits.tilt_max_deg), round(limits.pan_max_deg))
    assert spans == {11: (-45, 45, 180), 1: (-90, 45, 170)}
