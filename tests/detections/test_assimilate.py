"""Detections into the picture: what came of each, and every reason not to believe one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.detections import (
    Assimilated,
    Detection,
    DetectionRules,
    Direction,
    Fate,
    Lens,
    Pose,
    PoseHistory,
    Ray,
    Refused,
    Watch,
    assimilate,
    let_go,
    rays_of,
)
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.reports import ReportRules, Vector3
from hsop_gcs.tracks import Picture, TrackRules
from hsop_gcs.tracks.own import OwnAircraft
from hsop_gcs.tracks.track import TrackStatus
from tests.detections.examples import METRE, NOW_S, RIG, bearing_ray, pixel_detection, reported, still

WEST: Vector3 = (-30.0, 0.0, 30.0)
SOUTH: Vector3 = (0.0, -30.0, 30.0)
THREAT = (5.0, 4.0, 32.0)
HOSTS: Mapping[str, Vector3] = {"a": WEST, "b": SOUTH}


def take(
    picture: Picture, rays: Sequence[Ray | Refused], watch: Watch | None = None, now_s: float = NOW_S + 0.1
) -> Assimilated:
    return assimilate(
        picture,
        watch or Watch(),
        rays,
        now_s,
        own=OwnAircraft.at_rest(HOSTS),
        rules=DetectionRules(),
        track_rules=TrackRules(),
        clock=ReportRules(),
    )


def seen_by(*hosts: str, time_s: float = NOW_S, sigma_deg: float = 0.1, at: Sequence[float] = THREAT) -> list[Ray]:
    return [bearing_ray(host, HOSTS[host], at, time_s=time_s, sigma_deg=sigma_deg) for host in hosts]


def test_two_hosts_fix_a_threat_that_was_known_coarsely() -> None:
    picture = reported(("t1", (12.0, -6.0, 30.0)), sigma_m=15.0)
    done = take(picture, seen_by("a", "b"))
    assert [(each.fate, each.threat) for each in done.verdicts] == [(Fate.FIX, "t1")] * 2
    track = done.picture.tracks["t1"]
    assert track.position_m == pytest.approx(THREAT, abs=0.1 * METRE)
    assert track.sigma_m < 0.1 * METRE
    assert (done.watch.counts.fixes, done.watch.counts.used, done.watch.counts.bearing_only) == (1, 2, 0)


def test_one_host_alone_corrects_the_direction_and_leaves_the_range() -> None:
    picture = reported(("t1", (8.0, -2.0, 30.0)), sigma_m=5.0)
    watch = Watch()
    for tick in range(1, 11):
        time_s = NOW_S + 0.2 * tick
        done = take(picture, seen_by("a", time_s=time_s), watch, time_s + 0.1)
        picture, watch = done.picture, done.watch
        assert [each.fate for each in done.verdicts] == [Fate.BEARING]
    track = picture.tracks["t1"]
    along = [there - here for there, here in zip(THREAT, WEST, strict=True)]
    off = [there - here for there, here in zip(track.position_m, WEST, strict=True)]
    range_m = math.hypot(*along)
    ahead_m = sum(a * b for a, b in zip(along, off, strict=True)) / range_m
    assert math.sqrt(sum(value**2 for value in off) - ahead_m**2) < 0.1 * METRE
    unit = [value / range_m for value in along]
    assert math.sqrt(float(unit @ track.covariance[:3, :3] @ unit)) > 3 * METRE, "nobody has measured the range"
    assert (watch.counts.bearing_only, watch.counts.fixes) == (10, 0)


def test_two_hosts_begin_a_threat_that_nobody_reported_and_confirm_it() -> None:
    picture, watch = Picture(), Watch()
    fates = []
    for tick in range(8):
        time_s = NOW_S + 0.2 * tick
        done = take(picture, seen_by("a", "b", time_s=time_s), watch, time_s + 0.1)
        picture, watch = done.picture, done.watch
        fates.append([each.fate for each in done.verdicts])
    (track,) = picture.tracks.values()
    assert fates == [[Fate.CANDIDATE] * 2] + [[Fate.FIX] * 2] * 7
    assert (track.source, track.source_threat_id, track.status) == ("cameras", None, TrackStatus.CONFIRMED)
    assert track.position_m == pytest.approx(THREAT, abs=0.1 * METRE)
    assert (watch.counts.candidates, watch.counts.fixes, watch.counts.unexplained) == (1, 8, 0)


def test_hosts_whose_detections_come_in_posts_of_their_own_still_begin_a_threat() -> None:
    first = take(Picture(), seen_by("a"))
    assert [each.fate for each in first.verdicts] == [Fate.HELD]
    assert not first.picture.tracks
    second = take(first.picture, seen_by("b"), first.watch, NOW_S + 0.15)
    assert [each.fate for each in second.verdicts] == [Fate.CANDIDATE]
    assert len(second.picture.tracks) == 1
    assert second.watch.held == ()
    assert second.watch.counts.used == 2


def test_a_ray_held_in_vain_is_counted_when_it_is_let_go() -> None:
    held = take(Picture(), seen_by("a"))
    assert (len(held.watch.held), held.watch.counts.unexplained) == (1, 0)
    assert let_go(held.watch, NOW_S + 0.4, DetectionRules()) is held.watch
    later = let_go(held.watch, NOW_S + 1.0, DetectionRules())
    assert (len(later.held), later.counts.unexplained) == (0, 1)
    assert take(held.picture, [], held.watch, NOW_S + 1.0).watch == later


def test_rays_that_meet_at_an_own_host_begin_no_threat() -> None:
    rays = [bearing_ray(host, HOSTS[host], (10.0, 10.0, 30.0)) for host in ("a", "b")]
    done = assimilate(
        Picture(),
        Watch(),
        rays,
        NOW_S,
        own=OwnAircraft.at_rest({**HOSTS, "c": (10.5, 10.0, 30.0)}),
        rules=DetectionRules(),
        track_rules=TrackRules(),
        clock=ReportRules(),
    )
    assert not done.picture.tracks
    assert [each.fate for each in done.verdicts] == [Fate.REFUSED] * 2
    assert done.watch.counts.refused == {"own host": 2}
    assert done.watch.counts.candidates == 0


def test_a_repeated_detection_is_refused() -> None:
    picture = reported(("t1", THREAT), sigma_m=2.0)
    (ray,) = seen_by("a")
    once = take(picture, [ray])
    again = take(once.picture, [ray, ray], once.watch, NOW_S + 0.4)
    assert [each.fate for each in again.verdicts] == [Fate.REFUSED] * 2
    assert again.watch.counts.refused == {"duplicate": 2}
    assert again.picture == once.picture


@pytest.mark.parametrize(("offset_s", "shown"), [(-5.0, "old"), (5.0, "future")])
def test_a_detection_of_another_time_is_refused(offset_s: float, shown: str) -> None:
    done = take(reported(("t1", THREAT), sigma_m=2.0), seen_by("a", time_s=NOW_S + offset_s))
    (verdict,) = done.verdicts
    assert verdict.refusal is not None
    assert (verdict.fate, verdict.refusal.field) == (Fate.REFUSED, "time")
    assert shown in verdict.refusal.problem
    assert done.watch.counts.refused == {"clock": 1}


def test_every_detection_without_a_ray_says_why_and_costs_only_itself() -> None:
    pose = Pose(position_m=WEST, heading_deg=0.0, aim=Aim(pan_deg=80.0, tilt_deg=0.0))
    poses = {
        "a": still(pose),
        "deaf": PoseHistory(),
        "fixed": still(replace(pose, aim=None)),
        "gone": still(pose, NOW_S - 3.0),
    }
    rays = rays_of(
        [
            pixel_detection(640.0, 480.0, host="nobody"),
            pixel_detection(640.0, 480.0, host="deaf"),
            pixel_detection(640.0, 480.0, host="fixed"),
            pixel_detection(640.0, 480.0, host="gone"),
            pixel_detection(4000.0, 480.0, host="a"),
            pixel_detection(640.0, 480.0, host="a"),
        ],
        poses,
        dict.fromkeys(poses, RIG),
        DetectionRules(),
    )
    done = take(reported(("t1", THREAT), sigma_m=2.0), rays)
    refusals = [each.refusal for each in done.verdicts]
    assert [(each.reason, each.field) for each in refusals if each is not None] == [
        ("no pose", "host"),
        ("no pose", "time"),
        ("no aim", "time"),
        ("no pose", "time"),
        ("outside the image", "pixel.u_px"),
    ]
    assert done.verdicts[-1].fate is Fate.BEARING
    assert done.watch.counts.received == 6
    assert done.watch.counts.refused == {"no pose": 3, "no aim": 1, "outside the image": 1}


def test_a_late_detection_is_put_in_its_place() -> None:
    """The track is the same to rounding whether a host's detection comes in order or 0.4 s later."""
    picture = reported(("t1", (8.0, -2.0, 30.0)), sigma_m=5.0)
    first, second = seen_by("a", time_s=NOW_S + 0.2), seen_by("b", time_s=NOW_S + 0.4)
    in_order = take(take(picture, first, now_s=NOW_S + 0.5).picture, second, now_s=NOW_S + 0.6)
    late = take(take(picture, second, now_s=NOW_S + 0.5).picture, first, now_s=NOW_S + 0.6)
    assert [each.fate for each in late.verdicts] == [Fate.BEARING]
    expected = in_order.picture.tracks["t1"].state
    assert late.picture.tracks["t1"].state.mean == pytest.approx(expected.mean, abs=0.5 * METRE)
    assert late.picture.tracks["t1"].time_s == expected.time_s


