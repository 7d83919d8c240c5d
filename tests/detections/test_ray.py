"""From the truth to a pixel and back to a ray, at every attitude."""

import math

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import chi2

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.detections import Detection, Direction, Lens, Pixel, Pose, to_ray
from hsop_gcs.detections.detection import Reason, Unusable
from hsop_gcs.detections.ray import body_axes
from hsop_gcs.geometry.frames import Aim, aim_at
from hsop_gcs.simulator.eyes import image
from hsop_gcs.simulator.truth import TrueState
from tests.detections.examples import NOW_S, PIXEL, RADIAN, RIG, angle_between_rad, pixel_detection

NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
DISTORTED = CameraRig(peripheral=FisheyeCamera(distortion=(0.05, -0.01, 0.002, -0.0003)))


def euler_zyx(heading_rad: float, pitch_rad: float, roll_rad: float) -> npt.NDArray[np.float64]:
    """Body to north-east-down, from three elementary rotations: forward, right, down are its columns."""
    (cz, sz), (cy, sy), (cx, sx) = ((math.cos(a), math.sin(a)) for a in (heading_rad, pitch_rad, roll_rad))
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return np.asarray(about_z @ about_y @ about_x)


angles = st.floats(-180, 180)
tilts = st.floats(-60, 60)


@given(heading_deg=angles, roll_deg=tilts, pitch_deg=tilts)
def test_body_axes_are_those_of_mavlinks_attitude(heading_deg: float, roll_deg: float, pitch_deg: float) -> None:
    heading, roll, pitch = map(math.radians, (heading_deg, roll_deg, pitch_deg))
    forward, right, down = (NED_TO_ENU @ euler_zyx(heading, pitch, roll)).T
    assert body_axes(heading, roll, pitch) == pytest.approx(np.array([right, down, forward]), abs=1e-12)


@pytest.mark.parametrize("rig", [RIG, DISTORTED], ids=["no distortion", "distorted"])
@given(
    heading_deg=angles,
    roll_deg=tilts,
    pitch_deg=tilts,
    azimuth=angles,
    elevation=st.floats(-80, 80),
    off=st.floats(0, 24),
)
def test_truth_to_pixel_to_ray_comes_back_to_the_truth(
    rig: CameraRig, heading_deg: float, roll_deg: float, pitch_deg: float, azimuth: float, elevation: float, off: float
) -> None:
    origin = (3.0, -7.0, 40.0)
    direction = np.array(
        [
            math.sin(math.radians(azimuth)) * math.cos(math.radians(elevation)),
            math.cos(math.radians(azimuth)) * math.cos(math.radians(elevation)),
            math.sin(math.radians(elevation)),
        ]
    )
    x, y, z = (np.array(origin) + 20.0 * direction).tolist()
    threat = TrueState(id="t", position_m=(x, y, z), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)
    pose = Pose(
        position_m=origin,
        heading_deg=heading_deg,
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
        aim=Aim(pan_deg=azimuth + off, tilt_deg=elevation),
    )
    seen = 0
    for camera, lens in (
        (CameraKind.PERIPHERAL, Lens.FRONT),
        (CameraKind.PERIPHERAL, Lens.BACK),
        (CameraKind.CENTRAL, None),
    ):
        pixel = image(pose, threat, rig, camera, lens)
        if pixel is None:
            continue
        seen += 1
        u_px, v_px = pixel.tolist()
        ray = to_ray(pixel_detection(u_px, v_px, camera=camera, lens=lens), pose, rig)
        assert angle_between_rad(ray.direction, direction.tolist()) < 1e-9 * RADIAN
    assume(seen > 0)


@given(
    heading_deg=angles,
    roll_deg=tilts,
    pitch_deg=tilts,
    along=st.floats(5, 30),
    aside=st.floats(-20, 20),
    up=st.floats(-15, 15),
)
def test_the_front_fisheye_images_as_opencv_projects(
    heading_deg: float, roll_deg: float, pitch_deg: float, along: float, aside: float, up: float
) -> None:
    pose = Pose(position_m=(1.0, 2.0, 30.0), heading_deg=heading_deg, roll_deg=roll_deg, pitch_deg=pitch_deg)
    body = euler_zyx(*(math.radians(a) for a in (heading_deg, pitch_deg, roll_deg)))
    x, y, z = (np.array(pose.position_m) + NED_TO_ENU @ body @ np.array([along, aside, -up])).tolist()
    threat = TrueState(id="t", position_m=(x, y, z), velocity_mps=(0.0, 0.0, 0.0), size_m=3.0)
    # In OpenCV's camera frame x is right, y down and z ahead.
    in_camera = np.array([[[aside, -up, along]]])
    expected, _ = cv2.fisheye.projectPoints(
        in_camera,
        np.zeros(3),
        np.zeros(3),
        DISTORTED.peripheral.camera_matrix,
        np.array(DISTORTED.peripheral.distortion),
    )
    pixel = image(pose, threat, DISTORTED, CameraKind.PERIPHERAL, Lens.FRONT)
    assert pixel is not None
    assert pixel == pytest.approx(expected[0, 0], abs=1e-6 * PIXEL)


def test_the_central_camera_has_its_principal_point_in_the_middle_and_looks_where_the_gimbal_does() -> None:
    pose = Pose(position_m=(0.0, 0.0, 30.0), heading_deg=77.0, roll_deg=20.0, aim=Aim(pan_deg=90.0, tilt_deg=-10.0))
    middle = to_ray(pixel_detection(639.5, 479.5), pose, RIG)
    ten = math.radians(10.0)
    assert middle.direction == pytest.approx((math.cos(ten), 0.0, -math.sin(ten)), abs=1e-12)
    right = to_ray(pixel_detection(639.5 + 1280 * math.tan(0.1), 479.5), pose, RIG)
    assert right.direction[1] < 0, "right of east is south"
    assert angle_between_rad(right.direction, middle.direction) == pytest.approx(0.1, abs=1e-12 * RADIAN)
    below = to_ray(pixel_detection(639.5, 479.5 + 128), pose, RIG)
    assert below.direction[2] < middle.direction[2]


