"""What simulated cameras detect: Eqs. 3 and 4, fields of view, attitude, noise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.detections import Detection, Lens, Pixel, Pose
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.reports import Vector3
from hsop_gcs.simulator.eyes import Viewer, image, look
from hsop_gcs.simulator.truth import TrueState

RIG = CameraRig()
TIME_S = 1_800_000_000.0
LEVEL = Pose(position_m=(0.0, 0.0, 30.0), heading_deg=0.0, aim=Aim(pan_deg=0.0, tilt_deg=0.0))
EYES = [(CameraKind.PERIPHERAL, Lens.FRONT), (CameraKind.PERIPHERAL, Lens.BACK), (CameraKind.CENTRAL, None)]


def threat(position_m: Vector3, size_m: float = 1.0) -> TrueState:
    return TrueState(id="t", position_m=position_m, velocity_mps=(0.0, 0.0, 0.0), size_m=size_m)


def polar(distance_m: float, azimuth_deg: float, elevation_deg: float = 0.0) -> Vector3:
    """A place around the level host."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    across = distance_m * math.cos(elevation)
    return (across * math.sin(azimuth), across * math.cos(azimuth), 30.0 + distance_m * math.sin(elevation))


def detecting(pose: Pose, seen: TrueState) -> set[tuple[CameraKind, Lens | None]]:
    return {(camera, lens) for camera, lens in EYES if image(pose, seen, RIG, camera, lens) is not None}


FRONT, BACK, CENTRAL = EYES


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        # Eq. 4: 1280 px / d > 30 px within 42.7 m; Eq. 3 on the boresight: 455.8 px / d > 5 px within 91.2 m.
        (polar(42.6, 0.0), {FRONT, CENTRAL}),
        (polar(42.7, 0.0), {FRONT}),
        (polar(91.1, 0.0), {FRONT}),
        (polar(91.2, 0.0), set()),
        (polar(91.1, 180.0), {BACK}),
        # Half the field of view to the side; the image is lower than it is wide.
        (polar(20.0, 26.4), {FRONT, CENTRAL}),
        (polar(20.0, 26.6), {FRONT}),
        (polar(20.0, 0.0, 20.5), {FRONT, CENTRAL}),
        (polar(20.0, 0.0, 20.7), {FRONT}),
        # Eq. 3 at 20 m: θ / tan θ > 0.2194 up to 81.2°, and then not until as far from the other boresight.
        (polar(20.0, 81.1), {FRONT}),
        (polar(20.0, 81.3), set()),
        (polar(20.0, 90.0), set()),
        (polar(20.0, 98.9), {BACK}),
    ],
)
def test_a_camera_detects_what_is_wide_enough_and_in_view(
    place: Vector3, expected: set[tuple[CameraKind, Lens | None]]
) -> None:
    assert detecting(LEVEL, threat(place)) == expected


def test_a_larger_threat_is_seen_from_farther() -> None:
    assert detecting(LEVEL, threat(polar(80.0, 0.0), size_m=2.0)) == {FRONT, CENTRAL}


def test_fisheyes_turn_with_the_body_and_the_gimbal_stays_level() -> None:
    """A threat overhead is 85° from both boresights until the nose goes up or down."""
    above = threat(polar(20.0, 0.0, 85.0))
    assert detecting(LEVEL, above) == set()
    assert detecting(replace(LEVEL, pitch_deg=15.0), above) == {FRONT}
    assert detecting(replace(LEVEL, pitch_deg=-15.0), above) == {BACK}, "the nose is down, and the back looks up"
    ahead = threat(polar(20.0, 5.0, 2.0))
    level = image(LEVEL, ahead, RIG, *CENTRAL)
    banked = image(replace(LEVEL, roll_deg=25.0, pitch_deg=-10.0, heading_deg=70.0), ahead, RIG, *CENTRAL)
    assert level is not None
    assert banked == pytest.approx(level, abs=1e-9)


def test_the_gimbal_counts_as_it_points_and_not_as_it_was_told() -> None:
    east = threat(polar(20.0, 90.0))
    assert detecting(LEVEL, east) == set()
    assert detecting(replace(LEVEL, aim=Aim(pan_deg=80.0, tilt_deg=0.0)), east) == {CENTRAL}
    assert detecting(replace(LEVEL, aim=None), threat(polar(20.0, 0.0))) == {FRONT}


def test_noise_has_30_and_3_pixels_on_each_axis() -> None:
    """Squared errors in standard deviations follow chi-square with two degrees of freedom per detection."""
    seen = threat(polar(20.0, 8.0, 3.0))
    rng = np.random.default_rng(11)
    count = 1000
    squares = {CameraKind.PERIPHERAL: 0.0, CameraKind.CENTRAL: 0.0}
    truth_px = {camera: image(LEVEL, seen, RIG, camera, lens) for camera, lens in (FRONT, CENTRAL)}
    for _ in range(count):
        found = look([Viewer(host="h1", pose=LEVEL)], [seen], TIME_S, rng)
        assert [(each.camera, each.lens) for each in found] == [FRONT, CENTRAL]
        for each in found:
            assert isinstance(each.seen, Pixel)
            true_px = truth_px[each.camera]
            assert true_px is not None
            off = math.hypot(each.seen.u_px - true_px[0], each.seen.v_px - true_px[1])
            squares[each.camera] += (off / {CameraKind.PERIPHERAL: 30.0, CameraKind.CENTRAL: 3.0}[each.camera]) ** 2
    low, high = (float(chi2.ppf(share, 2 * count)) for share in (0.0005, 0.9995))
    assert all(low < total < high for total in squares.values()), squares


def test_what_noise_carries_off_the_sensor_is_not_detected() -> None:
    edge = threat(polar(20.0, 26.45))
    found = look([Viewer(host="h1", pose=LEVEL)] * 200, [edge], TIME_S, np.random.default_rng(2))
    central = [each for each in found if each.camera is CameraKind.CENTRAL]
    assert 100 < len(central) < 200
    assert all(isinstance(each.seen, Pixel) and each.seen.u_px <= 1279.5 for each in central)


def test_every_host_sees_every_threat_and_the_same_seed_sees_the_same() -> None:
    viewers = [Viewer(host=f"h{n}", pose=replace(LEVEL, heading_deg=40.0 * n)) for n in range(3)]
    threats = [threat(polar(25.0, 10.0)), threat(polar(30.0, 200.0))]

    def run() -> list[Detection]:
        return look(viewers, threats, TIME_S, np.random.default_rng(5))

    first = run()
    assert first == run()
    assert {each.host for each in first} == {"h0", "h1", "h2"}
    assert all(each.time_s == TIME_S and each.threat_id is None for each in first)


def test_each_host_sees_with_its_own_cameras() -> None:
    far_sighted = CameraRig(central=PinholeCamera(resolution_px=2560))
    viewers = [Viewer(host="h1", pose=LEVEL), Viewer(host="h2", pose=LEVEL, rig=far_sighted)]
    beyond = threat(polar(1.5 * 1280 / 30, 0.0))
    found = look(viewers, [beyond], TIME_S, np.random.default_rng(1))
    assert [each.host for each in found if each.camera is CameraKind.CENTRAL] == ["h2"]
