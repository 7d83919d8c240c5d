"""Images and rays of a lens in the world are each other's inverse, and carry the noise they say."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.sight import Sight, central_sight, fisheye_sight

BENT = FisheyeCamera(distortion=(0.02, -0.01, 0.003, -0.0005))


def sight(lens: FisheyeCamera | PinholeCamera, noise_px: float = 1.0) -> Sight:
    if isinstance(lens, PinholeCamera):
        return central_sight(lens, [5.0, 1.0, 2.0], 0.4, 0.1, noise_px=noise_px)
    return fisheye_sight(lens, [5.0, 1.0, 2.0], 0.4, towards_m=[5.4, 2.0, 2.0], noise_px=noise_px)


def point_off_axis(eye: Sight, off_deg: float, around_deg: float, distance_m: float = 30.0) -> np.ndarray:
    off, around = math.radians(off_deg), math.radians(around_deg)
    local = np.array([math.sin(off) * math.cos(around), math.sin(off) * math.sin(around), math.cos(off)])
    return np.asarray(eye.origin_m + distance_m * local @ eye.axes)


@settings(max_examples=100, deadline=None)
@given(st.sampled_from([FisheyeCamera(), BENT, PinholeCamera()]), st.floats(0, 89.5), st.floats(0, 360))
def test_the_ray_of_a_points_image_goes_through_the_point(
    lens: FisheyeCamera | PinholeCamera, off_deg: float, around_deg: float
) -> None:
    eye = sight(lens)
    point = point_off_axis(eye, off_deg, around_deg)
    ray = eye.rays(eye.image_of(point)).directions[0, 0]
    assert ray == pytest.approx((point - eye.origin_m) / 30.0, abs=1e-9)


@pytest.mark.parametrize("lens", [FisheyeCamera(), BENT])
def test_images_are_those_of_opencvs_fisheye_model(lens: FisheyeCamera) -> None:
    eye = sight(lens)
    points = np.array([point_off_axis(eye, off, 37.0 * off) for off in (*range(0, 90, 7), 89.0, 89.999)])
    local = (points - eye.origin_m) @ eye.axes.T
    seen, _ = cv2.fisheye.projectPoints(
        local[:, None], np.zeros(3), np.zeros(3), lens.camera_matrix, np.array(lens.distortion)
    )
    centre = (lens.resolution_px - 1) / 2
    ours = np.array([eye.image_of(point) for point in points]) + centre
    angle = np.linalg.norm(ours - seen[:, 0], axis=1) / lens.focal_length_px
    assert angle.max() <= 1e-9


@pytest.mark.parametrize("lens", [FisheyeCamera(), BENT])
def test_opencv_looks_the_same_way_through_a_pixel(lens: FisheyeCamera) -> None:
    eye = sight(lens)
    # OpenCV takes no θ_d above 90°, and so loses the rim of a lens that bends outwards
    images = np.array([eye.image_of(point_off_axis(eye, off, 37.0 * off)) for off in range(1, 80, 3)])
    pixels = images + (lens.resolution_px - 1) / 2
    slopes = cv2.fisheye.undistortPoints(pixels[:, None], lens.camera_matrix, np.array(lens.distortion))[:, 0]
    right, down, ahead = eye.axes @ eye.rays(images).directions[:, 0].T
    np.testing.assert_allclose(np.column_stack([right, down]) / ahead[:, None], slopes, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("lens", [FisheyeCamera(), BENT, PinholeCamera()])
@pytest.mark.parametrize("off_deg", [0.0, 25.0, 70.0])
def test_directions_scatter_as_the_whiteners_say(lens: FisheyeCamera | PinholeCamera, off_deg: float) -> None:
    eye = sight(lens, noise_px=2.0)
    image = eye.image_of(point_off_axis(eye, off_deg, 200.0))
    noise = np.random.default_rng(0).standard_normal((40_000, 2))
    directions = eye.rays(image + 2.0 * noise).directions[:, 0]
    whitened = directions @ eye.rays(image).whiteners[0, 0].T
    assert np.cov(whitened.T) == pytest.approx(np.eye(2), abs=0.03)


def test_noise_that_pushes_a_pixel_over_the_rim_gives_a_ray_beyond_90_degrees() -> None:
    for lens in (FisheyeCamera(), BENT):
        eye = sight(lens)
        rim = eye.image_of(point_off_axis(eye, 90.0, 0.0))
        beyond = eye.rays(rim * 1.05).directions[0, 0]
        assert math.degrees(math.acos(beyond @ eye.axes[2])) == pytest.approx(94.5, abs=1.5)


def test_what_lies_beyond_90_degrees_has_no_image() -> None:
    for lens in (FisheyeCamera(), PinholeCamera()):
        eye = sight(lens)
        with pytest.raises(ValueError, match="has no image"):
            eye.image_of(point_off_axis(eye, 91.0, 10.0))


def test_each_point_belongs_to_the_fisheye_that_is_turned_towards_it() -> None:
    ahead = fisheye_sight(FisheyeCamera(), [0, 0, 0], 0.0, towards_m=[3.0, 10.0, 0.0], noise_px=30.0)
    astern = fisheye_sight(FisheyeCamera(), [0, 0, 0], 0.0, towards_m=[3.0, -10.0, 0.0], noise_px=30.0)
    assert ahead.axes[2] == pytest.approx([0, 1, 0], abs=1e-12)
    assert astern.axes[2] == pytest.approx([0, -1, 0], abs=1e-12)


def test_reach_is_where_a_threat_has_the_least_width_the_detector_takes() -> None:
    assert sight(PinholeCamera()).reach_m(1.0) == pytest.approx(1280 / 30)
    assert sight(FisheyeCamera()).reach_m(1.0) == pytest.approx(1504 / 3.3 / 5)
