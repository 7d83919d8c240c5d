"""A mission that is written and read goes on as the one that was not: to the bit."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hsop_gcs.journal import SNAPSHOT, Journal, read
from hsop_gcs.journal.segments import newest_part, segments
from hsop_gcs.mission.core import MissionState, apply
from hsop_gcs.mission.inputs import Input
from hsop_gcs.mission.records import read_inputs
from hsop_gcs.mission.recovery import Fold, resumed
from hsop_gcs.mission.snapshots import MissionSaved, from_snapshot, to_snapshot
from hsop_gcs.replay import replay
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import Moment, straight
from tests.mission.test_safety import flown

NEAR = straight(
    [
        TrueState(id="t1", position_m=(0.0, 90.0, 35.0), velocity_mps=(0.5, -0.5, 0.0), size_m=1.0),
        TrueState(id="t2", position_m=(30.0, 100.0, 35.0), velocity_mps=(-0.5, 0.5, 0.0), size_m=1.0),
        TrueState(id="t3", position_m=(-40.0, 120.0, 35.0), velocity_mps=(0.0, 1.0, 0.0), size_m=1.0),
    ]
)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MissionState]:
    """The journal of a mission with a threat that was dismissed and a host that was held, and how it ended."""
    path = tmp_path_factory.mktemp("flight") / "journal"

    def watch(moment: Moment) -> None:
        if moment.time_s == pytest.approx(9.0, abs=0.01):
            moment.mission.dismiss("t3")
        elif moment.time_s == pytest.approx(11.0, abs=0.01):
            moment.mission.hold(["h1"])
        elif round(moment.time_s, 1) in (5.5, 8.5, 10.5, 12.5):
            journal.save(to_snapshot(moment.mission.state), time_s=moment.mission.clock())
            saved_s.append(moment.time_s)

    saved_s: list[float] = []
    with Journal(path, segment_bytes=10**9) as journal:
        mission = flown(watch, duration_s=14.0, hosts=3, truth=NEAR, journal=journal)
    assert len(saved_s) == 4
    return path, mission.state


def written(state: MissionState) -> Any:
    """The snapshot without what has no order."""
    plain = to_snapshot(state)
    return {**plain, "watch": {**plain["watch"], "recent": [len(each) for each in plain["watch"]["recent"]]}}


def saved_and_read(state: MissionState) -> MissionState:
    return from_snapshot(json.loads(json.dumps(to_snapshot(state))))


def inputs(path: Path) -> Iterator[Input]:
    return (given for _, given in read_inputs(path) if not isinstance(given, MissionSaved))


def test_every_snapshot_in_a_journal_is_what_the_entries_before_it_come_to(flight: tuple[Path, MissionState]) -> None:
    path, ended = flight
    assert len(segments(path)) == 5
    fold, saved = Fold(), 0
    for _, given in read_inputs(path):
        if isinstance(given, MissionSaved):
            assert given.state == fold.state
            assert written(given.state) == written(fold.state)
            saved += 1
            continue
        fold.take(given)
    assert saved == 4
    assert fold.state == ended
    assert written(fold.state) == written(ended)


def test_a_mission_goes_on_from_its_snapshot_as_from_itself(flight: tuple[Path, MissionState]) -> None:
    path, ended = flight
    one = other = MissionState()
    dismissed = 0
    for number, given in enumerate(inputs(path)):
        one, other = apply(one, given), apply(other, given)
        if number % 5 == 0:
            other = saved_and_read(other)
        dismissed += len(other.unwanted) > 0
    assert one == other == ended
    assert written(one) == written(other)
    assert dismissed


def test_what_a_snapshot_of_before_does_not_know_has_its_default_and_other_shapes_are_refused(
    flight: tuple[Path, MissionState],
) -> None:
    _, ended = flight
    plain = to_snapshot(ended)
    del plain["held"]
    assert from_snapshot(plain) == replace(ended, held=MissionState().held)
    shape, kind, text = plain["picture"]["tracks"]["facts"]
    plain["picture"]["tracks"]["facts"] = [[shape[0] * shape[1], 1], kind, text]
    with pytest.raises(ValueError, match="another tracker"):
        from_snapshot(plain)


def test_a_start_reads_what_follows_the_newest_snapshot_and_nothing_else(
    flight: tuple[Path, MissionState], tmp_path: Path
) -> None:
    path, ended = flight
    assert len(newest_part(path)) == 1
    shutil.copy(path, tmp_path)
    with resumed(tmp_path / path.name) as (_, recovered):
        assert recovered == ended
        assert written(recovered) == written(ended)


def test_a_replay_goes_over_segments_and_notices_a_snapshot_that_is_not_true(
    flight: tuple[Path, MissionState], tmp_path: Path
) -> None:
    path, _ = flight
    outcome = replay(path, to_s=0.0, jobs=1)
    assert (outcome.differences, outcome.given_up) == ((), 0)
    assert outcome.reports >= 36
    forged = tmp_path / "forged"
    with Journal(forged) as journal:
        saved = 0
        for entry in read(path):
            saved += entry.kind == SNAPSHOT
            data = {**entry.data, "held": True} if entry.kind == SNAPSHOT and saved == 1 else entry.data
            journal.append(entry.kind, data, time_s=entry.time_s)
    assert "state.held" in {each.what for each in replay(forged, to_s=0.0, jobs=1).differences}
