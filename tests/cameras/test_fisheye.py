"""The fisheye model by hand (Eqs. 1-3), and against OpenCV's."""

import math

import cv2
import numpy as np
import pytest

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.errors import BadInput

RADIAN = 1.0
PIXEL = 1.0
DISTORTIONS = [(0.0, 0.0, 0.0, 0.0), (0.02, -0.004, 0.001, -0.0002), (-0.05, 0.01, -0.001, 0.0)]


def directions(angles_rad: np.ndarray, turn_rad: float = 0.7) -> np.ndarray:
    """Unit rays at angles from the boresight, camera frame."""
    across = np.sin(angles_rad)
    return np.column_stack([across * math.cos(turn_rad), across * math.sin(turn_rad), np.cos(angles_rad)])


def test_table_1_gives_456_pixels_per_radian() -> None:
    assert FisheyeCamera().focal_length_px == pytest.approx(1.0 * 1504 / 3.3, abs=1e-9 * PIXEL)


def test_eq_1_by_hand() -> None:
    camera = FisheyeCamera(distortion=(0.1, 0.01, 0.001, 0.0001))
    assert float(camera.distorted_angle(0.5)) == pytest.approx(
        0.5 * (1 + 0.1 * 0.25 + 0.01 * 0.0625 + 0.001 * 0.015625 + 0.0001 * 0.00390625), abs=1e-15 * RADIAN
    )


def test_eq_3_by_hand_at_45_degrees() -> None:
    # θ / tan θ is π/4 at 45°; 1 m at 40 m.
    expected = 1.0 * 1504 / 3.3 / 40 * math.pi / 4
    assert float(FisheyeCamera().pixel_width(1.0, 40.0, math.pi / 4)) == pytest.approx(expected, abs=1e-9 * PIXEL)


def test_an_object_at_90_degrees_has_no_width() -> None:
    assert FisheyeCamera().pixel_width(1.0, 20.0, np.array([math.pi / 2, 2.0])).tolist() == [0.0, 0.0]


def test_an_object_shrinks_all_the_way_from_the_boresight_to_90_degrees() -> None:
    sizes = FisheyeCamera().relative_pixel_size(np.linspace(0, math.pi / 2, 200))
    assert sizes[0] == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(sizes) < 0).all()


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_the_slope_of_the_distorted_angle_is_its_derivative(distortion: tuple[float, float, float, float]) -> None:
    camera, angles, step = FisheyeCamera(distortion=distortion), np.linspace(0.05, 1.5, 30), 1e-6
    difference = (camera.distorted_angle(angles + step) - camera.distorted_angle(angles - step)) / (2 * step)
    np.testing.assert_allclose(camera.distorted_angle_slope(angles), difference, atol=1e-8)


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_distorted_angles_are_those_of_opencv(distortion: tuple[float, float, float, float]) -> None:
    camera, angles = FisheyeCamera(distortion=distortion), np.linspace(0.01, 1.56, 100)
    pixels = camera.project(directions(angles))
    centre = (camera.resolution_px - 1) / 2
    measured = np.hypot(*(pixels - centre).T) / camera.focal_length_px
    np.testing.assert_allclose(camera.distorted_angle(angles), measured, atol=1e-9 * RADIAN)


def test_the_boresight_meets_the_middle_of_the_sensor() -> None:
    np.testing.assert_allclose(FisheyeCamera().project([0.0, 0.0, 5.0]), [[751.5, 751.5]], atol=1e-9 * PIXEL)


def test_rays_from_behind_have_no_image() -> None:
    assert np.isnan(FisheyeCamera().project([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0]])).all()


def test_opencv_images_what_is_behind_where_its_opposite_would_be() -> None:
    camera, ray = FisheyeCamera(), np.array([[[0.6, 0.3, 0.4]]])
    ahead, behind = (
        cv2.fisheye.projectPoints(side * ray, np.zeros(3), np.zeros(3), camera.camera_matrix, np.zeros(4))[0][0, 0]
        for side in (1.0, -1.0)
    )
    np.testing.assert_allclose(ahead, camera.project(ray[0])[0], atol=1e-9 * PIXEL)
    np.testing.assert_allclose(behind, ahead, atol=1e-9 * PIXEL)


@pytest.mark.parametrize("field", ["focal_length_mm", "sensor_width_mm", "resolution_px", "min_pixels"])
@pytest.mark.parametrize("value", [0, -1.0, math.nan, math.inf])
def test_sizes_that_are_not_positive_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(BadInput, match=field):
        FisheyeCamera(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("distortion", [(math.nan, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-0.9, 0.0, 0.0, 0.0)])
def test_distortion_that_is_no_lens_is_refused(distortion: tuple[float, float, float, float]) -> None:
    with pytest.raises(BadInput, match="distortion"):
        FisheyeCamera(distortion=distortion)
