"""Where a vehicle's gimbal looks and who steers it, our vehicle machine against simulated autopilots."""

import math

import numpy as np
import pytest

from hsop_gcs.geometry.frames import Aim
from hsop_gcs.link.enums import MavCmd
from hsop_gcs.link.events import AimClipped, GimbalControlLost, GimbalFailed, GimbalOffTarget, GimbalOnTarget, OnStation
from hsop_gcs.link.messages import CommandLong
from hsop_gcs.link.protocol.gimbal import separation_deg
from hsop_gcs.simulator.gimbal import GimbalLimits
from tests.link.two_ends import BOTH, DEGREE, Stack, TwoEnds


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
