"""The loop closed through the whole mission: radar, cameras, plans, flights. All seeds: ``tests.bench.bench_loop``."""

import numpy as np
import pytest

from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.simulator.truth import TrueState
from tests.mission.closed_loop import PERIOD_S, Score, consistency
from tests.mission.headless import Flight, Moment, decide_in_rounds, fly, straight

TRUTH = straight(
    [
        TrueState(id="t1", position_m=(0.0, 60.0, 35.0), velocity_mps=(0.2, 0.0, 0.0), size_m=1.0),
        TrueState(id="t2", position_m=(45.0, 75.0, 32.0), velocity_mps=(-0.2, 0.0, 0.0), size_m=1.0),
    ]
)


def test_a_mission_on_station_knows_its_threats_to_half_a_metre() -> None:
    score = Score(threats=2)
    flight = Flight(truth=TRUTH, hosts=4, duration_s=75.0, seed=3, rules=Rules(autonomy=Autonomy.AUTO))
    fly(flight, score.watch, decide_in_rounds(1))
    assert sorted(score.first_s) == ["t1", "t2"], "all were on station"
    assert len(score.errors_m["central"]) > 5 / PERIOD_S
    assert np.median(score.errors_m["central"]) <= 0.5
    assert (score.lost.total(), score.swapped.total(), score.strange.total()) == (0, 0, 0)


def test_threats_that_are_dismissed_stay_away_though_cameras_see_them() -> None:
    seen_after: set[str] = set()
    tracks_after: set[str] = set()
    dismissed_s: list[float] = []

    def watch(moment: Moment) -> None:
        mission = moment.mission
        if not dismissed_s and moment.time_s > 15.0:
            assert all(moment.seen_by.values()), "cameras see all of them"
            for name in list(mission.state.picture.tracks):
                mission.dismiss(name)
            dismissed_s.append(moment.time_s)
        elif dismissed_s and moment.time_s > dismissed_s[0] + 1.0:
            seen_after.update(*moment.seen_by.values())
            tracks_after.update(mission.state.picture.tracks)
            assert mission.state.plans.flying is None

    flight = Flight(truth=TRUTH, hosts=4, duration_s=24.0, seed=3, rules=Rules(autonomy=Autonomy.AUTO))
    fly(flight, watch, decide_in_rounds(1))
    assert len(seen_after) > 1
    assert tracks_after == set()


def test_the_bounds_of_a_mean_nees_are_those_of_what_is_independent() -> None:
    rng = np.random.default_rng(5)
    white = [consistency([rng.chisquare(3, 200).tolist() for _ in range(10)], 3) for _ in range(60)]
    assert 52 <= sum(each.holds for each in white) < 60
    assert np.mean([each.samples for each in white]) == pytest.approx(2000, rel=0.1)
    held = consistency([np.repeat(rng.chisquare(3, 40), 5).tolist() for _ in range(10)], 3)
    assert held.samples == pytest.approx(400, rel=0.3)
    two_hosts = [np.stack([rng.chisquare(3, 200), np.repeat(rng.chisquare(3, 40), 5)], 1) for _ in range(10)]
    alternating = consistency([pair.ravel().tolist() for pair in two_hosts], 3)
    assert alternating.samples < 0.5 * 4000
    assert not consistency([rng.chisquare(6, 200).tolist()], 3).holds
