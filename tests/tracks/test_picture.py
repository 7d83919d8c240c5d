"""The picture as a whole: what it refuses and counts, what it knows of velocities, that it is the same each time."""

import pickle

import numpy as np
import pytest

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, dismiss, prune, update
from hsop_gcs.tracks.own import OwnAircraft
from tests.tracks.world import RULES, T0_S, after, bearing, report, verdict_on

MM_PER_S = 1e-3
MILLISECOND = 1e-3


def test_a_velocity_the_source_gives_is_believed() -> None:
    track = after(report(0, 0, velocity_mps=(3.0, 0.0, 0.0))).tracks["t1"]
    assert track.velocity_known
    assert track.position_at(T0_S + 2.0) == pytest.approx((6.0, 0.0, 40.0))


def test_a_velocity_nobody_gives_comes_from_successive_reports() -> None:
    track = after(*(report(0.5 * k, 2.0 * 0.5 * k, -1.0 * 0.5 * k) for k in range(12))).tracks["t1"]
    assert track.velocity_known
    assert track.velocity_mps == pytest.approx((2.0, -1.0, 0.0), abs=5 * MM_PER_S)


def test_one_report_without_velocity_leaves_it_unknown() -> None:
    track = after(report(0, 10)).tracks["t1"]
    assert not track.velocity_known
    assert track.velocity_mps == (0.0, 0.0, 0.0)


def test_a_velocity_of_coarse_reports_takes_longer_to_be_known() -> None:
    fine = after(*(report(0.5 * k, 0.0, sigma_m=1.0) for k in range(4)))
    coarse = after(*(report(0.5 * k, 0.0, sigma_m=15.0) for k in range(4)))
    assert fine.tracks["t1"].velocity_known
    assert not coarse.tracks["t1"].velocity_known


def test_many_coarse_reports_make_a_fine_track() -> None:
    track = after(*(report(0.1 * k, 0.0, sigma_m=15.0) for k in range(60))).tracks["t1"]
    assert track.sigma_m < 5.0
    assert track.covariance.shape == (6, 6)


def test_a_name_of_ours_never_meets_a_name_of_a_source() -> None:
    picture = after(report(0, 0, threat_id="T1"), report(0, 500, threat_id=None))
    assert set(picture.tracks) == {"T1", "T2"}


@pytest.mark.parametrize("threat_id", ["t1", None])
def test_a_report_repeated_is_refused_and_the_track_kept(threat_id: str | None) -> None:
    once = report(0, 0, threat_id=threat_id)
    picture = after(once)
    picture, (verdict,) = update(picture, [once], T0_S + 0.1, RULES)
    assert isinstance(verdict, Refusal)
    assert (verdict.kind, verdict.field) == (RefusalKind.DUPLICATE, "time")
    assert [track.reports for track in picture.tracks.values()] == [1]
    _, verdicts = update(Picture(), [once, once], T0_S, RULES)
    assert [isinstance(each, Refusal) for each in verdicts] == [False, True]


def test_a_report_on_top_of_an_own_host_is_of_that_host() -> None:
    own = OwnAircraft.at_rest({"h1": (50.0, 0.0, 40.0)})
    for east, sigma_m, refused in ((47.0, None, True), (41.0, 15.0, True), (38.0, 15.0, False), (43.0, 1.0, False)):
        verdict = verdict_on(Picture(), report(0, east, sigma_m=sigma_m), own=own)
        assert isinstance(verdict, Refusal) == refused
        if isinstance(verdict, Refusal):
            assert (verdict.kind, verdict.field) == (RefusalKind.OWN_HOST, "position")
            assert "'h1'" in verdict.problem


def test_a_known_threat_that_passes_a_host_does_not_vanish() -> None:
    picture = after(*(report(0.1 * k, 40 + 0.5 * k) for k in range(20)))
    own = OwnAircraft.at_rest({"h1": (50.0, 0.0, 40.0)})
    assert verdict_on(picture, report(2.0, 50.0), own=own) == "t1"
    assert isinstance(verdict_on(picture, report(2.0, 50.0, threat_id="t2"), own=own), Refusal)
    far = after(report(1.9, 200.0))
    assert isinstance(verdict_on(far, report(2.0, 50.0), own=own), Refusal)


