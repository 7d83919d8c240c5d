"""A reported threat and the one that cameras began beside it are one, if nothing speaks against it."""

from dataclasses import replace
from types import MappingProxyType

import pytest

from hsop_gcs.detections import DetectionRules
from hsop_gcs.detections.merging import SOURCE, merged
from hsop_gcs.reports import Report, Vector3
from hsop_gcs.tracks import Picture, Track, TrackRules, update
from hsop_gcs.tracks.track import Binding
from tests.detections.examples import METRE, NOW_S

RULES = TrackRules()
BESIDE: Vector3 = (9.0, -6.0, 42.0)


def followed(source: str, name: str | None, place_m: Vector3, sigma_m: float, *, track: str | None = None) -> Track:
    """A track of four seconds, five reports a second."""
    picture = Picture()
    for step in range(21):
        time_s = NOW_S - 4.0 + 0.2 * step
        report = Report(
            source=source, threat_id=name, time_s=time_s, position_m=place_m, sigma_m=sigma_m, track_id=track
        )
        picture, _ = update(picture, [report], time_s, RULES)
    (only,) = picture.tracks.values()
    return only


def picture_of(*tracks: Track) -> Picture:
    return Picture(tracks=MappingProxyType({track.id: track for track in tracks}))


def after(*tracks: Track, wait_s: float = 0.0) -> Picture:
    return merged(picture_of(*tracks), NOW_S + wait_s, DetectionRules(), RULES)


def test_the_reported_name_stays_with_what_the_cameras_know() -> None:
    coarse, sharp = followed("radar", "t1", (0.0, 0.0, 40.0), 15.0), followed(SOURCE, None, BESIDE, 0.2)
    (one,) = after(coarse, sharp).tracks.values()
    assert (one.id, one.source, one.source_threat_id) == ("t1", "radar", "t1")
    assert Binding("radar", "t1") in one.sources
    assert one.position_m == pytest.approx(BESIDE, abs=0.2 * METRE)
    assert one.sigma_m == sharp.sigma_m < coarse.sigma_m
    assert one.reports == coarse.reports + sharp.reports


def test_a_threat_that_cameras_see_where_it_is_reported_is_another() -> None:
    seen, sharp = followed("radar", "t1", (0.0, 0.0, 40.0), 15.0, track="t1"), followed(SOURCE, None, BESIDE, 0.2)
    assert set(after(seen, sharp).tracks) == {seen.id, sharp.id}


def test_a_report_that_names_no_threat_is_a_report() -> None:
    nameless = replace(followed("radar", None, (0.0, 0.0, 40.0), 15.0), id="t9")
    (one,) = after(nameless, followed(SOURCE, None, BESIDE, 0.2)).tracks.values()
    assert (one.id, one.source) == ("t9", "radar")
    assert one.position_m == pytest.approx(BESIDE, abs=0.2 * METRE)


def test_one_that_is_too_far_off_is_another() -> None:
    coarse, sharp = followed("radar", "t1", (0.0, 0.0, 40.0), 15.0), followed(SOURCE, None, (80.0, 0.0, 40.0), 0.2)
    assert set(after(coarse, sharp).tracks) == {"t1", sharp.id}


def test_one_that_cameras_have_lost_is_no_better() -> None:
    coarse, lost = followed("radar", "t1", (0.0, 0.0, 40.0), 15.0), followed(SOURCE, None, BESIDE, 0.2)
    assert set(after(coarse, lost, wait_s=2.5).tracks) == {"t1", lost.id}


def test_of_two_reported_threats_the_nearer_is_the_one_that_is_seen() -> None:
    far, near = followed("radar", "t1", (20.0, 0.0, 40.0), 15.0), followed("radar", "t2", (8.0, -4.0, 40.0), 15.0)
    merged_tracks = after(far, near, followed(SOURCE, None, BESIDE, 0.2)).tracks
    assert set(merged_tracks) == {"t1", "t2"}
    assert merged_tracks["t1"] is far
    assert merged_tracks["t2"].position_m == pytest.approx(BESIDE, abs=0.2 * METRE)
