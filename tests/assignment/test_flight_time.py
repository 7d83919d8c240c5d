"""How long flights take is what a host needs that gathers speed and stops, stepped through here."""

import math

import pytest

from hsop_gcs.assignment import Mover, flight_s

SPEED_MPS, CLIMB_MPS, ACCELERATION_MPS2 = 8.0, 1.5, 2.0
STEP_S = 0.005


def stepped_s(away_m: float) -> float:
    """From rest to rest, as fast as speed and acceleration allow."""
    left_m, speed_mps, time_s = away_m, 0.0, 0.0
    while left_m > 0.01:
        stops_from_mps = math.sqrt(2 * ACCELERATION_MPS2 * left_m)
        speed_mps = min(speed_mps + ACCELERATION_MPS2 * STEP_S, SPEED_MPS, stops_from_mps)
        left_m -= speed_mps * STEP_S
        time_s += STEP_S
    return time_s


@pytest.mark.parametrize("away_m", [1.0, 5.0, 20.0, 32.0, 50.0, 200.0])
def test_a_flight_lasts_until_the_host_has_gathered_speed_and_stopped(away_m: float) -> None:
    host = Mover(id="h1", position_m=(0.0, 0.0, 40.0), speed_mps=SPEED_MPS, climb_mps=CLIMB_MPS)
    assert flight_s(host, ((away_m, 0.0, 40.0),)) == pytest.approx(stepped_s(away_m), abs=0.15)
    by_a_point = flight_s(host, ((away_m, 0.0, 40.0), (away_m, away_m, 40.0)))
    assert by_a_point == pytest.approx(2 * stepped_s(away_m), abs=0.3), "it stops at each point of a route"
    assert flight_s(host, ((1.0, 0.0, 55.0),)) == pytest.approx(10.0), "a climb takes its own time"
