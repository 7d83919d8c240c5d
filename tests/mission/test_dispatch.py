"""What becomes of an order as its host's link tells of it."""

import pytest

from hsop_gcs.assignment import HostOrder
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.events import Arrived, Drifted, Event, GimbalOffTarget, GimbalOnTarget, OnStation, OrderAccepted
from hsop_gcs.mission.dispatch import OrderProgress, OrderStatus, progressed

ORDER = HostOrder(host="h1", position_m=(1.0, 2.0, 30.0), heading_deg=90.0, aim=Aim(pan_deg=0, tilt_deg=0), views=())
NAME = {"system": 1, "order_id": "P1/h1"}
ACCEPTED, ARRIVED, ON_STATION = OrderAccepted(**NAME), Arrived(**NAME), OnStation(**NAME)  # type: ignore[arg-type]
ON_TARGET, OFF_TARGET = GimbalOnTarget(**NAME), GimbalOffTarget(**NAME)  # type: ignore[arg-type]
DRIFTED = Drifted(**NAME, problem="3 m away")  # type: ignore[arg-type]


def after(*events: Event) -> OrderProgress:
    progress = OrderProgress(order_id="P1/h1", plan_id="P1", order=ORDER, status=OrderStatus.SENT)
    for event in events:
        progress = progressed(progress, event)
    return progress


@pytest.mark.parametrize(
    ("events", "status"),
    [
        ((ACCEPTED,), OrderStatus.ACCEPTED),
        ((ACCEPTED, ON_TARGET, OFF_TARGET), OrderStatus.ACCEPTED),
        ((ACCEPTED, ON_TARGET, ARRIVED, ON_STATION), OrderStatus.ON_STATION),
        ((ACCEPTED, ON_TARGET, ARRIVED, ON_STATION, OFF_TARGET), OrderStatus.ARRIVED),
        ((ACCEPTED, ON_TARGET, ARRIVED, ON_STATION, DRIFTED, OFF_TARGET), OrderStatus.ACCEPTED),
    ],
)
def test_a_gimbal_that_loses_its_target_on_the_way_makes_no_arrival(
    events: tuple[Event, ...], status: OrderStatus
) -> None:
    assert after(*events).status is status