def test_a_peripheral_and_a_central_view_of_different_hosts_make_a_fix_in_between() -> None:
    picture = reported(("t1", THREAT), sigma_m=5.0)
    central, peripheral = seen_by("a"), seen_by("b", sigma_deg=3.8)
    done = take(picture, [*central, *peripheral])
    assert [each.fate for each in done.verdicts] == [Fate.FIX] * 2
    assert 0.5 * METRE < done.picture.tracks["t1"].sigma_m < 2.5 * METRE


def test_the_same_calls_give_the_same_picture_to_the_bit() -> None:
    def run() -> Assimilated:
        picture, watch = reported(("t1", (12.0, -6.0, 30.0)), sigma_m=15.0), Watch()
        for tick in range(5):
            time_s = NOW_S + 0.2 * tick
            rays = seen_by("a", "b", time_s=time_s) + seen_by("a", "b", time_s=time_s, at=(-9.0, 8.0, 25.0))
            done = take(picture, rays, watch, time_s + 0.1)
            picture, watch = done.picture, done.watch
        return done

    assert run() == run()


def test_a_camera_of_a_host_is_a_source_of_its_own() -> None:
    seen = Direction(azimuth_deg=0.0, elevation_deg=0.0, sigma_deg=1.0)
    front = Detection(host="h1", camera=CameraKind.PERIPHERAL, lens=Lens.FRONT, time_s=NOW_S, seen=seen)
    assert front.source == "h1/peripheral/front"
    assert replace(front, camera=CameraKind.CENTRAL, lens=None).source == "h1/central"
