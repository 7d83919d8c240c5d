"""Wind, satellite errors and batteries, at simulated vehicles of both stacks."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.enums import MavBatteryChargeState, MavCmd
from hsop_gcs.link.messages import Attitude, BatteryStatus, GlobalPositionInt, SysStatus
from hsop_gcs.simulator.battery import BatteryConfig
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.disturbances import Drift, GpsError, Wind
from tests.simulator.station import CONFIG, Station, ardupilot, px4

METRE = 1.0
STACKS = [pytest.param(px4, id="px4"), pytest.param(ardupilot, id="ardupilot")]
Stack = Callable[[VehicleConfig], Station]
AIRBORNE = replace(CONFIG, airborne_m=30.0)


def path(station: Station, seconds: float) -> np.ndarray:
    """Return the true positions at every twentieth of a second."""
    positions = []
    for _ in range(round(seconds / 0.05)):
        station.wait(0.05)
        positions.append(station.vehicle.state.position_m)
    return np.array(positions)


def test_a_drift_keeps_its_standard_deviation_and_forgets_in_its_time() -> None:
    drift = Drift(2.0, 5.0, 200, np.random.default_rng(1))
    first = np.array(drift.value)
    for _ in range(250):
        drift.step(0.1)
    assert np.std(drift.value) == pytest.approx(2.0, rel=0.2)
    # 25 s are five correlation times: a correlation of 0.7 %, seen through 200 samples.
    assert abs(np.corrcoef(first, drift.value)[0, 1]) < 0.3


@pytest.mark.parametrize("stack", STACKS)
def test_a_vehicle_holds_its_place_in_gusts_and_leans_into_the_wind(stack: Stack) -> None:
    station = stack(replace(AIRBORNE, wind=Wind(speed_mps=8.0, from_deg=270.0, gust_mps=2.0)))
    station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=float(Attitude.ID), param2=1e5)
    positions = path(station, 40.0)
    off_m = np.hypot(positions[:, 0], positions[:, 1])
    assert 0.05 * METRE < np.max(off_m) < 1.5 * METRE
    # The nose is north and the wind comes from the west: it rolls left.
    assert math.degrees(station.last(Attitude).roll) == pytest.approx(-11.0, abs=6.0)


def test_a_wind_stronger_than_the_airframe_carries_it_away() -> None:
    station = px4(replace(AIRBORNE, wind=Wind(speed_mps=AIRBORNE.flight.max_speed_mps + 3.0, from_deg=0.0)))
    assert path(station, 20.0)[-1][1] < -20.0 * METRE


def test_the_same_seed_gives_the_same_gusts() -> None:
    windy = replace(AIRBORNE, wind=Wind(gust_mps=2.0))
    assert np.array_equal(path(px4(windy), 5.0), path(px4(windy), 5.0))


@pytest.mark.parametrize("stack", STACKS)
def test_a_vehicle_believes_its_receiver_and_stands_beside_its_point(stack: Stack) -> None:
    offset_m = (2.0, -1.0, 0.5)
    station = stack(replace(AIRBORNE, gps=GpsError(offset_m=offset_m, noise_m=0.2)))
    station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=float(GlobalPositionInt.ID), param2=1e5)
    station.wait(1.0)
    station.reposition(15.0, 10.0, 32.0)
    station.wait(15.0)
    really_m = np.array(station.vehicle.state.position_m)
    assert np.linalg.norm(really_m - (np.array([15.0, 10.0, 32.0]) - offset_m)) < 1.2 * METRE
    told = station.last(GlobalPositionInt)
    place = GeodeticPoint(lat_deg=told.lat * 1e-7, lon_deg=told.lon * 1e-7, altitude_amsl_m=told.alt * 1e-3)
    assert np.linalg.norm(station.vehicle.local.to_enu(place) - [15.0, 10.0, 32.0]) < 0.6 * METRE


@pytest.mark.parametrize("stack", STACKS)
def test_a_battery_drains_in_the_air_and_is_told(stack: Stack) -> None:
    station = stack(replace(AIRBORNE, battery=BatteryConfig(endurance_s=100.0, percent=80.0)))
    for message in (SysStatus, BatteryStatus):
        station.command_long(MavCmd.SET_MESSAGE_INTERVAL, param1=float(message.ID), param2=2e5)
    station.wait(20.0)
    assert station.last(SysStatus).battery_remaining == pytest.approx(60, abs=1)
    assert station.last(BatteryStatus).battery_remaining == pytest.approx(60, abs=1)
    assert station.last(SysStatus).voltage_battery < station.all(SysStatus)[0].voltage_battery


def test_a_battery_on_the_ground_keeps_its_charge() -> None:
    station = px4(replace(CONFIG, battery=BatteryConfig(endurance_s=10.0)))
    station.wait(20.0)
    assert station.vehicle.battery_percent == 100


@pytest.mark.parametrize("stack", STACKS)
def test_a_low_battery_is_told_before_the_failsafe_brings_the_vehicle_home(stack: Stack) -> None:
    config = replace(AIRBORNE, battery=BatteryConfig(endurance_s=300.0, percent=22.0))
    station = stack(config)
    station.wait(1.0)
    station.reposition(20.0, 0.0, 30.0)
    station.wait(120.0)
    low = next(i for i, text in enumerate(station.texts) if "low" in text.lower())
    assert "attery" in station.texts[low]
    assert not station.vehicle.in_air
    assert station.vehicle.battery.level >= MavBatteryChargeState.LOW
    assert np.hypot(*station.vehicle.state.position_m[:2]) < 2.0 * METRE
