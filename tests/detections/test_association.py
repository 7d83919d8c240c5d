"""Which threat a ray shows: two threats known coarsely, two hosts, and the ghosts where the wrong rays meet."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.detections import DetectionRules, Ray
from hsop_gcs.detections.association import Doubt, associate
from hsop_gcs.reports import Vector3
from hsop_gcs.tracks import Picture, TrackRules
from tests.detections.examples import NOW_S, bearing_ray, reported

WEST: Vector3 = (-30.0, 0.0, 30.0)
SOUTH: Vector3 = (0.0, -30.0, 30.0)
EAST: Vector3 = (30.0, 2.0, 30.0)


def shown(picture: Picture, *rays: Ray, rules: DetectionRules | None = None) -> list[str | Doubt]:
    return associate(rays, picture.tracks, NOW_S, TrackRules(), rules or DetectionRules())


def test_rays_go_to_the_threats_they_point_at() -> None:
    picture = reported(("t1", (0.0, 5.0, 30.0)), ("t2", (0.0, -5.0, 30.0)), sigma_m=0.5)
    rays = [
        bearing_ray(host, origin, at) for host, origin in (("a", WEST), ("b", EAST)) for at in ((0, 5, 30), (0, -5, 30))
    ]
    assert shown(picture, *rays) == ["t1", "t2", "t1", "t2"]


def test_a_ray_that_points_at_nothing_is_unexplained() -> None:
    picture = reported(("t1", (0.0, 5.0, 30.0)), sigma_m=0.5)
    assert shown(picture, bearing_ray("a", WEST, (0.0, 25.0, 30.0))) == [Doubt.UNEXPLAINED]
    assert shown(picture, bearing_ray("a", WEST, (-60.0, -5.0, 30.0))) == [Doubt.UNEXPLAINED], "it points away"
    assert shown(Picture(), bearing_ray("a", WEST, (0.0, 25.0, 30.0))) == [Doubt.UNEXPLAINED]


def test_of_two_rays_in_one_image_a_threat_takes_one() -> None:
    picture = reported(("t1", (0.0, 5.0, 30.0)), sigma_m=0.5)
    near, far = bearing_ray("a", WEST, (0.0, 5.1, 30.0)), bearing_ray("a", WEST, (0.0, 8.0, 30.0))
    assert shown(picture, far, near) == [Doubt.UNEXPLAINED, "t1"]


def test_two_rays_that_might_as_well_be_exchanged_are_not_used() -> None:
    picture = reported(("t1", (0.0, 0.4, 30.0)), ("t2", (10.0, -0.4, 30.0)), sigma_m=1.0)
    rays = [bearing_ray("a", WEST, (0.0, north, 30.0), sigma_deg=3.0) for north in (0.2, -0.2)]
    assert shown(picture, *rays) == [Doubt.AMBIGUOUS, Doubt.AMBIGUOUS]


def test_all_hosts_together_decide_what_each_by_itself_would_get_wrong() -> None:
    """Both threats are believed 7 m from where they are, so that each camera's nearest choice is the wrong one."""
    first, second = (6.0, -6.0, 30.0), (-6.0, 6.0, 34.0)
    picture = reported(("t1", (7.0, 1.0, 32.0)), ("t2", (-7.0, -1.0, 32.0)), sigma_m=3.5)
    origins = {"a": WEST, "b": SOUTH, "c": EAST, "d": (0.0, 30.0, 30.0)}
    alone = [
        shown(picture, bearing_ray(host, at, first), bearing_ray(host, at, second)) for host, at in origins.items()
    ]
    rays = [bearing_ray(host, at, threat) for host, at in origins.items() for threat in (first, second)]
    assert ["t1", "t2"] not in [alone[0], alone[2]], "by themselves, the cameras in the west and east cannot say"
    assert shown(picture, *rays) == ["t1", "t2"] * 4


def test_the_hosts_own_word_decides_unless_it_is_impossible() -> None:
    picture = reported(("t1", (0.0, 0.4, 30.0)), ("t2", (10.0, -0.4, 30.0)), sigma_m=1.0)
    hinted = [
        bearing_ray("a", WEST, (0.0, north, 30.0), sigma_deg=3.0, threat_id=t)
        for north, t in ((0.2, "t2"), (-0.2, "t1"))
    ]
    assert shown(picture, *hinted) == ["t2", "t1"]
    assert shown(picture, bearing_ray("a", SOUTH, (0.0, 0.4, 30.0), threat_id="t2")) == ["t1"]
    assert shown(picture, bearing_ray("a", WEST, (0.0, 0.4, 30.0), threat_id="t99")) != [Doubt.UNEXPLAINED]


def test_the_same_rays_in_another_order_of_hosts_show_the_same_threats() -> None:
    rng = np.random.default_rng(5)
    scenes = agree = 0
    for _ in range(60):
        places = rng.uniform(-15, 15, size=(3, 2))
        if min(math.dist(places[i], places[j]) for i, j in ((0, 1), (0, 2), (1, 2))) < 10:
            continue
        truth = [(float(x), float(y), 30.0 + 2 * k) for k, (x, y) in enumerate(places)]
        believed = [tuple((np.array(each) + rng.normal(0, 4, 3)).tolist()) for each in truth]
        picture = reported(*((f"t{k}", each) for k, each in enumerate(believed)), sigma_m=4.0)
        images = [
            [bearing_ray(host, at, each, sigma_deg=0.5) for each in truth]
            for host, at in (("a", WEST), ("b", SOUTH), ("c", EAST))
        ]
        forth = shown(picture, *[ray for image in images for ray in image])
        back = shown(picture, *[ray for image in reversed(images) for ray in image])
        assert forth == [threat for image in range(3) for threat in back[3 * (2 - image) : 3 * (2 - image) + 3]]
        assert all(each in (f"t{k % 3}", Doubt.AMBIGUOUS) for k, each in enumerate(forth)), (truth, believed, forth)
        scenes += 1
        agree += forth == ["t0", "t1", "t2"] * 3
    assert scenes >= 10
    assert agree >= 0.6 * scenes


@pytest.mark.parametrize("hypotheses", [2, 64])
def test_a_burst_of_rays_in_a_crowd_of_threats_is_judged_within_its_means(hypotheses: int) -> None:
    """40 rays towards 12 coarse threats: the beam is bounded, and what it says of each ray is one of the answers."""
    rng = np.random.default_rng(3)
    places = [tuple(rng.uniform(-40, 40, 3).tolist()) for _ in range(12)]
    picture = reported(*((f"t{k}", each) for k, each in enumerate(places)), sigma_m=10.0)
    rays = [
        bearing_ray(f"h{k % 4}", (60.0, 20.0 * (k % 4), 30.0), rng.uniform(-40, 40, 3).tolist(), sigma_deg=3.0)
        for k in range(40)
    ]
    rays.sort(key=lambda ray: ray.look)
    found = shown(picture, *rays, rules=replace(DetectionRules(), hypotheses=hypotheses))
    assert len(found) == 40
    for host in range(4):
        taken = [
            each
            for each, ray in zip(found, rays, strict=True)
            if ray.detection.host == f"h{host}" and not isinstance(each, Doubt)
        ]
        assert len(taken) == len(set(taken)), "one image shows a threat once"
