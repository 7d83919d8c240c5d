"""How reports become tracks."""

import pickle

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.reports import Report
from hsop_gcs.tracks import Picture, TrackRules, prune, update

RULES = TrackRules()
MM_PER_S = 1e-3


def report(time_s: float, east: float, north: float = 0.0, **given: object) -> Report:
    fields: dict[str, object] = {
        "source": "radar",
        "threat_id": "t1",
        "time_s": time_s,
        "position_m": (east, north, 40.0),
    }
    return Report(**(fields | given))  # type: ignore[arg-type]


def after(*reports: Report) -> Picture:
    picture = Picture()
    for each in reports:
        picture, _ = update(picture, each, RULES)
    return picture


def test_a_velocity_the_source_gives_is_believed() -> None:
    track = after(report(0, 0, velocity_mps=(3.0, 0.0, 0.0))).tracks["t1"]
    assert track.velocity_known
    assert track.position_at(2.0) == pytest.approx((6.0, 0.0, 40.0))


def test_a_velocity_nobody_gives_comes_from_successive_reports() -> None:
    track = after(*(report(0.5 * k, 2.0 * 0.5 * k, -1.0 * 0.5 * k) for k in range(6))).tracks["t1"]
    assert track.velocity_known
    assert track.velocity_mps == pytest.approx((2.0, -1.0, 0.0), abs=1 * MM_PER_S)


def test_one_report_without_velocity_leaves_it_unknown() -> None:
    track = after(report(0, 10)).tracks["t1"]
    assert not track.velocity_known
    assert track.velocity_mps == (0.0, 0.0, 0.0)


def test_a_turn_is_noticed_because_old_sightings_are_forgotten() -> None:
    out = [report(0.5 * k, 4.0 * 0.5 * k) for k in range(20)]
    back = [report(10 + 0.5 * k, 38.0 - 4.0 * 0.5 * k) for k in range(1, 13)]
    track = after(*out, *back).tracks["t1"]
    assert track.velocity_mps[0] == pytest.approx(-4.0, abs=1 * MM_PER_S)


def test_the_same_id_from_two_sources_is_two_threats() -> None:
    picture = after(report(0, 0), report(0, 900, source="console"))
    assert set(picture.tracks) == {"t1", "console/t1"}


def test_reports_without_an_id_join_the_nearest_prediction() -> None:
    picture = after(
        report(0.0, 0, threat_id=None, velocity_mps=(5.0, 0.0, 0.0)),
        report(0.0, 200, threat_id=None, velocity_mps=(-5.0, 0.0, 0.0)),
        report(2.0, 12, threat_id=None),
        report(2.0, 188, threat_id=None),
    )
    assert {track.id: track.reports for track in picture.tracks.values()} == {"T1": 2, "T2": 2}


def test_a_name_of_ours_never_meets_a_name_of_a_source() -> None:
    picture = after(report(0, 0, threat_id="T1"), report(0, 500, threat_id=None))
    assert set(picture.tracks) == {"T1", "T2"}


def test_a_report_no_newer_than_the_last_is_refused() -> None:
    picture = after(report(10, 0))
    for late in (10.0, 9.0):
        with pytest.raises(BadInput, match="older than the newest"):
            update(picture, report(late, 1), RULES)


def test_a_jump_no_aircraft_flies_is_refused_and_the_track_stays_as_it_was() -> None:
    picture = after(report(0, 0))
    with pytest.raises(BadInput, match="more than 100 m/s"):
        update(picture, report(1, 500), RULES)
    assert picture.tracks["t1"].position_m == (0.0, 0.0, 40.0)


def test_a_threat_that_is_not_reported_any_more_leaves() -> None:
    picture = after(report(0, 0), report(8, 900, threat_id="t2"))
    picture, gone = prune(picture, 12.0, RULES)
    assert [track.id for track in gone] == ["t1"]
    assert set(picture.tracks) == {"t2"}


def test_tracks_go_to_another_process() -> None:
    track = after(report(0, 0)).tracks["t1"]
    assert pickle.loads(pickle.dumps(track)) == track
