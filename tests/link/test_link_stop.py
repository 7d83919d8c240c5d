"""Stops at speed: they end where the vehicle comes to rest, not where its autopilot had expected to."""

import math

import pytest

from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import CommandFinished
from hsop_gcs.link.messages import CommandLong, SetMode
from tests.link.two_ends import BAD, BOTH, PERFECT, Stack, TwoEnds


def stopped(ends: TwoEnds, *, at_speed_mps: float, for_s: float = 15.0) -> tuple[float, float]:
    """Order a stop on the way east; return how far the vehicle then flew, and how far back of that, metres."""
    ends.ready().order(east_m=400.0, north_m=0.0, up_m=20.0)
    ends.until(lambda: ends.sim.state.ground_speed_mps >= at_speed_mps)
    here_m = ends.sim.state.position_m[0]
    ends.vehicle.hold(ends.now)
    way_m = []
    end = ends.now + for_s
    while ends.now < end:
        ends.run(0.2)
        way_m.append(ends.sim.state.position_m[0] - here_m)
    return max(way_m), max(way_m) - way_m[-1]


@BOTH
@pytest.mark.parametrize("at_speed_mps", [4.0, 7.5])
def test_a_vehicle_stays_where_its_stop_has_ended(stack: Stack, at_speed_mps: float) -> None:
    """Left to itself, a PX4 that is stopped while it gathers speed comes back 8 m."""
    ends = TwoEnds(stack)
    far_m, back_m = stopped(ends, at_speed_mps=at_speed_mps)
    assert far_m < 20.0
    assert back_m < 1.2
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="hold", problem=None)]


@pytest.mark.parametrize("seed", range(3))
def test_it_stays_over_a_bad_line_too_or_comes_back_no_farther_than_by_itself(seed: int) -> None:
    far_m, back_m = stopped(TwoEnds("px4", impairment=BAD, seed=seed), at_speed_mps=4.0)
    assert far_m < 40.0, "the order itself may be late by two tries"
    assert back_m < 10.0


def test_what_stands_still_is_told_to_stop_once() -> None:
    ends = TwoEnds("px4", impairment=PERFECT).ready()
    ends.vehicle.hold(ends.now)
    ends.run(20.0)
    assert len(stops(ends)) == 1


def test_another_order_before_the_stop_has_ended_is_not_stopped() -> None:
    ends = TwoEnds("px4")
    stopped(ends, at_speed_mps=7.5, for_s=1.0)
    ends.order(order_id="back", east_m=-50.0, north_m=0.0, up_m=20.0)
    ends.run(30.0)
    assert len(stops(ends)) == 1
    assert ends.error_m() < 1.0


def test_a_vehicle_that_somebody_takes_over_while_it_stops_is_left_to_him() -> None:
    ends = TwoEnds("px4")
    stopped(ends, at_speed_mps=7.5, for_s=1.0)
    ends.send(SetMode(target_system=1, base_mode=1, custom_mode=0x0504_0000))
    ends.until(lambda: ends.vehicle.state.mode == "Return")
    ends.run(15.0)
    assert len(stops(ends)) == 1
    assert ends.vehicle.state.mode == "Return"


def stops(ends: TwoEnds) -> list[CommandLong]:
    return [
        message
        for _, message in ends.sent(MavCmd.DO_REPOSITION)
        if isinstance(message, CommandLong) and math.isnan(message.param5)
    ]
