"""Eqs. 8-11 by hand, their symmetries, and the predicted error against sampled noise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.placement.objective import Evaluation, Eye, Views, evaluate, expected_error_m, segment_distance
from hsop_gcs.placement.problem import Formulation, Point, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, View

METRE = DEGREE = PIXEL = 1.0
CENTRAL, PERIPHERAL = CameraKind.CENTRAL, CameraKind.PERIPHERAL

KP, KC = 1504 / 3.3, 1280.0


def pose(host: str, east_m: float, north_m: float, heading_deg: float = 0.0, pan_deg: float | None = None) -> HoverPose:
    return HoverPose(host=host, position_m=(east_m, north_m, 0.0), heading_deg=heading_deg, pan_deg=pan_deg)


def views(first: CameraKind, second: CameraKind) -> Views:
    return {"t1": (View(host="h1", camera=first), View(host="h2", camera=second))}


def still(formulation: Formulation = Formulation.LETTER) -> Problem:
    return Problem(threats=(Threat(id="t1", position_m=(0.0, 0.0, 0.0)),), formulation=formulation)


def test_two_central_cameras_at_right_angles_by_hand() -> None:
    hosts = [pose("h1", -20.0, 0.0, pan_deg=90.0), pose("h2", 0.0, -25.0, pan_deg=0.0)]
    worth = evaluate(still(), hosts, views(CENTRAL, CENTRAL))
    # d/α = d²/1280 for each; the threat at rest counts at both points.
    assert worth.cost == pytest.approx(2 * (400 / KC) * (625 / KC), rel=1e-12)
    assert worth.margins.pixels == pytest.approx(KC / 25 - 30, abs=1e-9 * PIXEL)
    assert worth.margins.fov_deg == pytest.approx(26.5, abs=1e-9 * DEGREE)
    assert worth.margins.distance_m == pytest.approx(0.0, abs=1e-12 * METRE)


def test_a_fisheye_view_45_degrees_off_the_nearer_boresight_by_hand() -> None:
    # h1 looks along 225°; the threat is due east of it, 45° from the boresight behind.
    hosts = [pose("h1", -30.0, 0.0, heading_deg=225.0), pose("h2", -20.0, -20.0, pan_deg=45.0)]
    worth = evaluate(still(), hosts, views(PERIPHERAL, CENTRAL))
    first = 900 / (KP * math.pi / 4)
    second = 800 / KC
    assert worth.cost == pytest.approx(2 * first * second / math.sin(math.pi / 4), rel=1e-12)
    assert worth.margins.pixels == pytest.approx(KP / 30 * math.pi / 4 - 5, abs=1e-9 * PIXEL)


def test_a_moving_threat_counts_where_it_is_and_where_it_will_be() -> None:
    problem = Problem(
        threats=(Threat(id="t1", position_m=(0.0, 0.0, 0.0), velocity_mps=(0.0, 1.0, 0.0)),),
        horizon_s=10.0,
        formulation=Formulation.LETTER,
    )
    hosts = [pose("h1", -20.0, 0.0, pan_deg=90.0), pose("h2", 0.0, -20.0, pan_deg=0.0)]
    worth = evaluate(problem, hosts, views(CENTRAL, CENTRAL))
    sine_later = 20 / math.hypot(20, 10)
    assert worth.cost == pytest.approx((400 / KC) ** 2 + (500 / KC) * (900 / KC) / sine_later, rel=1e-12)
    assert worth.margins.fov_deg == pytest.approx(26.5 - math.degrees(math.atan2(10, 20)), abs=1e-9 * DEGREE)


def test_hosts_that_look_along_one_line_cannot_triangulate() -> None:
    hosts = [pose("h1", -20.0, 0.0, pan_deg=90.0), pose("h2", -30.0, 0.0, pan_deg=90.0)]
    worth = evaluate(still(), hosts, views(CENTRAL, CENTRAL))
    assert worth.cost == math.inf
    assert worth.expected_errors_m["t1"] == math.inf


def test_the_letter_weighs_threats_equally_and_the_operational_formulation_does_not() -> None:
    hosts = [pose("h1", -20.0, 0.0, pan_deg=90.0), pose("h2", 0.0, -25.0, pan_deg=0.0)]
    costs = {}
    for formulation in Formulation:
        problem = still(formulation)
        heavier = replace(problem, threats=(replace(problem.threats[0], weight=3.0),))
        costs[formulation] = evaluate(heavier, hosts, views(CENTRAL, CENTRAL)).cost
    assert costs[Formulation.OPERATIONAL] == pytest.approx(3 * costs[Formulation.LETTER], rel=1e-12)


def test_only_the_operational_formulation_minds_the_path_between_the_points_and_hosts_that_crowd() -> None:
    threat = Threat(id="t1", position_m=(-30.0, 0.0, 0.0), velocity_mps=(6.0, 0.0, 0.0))
    hosts = [pose("h1", 0.0, 5.0), pose("h2", 3.0, 9.0)]
    letter = Problem(threats=(threat,), formulation=Formulation.LETTER)
    seen = views(PERIPHERAL, PERIPHERAL)
    assert evaluate(letter, hosts, seen).margins.distance_m == pytest.approx(math.hypot(27, 9) - 20, abs=1e-9 * METRE)
    flown = evaluate(replace(letter, formulation=Formulation.OPERATIONAL), hosts, seen).margins
    assert flown.distance_m == pytest.approx(5.0 - 20.0, abs=1e-9 * METRE)
    assert flown.separation_m == pytest.approx(5.0 - 10.0, abs=1e-9 * METRE)


@pytest.mark.parametrize(
    ("point", "expected"), [((5.0, 3.0), 3.0), ((-3.0, 4.0), 5.0), ((13.0, -4.0), 5.0), ((10.0, 0.0), 0.0)]
)
def test_the_distance_from_a_path_is_that_of_its_nearest_point(point: tuple[float, float], expected: float) -> None:
    assert segment_distance(point, (0.0, 0.0), (10.0, 0.0)) == pytest.approx(expected, abs=1e-12 * METRE)


def moved(point: Point, turn_rad: float, shift_m: tuple[float, float]) -> Point:
    """Turn clockwise (as a compass does) about the origin, then shift."""
    east, north, up = point
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    return (cosine * east + sine * north + shift_m[0], cosine * north - sine * east + shift_m[1], up)


def crowded() -> tuple[Problem, list[HoverPose], Views]:
    threats = (
        Threat(id="t1", position_m=(10.0, 35.0, 0.0), velocity_mps=(-0.6, 2.0, 0.0)),
        Threat(id="t2", position_m=(41.0, 28.0, 0.0), velocity_mps=(-2.0, -0.9, 0.0)),
    )
    hosts = [
        pose("h1", 28.0, 63.0, 158.0, 273.0),
        pose("h2", 1.0, 5.0, 9.0, 64.0),
        pose("h3", 70.0, 40.0, 250.0, 250.0),
    ]
    seen = {
        "t1": (View(host="h1", camera=CENTRAL), View(host="h2", camera=PERIPHERAL)),
        "t2": (View(host="h2", camera=CENTRAL), View(host="h3", camera=PERIPHERAL)),
    }
    return Problem(threats=threats), hosts, seen


def assert_same(left: Evaluation, right: Evaluation) -> None:
    assert left.cost == pytest.approx(right.cost, rel=1e-8)
    assert left.expected_errors_m == pytest.approx(right.expected_errors_m, rel=1e-8)
    for name in ("pixels", "fov_deg", "distance_m", "separation_m"):
        assert getattr(left.margins, name) == pytest.approx(getattr(right.margins, name), abs=1e-6)


@given(turn_deg=st.floats(-360, 360), east_m=st.floats(-1e4, 1e4), north_m=st.floats(-1e4, 1e4))
def test_turning_and_shifting_everything_changes_nothing(turn_deg: float, east_m: float, north_m: float) -> None:
    problem, hosts, seen = crowded()
    turn, shift = math.radians(turn_deg), (east_m, north_m)
    threats = tuple(
        replace(t, position_m=moved(t.position_m, turn, shift), velocity_mps=moved(t.velocity_mps, turn, (0.0, 0.0)))
        for t in problem.threats
    )
    turned = [
        replace(
            h,
            position_m=moved(h.position_m, turn, shift),
            heading_deg=(h.heading_deg + turn_deg) % 360,
            pan_deg=None if h.pan_deg is None else (h.pan_deg + turn_deg) % 360,
        )
        for h in hosts
    ]
    assert_same(evaluate(replace(problem, threats=threats), turned, seen), evaluate(problem, hosts, seen))


def test_turning_a_host_round_changes_nothing_because_its_fisheyes_are_back_to_back() -> None:
    problem, hosts, seen = crowded()
    about = [replace(h, heading_deg=(h.heading_deg + 180) % 360) for h in hosts]
    assert_same(evaluate(problem, about, seen), evaluate(problem, hosts, seen))


@pytest.mark.parametrize("cameras", [(CENTRAL, CENTRAL), (PERIPHERAL, CENTRAL), (PERIPHERAL, PERIPHERAL)])
def test_the_expected_error_is_that_of_noisy_rays_triangulated_ten_thousand_times(
    cameras: tuple[CameraKind, CameraKind],
) -> None:
    target = np.array([3.0, 4.0, 2.0])
    hosts = [pose("h1", -22.0, 5.0), pose("h2", 8.0, -30.0)]
    noise = {CENTRAL: 3 / KC, PERIPHERAL: 30 / KP}
    rng = np.random.default_rng(5)
    # Weighted least squares on the two angles of each ray, linear about the true point.
    rows, values = [], []
    for host, camera in zip(hosts, cameras, strict=True):
        ray = target - np.array(host.position_m)
        length = float(np.linalg.norm(ray))
        sideways = np.cross(ray / length, [0.0, 0.0, 1.0])
        sideways /= np.linalg.norm(sideways)
        upwards = np.cross(sideways, ray / length)
        for axis in (sideways, upwards):
            rows.append(axis / (noise[camera] * length))
            values.append(rng.standard_normal(10_000))
    errors, *_ = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)
    sampled = math.sqrt((errors**2).sum(axis=0).mean())
    eyes = [Eye(host, CameraRig(), camera) for host, camera in zip(hosts, cameras, strict=True)]
    predicted = expected_error_m(target[None], eyes)
    # The mean square of 10 000 samples scatters by about 1 %; three of these, halved by the root.
    assert sampled == pytest.approx(predicted, rel=0.02)


def test_the_expected_error_of_level_rays_at_right_angles_by_hand() -> None:
    hosts = [pose("h1", -20.0, 0.0), pose("h2", 0.0, -40.0)]
    a, b = 3 / KC * 20, 30 / KP * 40
    across, upwards = a * a + b * b, 1 / (1 / a**2 + 1 / b**2)
    eyes = [Eye(hosts[0], CameraRig(), CENTRAL), Eye(hosts[1], CameraRig(), PERIPHERAL)]
    predicted = expected_error_m(np.zeros((1, 3)), eyes)
    assert predicted == pytest.approx(math.sqrt(across + upwards), rel=1e-9)
