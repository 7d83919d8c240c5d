"""The system clock is set in flight, with threats tracked: nothing freezes, nothing vanishes, and people are told.

Whole missions in virtual time; see ``headless``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from hsop_gcs.api.bounds import Account
from hsop_gcs.api.views import event_out, health_out, threat_out
from hsop_gcs.journal import Journal
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.inputs import ClockStepped, Rules
from hsop_gcs.mission.planning import PlanningRules
from hsop_gcs.mission.records import read_inputs
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.replay import replay
from hsop_gcs.reports import Report
from hsop_gcs.simulator.truth import TrueState
from hsop_gcs.tracks import TrackStatus
from tests.mission.headless import EPOCH_S, UTC, Flight, Moment, fly, straight, true_utc
from tests.mission.test_safety import Planner

STEPPED_S = 6.3
ENDS_S = 12.0
TRUTH = straight([TrueState(id="t1", position_m=(10.0, 70.0, 35.0), velocity_mps=(1.0, 0.5, 0.0), size_m=1.0)])


def stepping(*steps: tuple[float, float]) -> UTC:
    """A clock that is set: when, and by how much."""
    return lambda time_s: EPOCH_S + time_s + sum(by_s for at_s, by_s in steps if time_s >= at_s)


@dataclass
class Watch:
    """What must hold at every moment once the threat is known. another: the clock of a second source."""

    tracked_since_s: float = 4.0
    another: UTC | None = None
    used: list[tuple[float, int]] = field(default_factory=list)
    """Detections used so far, by time."""
    reports: list[tuple[float, int]] = field(default_factory=list)
    """Reports accepted so far, by time."""
    silent_s: float = 0.0

    def __call__(self, moment: Moment) -> None:
        mission = moment.mission
        if self.another is not None:
            (true,) = moment.truth
            utc_s = self.another(moment.time_s - 1.2)
            mission.submit([Report(source="rid", threat_id="X", time_s=utc_s, position_m=true.position_m, sigma_m=3.0)])
        self.used.append((moment.time_s, mission.state.watch.counts.used))
        self.reports.append((moment.time_s, mission.reports_accepted))
        if moment.time_s < self.tracked_since_s:
            return
        assert set(mission.state.picture.tracks) == {"t1"}
        track = mission.state.picture.tracks["t1"]
        self.silent_s = max(self.silent_s, mission.clock() - track.time_s)
        assert track.status is TrackStatus.CONFIRMED
        shown = threat_out(track, mission).time.timestamp()
        assert shown == pytest.approx(health_out(mission, 0.0, Account()).time.timestamp(), abs=2.5), (
            "shown by one clock"
        )


def grown(counts: Sequence[tuple[float, int]], from_s: float, to_s: float) -> int:
    within = [count for at_s, count in counts if from_s <= at_s <= to_s]
    return within[-1] - within[0]


def flight(wall: UTC, *, radar: UTC = true_utc, cameras: UTC = true_utc, duration_s: float = ENDS_S) -> Flight:
    return Flight(
        truth=TRUTH,
        hosts=2,
        duration_s=duration_s,
        rules=Rules(autonomy=Autonomy.AUTO, planning=PlanningRules(horizon_s=60.0)),
        radar_sigma_m=3.0,
        camera_period_s=0.5,
        wall=wall,
        radar_clock=radar,
        cameras_clock=cameras,
    )


def flown(given: Flight, watch: Callable[[Moment], None], journal: Path | None = None) -> Mission:
    if journal is None:
        return fly(given, watch, Planner())
    with Journal(journal) as file:
        return fly(given, watch, Planner(), file)


@pytest.mark.parametrize("by_s", [20.0, -20.0, 3600.0, -3600.0])
def test_tracks_neither_freeze_nor_vanish_and_all_sources_are_taken_at_once(by_s: float, tmp_path: Path) -> None:
    wall = stepping((STEPPED_S, by_s))
    watch, journal = Watch(another=true_utc), tmp_path / "journal"
    mission = flown(flight(wall, radar=wall, cameras=wall if by_s > 0 else true_utc), watch, journal)
    assert mission.reports_refused == {}
    assert grown(watch.reports, STEPPED_S, STEPPED_S + 2.0) >= 4
    assert grown(watch.used, STEPPED_S + 0.5, STEPPED_S + 2.5) >= 2
    assert watch.silent_s < 1.5
    assert mission.state.plans.flying is not None
    assert any(progress.flying for progress in mission.state.progress.values()), "flights go on"
    (stepped,) = [each for each in mission.events if isinstance(each.event, ClockStepped)]
    assert event_out(stepped, mission).details == {"by_s": pytest.approx(by_s), "offset_s": pytest.approx(by_s)}
    health = health_out(mission, 0.0, Account())
    assert health.status == "degraded"
    which, side = ("forward", "behind") if by_s > 0 else ("back", "ahead of")
    assert [each for each in health.problems if each.startswith(("clock", "source"))] == [
        f"clock: the system clock was set {which} by {abs(by_s):.1f} s, 6 s ago",
        f"source 'rid': its clock is {abs(by_s):.1f} s {side} the system clock that was set",
    ]
    assert health.reports.sources["rid"].clock_offset_s == pytest.approx(-1.2 - by_s, abs=0.5)
    assert health.reports.sources["radar"].clock_offset_s == pytest.approx(0.0, abs=0.1)
    assert health.time.timestamp() == pytest.approx(EPOCH_S + ENDS_S + by_s, abs=0.5)
    assert replay(journal, jobs=1, to_s=0.0).differences == ()
    with resumed(journal) as (_, recovered):
        assert recovered == mission.state
    times_s = [given.time_s for _, given in read_inputs(journal)]
    assert times_s == sorted(times_s)


def test_two_steps_in_opposite_directions_and_a_source_that_follows_late() -> None:
    wall = stepping((STEPPED_S, 3600.0), (STEPPED_S + 3.0, -3600.0))
    late = stepping((STEPPED_S + 1.5, 3600.0), (STEPPED_S + 4.5, -3600.0))
    watch = Watch()
    mission = flown(flight(wall, radar=late), watch)
    assert mission.reports_refused == {}
    assert watch.silent_s < 1.5
    assert mission.state.timeline.offsets_s == pytest.approx((0.0, 3600.0))
    assert mission.dating.elsewhere == {}


def test_a_clock_that_is_set_while_the_service_starts_and_drifts_afterwards_costs_nothing() -> None:
    """A computer without a clock of its own, which hears of the time after the service has begun."""

    def wall(time_s: float) -> float:
        return EPOCH_S + 1.0005 * time_s - (20_000_000.0 if time_s < 0.5 else 0.0)

    watch = Watch()
    mission = flown(flight(wall), watch)
    assert mission.reports_refused == {}
    assert watch.silent_s < 1.5
    assert [type(each.event) for each in mission.events if each.host is None] == [ClockStepped]


@pytest.mark.parametrize(
    ("by_s", "why"),
    [
        (3600.0, "3600.0 s in the future; the limit is 2 s"),
        (-20.0, "20.0 s old; the limit is 10 s"),
    ],
)
def test_a_source_whose_clock_alone_is_set_is_refused_and_named(by_s: float, why: str) -> None:
    clock = stepping((STEPPED_S, by_s))
    mission = flown(flight(true_utc, radar=clock, cameras=clock), lambda _: None)
    told = [each for each in health_out(mission, 0.0, Account()).problems if each.startswith("source")]
    assert any(each.startswith("source 'radar': all 6 it sent for 5 s are refused: time: ") for each in told)
    assert any(why in each for each in told)
    assert any(each.startswith("source 'cameras of h1': all ") for each in told)
    assert [each for each in mission.events if each.host is None] == []


def test_a_mission_goes_on_after_a_restart_though_the_clock_was_set_back_between(tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    before = flown(flight(true_utc, duration_s=6.0), Watch(), journal)
    with resumed(journal) as (file, recovered):
        assert recovered == before.state
        wall: UTC = lambda time_s: EPOCH_S + 6.0 - 3600.0 + time_s  # noqa: E731
        watch = Watch(tracked_since_s=2.6)
        again = fly(flight(wall, radar=wall, cameras=wall, duration_s=8.0), watch, Planner(), file, recovered)
    assert watch.silent_s < 1.5
    assert again.reports_refused == {}
    assert again.clock() - before.clock() == pytest.approx(8.0, abs=1.0)
    assert again.state.plans.flying is not None
    with resumed(journal) as (_, recovered):
        assert recovered == again.state
