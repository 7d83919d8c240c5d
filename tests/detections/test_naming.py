"""Names: which threat all rays of one place are of, where threats are known coarsely."""

import numpy as np

from hsop_gcs.detections import DetectionRules, Ray
from hsop_gcs.detections.association import associate
from hsop_gcs.detections.naming import doubtful
from hsop_gcs.reports import Vector3
from hsop_gcs.tracks import TrackRules
from tests.detections.examples import NOW_S, bearing_ray, reported

RULES = DetectionRules()
HOSTS: tuple[Vector3, ...] = tuple((12.0 * (n % 3), 12.0 * (n // 3), 30.0) for n in range(8))
SIGMA_DEG = 3.8
"""Of a fisheye's 30 px."""
FIRST, SECOND = (-10.0, 60.0, 30.0), (10.0, 60.0, 30.0)


def rays_at(*threats: Vector3, rng: np.random.Generator | None = None) -> list[Ray]:
    """Those of all hosts, host by host; without ``rng`` they go through the threats."""
    return [
        bearing_ray(f"h{number}", host, at, sigma_deg=SIGMA_DEG, off_deg=(0.0, 0.0) if rng is None else off(rng))
        for number, host in enumerate(HOSTS)
        for at in threats
    ]


def off(rng: np.random.Generator) -> tuple[float, float]:
    azimuth_deg, elevation_deg = rng.normal(0, SIGMA_DEG, 2).tolist()
    return azimuth_deg, elevation_deg


def believed(*places_m: Vector3, sigma_m: float) -> tuple[np.typing.NDArray[np.float64], np.typing.NDArray[np.float64]]:
    return np.array(places_m), np.array([sigma_m**2 * np.eye(3)] * len(places_m))


def test_rays_of_two_threats_are_named_if_the_threats_are_known_well_enough() -> None:
    groups = {0: rays_at(FIRST), 1: rays_at(SECOND)}
    assert doubtful(groups, *believed(FIRST, SECOND, sigma_m=4.0), RULES) == set()
    assert doubtful(groups, *believed(FIRST, SECOND, sigma_m=12.0), RULES) == {0, 1}


def test_a_threat_that_nobody_sees_may_be_the_one_that_is_seen() -> None:
    assert doubtful({0: rays_at(FIRST)}, *believed(FIRST, (-10.0, 75.0, 30.0), sigma_m=12.0), RULES) == {0}
    assert doubtful({0: rays_at(FIRST)}, *believed(FIRST, (-10.0, 160.0, 30.0), sigma_m=12.0), RULES) == set()


def test_rays_that_lie_far_from_their_threat_may_be_of_none_that_is_known() -> None:
    assert doubtful({0: rays_at((60.0, 60.0, 30.0))}, *believed(FIRST, sigma_m=2.0), RULES) == {0}


def test_one_report_of_each_does_not_name_four_threats() -> None:
    """By these first reports it is 15 times likelier that the second and the fourth threat are the other way around."""
    truth = ((31.0, 64.0, 33.0), (-15.0, 69.0, 35.0), (4.0, 77.0, 37.0))
    reports = {
        "t1": (38.0, 46.0, 16.0), "t2": (-3.0, 59.0, 40.0), "t3": (22.0, 132.0, 6.0), "t4": (-32.0, 77.0, 20.0)
    }  # fmt: skip
    picture = reported(*reports.items(), sigma_m=15.0)
    rng = np.random.default_rng(5)
    for _ in range(20):
        shown = associate(rays_at(*truth, rng=rng), picture.tracks, NOW_S, TrackRules(), RULES)
        assert "t4" not in shown[1::3]
        assert "t2" not in shown[2::3]
