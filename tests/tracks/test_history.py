"""Late measurements: put in their place, replayed, the same as if they had come in time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.reports import Measurement
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, TrackRules, state_before, update
from tests.tracks.world import RULES, T0_S, after, bearing, report

REPORTS: list[Measurement] = [
    report(0.3 * number, 3.0 * 0.3 * number, velocity_mps=(3.0, 0.0, 0.0) if number % 2 else None, sigma_m=1.0 + number)
    for number in range(8)
]


@given(st.permutations(REPORTS))
@settings(max_examples=40, deadline=None)
def test_any_order_within_the_lag_ends_in_the_same_track_to_the_bit(order: list[Measurement]) -> None:
    picture = Picture()
    for each in order:
        picture, (verdict,) = update(picture, [each], T0_S + 2.5, RULES)
        assert verdict == "t1"
    expected = after(*REPORTS).tracks["t1"]
    track = picture.tracks["t1"]
    assert track.state == expected.state
    assert track.reports == len(REPORTS)
    assert track.first_seen_s == T0_S
    watch = picture.sources["radar"]
    late = sum(each.time_s < max(earlier.time_s for earlier in order[:n]) for n, each in enumerate(order) if n)
    assert (watch.accepted, watch.out_of_order) == (len(REPORTS), late)


@given(st.permutations(range(8)))
@settings(max_examples=20, deadline=None)
def test_what_fixes_have_in_common_does_not_hang_on_the_order_either(order: list[int]) -> None:
    vague, sure, common, less = (((v, 0.0, 0.0), (0.0, v, 0.0), (0.0, 0.0, v)) for v in (0.09, 0.04, 0.03, 0.01))
    seen: list[Measurement] = [
        report(0.0, 0.0, 60.0),
        report(0.3, 0.1, 60.0, covariance_m2=vague, common_m2=common),
        bearing(0.6, (0, 0, 0), (0, 60, 40), 0.01, track_id="t1"),
        report(0.9, 0.2, 60.0),
        report(1.2, 0.0, 60.1, covariance_m2=sure),
        report(1.5, 0.0, 60.0, covariance_m2=sure, common_m2=less),
        bearing(1.8, (0, 0, 0), (0, 60, 40), 0.01, track_id="t1"),
        report(2.1, 0.0, 60.0, sigma_m=1.0),
    ]
    late = after(seen[0], *(seen[number] for number in order if number))
    assert late.tracks["t1"].state == after(*seen).tracks["t1"].state


def test_a_late_bearing_is_replayed_too() -> None:
    seen: list[Measurement] = [
        report(0, 0, 60),
        bearing(0.2, (0, 0, 0), (1, 60, 40), 0.01, track_id="t1"),
        report(0.4, 1, 60),
    ]
    in_time, late = after(*seen), after(seen[0], seen[2], seen[1])
    assert late.tracks["t1"].state == in_time.tracks["t1"].state


def test_a_report_older_than_the_lag_is_refused_and_counted() -> None:
    picture = after(*(report(0.5 * number, 0.0) for number in range(20)))
    picture, (verdict,) = update(picture, [report(6.0, 0.1)], T0_S + 9.5, RULES)
    assert isinstance(verdict, Refusal)
    assert verdict.field == "time"
    assert "3.5 s older" in verdict.problem
    assert picture.sources["radar"].refused == {RefusalKind.LATE: 1}
    assert picture.tracks["t1"].reports == 20


def test_a_late_plot_without_an_id_begins_no_threat_in_the_past() -> None:
    picture = after(*(report(0.5 * number, 0.0, threat_id=None) for number in range(20)))
    picture, (verdict,) = update(picture, [report(6.2, 0.1, threat_id=None)], T0_S + 9.5, RULES)
    assert isinstance(verdict, Refusal)
    assert verdict.kind is RefusalKind.LATE
    assert list(picture.tracks) == ["T1"]


def test_the_buffer_reaches_as_far_back_as_the_lag_and_no_further() -> None:
    rules = TrackRules(lag_s=3.0)
    steps = after(*(report(0.1 * number, 0.0) for number in range(100)), rules=rules).tracks["t1"].steps
    assert len(steps) == pytest.approx(32, abs=1)
    assert state_before(steps, T0_S + 7.05).time_s == pytest.approx(T0_S + 7.0, abs=1e-6)
    assert np.isfinite(state_before(steps, T0_S).mean).all()


def test_what_no_track_remembers_is_let_go() -> None:
    picture = after(*(report(0.1 * number, 0.0) for number in range(1000)))
    assert len(picture.tracks["t1"].steps.log.measurements) < 250


def test_tracks_of_several_pictures_make_one() -> None:
    one, other = after(*REPORTS), after(*(report(0.1 * number, 500.0, threat_id="t2") for number in range(100)))
    both = Picture(tracks={**other.tracks, **one.tracks})
    late = report(1.0, 3.0)
    alone, together = after(late, picture=one), after(late, picture=both)
    assert together.tracks["t1"] == alone.tracks["t1"]
    assert together.tracks["t2"] == other.tracks["t2"]


def test_a_batch_out_of_order_is_the_batch_in_order() -> None:
    shuffled = [REPORTS[index] for index in (3, 1, 7, 0, 5, 2, 6, 4)]
    picture, verdicts = update(Picture(), shuffled, T0_S + 2.5, RULES)
    assert verdicts == ("t1",) * 8
    assert picture.tracks["t1"].state == after(*REPORTS).tracks["t1"].state
    assert picture.sources["radar"].out_of_order == 0
