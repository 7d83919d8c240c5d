"""Which report is of which threat."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from hsop_gcs.reports import Measurement, Report
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, TrackRules, TrackStatus, Verdict, prune, update
from hsop_gcs.tracks.kernels import FORBIDDEN, assigned
from hsop_gcs.tracks.track import Binding
from tests.tracks.gospa import gospa_m
from tests.tracks.world import RULES, T0_S, after, bearing, distances, report, vector, verdict_on

GOLDEN = Path(__file__).parents[1] / "data" / "tracks" / "scans.json"
ROUNDING_M = 1e-9


@pytest.mark.parametrize("name", ["crossing", "abreast", "clutter"])
def test_the_picture_is_no_farther_from_the_truth_than_stone_soups(name: str) -> None:
    golden = json.loads(GOLDEN.read_text())
    rule, scenario = golden["rules"], golden["scenarios"][name]
    rules = TrackRules(timeout_s=rule["timeout_s"], tentative_timeout_s=rule["tentative_timeout_s"])
    picture, values = Picture(), []
    for scan in scenario["scans"]:
        now_s = T0_S + scan["time_s"]
        plots = [
            Report(source="radar", threat_id=None, time_s=now_s, position_m=vector(plot), sigma_m=rule["sigma_m"])
            for plot in scan["plots_m"]
        ]
        picture, _ = prune(update(picture, plots, now_s, rules)[0], now_s, rules)
        shown = [each for each in picture.tracks.values() if each.status is not TrackStatus.TENTATIVE]
        values.append(gospa_m(scan["truth_m"], [each.position_at(now_s) for each in shown]))
    assert np.mean(values) <= scenario["stone_soup"]["mean_gospa_m"] + ROUNDING_M


def test_a_scan_goes_to_the_assignment_of_greatest_likelihood() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        places = rng.uniform(-12, 12, (4, 2))
        picture = after(*(report(0, *place, threat_id=f"t{n}", sigma_m=8.0) for n, place in enumerate(places)))
        plots: list[Measurement] = [
            report(0.5, *(place + rng.normal(0, 8, 2)), source="plots", threat_id=None, sigma_m=8.0) for place in places
        ]
        _, verdicts = update(picture, plots, T0_S + 0.5, RULES)
        cost = np.array(
            [distances([track.state] * 4, plots) for track in picture.tracks.values()]
        )  # all determinants are equal
        best = min(itertools.permutations(range(4)), key=lambda order: sum(cost[t, p] for p, t in enumerate(order)))
        assert verdicts == tuple(f"t{track}" for track in best)


@given(st.integers(1, 8), st.integers(0, 8), st.integers(0, 2**32 - 1))
def test_assignments_are_those_of_scipy(rows: int, more: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.uniform(-20, 20, (rows, rows + more))
    cost[rng.uniform(size=cost.shape) < 0.5] = FORBIDDEN
    columns = assigned(cost)
    assert len(set(columns.tolist())) == rows
    assert cost[np.arange(rows), columns].sum() == pytest.approx(cost[linear_sum_assignment(cost)].sum(), abs=1e-5)


def test_an_id_binds_a_report_to_its_track_though_another_is_nearer() -> None:
    picture = after(report(0, 0, sigma_m=5.0), report(0, 12, threat_id="t2", sigma_m=5.0))
    assert verdict_on(picture, report(0.5, 11, sigma_m=5.0)) == "t1"


def test_ids_of_two_sources_at_one_place_are_one_threat() -> None:
    picture = after(report(0, 0, sigma_m=5.0), report(0.1, 3, source="console", threat_id="bogey", sigma_m=5.0))
    assert list(picture.tracks) == ["t1"]
    bound = [(each.source, each.threat_id) for each in picture.tracks["t1"].sources]
    assert bound == [("radar", "t1"), ("console", "bogey")]
    assert verdict_on(picture, report(0.5, 4, source="console", threat_id="bogey")) == "t1"


def test_two_ids_of_one_source_are_two_threats_wherever_they_are() -> None:
    picture = after(report(0, 0), report(0, 0.5, threat_id="t2"))
    assert set(picture.tracks) == {"t1", "t2"}


def test_the_same_id_of_two_sources_far_apart_is_two_threats() -> None:
    picture = after(report(0, 0), report(0, 900, source="console"))
    assert set(picture.tracks) == {"t1", "console/t1"}
    assert verdict_on(picture, report(0.5, 900, source="console")) == "console/t1"


def test_two_ids_taken_for_one_threat_part_when_it_becomes_impossible() -> None:
    picture = Picture()
    for number in range(60):
        east = 0.4 * number
        both = [report(0.2 * number, -east), report(0.2 * number, east, source="console", threat_id="c7")]
        picture, verdicts = update(picture, both, T0_S + 0.2 * number, RULES)
        assert all(isinstance(each, str) for each in verdicts)
    assert verdicts == ("t1", "c7")
    assert picture.tracks["t1"].position_m[0] == pytest.approx(-23.6, abs=1.0)
    assert picture.tracks["c7"].position_m[0] == pytest.approx(23.6, abs=1.0)
    assert Binding("console", "c7") not in picture.tracks["t1"].sources


def test_a_threat_known_by_one_id_may_manoeuvre_but_not_faster_than_aircraft_fly() -> None:
    picture = after(report(0, 0))
    assert verdict_on(picture, report(1.0, 60)) == "t1"
    refusal = verdict_on(picture, report(1.0, 500))
    assert isinstance(refusal, Refusal)
    assert (refusal.kind, refusal.field) == (RefusalKind.IMPOSSIBLE, "position")
    assert "more than 100 m/s" in refusal.problem


def test_plots_without_an_id_join_the_nearest_prediction() -> None:
    picture = after(
        report(0.0, 0, threat_id=None, velocity_mps=(5.0, 0.0, 0.0)),
        report(0.0, 200, threat_id=None, velocity_mps=(-5.0, 0.0, 0.0)),
        report(2.0, 12, threat_id=None),
        report(2.0, 188, threat_id=None),
    )
    assert {track.id: track.reports for track in picture.tracks.values()} == {"T1": 2, "T2": 2}


def test_plots_of_one_scan_are_of_different_threats_also_when_they_come_one_by_one() -> None:
    picture = after(report(0, 0, threat_id=None, sigma_m=5.0), report(0, 4, threat_id=None, sigma_m=5.0))
    assert set(picture.tracks) == {"T1", "T2"}


def test_a_plot_a_confirmed_threat_explains_begins_none_and_feeds_none() -> None:
    picture = after(report(0, 0), report(0, 3, threat_id=None, source="plots"), report(0.1, 4, threat_id=None))
    assert list(picture.tracks) == ["t1"]


@pytest.mark.parametrize("ids", [True, False])
def test_threats_that_pass_at_ten_metres_keep_their_identities(ids: bool) -> None:
    """Head on and in a chase, 10 m apart at the nearest; fixes as two cameras make them, or coarse reports with ids."""
    rng = np.random.default_rng(5)
    sigma_m = 15.0 if ids else 1.0
    for velocities in (((6.0, 0.0), (-6.0, 0.0)), ((6.0, 0.0), (1.0, 0.0)), ((4.0, 0.0), (0.0, 0.0))):
        for _ in range(10):
            picture = Picture()
            middle_s = 8.0
            belongs: dict[int, Verdict] = {}
            for number in range(80):
                time_s = 0.2 * number
                scan = []
                for threat, (velocity, north) in enumerate(zip(velocities, (0.0, 10.0), strict=True)):
                    place = np.array([velocity[0] * (time_s - middle_s), north, 40.0]) + rng.normal(0, sigma_m, 3)
                    scan.append(report(time_s, *place, sigma_m=sigma_m, threat_id=f"t{threat}" if ids else None))
                order = rng.permutation(2)
                picture, verdicts = update(picture, [scan[index] for index in order], T0_S + time_s, RULES)
                for index, verdict in zip(order.tolist(), verdicts, strict=True):
                    assert belongs.setdefault(index, verdict) == verdict
            assert len(picture.tracks) == 2


def test_a_bearing_sharpens_the_threat_it_points_at() -> None:
    picture = after(report(0, 0, 80, sigma_m=15.0), report(0, 60, 80, threat_id="t2", sigma_m=15.0))
    seen = bearing(0.1, (0.0, 0.0, 40.0), (62.0, 80.0, 41.0), 0.005)
    assert verdict_on(picture, seen) == "t2"
    before, now = picture.tracks["t2"].sigma_m, after(seen, picture=picture).tracks["t2"].sigma_m
    assert now < 0.7 * before


def test_a_bearing_no_threat_explains_is_said_so() -> None:
    refusal = verdict_on(after(report(0, 0, 80)), bearing(0.1, (0.0, 0.0, 40.0), (80.0, 0.0, 40.0), 0.005))
    assert isinstance(refusal, Refusal)
    assert (refusal.kind, refusal.field) == (RefusalKind.UNEXPLAINED, "direction")


def test_our_own_name_for_a_threat_binds_like_an_id() -> None:
    picture = after(report(0, 0, sigma_m=5.0), report(0, 12, threat_id="t2", sigma_m=5.0))
    fix = report(0.5, 11, threat_id=None, track_id="t1", source="cameras", sigma_m=5.0)
    assert verdict_on(picture, fix) == "t1"
    far = report(0.5, 300, threat_id=None, track_id="t1", source="cameras", sigma_m=0.5)
    picture = after(*(report(0.1 * n, 0) for n in range(1, 5)), report(0.5, 0, source="console"))
    assert verdict_on(picture, far) == "T1"
