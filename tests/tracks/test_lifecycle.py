"""Tentative, confirmed, coasting, gone."""

import pytest

from hsop_gcs.reports import Measurement
from hsop_gcs.tracks import ConfirmAtOnce, Picture, TrackRules, TrackStatus, prune, update
from tests.tracks.world import RULES, T0_S, after, report


def status(picture: Picture, track_id: str = "T1") -> TrackStatus:
    return picture.tracks[track_id].status


def plots(*times_s: float) -> list[Measurement]:
    return [report(time_s, 0.0, threat_id=None) for time_s in times_s]


def test_one_plot_is_shown_at_once_and_tentative() -> None:
    assert status(after(*plots(0))) is TrackStatus.TENTATIVE


@pytest.mark.parametrize("period_s", [0.5, 1.0])
def test_three_of_five_slots_confirm(period_s: float) -> None:
    assert status(after(*plots(0, period_s))) is TrackStatus.TENTATIVE
    assert status(after(*plots(0, period_s, 2 * period_s))) is TrackStatus.CONFIRMED


def test_a_burst_confirms_nothing() -> None:
    assert status(after(*plots(*(0.02 * number + 0.001 for number in range(10))))) is TrackStatus.TENTATIVE


def test_three_plots_too_far_apart_in_time_confirm_nothing() -> None:
    assert status(after(*plots(0, 2, 4, 6, 8))) is TrackStatus.TENTATIVE


def test_a_late_plot_confirms_too() -> None:
    assert status(after(*plots(0, 1.0, 0.5))) is TrackStatus.CONFIRMED


@pytest.mark.parametrize(
    ("rule", "with_id", "with_both"),
    [
        (ConfirmAtOnce.ID, TrackStatus.CONFIRMED, TrackStatus.CONFIRMED),
        (ConfirmAtOnce.ID_AND_VELOCITY, TrackStatus.TENTATIVE, TrackStatus.CONFIRMED),
        (ConfirmAtOnce.NEVER, TrackStatus.TENTATIVE, TrackStatus.TENTATIVE),
    ],
)
def test_who_is_confirmed_by_a_first_report_is_a_rule(
    rule: ConfirmAtOnce, with_id: TrackStatus, with_both: TrackStatus
) -> None:
    rules = TrackRules(confirm_at_once=rule)
    assert status(after(report(0, 0), rules=rules), "t1") is with_id
    assert status(after(report(0, 0, velocity_mps=(1.0, 0.0, 0.0)), rules=rules), "t1") is with_both


def test_a_confirmed_track_coasts_and_comes_back() -> None:
    picture = after(report(0, 0))
    picture, gone = prune(picture, T0_S + 1.9, RULES)
    assert status(picture, "t1") is TrackStatus.CONFIRMED
    picture, gone = prune(picture, T0_S + 2.1, RULES)
    assert not gone
    assert status(picture, "t1") is TrackStatus.COASTING
    assert status(after(report(5.0, 0), picture=picture), "t1") is TrackStatus.CONFIRMED


def test_a_threat_that_is_not_reported_any_more_leaves() -> None:
    picture = after(report(0, 0), report(8, 900, threat_id="t2"))
    picture, gone = prune(picture, T0_S + 10.5, RULES)
    assert gone == {"t1": T0_S}
    assert list(picture.tracks) == ["t2"]


def test_what_was_never_confirmed_leaves_sooner() -> None:
    picture, gone = prune(after(*plots(0)), T0_S + 4.1, RULES)
    assert gone == {"T1": T0_S}
    assert not picture.tracks


def test_a_source_whose_clock_is_behind_has_tracks_all_the_same() -> None:
    picture = Picture()
    for number in range(10):
        picture, verdicts = update(picture, [report(0.5 * number, 0.0)], T0_S + 0.5 * number + 5.0, RULES)
        assert verdicts == ("t1",)
    assert status(picture, "t1") is TrackStatus.COASTING
