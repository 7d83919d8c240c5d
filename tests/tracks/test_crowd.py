"""More threats and more sources than a picture holds: the new ones are refused, those in it go on."""

from dataclasses import replace

from hsop_gcs.mission.core import MissionState, apply, take_reports
from hsop_gcs.mission.inputs import ReportsArrived, Rules, ThreatDismissed
from hsop_gcs.reports import Report
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, TrackRules, prune, update
from hsop_gcs.tracks.crowd import with_room_for_sources
from tests.tracks.world import T0_S, report

FEW = TrackRules(max_tracks=3, max_sources=3)


def sight(number: int, *, at_s: float = 0.0, source: str = "radar", id: bool = True) -> Report:
    return report(at_s, 100.0 * number, source=source, threat_id=f"t{number}" if id else None)


def refused(verdicts: tuple[object, ...]) -> list[tuple[RefusalKind, str] | None]:
    return [(each.kind, each.field) if isinstance(each, Refusal) else None for each in verdicts]


def test_of_one_scan_those_are_refused_for_which_there_is_no_room() -> None:
    for with_ids in (True, False):
        scan = [sight(number, id=with_ids) for number in range(5)]
        picture, verdicts = update(Picture(), scan, T0_S, FEW)
        assert len(picture.tracks) == 3
        assert refused(verdicts) == [None] * 3 + [(RefusalKind.FULL, "threat_id")] * 2
        assert picture.sources["radar"].refused == {RefusalKind.FULL: 2}


def test_threats_in_a_full_picture_are_followed_and_a_new_one_taken_once_another_has_left() -> None:
    picture, _ = update(Picture(), [sight(number) for number in range(3)], T0_S, FEW)
    picture, verdicts = update(picture, [sight(number, at_s=1.0) for number in (2, 3, 1)], T0_S + 1.0, FEW)
    assert refused(verdicts) == [None, (RefusalKind.FULL, "threat_id"), None]
    picture, gone = prune(picture, T0_S + 10.5, FEW)
    assert list(gone) == ["t0"]
    picture, verdicts = update(picture, [sight(3, at_s=10.5)], T0_S + 10.5, FEW)
    assert verdicts == ("t3",)


def test_sources_without_number_are_refused_until_others_fall_silent() -> None:
    picture, _ = update(Picture(), [sight(0, source=f"s{number}") for number in range(2)], T0_S, FEW)
    crowd = [sight(0, at_s=1.0, source=f"s{number}") for number in (0, 2, 3, 4)]
    known, unknown = with_room_for_sources(picture, crowd, T0_S + 1.0, FEW)
    assert {index: (each.kind, each.field) for index, each in unknown.items()} == {
        2: (RefusalKind.FULL, "source"),
        3: (RefusalKind.FULL, "source"),
    }
    known, unknown = with_room_for_sources(known, [sight(0, at_s=70.0, source="s5")] * 2, T0_S + 70.0, FEW)
    assert unknown == {}


def test_a_mission_answers_each_report_of_a_crowd_in_its_place() -> None:
    mission = MissionState(rules=replace(Rules(), tracks=FEW))
    crowd = tuple(sight(number % 2, source=f"s{number}") for number in range(5))
    mission, verdicts = take_reports(mission, ReportsArrived(time_s=T0_S, measurements=crowd))
    assert refused(verdicts) == [None] * 3 + [(RefusalKind.FULL, "source")] * 2
    assert len(mission.picture.sources) == 3


def test_what_was_dismissed_is_forgotten_when_it_is_over() -> None:
    mission = MissionState()
    for number in range(1200):
        time_s = T0_S + number / 10
        given = ReportsArrived(time_s=time_s, measurements=(sight(number, at_s=number / 10),))
        mission, _ = take_reports(mission, given)
        mission = apply(mission, ThreatDismissed(time_s=time_s, threat_id=f"t{number}"))
    assert len(mission.dismissed) == 500
    assert ("radar", "t1199") in mission.dismissed
    assert len(mission.unwanted) <= 101, "those that left ten seconds ago would not be seen any more"
