"""Triangulation held against geometry by hand, the noise it claims to bear, and the Cramér-Rao bound."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.sight import Sight, central_sight, fisheye_sight, joined
from hsop_gcs.geometry.rays import Rays, camera_axes, intersection_angle_rad
from hsop_gcs.geometry.triangulation import covariance, triangulate, triangulate_eq5

MICROMETRE = 1e-6
DRAWS = 20_000
TARGET = np.array([3.0, -2.0, 1.0])


def at_bearing(bearing_deg: float, distance_m: float, kind: str) -> Sight:
    """Return a camera that sees the target from a side: central 5° off its axis, fisheye 30° off."""
    bearing = math.radians(bearing_deg)
    origin = TARGET - distance_m * np.array([math.sin(bearing), math.cos(bearing), 0.0])
    if kind == "central":
        return central_sight(PinholeCamera(), origin, bearing + math.radians(5), noise_px=3.0)
    heading = bearing + math.radians(30)
    return fisheye_sight(FisheyeCamera(), origin, heading, towards_m=TARGET, noise_px=30.0)


def noisy(sights: list[Sight], draws: int, seed: int = 0) -> tuple[np.ndarray, Rays]:
    noise = np.random.default_rng(seed).standard_normal((len(sights), draws, 2))
    rays = [s.rays(s.image_of(TARGET) + s.noise_px * e) for s, e in zip(sights, noise, strict=True)]
    return np.array([s.origin_m for s in sights]), joined(rays)


def crossing(kinds: tuple[str, ...], distance_m: float) -> list[Sight]:
    return [at_bearing(70.0 * k, distance_m, kind) for k, kind in enumerate(kinds)]


PAIRS = [("central", "central"), ("peripheral", "central"), ("peripheral", "peripheral")]


def test_equation_5_is_what_the_letter_prints() -> None:
    r_pg, r_cg = np.array([1.0, 2.0, 3.0]), np.array([-4.0, 5.0, 6.0])
    r_tp, r_tc = np.array([2.0, 7.0, -1.0]), np.array([3.0, 1.0, 0.5])
    r_pc = r_pg - r_cg
    printed = r_pg + np.linalg.norm(np.cross(r_tc, r_pc)) / np.linalg.norm(np.cross(r_tc, r_tp)) * r_tp
    assert triangulate_eq5(r_pg, r_tp, r_cg, r_tc)[0] == pytest.approx(printed, abs=MICROMETRE)


def test_equation_5_stays_on_the_first_ray_however_long_its_vector() -> None:
    first, second = np.array([0.0, 2.0, 0.0]), np.array([-1.0, 1.0, 0.3])
    fix = triangulate_eq5([0, 0, 0], first, [10, 0, 0], second)[0]
    assert np.cross(fix, first) == pytest.approx(np.zeros(3), abs=MICROMETRE)
    assert triangulate_eq5([0, 0, 0], 5 * first, [10, 0, 0], 9 * second)[0] == pytest.approx(fix, abs=MICROMETRE)


def test_the_intersection_angle_keeps_its_digits_near_zero() -> None:
    assert intersection_angle_rad([1.0, 0, 0], [1.0, 1e-9, 0]) == pytest.approx(1e-9, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0, 359), st.floats(-40, 40), st.floats(20, 80)), min_size=2, max_size=5),
    st.floats(-80, 80),
)
def test_rays_without_noise_meet_in_the_target(cameras: list[tuple[float, float, float]], east_m: float) -> None:
    target = np.array([east_m, 12.0, 5.0])
    directions, origins = [], []
    for bearing, tilt, distance in cameras:
        ahead = camera_axes(math.radians(bearing), math.radians(tilt))[2]
        directions.append(ahead)
        origins.append(target - distance * ahead)
    angles = [float(intersection_angle_rad(directions[0], other)) for other in directions[1:]]
    if max(math.sin(angle) for angle in angles) < 0.05:
        return
    whiteners = np.array([[camera_axes(math.radians(b), math.radians(t))[:2] / 0.01 for b, t, _ in cameras]])
    rays = Rays(np.array([directions]), whiteners)
    assert triangulate(origins, rays)[0] == pytest.approx(target, abs=1e-3)


@pytest.mark.parametrize("kinds", PAIRS)
@pytest.mark.parametrize("distance_m", [20.0, 60.0])
def test_the_sampled_covariance_is_the_predicted_one(kinds: tuple[str, str], distance_m: float) -> None:
    sights = crossing(kinds, distance_m)
    origins, rays = noisy(sights, DRAWS)
    fixes = triangulate(origins, rays)
    exact = joined([sight.rays(sight.image_of(TARGET)) for sight in sights])
    predicted = covariance(origins, exact, TARGET)[0]
    sampled = np.cov(fixes.T)
    # 1 % from the number of draws; 30 px of a fisheye bend the image enough for the rest.
    bound = 0.04 if kinds == ("central", "central") else 0.08
    whitened = np.linalg.solve(np.linalg.cholesky(predicted), sampled)
    whitened = np.linalg.solve(np.linalg.cholesky(predicted), whitened.T)
    assert np.linalg.eigvalsh(whitened) == pytest.approx(np.ones(3), abs=bound)


@pytest.mark.parametrize("distance_m", [20.0, 60.0])
def test_central_pairs_come_within_five_percent_of_the_bound(distance_m: float) -> None:
    sights = crossing(("central", "central"), distance_m)
    origins, rays = noisy(sights, DRAWS)
    squares = np.square(triangulate(origins, rays) - TARGET).sum(axis=1)
    exact = joined([sight.rays(sight.image_of(TARGET)) for sight in sights])
    bound = math.sqrt(float(np.trace(covariance(origins, exact, TARGET)[0])))
    assert math.sqrt(float(squares.mean())) <= 1.05 * bound


@pytest.mark.parametrize("kinds", PAIRS)
def test_maximum_likelihood_beats_equation_5(kinds: tuple[str, str]) -> None:
    origins, rays = noisy(crossing(kinds, 40.0), DRAWS)
    printed = triangulate_eq5(origins[0], rays.directions[:, 0], origins[1], rays.directions[:, 1])
    assert error(triangulate(origins, rays)) < 0.95 * error(printed)


def test_every_further_view_makes_the_fix_better() -> None:
    errors = []
    for views in (2, 3, 4, 6):
        origins, rays = noisy([at_bearing(55.0 * k, 40.0, "central") for k in range(views)], DRAWS)
        errors.append(error(triangulate(origins, rays)))
    assert all(later < 0.95 * earlier for earlier, later in itertools.pairwise(errors))


def test_a_poor_view_beside_two_good_ones_does_no_harm() -> None:
    good = [at_bearing(0.0, 30.0, "central"), at_bearing(90.0, 30.0, "central")]
    origins, rays = noisy([*good, at_bearing(45.0, 60.0, "peripheral")], DRAWS)
    pair = Rays(rays.directions[:, :2], rays.whiteners[:, :2])
    assert error(triangulate(origins, rays)) <= 1.001 * error(triangulate(origins[:2], pair))


def test_a_fix_is_the_least_of_the_sum_it_minimises() -> None:
    origins, rays = noisy(crossing(("peripheral", "central"), 40.0), 50)
    fixes = triangulate(origins, rays)
    rng = np.random.default_rng(1)
    for _ in range(20):
        assert np.all(squares(origins, rays, fixes + rng.normal(0, 0.05, 3)) >= squares(origins, rays, fixes) - 1e-6)


def test_no_fix_lies_beyond_reach_and_none_is_missing_where_rays_are_almost_parallel() -> None:
    sights = [at_bearing(0.0, 60.0, "peripheral"), at_bearing(3.0, 60.0, "peripheral")]
    origins, rays = noisy(sights, 5000)
    fixes = triangulate(origins, rays, reach_m=90.0)
    depth = np.einsum("nvi,nvi->nv", fixes[:, None] - origins, rays.directions)
    assert np.isfinite(fixes).all()
    assert depth.max() <= 90.0
    assert np.isnan(triangulate(origins, rays)).mean() < 0.01


def test_cameras_around_the_target_with_wild_noise_still_give_a_fix() -> None:
    sights = [at_bearing(60.0 * k, 60.0, "peripheral") for k in range(6)]
    origins, rays = noisy(sights, 5000)
    assert np.isfinite(triangulate(origins, rays, reach_m=120.0)).all()


def test_parallel_rays_have_no_fix_and_no_finite_covariance() -> None:
    axes = camera_axes(0.3)
    rays = Rays(np.array([[axes[2], axes[2]]]), np.array([[axes[:2], axes[:2]]]) / 0.01)
    origins = np.array([[0.0, 0.0, 0.0], 10.0 * axes[2]])
    assert np.isnan(triangulate_eq5(origins[0], axes[2], origins[1], axes[2])).all()
    assert not np.isfinite(covariance(origins, rays, 50.0 * axes[2])).any()


def test_a_single_view_is_refused() -> None:
    with pytest.raises(ValueError, match="two views"):
        triangulate([[0, 0, 0]], Rays(np.ones((1, 1, 3)), np.ones((1, 1, 2, 3))))


def error(fixes: np.ndarray) -> float:
    return float(np.linalg.norm(fixes - TARGET, axis=1).mean())


def squares(origins: np.ndarray, rays: Rays, points: np.ndarray) -> np.ndarray:
    offsets = points[:, None] - origins
    depth = np.einsum("nvi,nvi->nv", offsets, rays.directions)
    whitened = np.einsum("nvij,nvj->nvi", rays.whiteners, offsets) / depth[..., None]
    return np.asarray(np.square(whitened).sum(axis=(1, 2)))