def test_front_looks_along_the_heading_and_back_against_it() -> None:
    pose = Pose(position_m=(0.0, 0.0, 30.0), heading_deg=30.0)
    centre = (1504 - 1) / 2
    for lens, heading_deg in ((Lens.FRONT, 30.0), (Lens.BACK, 210.0)):
        ray = to_ray(pixel_detection(centre, centre, camera=CameraKind.PERIPHERAL, lens=lens), pose, RIG)
        expected = (math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg)), 0.0)
        assert ray.direction == pytest.approx(expected, abs=1e-12)


def test_a_bearing_is_a_ray_whatever_the_hosts_attitude() -> None:
    seen = Direction(azimuth_deg=300.0, elevation_deg=20.0, sigma_deg=0.5)
    detection = Detection(host="h1", camera=CameraKind.PERIPHERAL, time_s=NOW_S, seen=seen)
    ray = to_ray(detection, Pose(position_m=(5.0, 6.0, 7.0), heading_deg=12.0, roll_deg=30.0), RIG)
    aim = aim_at(np.zeros(3), np.array(ray.direction))
    assert (aim.pan_deg, aim.tilt_deg) == pytest.approx((300.0, 20.0), abs=1e-9)
    assert ray.sigma_rad == pytest.approx((math.radians(0.5),) * 2, abs=1e-12 * RADIAN)


@pytest.mark.parametrize("off_deg", [0.0, 40.0, 70.0])
def test_the_angular_error_of_noisy_pixels_is_what_the_ray_says(off_deg: float) -> None:
    """Squared errors in the ray's own sigmas follow chi-square with two degrees of freedom; 10 px keep it linear."""
    pose = Pose(position_m=(0.0, 0.0, 30.0), heading_deg=0.0, roll_deg=5.0, pitch_deg=-8.0)
    azimuth = math.radians(off_deg)
    x, y, z = 20 * math.sin(azimuth), 20 * math.cos(azimuth), 32.0
    threat = TrueState(id="t", position_m=(x, y, z), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)
    pixel = image(pose, threat, DISTORTED, CameraKind.PERIPHERAL, Lens.FRONT)
    assert pixel is not None
    rng = np.random.default_rng(7)
    truth = np.array([x, y, z - 30.0]) / math.hypot(x, y, z - 30.0)
    draws = 1000
    total = 0.0
    noise_px = rng.normal(0.0, 10.0, size=(draws, 2))
    for number in range(draws):
        u_px, v_px = float(pixel[0] + noise_px[number, 0]), float(pixel[1] + noise_px[number, 1])
        seen = Pixel(u_px=u_px, v_px=v_px, sigma_px=10.0)
        detection = Detection(host="h1", camera=CameraKind.PERIPHERAL, lens=Lens.FRONT, time_s=NOW_S, seen=seen)
        ray = to_ray(detection, pose, DISTORTED)
        total += sum(float(np.dot(a, truth) / s) ** 2 for a, s in zip(ray.across, ray.sigma_rad, strict=True))
    low, high = (float(chi2.ppf(share, 2 * draws)) for share in (0.0005, 0.9995))
    assert low < total < high


def test_what_interpolation_leaves_open_widens_the_ray() -> None:
    aim = Aim(pan_deg=0.0, tilt_deg=0.0)
    sharp = to_ray(pixel_detection(639.5, 479.5), Pose(position_m=(0.0, 0.0, 0.0), heading_deg=0.0, aim=aim), RIG)
    loose = to_ray(
        pixel_detection(639.5, 479.5),
        Pose(position_m=(0.0, 0.0, 0.0), heading_deg=0.0, aim=aim, aim_sigma_rad=0.01, attitude_sigma_rad=0.5),
        RIG,
    )
    assert sharp.sigma_rad[0] == pytest.approx(3 / 1280, abs=1e-12 * RADIAN)
    assert loose.sigma_rad[0] == pytest.approx(math.hypot(3 / 1280, 0.01), abs=1e-12 * RADIAN)


@pytest.mark.parametrize(
    ("u_px", "v_px", "camera", "field"),
    [
        (-1.0, 5.0, CameraKind.CENTRAL, "pixel.u_px"),
        (5.0, 960.0, CameraKind.CENTRAL, "pixel.v_px"),
        (1504.0, 700.0, CameraKind.PERIPHERAL, "pixel.u_px"),
        (20.0, 20.0, CameraKind.PERIPHERAL, "pixel"),
    ],
)
def test_a_pixel_that_the_camera_does_not_have_is_refused(
    u_px: float, v_px: float, camera: CameraKind, field: str
) -> None:
    lens = Lens.FRONT if camera is CameraKind.PERIPHERAL else None
    pose = Pose(position_m=(0.0, 0.0, 0.0), heading_deg=0.0, aim=Aim(pan_deg=0.0, tilt_deg=0.0))
    with pytest.raises(Unusable) as caught:
        to_ray(pixel_detection(u_px, v_px, camera=camera, lens=lens), pose, RIG)
    assert (caught.value.reason, caught.value.field) == (Reason.IMAGE, field)


def test_a_central_pixel_needs_to_know_where_the_gimbal_looked() -> None:
    with pytest.raises(Unusable, match="gimbal") as caught:
        to_ray(pixel_detection(600.0, 400.0), Pose(position_m=(0.0, 0.0, 0.0), heading_deg=0.0), RIG)
    assert caught.value.reason is Reason.NO_AIM
