"""The drawn regions are exactly where the planner's pixel widths say."""

import math

import numpy as np
import pytest

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.regions import central_region, peripheral_region

MILLIMETRE = 1e-3


@pytest.mark.parametrize("size_m", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.05, 0.01, 0.0, 0.0)])
def test_on_the_peripheral_outline_an_object_is_just_wide_enough(
    size_m: float, distortion: tuple[float, float, float, float]
) -> None:
    lens = FisheyeCamera(distortion=distortion)
    heading = 0.7
    outline = peripheral_region(lens, size_m, heading)
    distance = np.hypot(*outline.T)
    off = (np.arctan2(*outline.T) - heading + math.pi) % (2 * math.pi) - math.pi
    off = np.minimum(np.abs(off), math.pi - np.abs(off))
    seen = distance > MILLIMETRE
    assert lens.pixel_width(size_m, distance[seen], off[seen]) == pytest.approx(lens.min_pixels, rel=1e-9)


def test_the_peripheral_region_has_two_lobes_that_meet_in_the_camera() -> None:
    lens = FisheyeCamera()
    outline = peripheral_region(lens, 1.0)
    distance = np.hypot(*outline.T)
    assert distance.max() == pytest.approx(1504 / 3.3 / 5, abs=MILLIMETRE)
    assert outline[distance.argmax(), 0] == pytest.approx(0.0, abs=MILLIMETRE)
    assert distance[90] == pytest.approx(0.0, abs=MILLIMETRE)
    assert outline[0] == pytest.approx(outline[-1], abs=MILLIMETRE)


def test_the_central_region_is_a_sector_of_the_field_of_view() -> None:
    lens = PinholeCamera()
    outline = central_region(lens, 1.5, math.radians(90))
    arc = outline[1:-1]
    assert lens.pixel_width(1.5, np.hypot(*arc.T)) == pytest.approx(np.full(len(arc), lens.min_pixels))
    bearings = np.degrees(np.arctan2(arc[:, 0], arc[:, 1]))
    assert (bearings[0], bearings[-1]) == pytest.approx((90 - 26.5, 90 + 26.5))
    assert not outline[0].any()
    assert not outline[-1].any()


def test_regions_grow_in_proportion_to_the_object() -> None:
    small, large = peripheral_region(FisheyeCamera(), 0.5), peripheral_region(FisheyeCamera(), 1.5)
    assert large == pytest.approx(3 * small)
