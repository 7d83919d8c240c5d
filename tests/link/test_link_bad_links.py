"""Plans over links that lose 30 % each way, delay by 300 ± 200 ms and double 5 %: everything once, in its order."""

import math

import numpy as np
import pytest

from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.events import Arrived, OrderAccepted, OrderFailed
from hsop_gcs.simulator.channel import Impairment
from tests.link.bad_links import HEIGHT_M, FleetOverBadLinks, HostPlan

HOSTS = 6
TERRIBLE = Impairment(loss=0.3, duplication=0.05, delay_s=0.3, jitter_s=0.2)
METRE = 1.0


def plan(name: str, *, north_m: float, via: bool) -> list[HostPlan]:
    """Hover points 15 m apart, each host by a point of its own beside the straight way if asked for."""
    hosts = []
    for index in range(HOSTS):
        goal = (15.0 * index, north_m, HEIGHT_M + index)
        legs = [(15.0 * index + 10.0, north_m / 2, HEIGHT_M), goal] if via else [goal]
        aim = Aim(pan_deg=20.0 * index, tilt_deg=-10.0)
        hosts.append(HostPlan(f"{name}/h{index + 1}", legs, heading_deg=30.0 * index, aim=aim))
    return hosts


FIRST, SECOND = plan("P1", north_m=70.0, via=True), plan("P2", north_m=110.0, via=False)


def fly_both(impairment: Impairment, seed: int) -> tuple[FleetOverBadLinks, list[float]]:
    fleet = FleetOverBadLinks(HOSTS, impairment, seed).ready()
    return fleet, [fleet.fly(each, within_s=200.0) for each in (FIRST, SECOND)]


def check_two_plans(seed: int) -> None:
    """Fly both plans over good links and over terrible ones, and hold them against each other."""
    _, without_loss_s = fly_both(Impairment(), seed)
    fleet, took_s = fly_both(TERRIBLE, seed)
    for bad_s, good_s in zip(took_s, without_loss_s, strict=True):
        assert bad_s <= 3 * good_s
    assert fleet.of(OrderFailed) == []
    lost_to_vehicles = sum(end.inward.lost for end in fleet.ends)
    assert lost_to_vehicles / fleet.router.counters.sent == pytest.approx(TERRIBLE.loss, abs=0.05)
    assert fleet.router.counters.lost > 0
    for index, end in enumerate(fleet.ends):
        wanted_m = [*FIRST[index].legs_m, *SECOND[index].legs_m]
        # Before the first order it hovered where it was; a goal taken up twice in a row is still one goal.
        flown_m = [goal for goal in end.flown_m if np.linalg.norm(np.subtract(goal, end.flown_m[0])) > 1.0 * METRE]
        assert np.allclose(flown_m, wanted_m, atol=0.5 * METRE), f"host {index + 1} flew to {flown_m}"
        ids = [event.order_id for event in fleet.of(OrderAccepted) if event.system == index + 1]
        assert ids == [f"P1/h{index + 1}/via1", f"P1/h{index + 1}", f"P2/h{index + 1}"]
        arrived = [event.order_id for event in fleet.of(Arrived) if event.system == index + 1]
        assert arrived == [f"P1/h{index + 1}", f"P2/h{index + 1}"]
        assert np.allclose(end.position_m, wanted_m[-1], atol=1.0 * METRE)
        assert abs(math.degrees(end.vehicle.state.heading_rad) - SECOND[index].heading_deg) < 3


def test_two_plans_are_carried_out_once_and_in_order_over_terrible_links() -> None:
    check_two_plans(seed=0)
