"""The letter's claims, and what goes beyond them, on a small study; the full one is in docs/study.md."""

import math

import numpy as np
import pytest

from hsop_gcs.placement.objective import margins, threat_points_m
from hsop_gcs.study.assumptions import Assumptions, CoverageCameras
from hsop_gcs.study.claims import claims, ratio
from hsop_gcs.study.coverage import cover
from hsop_gcs.study.engine import run
from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind, placements
from hsop_gcs.study.results import Results
from hsop_gcs.study.summary import Row, error_of, rows
from hsop_gcs.study.trial import Record, Study, Trial, scenario
from hsop_gcs.study.views import all_sights

STUDY = Study(threats=(2, 3), scenarios=8, draws=1000, rounds=2, seed=1)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return run(Results(STUDY, None))


@pytest.fixture(scope="module")
def table(records: list[Record]) -> list[Row]:
    return rows(records)


@pytest.mark.parametrize("threats", [2, 3])
def test_hsops_error_falls_as_hosts_are_added_and_is_below_a_metre_on_average(threats: int, table: list[Row]) -> None:
    errors = error_of(table, threats, Kind.HSOP, Estimator.EQ5)
    assert errors[2 * threats] < 0.3 * errors[2]
    assert np.mean(list(errors.values())) < 1.0


@pytest.mark.parametrize("threats", [2, 3])
def test_central_cameras_take_over_as_hosts_are_added(threats: int, table: list[Row]) -> None:
    shares = error_of(table, threats, Kind.HSOP, Estimator.EQ5, column="central_share")
    assert shares[2] < shares[2 * threats] - 0.1
    assert shares[2 * threats] > 0.99


def test_coverage_only_lies_near_9_to_10_metres_whatever_the_number_of_hosts(table: list[Row]) -> None:
    errors = [
        error for threats in (2, 3) for error in error_of(table, threats, Kind.COVERAGE_ONLY, Estimator.EQ5).values()
    ]
    assert np.mean(errors) == pytest.approx(9.5, abs=3.0)
    assert min(errors) > 4.0


def test_every_claim_holds_on_a_small_study(records: list[Record]) -> None:
    found = claims(records)
    assert [claim for claim in found if not claim.holds] == []
    assert len(found) == 2 * (3 + 2) + 3


def test_coverage_onlys_lines_of_sight_are_longest_where_two_hosts_see_four_threats() -> None:
    lengths_m: dict[int, list[float]] = {2: [], 8: []}
    for k in range(30):
        problem = scenario(Study(), Trial(threats=4, index=k))
        for n_hosts, lengths in lengths_m.items():
            placement = cover(problem, n_hosts, Assumptions(), np.random.default_rng(k))
            assert placement is not None
            at = {pose.host: pose.position_m for pose in placement.hosts}
            for pair, points in zip(placement.pairs, threat_points_m(problem), strict=True):
                lengths += [math.dist(at[view.host], point) for view in pair.views for point in points]
    assert np.mean(lengths_m[2]) > 1.08 * np.mean(lengths_m[8])


def test_least_rms_with_maximum_likelihood_on_all_views_has_at_most_0_4_of_hsops_error(records: list[Record]) -> None:
    assert ratio(records, (Kind.RMS, Estimator.ML_ALL_VIEWS), (Kind.HSOP, Estimator.EQ5)) <= 0.4


def test_maximum_likelihood_alone_is_better_than_equation_5(records: list[Record]) -> None:
    assert ratio(records, (Kind.HSOP, Estimator.ML), (Kind.HSOP, Estimator.EQ5)) <= 0.9


def test_a_ways_ratio_to_itself_is_one(records: list[Record]) -> None:
    same = (Kind.RMS, Estimator.ML)
    assert ratio(records, same, same) == pytest.approx(1.0)


def test_central_pairs_come_within_five_percent_of_the_cramer_rao_bound(records: list[Record]) -> None:
    central = [r for record in records for r in record["results"] if r["central_share"] == 1.0]
    assert len(central) >= 8
    errors, bounds = ([r["rms_error_m"]["ml"] for r in central], [r["bound_m"] for r in central])
    assert np.linalg.norm(errors) <= 1.05 * np.linalg.norm(bounds)


@pytest.mark.parametrize("cameras", list(CoverageCameras))
@pytest.mark.parametrize("n_hosts", [2, 3, 4])
def test_coverage_only_keeps_every_constraint(cameras: CoverageCameras, n_hosts: int) -> None:
    assumptions = Assumptions(coverage_cameras=cameras)
    for seed in range(4):
        problem = assumptions.problem(2, np.random.default_rng(seed))
        placement = cover(problem, n_hosts, assumptions, np.random.default_rng(seed))
        assert placement is not None
        assert len(placement.hosts) == n_hosts
        slack = margins(problem, placement.hosts, {pair.threat: pair.views for pair in placement.pairs})
        assert min(slack.pixels, slack.fov_deg, slack.distance_m) >= 0


def test_the_pairs_own_views_come_first_and_no_lens_is_counted_twice() -> None:
    problem = scenario(STUDY, Trial(threats=3, index=0))
    placement = placements(problem, Kind.RMS, STUDY.assumptions, rounds=1, seed=0)[3]
    for threat, points in enumerate(threat_points_m(problem)):
        for point in points:
            sights = all_sights(problem.rig, 1.5, placement, threat, point)
            assert len(sights) >= 2
            lenses = [(*sight.origin_m, type(sight.lens).__name__) for sight in sights]
            assert len(set(lenses)) == len(lenses)


def test_scenarios_lie_in_the_square_and_fly_no_faster_than_the_fastest() -> None:
    problems = [scenario(STUDY, Trial(threats=3, index=k)) for k in range(50)]
    threats = [threat for problem in problems for threat in problem.threats]
    assert max(abs(x) for threat in threats for x in threat.position_m) <= 20.0
    speeds = [math.hypot(*threat.velocity_mps) for threat in threats]
    assert max(speeds) <= 5.0
    assert np.mean(speeds) == pytest.approx(2.5, abs=0.4)
