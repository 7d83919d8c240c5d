"""Every gate closes for what it is there for, says why, and opens again."""

import re
from dataclasses import replace
from typing import Any

import pytest

from hsop_gcs.fleet import FlightLimits
from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.enums import MavType
from hsop_gcs.link.protocol.telemetry import VehicleState
from hsop_gcs.mission.gates import Aircraft, Closed, closed
from hsop_gcs.placement.airspace import Airspace, KeepOut
from hsop_gcs.placement.problem import Point

NOW_S = 100.0
HERE = GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=500.0)
FLYING = VehicleState(
    system=1,
    link_up=True,
    autopilot="px4",
    type=MavType.QUADROTOR,
    armed=True,
    in_air=True,
    position=HERE,
    position_heard_s=NOW_S,
    heading_deg=0.0,
    home=HERE,
    battery_percent=80.0,
    gps_fix=3,
    estimator_healthy=True,
)
SQUARE = ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))
AIRSPACE = Airspace(
    inside=(SQUARE,), keep_outs=(KeepOut(polygon=((20.0, 20.0), (40.0, 20.0), (40.0, 40.0)), ceiling_m=30.0),)
)


def aircraft(
    *, loss: float | None = 0.1, position_m: Any = (0.0, 0.0, 40.0), obeys: bool = True, **changes: Any
) -> Aircraft:
    state = replace(FLYING, **changes)
    return Aircraft(id="h1", state=state, now_s=NOW_S, position_m=position_m, loss=loss, obeys=obeys)


def at(host: Aircraft, *ahead_m: Point, **limits: float) -> Closed | None:
    return closed(host, FlightLimits(**limits), AIRSPACE, ahead_m)


def test_a_host_in_good_order_passes_all() -> None:
    assert at(aircraft()) is None
    assert at(aircraft(gps_fix=None, estimator_healthy=None, loss=None)) is None
    assert at(aircraft(position_m=(35.0, 25.0, 31.0))) is None


@pytest.mark.parametrize(
    ("host", "gate", "reason"),
    [
        (aircraft(link_up=False), "link", "no link to the vehicle"),
        (aircraft(autopilot="other"), "autopilot", "no orders are given to an autopilot of kind other"),
        (aircraft(armed=False), "armed", "the vehicle is not armed"),
        (aircraft(armed=None), "armed", "the vehicle is not armed"),
        (aircraft(in_air=False), "in air", "the vehicle is on the ground"),
        (aircraft(in_air=None), "in air", "not known to be in the air"),
        (aircraft(position=None), "position", "position is not known"),
        (aircraft(position_heard_s=NOW_S - 3), "position", "position is not known"),
        (aircraft(heading_deg=None), "position", "heading is not known"),
        (aircraft(gps_fix=2), "position health", r"\(fix type 2\)"),
        (aircraft(estimator_healthy=False), "position health", "does not trust its position"),
        (aircraft(home=None), "home", "home is not known"),
        (aircraft(obeys=False, mode="Loiter"), "mode", r"somebody else flies it \(mode Loiter\)"),
        (aircraft(battery_percent=19.0), "battery", "19 % left, less than the reserve of 20 %"),
        (aircraft(battery_percent=None), "battery", "battery is not known"),
        (aircraft(loss=0.75), "link reserve", "loses 75% of the vehicle's messages, more than 60%"),
        (aircraft(position_m=(62.0, 0.0, 40.0)), "fence", "12 m outside the fence"),
        (aircraft(position_m=(35.0, 25.0, 29.0)), "keep-out", "inside a keep-out area"),
    ],
)
def test_a_gate_closes_with_a_reason(host: Aircraft, gate: str, reason: str) -> None:
    found = at(host)
    assert found is not None
    assert found.gate == gate
    assert re.search(reason, found.reason)


def test_a_reserve_of_nothing_asks_for_nothing() -> None:
    assert at(aircraft(battery_percent=None), battery_reserve_percent=0.0) is None
    assert at(aircraft(loss=0.99), link_loss_max=1.0) is None


def test_a_host_outside_passes_while_it_flies_straight_back_in() -> None:
    outside, in_keep_out = aircraft(position_m=(62.0, 0.0, 40.0)), aircraft(position_m=(36.0, 25.0, 20.0))
    assert at(outside, (0.0, 0.0, 40.0)) is None
    assert at(in_keep_out, (48.0, 0.0, 20.0)) is None
    for away in (at(outside, (80.0, 0.0, 40.0)), at(outside, (62.0, 40.0, 40.0), (0.0, 0.0, 40.0))):
        assert away is not None
        assert away.gate == "fence"
    through = at(in_keep_out, (0.0, 0.0, 20.0))
    assert through is not None
    assert through.gate == "keep-out"
