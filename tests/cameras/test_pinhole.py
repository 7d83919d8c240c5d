"""The central camera by hand (Eq. 4)."""

import math

import pytest

from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.errors import BadInput

PIXEL = 1.0


def test_eq_4_by_hand() -> None:
    # 4.8 mm × 1280 px / 4.8 mm = 1280 px; 0.5 m at 32 m.
    assert float(PinholeCamera().pixel_width(0.5, 32.0)) == pytest.approx(20.0, abs=1e-9 * PIXEL)


def test_half_the_field_of_view_is_an_angle_in_radians() -> None:
    assert PinholeCamera(fov_deg=60).half_fov_rad == pytest.approx(math.pi / 6, abs=1e-12)


@pytest.mark.parametrize("field", ["focal_length_mm", "sensor_width_mm", "resolution_px", "min_pixels"])
@pytest.mark.parametrize("value", [0, -1.0, math.nan, math.inf])
def test_sizes_that_are_not_positive_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(BadInput, match=field):
        PinholeCamera(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("fov_deg", [0.0, -5.0, 180.0, math.nan])
def test_a_field_of_view_outside_0_to_180_degrees_is_refused(fov_deg: float) -> None:
    with pytest.raises(BadInput, match="fov_deg"):
        PinholeCamera(fov_deg=fov_deg)
