"""Giving way: no host comes nearer to a threat by its own motion, and each flees as far as its speed allows."""

import math

import pytest

from hsop_gcs.simulator.fleet import Autopilot
from tests.mission.closing import OWN_MPS, SAFETY_M, TICK_S, circle, flown, flown_ways
from tests.mission.headless import Truth

PX4, ARDUPILOT = Autopilot.PX4, Autopilot.ARDUPILOT
HOVER = (0.0, 60.0, 30.0)
SHORT_M = 1.5
"""How much nearer a threat may come than to the host that flees at its limit, besides what it flies in one look: a
vehicle answers late, and a track shows a turn late."""


def turns_towards(speed_mps: float, aside_m: float, at_s: float = 14.0) -> Truth:
    """A threat that flies past the hover point, north, and beside it turns towards it."""
    start = [aside_m, HOVER[1] - speed_mps * at_s, HOVER[2]]
    turn = {"at_s": at_s, "for_s": 3.0, "rate_deg_s": -30.0}
    return flown_ways({"position_m": start, "velocity_mps": [0.0, speed_mps, 0.0], "turns": [turn]})


def arrives(*, by: tuple[float, float, float], at_s: float = 20.0) -> Truth:
    """A threat that flies straight to the hover point."""
    start = [place - at_s * speed for place, speed in zip(HOVER, by, strict=True)]
    return flown_ways({"position_m": start, "velocity_mps": list(by)})


@pytest.mark.parametrize(
    ("truth", "duration_s", "autopilot"),
    [
        (circle((0.0, 90.0, 30.0), 30.0, 4.0, phase_deg=60.0), 32.0, ARDUPILOT),
        (circle((0.0, 80.0, 30.0), 20.0, 2.0, phase_deg=80.0), 32.0, PX4),
        (turns_towards(4.0, 26.0), 24.0, PX4),
        (arrives(by=(0.0, -2.5, -2.5)), 24.0, ARDUPILOT),
    ],
    ids=["on a circle of 30 m", "on a circle of 20 m", "turning towards it", "diving at it"],
)
def test_a_host_keeps_away_from_a_threat_as_far_as_its_speed_allows(
    truth: Truth, duration_s: float, autopilot: Autopilot
) -> None:
    outcome = flown(truth, [HOVER], duration_s=duration_s, autopilot=autopilot, camera_period_s=0.2)
    assert outcome.closing() == [], f"faster than {OWN_MPS} m/s towards it within {SAFETY_M} m"
    assert outcome.moves["HostGaveWay"] >= 1
    assert outcome.short_of_the_limit_m() <= SHORT_M + 4.0 * TICK_S
    assert outcome.nearest_m() > 15.0


def test_between_two_threats_that_close_from_both_sides_a_host_leaves_sideways() -> None:
    truth = flown_ways(
        {"position_m": [66.0, *HOVER[1:]], "velocity_mps": [-3.0, 0.0, 0.0]},
        {"position_m": [-66.0, *HOVER[1:]], "velocity_mps": [3.0, 0.0, 0.0]},
    )
    outcome = flown(truth, [HOVER], duration_s=22.0)
    assert outcome.closing() == []
    assert outcome.nearest_m() > SAFETY_M - SHORT_M
    here = outcome.encounters["h1", "t1"].host_m[-1]
    assert math.dist(here[:1], HOVER[:1]) < 15.0 < abs(here[1] - HOVER[1])
