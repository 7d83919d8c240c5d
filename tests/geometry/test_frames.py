"""The local frame against an independent library, and compass angles against what a person would draw."""

import math

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame, aim_at, compass_deg, wrap_deg, wrap_rad

MICROMETRE = 1e-6
ORIGIN = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)

offsets_m = st.floats(-20_000, 20_000, allow_nan=False)


@given(offsets_m, offsets_m, st.floats(-500, 5000), st.floats(-89, 89), st.floats(-180, 180))
def test_a_place_survives_the_way_to_the_local_frame_and_back(
    east: float, north: float, up: float, lat_deg: float, lon_deg: float
) -> None:
    frame = LocalFrame(GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=100.0))
    back = frame.to_enu(frame.to_geodetic(np.array([east, north, up])))
    assert back == pytest.approx([east, north, up], abs=MICROMETRE)


@pytest.mark.parametrize("lat_deg", [47.40, 47.39, 47.30])
@pytest.mark.parametrize("lon_deg", [8.50, 8.60])
def test_the_local_frame_agrees_with_an_independent_library(lat_deg: float, lon_deg: float) -> None:
    ours = LocalFrame(ORIGIN).to_enu(GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=530.0))
    theirs = pymap3d.geodetic2enu(lat_deg, lon_deg, 530.0, ORIGIN.lat_deg, ORIGIN.lon_deg, ORIGIN.altitude_amsl_m)
    assert ours == pytest.approx([float(value) for value in theirs], abs=MICROMETRE)


@pytest.mark.parametrize(
    ("east", "north", "compass"), [(0, 1, 0), (1, 0, 90), (0, -1, 180), (-1, 0, 270), (1, 1, 45), (-1, 1, 315)]
)
def test_compass_courses_run_clockwise_from_north(east: float, north: float, compass: float) -> None:
    assert compass_deg(east, north) == pytest.approx(compass)


def test_a_camera_below_its_target_looks_up() -> None:
    aim = aim_at(np.array([0.0, 0.0, 10.0]), np.array([30.0, 0.0, 40.0]))
    assert (aim.pan_deg, aim.tilt_deg) == pytest.approx((90.0, 45.0))


@given(st.floats(-1e4, 1e4))
def test_wrapping_keeps_the_angle_and_its_range(angle: float) -> None:
    assert -180 <= wrap_deg(angle) < 180
    assert math.isclose(math.cos(math.radians(wrap_deg(angle))), math.cos(math.radians(angle)), abs_tol=1e-9)
    assert -math.pi <= wrap_rad(angle) < math.pi
    assert math.isclose(math.sin(wrap_rad(angle)), math.sin(angle), abs_tol=1e-9)
