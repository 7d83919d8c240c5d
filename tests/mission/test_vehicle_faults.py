"""A fault of the service's own at one host, as the mission sees it: that host's order ends and is tried again."""

from typing import Any

from hsop_gcs.link.events import LinkLost, OrderFailed, VehicleFault
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.inputs import HostDeparted, HostRetried, HostStopped, Rules
from hsop_gcs.mission.state import Autonomy
from tests.mission.headless import Flight, Moment, fly
from tests.mission.test_behind import ONE, far_away

AT_S = 10.0


def test_a_machine_that_fails_once_costs_its_host_a_moment_and_the_other_host_nothing() -> None:
    broken: list[float] = []

    def watch(moment: Moment) -> None:
        if broken or moment.time_s < AT_S:
            return
        broken.append(moment.time_s)
        hover = moment.mission.link.vehicles[1]._hover

        def receive(*_: Any) -> None:
            raise RuntimeError("thrown in by a test")

        hover.receive = receive  # type: ignore[assignment, method-assign]

    flight = Flight(truth=ONE, hosts=2, duration_s=22.0, rules=Rules(autonomy=Autonomy.AUTO))
    mission = fly(flight, watch, far_away)
    of_h1 = [each.event for each in mission.events if each.host == "h1"]
    (fault,) = [event for event in of_h1 if isinstance(event, VehicleFault)]
    assert (fault.where, fault.problem) == ("hover", "RuntimeError: thrown in by a test")
    (failed,) = [event for event in of_h1 if isinstance(event, OrderFailed)]
    assert "the service failed at it (hover)" in failed.reason
    assert [type(event) for event in of_h1 if isinstance(event, HostRetried | HostDeparted)] == [
        HostDeparted,
        HostRetried,
        HostDeparted,
    ]
    of_h2 = [each.event for each in mission.events if each.host == "h2"]
    assert not [event for event in of_h2 if isinstance(event, HostStopped | OrderFailed | LinkLost | VehicleFault)]
    assert mission.state.progress["h1"].status in (OrderStatus.ACCEPTED, OrderStatus.ARRIVED, OrderStatus.ON_STATION)
    assert mission.link.vehicles[1].faults == 1
