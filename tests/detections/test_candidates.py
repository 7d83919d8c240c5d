"""Where rays of different hosts meet that nothing explains."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from hsop_gcs.detections import DetectionRules, Ray
from hsop_gcs.detections.candidates import Meeting, meetings
from hsop_gcs.detections.fix import Belief, fix_of
from hsop_gcs.geometry.rays import FloatArray
from hsop_gcs.geometry.triangulation import Place
from hsop_gcs.reports import Vector3
from tests.detections.examples import METRE, NOW_S, bearing_ray

WEST: Vector3 = (-30.0, 0.0, 30.0)
SOUTH: Vector3 = (0.0, -30.0, 30.0)
NORTH_EAST: Vector3 = (25.0, 25.0, 36.0)
FIRST = (5.0, 4.0, 32.0)
SECOND = (-8.0, 9.0, 32.0)
RULES = DetectionRules()


def found(*rays: Ray) -> list[Meeting]:
    return meetings(rays, RULES)


def test_two_hosts_rays_meet_where_the_threat_is() -> None:
    (meeting,) = found(bearing_ray("a", WEST, FIRST), bearing_ray("b", SOUTH, FIRST))
    assert meeting.rays == (0, 1)
    assert meeting.fix.position_m == pytest.approx(FIRST, abs=1e-6 * METRE)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        pytest.param(bearing_ray("a", WEST, FIRST), bearing_ray("a", SOUTH, FIRST), id="of one host"),
        pytest.param(bearing_ray("a", WEST, FIRST), bearing_ray("b", SOUTH, (5.0, 4.0, 38.0)), id="that pass by"),
        pytest.param(bearing_ray("a", WEST, FIRST), bearing_ray("b", SOUTH, (-5.0, -64.0, 28.0)), id="behind a host"),
        pytest.param(
            bearing_ray("a", WEST, (400.0, 4.0, 32.0)), bearing_ray("b", SOUTH, (400.0, 4.0, 32.0)), id="too far"
        ),
        pytest.param(
            bearing_ray("a", WEST, FIRST), bearing_ray("b", SOUTH, FIRST, time_s=NOW_S + 0.3), id="not together"
        ),
        pytest.param(
            bearing_ray("a", WEST, (100.0, 0.0, 30.0), sigma_deg=3.0),
            bearing_ray("b", (-40.0, 1.0, 30.0), (100.0, 0.0, 30.0), sigma_deg=3.0),
            id="all but parallel",
        ),
    ],
)
def test_rays_do_not_meet(first: Ray, second: Ray) -> None:
    assert found(first, second) == []


def test_two_hosts_that_see_two_threats_at_one_height_begin_none() -> None:
    """Four meetings, two of them ghosts; nothing tells which."""
    level = [(x, y, 30.0) for x, y, _ in (FIRST, SECOND)]
    rays = [bearing_ray(host, at, threat) for host, at in (("a", WEST), ("b", SOUTH)) for threat in level]
    assert found(*rays) == []


def test_different_heights_tell_threats_from_ghosts() -> None:
    threats = (FIRST, (-8.0, 9.0, 27.0))
    rays = [bearing_ray(host, at, threat) for host, at in (("a", WEST), ("b", SOUTH)) for threat in threats]
    assert sorted(meeting.rays for meeting in found(*rays)) == [(0, 2), (1, 3)]


def test_a_third_host_tells_threats_from_ghosts() -> None:
    rays = [
        bearing_ray(host, at, (*threat[:2], 30.0))
        for host, at in (("a", WEST), ("b", SOUTH), ("c", NORTH_EAST))
        for threat in (FIRST, SECOND)
    ]
    assert sorted(meeting.rays for meeting in found(*rays)) == [(0, 2, 4), (1, 3, 5)]


def test_both_cameras_of_a_host_take_part() -> None:
    rays = [
        bearing_ray("a", WEST, FIRST),
        bearing_ray("b", SOUTH, FIRST),
        bearing_ray("b", SOUTH, FIRST, sigma_deg=3.0, time_s=NOW_S + 0.01),
    ]
    (meeting,) = found(*rays)
    assert (meeting.rays, meeting.hosts) == ((0, 1, 2), 2)


def test_a_fix_allows_for_the_flight_between_two_exposures() -> None:
    """The threat flies 3 m/s; 0.1 s later its second ray is taken, from where it is then."""
    rays = [
        bearing_ray("a", WEST, (5.0, 4.0, 32.0), time_s=NOW_S),
        bearing_ray("b", SOUTH, (5.3, 4.0, 32.0), time_s=NOW_S + 0.1),
    ]
    fix = fix_of(rays, NOW_S + 0.1, Belief(velocity_mps=(3.0, 0.0, 0.0), speed_sigma_mps=0.1), RULES)
    assert fix is not None
    assert fix.position_m == pytest.approx((5.3, 4.0, 32.0), abs=1e-6 * METRE)


def test_a_fix_is_no_better_than_the_hosts_own_positions_and_the_threats_speed_are_known() -> None:
    rays = [
        bearing_ray("a", WEST, FIRST, sigma_deg=0.01),
        bearing_ray("b", SOUTH, FIRST, sigma_deg=0.01, time_s=NOW_S + 0.1),
    ]
    sure = fix_of(rays, NOW_S + 0.1, Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=0.0), RULES)
    vague = fix_of(rays, NOW_S + 0.1, Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=5.0), RULES)
    assert sure is not None
    assert vague is not None
    # Rays at right angles: each host's 5 cm on one axis, and their mean on the third.
    assert sure.sigma_m == pytest.approx(0.05 * math.sqrt(2.5), rel=0.05)
    assert vague.sigma_m > 0.3


def believed(mean_m: Vector3, sigma_m: Sequence[float]) -> Belief:
    """In a threat that stands still somewhere there, with a standard deviation for each axis."""
    place = Place(np.array(mean_m), np.diag(1 / np.square(sigma_m)))
    return Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=0.0, place=place)


def test_a_fix_that_noise_put_nearer_is_no_surer_than_one_put_farther() -> None:
    """Two rays 3 degrees too far left or right; the track knows better where the threat is."""
    belief = believed((0.0, 0.0, 30.0), [0.5 / math.sqrt(3)] * 3)
    hosts: tuple[tuple[str, Vector3, float], ...] = (("a", (-10.0, -30.0, 30.0), 1.0), ("b", (10.0, -30.0, 30.0), -1.0))
    sigmas_m = []
    for turn_deg in (3.0, -3.0):
        rays = [
            bearing_ray(host, at, (0.0, 0.0, 30.0), sigma_deg=3.0, off_deg=(side * turn_deg, 0.0))
            for host, at, side in hosts
        ]
        fix = fix_of(rays, NOW_S, belief, RULES)
        assert fix is not None
        alone = fix_of(rays, NOW_S, Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=0.0), RULES)
        assert alone is not None
        sigmas_m.append((fix.sigma_m, alone.sigma_m))
    (near, near_alone), (far, far_alone) = sigmas_m
    assert near == pytest.approx(far, rel=0.01)
    assert near_alone < 0.9 * far_alone


@pytest.mark.parametrize("turn_deg", [-8.0, -4.0, 0.0, 4.0, 8.0])
def test_a_fix_and_a_belief_together_give_the_likeliest_place_by_both(turn_deg: float) -> None:
    """Two vague rays, ten metres apart and sixty from the threat: noise moves where they meet by many metres, or lets
    them meet nowhere. The likeliest place is that of an optimiser that knows nothing of fixes."""
    threat: Vector3 = (3.0, 60.0, 40.0)
    hosts: dict[str, Vector3] = {"a": (-5.0, 0.0, 30.0), "b": (5.0, 0.0, 30.0)}
    sigma_deg, sigma_m = 3.0, (6.0, 12.0, 8.0)
    belief = believed((0.0, 66.0, 37.0), sigma_m)
    rays = [
        bearing_ray(host, at, threat, sigma_deg=sigma_deg, off_deg=(turn_deg if host == "a" else -turn_deg, 0.5))
        for host, at in hosts.items()
    ]

    def misses(place_m: FloatArray) -> FloatArray:
        found = [(place_m - belief.place.mean_m) / sigma_m]
        for ray in rays:
            reach = place_m - np.array(ray.origin_m)
            range_m = np.linalg.norm(reach)
            sigma_rad = np.hypot(math.radians(sigma_deg), RULES.host_sigma_m / range_m)
            found.append(np.array(ray.across) @ reach / (np.array(ray.direction) @ reach) / sigma_rad)
        return np.concatenate(found)

    likeliest = least_squares(misses, belief.place.mean_m, xtol=1e-12, ftol=1e-12)
    fix = fix_of(rays, NOW_S, belief, RULES)
    assert fix is not None
    seen = np.linalg.inv(fix.covariance_m2)
    both = np.linalg.solve(
        seen + belief.place.information, seen @ fix.position_m + belief.place.information @ belief.place.mean_m
    )
    assert both == pytest.approx(likeliest.x, abs=0.02 * METRE)
    assert seen + belief.place.information == pytest.approx(
        np.asarray(likeliest.jac).T @ np.asarray(likeliest.jac), rel=0.02, abs=1e-4
    )


def test_a_vague_fix_is_vague_along_its_rays_though_the_threat_is_believed_beside_them() -> None:
    """A sharp ray and a vague one that is almost parallel to it: how far away the threat is, they hardly tell."""
    threat: Vector3 = (0.0, 30.0, 30.0)
    beside = believed((6.0, 24.0, 30.0), [6.0 / math.sqrt(3)] * 3)
    rays = [
        bearing_ray("a", (0.0, -30.0, 30.0), threat, sigma_deg=0.1),
        bearing_ray("b", (10.0, -30.0, 30.0), threat, sigma_deg=3.0, off_deg=(2.0, 0.0)),
    ]
    fix = fix_of(rays, NOW_S, beside, RULES)
    assert fix is not None
    off_m = fix.position_m - np.array(threat)
    assert np.linalg.norm(off_m) > 5.0
    assert off_m @ np.linalg.solve(fix.covariance_m2, off_m) < chi2.ppf(0.99, 3)


def test_rays_that_almost_agree_in_direction_leave_a_track_where_it_was() -> None:
    """Three cameras at one side, of which noise makes the rays cross at half the distance."""
    threat: Vector3 = (-11.0, 66.0, 42.0)
    hosts: tuple[tuple[str, Vector3, float], ...] = (
        ("a", (0.0, 0.0, 30.0), 0.0),
        ("b", (12.0, 0.0, 30.0), 6.0),
        ("c", (0.0, 12.0, 30.0), -5.0),
    )
    rays = [bearing_ray(host, at, threat, sigma_deg=3.8, off_deg=(-turn_deg, 0.0)) for host, at, turn_deg in hosts]
    alone = fix_of(rays, NOW_S, Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=0.0), RULES)
    assert alone is not None
    assert math.dist(alone.position_m, threat) > 25.0 * METRE
    belief = believed((-8.0, 60.0, 41.0), (6.0, 6.0, 3.0))
    fix = fix_of(rays, NOW_S, belief, RULES)
    assert fix is not None
    seen = np.linalg.inv(fix.covariance_m2)
    information = seen + belief.place.information
    both = np.linalg.solve(information, seen @ fix.position_m + belief.place.information @ belief.place.mean_m)
    off_m = both - np.array(threat)
    assert off_m @ information @ off_m < chi2.ppf(0.99, 3)


def test_the_hosts_own_positions_are_a_part_of_every_fix() -> None:
    """However rays pass each other: what is left of the covariance without that part is one."""
    rng = np.random.default_rng(1)
    fixes = 0
    for _ in range(200):
        threat = rng.uniform((-20, -20, 25), (20, 20, 45))
        rays = [
            bearing_ray(
                str(host),
                tuple(rng.uniform((-60, -60, 25), (60, 60, 45)).tolist()),
                threat.tolist(),
                sigma_deg=sigma_deg,
                off_deg=(rng.normal(0, sigma_deg), rng.normal(0, sigma_deg)),
            )
            for host, sigma_deg in enumerate(rng.choice([0.05, 1.0, 4.0], 3))
        ]
        fix = fix_of(rays, NOW_S, believed(tuple(threat + rng.normal(0, 4, 3)), (4.0, 4.0, 4.0)), RULES)
        if fix is not None:
            fixes += 1
            assert np.linalg.eigvalsh(fix.covariance_m2 - fix.common_m2)[0] > 0
            assert np.linalg.eigvalsh(fix.common_m2)[0] > -1e-9
    assert fixes > 150