NAN = float("nan")
UNIT_M2 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("measurement", "field"),
    [
        (report(0, NAN), "position"),
        (report(0, 0, velocity_mps=(0.0, NAN, 0.0)), "velocity"),
        (report(0, 0, sigma_m=-1.0), "sigma_m"),
        (report(0, 0, covariance_m2=((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))), "covariance_m2"),
        (
            report(0, 0, covariance_m2=UNIT_M2, common_m2=((1.0, 0.5, 0.0), (0.5, 1.0, 0.0), (0.0, 0.0, 0.0))),
            "common_m2",
        ),
        (bearing(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1), "direction"),
        (bearing(0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0), "sigma_rad"),
        (bearing(0, (NAN, 0.0, 0.0), (0.0, 1.0, 0.0), 0.1), "origin_m"),
    ],
)
def test_numbers_that_are_no_measurement_are_refused(measurement: Report | Bearing, field: str) -> None:
    verdict = verdict_on(after(report(-1, 0)), measurement)
    assert isinstance(verdict, Refusal)
    assert (verdict.kind, verdict.field) == (RefusalKind.INVALID, field)


def test_a_clock_that_is_off_is_measured_also_when_its_reports_are_refused() -> None:
    rng = np.random.default_rng(2)
    picture = Picture()
    for number in range(40):
        arrival_s = T0_S + number
        here = report(number + 0.8 - rng.uniform(0.0, 0.05), 0.0, source="ahead")
        far_ahead = report(number + 7.0, 0.0, source="far ahead")
        picture, verdicts = update(picture, [here, far_ahead], arrival_s, RULES)
        assert [isinstance(each, Refusal) for each in verdicts] == [False, True]
    ahead, far = picture.sources["ahead"], picture.sources["far ahead"]
    assert ahead.clock_offset_s == pytest.approx(0.775, abs=15 * MILLISECOND)
    assert far.clock_offset_s == pytest.approx(7.0, abs=1 * MILLISECOND)
    assert (ahead.clock_samples, ahead.accepted) == (40, 40)
    assert far.refused == {RefusalKind.CLOCK: 40}


def test_a_source_not_heard_for_long_is_forgotten() -> None:
    picture = after(report(0, 0))
    assert list(prune(picture, T0_S + 599, RULES)[0].sources) == ["radar"]
    assert list(prune(picture, T0_S + 601, RULES)[0].sources) == []


def test_a_bad_measurement_costs_only_itself() -> None:
    batch: list[Measurement] = [report(0, 0), report(0, NAN, threat_id="t2"), report(0, 90, threat_id="t3")]
    _, verdicts = update(Picture(), batch, T0_S, RULES)
    assert [each if isinstance(each, str) else each.kind for each in verdicts] == ["t1", RefusalKind.INVALID, "t3"]


def test_a_threat_that_is_dismissed_is_gone() -> None:
    picture = dismiss(after(report(0, 0), report(0, 90, threat_id="t2")), "t1")
    assert list(picture.tracks) == ["t2"]
    with pytest.raises(KeyError, match="t1"):
        dismiss(picture, "t1")


def everything(seed: int) -> bytes:
    rng = np.random.default_rng(seed)
    picture = Picture()
    for number in range(60):
        scan: list[Measurement] = []
        for threat in range(6):
            place = np.array([40.0 * threat + 0.3 * number, 0.2 * number, 40.0]) + rng.normal(0, 2.0, 3)
            named = f"t{threat}" if threat % 2 else None
            scan.append(report(0.1 * number - rng.exponential(0.3), *place, threat_id=named, sigma_m=2.0))
        scan.append(bearing(0.1 * number, (0.0, -60.0, 30.0), (40.0 + 0.3 * number, 0.2 * number, 40.0), 0.01))
        picture, _ = update(picture, scan, T0_S + 0.1 * number, RULES)
        picture, _ = prune(picture, T0_S + 0.1 * number, RULES)
    return pickle.dumps([(track, track.position_m) for track in picture.tracks.values()])


def test_the_same_reports_make_the_same_picture_to_the_bit() -> None:
    assert everything(4) == everything(4)


def test_an_update_leaves_the_old_picture_as_it_was() -> None:
    old = after(report(0, 0))
    before = pickle.dumps(old.tracks["t1"])
    after(report(0.5, 1), report(0.2, 1), picture=old)
    assert pickle.dumps(old.tracks["t1"]) == before
    assert old.tracks["t1"].reports == 1


def test_tracks_go_to_another_process() -> None:
    track = after(report(0, 0), report(0.5, 1)).tracks["t1"]
    assert pickle.loads(pickle.dumps(track)) == track
