"""What cameras see of our own aircraft."""

from collections.abc import Sequence

import pytest

from hsop_gcs.detections import Assimilated, DetectionRules, Fate, Ray, Watch, assimilate
from hsop_gcs.reports import ReportRules, Vector3
from hsop_gcs.tracks import Picture, TrackRules
from hsop_gcs.tracks.own import OwnAircraft
from tests.detections.examples import NOW_S, bearing_ray, reported

WEST: Vector3 = (-30.0, 0.0, 30.0)
SOUTH: Vector3 = (0.0, -30.0, 30.0)
THIRD: Vector3 = (10.0, 10.0, 30.0)
HOSTS = {"a": WEST, "b": SOUTH, "c": THIRD}


def take(picture: Picture, rays: Sequence[Ray], own: OwnAircraft, now_s: float = NOW_S + 0.1) -> Assimilated:
    return assimilate(
        picture,
        Watch(),
        rays,
        now_s,
        own=own,
        rules=DetectionRules(),
        track_rules=TrackRules(),
        clock=ReportRules(),
    )


def test_a_ray_that_leads_to_a_host_of_ours_is_not_held() -> None:
    done = take(Picture(), [bearing_ray("a", WEST, THIRD, sigma_deg=1.0)], OwnAircraft.at_rest(HOSTS))
    (verdict,) = done.verdicts
    assert verdict.refusal is not None
    assert (verdict.refusal.reason, verdict.refusal.problem) == (
        "own host",
        "host 'c' lies there, as 'a/central' sees it",
    )
    assert done.watch.held == ()


def test_coarse_rays_that_cross_far_from_the_host_they_show_begin_no_threat() -> None:
    """Two hosts in one line with a third: their rays cross 20 m beyond it."""
    near: Vector3 = (-30.0, 4.0, 30.0)
    rays = [
        bearing_ray(host, place, THIRD, sigma_deg=2.0, off_deg=(off, 0.0))
        for host, place, off in (("a", WEST, 1.0), ("b", near, -1.0))
    ]
    own = OwnAircraft.at_rest({"a": WEST, "b": near, "c": THIRD})
    assert not take(Picture(), rays, own).picture.tracks


def test_a_host_that_flies_is_looked_for_where_it_was_when_the_image_was_exposed() -> None:
    seen_s = NOW_S - 1.5
    path = ((seen_s, THIRD), (NOW_S, (22.0, 10.0, 30.0)))
    own = OwnAircraft(paths={"a": ((NOW_S, WEST),), "b": ((NOW_S, SOUTH),), "c": path})
    rays = [bearing_ray(host, HOSTS[host], THIRD, time_s=seen_s) for host in ("a", "b")]
    done = take(Picture(), rays, own, NOW_S)
    assert not done.picture.tracks
    assert done.watch.counts.refused == {"own host": 2}


@pytest.mark.parametrize("apart_m", [6.0, 4.0])
def test_a_threat_beside_a_host_is_still_fixed(apart_m: float) -> None:
    threat = (THIRD[0] + apart_m, THIRD[1] - apart_m, THIRD[2] + 2.0)
    picture = reported(("t1", threat), sigma_m=2.0)
    rays = [bearing_ray(host, HOSTS[host], threat, sigma_deg=0.3) for host in ("a", "b")]
    done = take(picture, rays, OwnAircraft.at_rest(HOSTS))
    assert [(each.fate, each.threat) for each in done.verdicts] == [(Fate.FIX, "t1")] * 2


def test_a_ray_to_a_host_does_not_carry_a_threat_behind_it_off() -> None:
    behind = (20.0, 13.0, 30.0)
    picture = reported(("t1", behind), sigma_m=4.0)
    done = take(picture, [bearing_ray("a", WEST, THIRD, sigma_deg=0.3)], OwnAircraft.at_rest(HOSTS))
    assert [each.fate for each in done.verdicts] == [Fate.AMBIGUOUS]
    assert done.picture.tracks["t1"].position_m == picture.tracks["t1"].position_m
