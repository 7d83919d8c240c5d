"""How evenly a camera is led along with its threat."""

from itertools import pairwise

from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import OnStation
from hsop_gcs.link.protocol.gimbal import GimbalTolerances
from tests.link.two_ends import BOTH, Stack, TwoEnds

TICK_S = 0.205
"""Of the mission: a fifth of a second, and what its work takes."""
TICKS = 30
RUN_S = 4.0
PERIOD_S = GimbalTolerances().least_period_s


def on_station(stack: Stack) -> TwoEnds:
    """A vehicle at its hover point, its camera aimed."""
    ends = TwoEnds(stack).ready()
    ends.order(aim=Aim(pan_deg=10.0, tilt_deg=-5.0))
    ends.until(lambda: ends.saw(OnStation))
    return ends


@BOTH
def test_an_aim_that_moves_all_the_time_is_sent_evenly(stack: Stack) -> None:
    ends = on_station(stack)
    started = ends.now
    for tick in range(TICKS):
        ends.vehicle.follow(Aim(pan_deg=10.0 + 2.0 * tick, tilt_deg=-5.0), ends.now)
        ends.run(TICK_S)
    times = [at for at, _ in ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW) if at > started]
    assert len(times) >= TICKS - 2
    periods = [(later - earlier) / PERIOD_S for earlier, later in pairwise(times)]
    assert all(0.99 < each < 1.01 or 1.99 < each < 2.01 for each in periods)


@BOTH
def test_an_aim_that_moves_all_the_time_is_sent_no_more_than_five_times_a_second(stack: Stack) -> None:
    ends = on_station(stack)
    started = ends.now
    while ends.now < started + RUN_S:
        ends.vehicle.follow(Aim(pan_deg=10.0 + 20.0 * (ends.now - started), tilt_deg=-5.0), ends.now)
        ends.run(0.02)
    times = [at for at, _ in ends.sent(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW) if at > started]
    assert 4 * RUN_S <= len(times) <= 5 * RUN_S + 1
