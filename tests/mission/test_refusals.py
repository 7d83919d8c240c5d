"""Sources of which nothing is believed are told by name, and only so many."""

from hsop_gcs.mission.refusals import Refusals


def test_a_source_is_told_once_it_was_refused_three_times_until_something_of_it_is_believed() -> None:
    refusals = Refusals()
    for number in range(3):
        assert refusals.problems(10.0 + number) == []
        refusals.refused("radar", "position.altitude_datum: 'hae' needs a geoid separation", 10.0 + number)
    assert refusals.problems(13.0) == [
        "source 'radar': all 3 it sent for 3 s are refused: position.altitude_datum: 'hae' needs a geoid separation"
    ]
    refusals.accepted("radar")
    assert refusals.problems(13.0) == []


def test_a_source_that_has_fallen_silent_is_no_problem_of_now() -> None:
    refusals = Refusals()
    for _ in range(5):
        refusals.refused("radar", "time: 3600.0 s old", 10.0)
    assert refusals.problems(70.0) != []
    assert refusals.problems(71.0) == []


def test_of_many_sources_the_newest_are_told() -> None:
    refusals = Refusals()
    for number in range(300):
        for _ in range(3):
            refusals.refused(f"s{number}", "time: 3600.0 s old", 10.0)
    told = refusals.problems(11.0)
    assert len(told) == 9
    assert told[0].startswith("source 's299'")
    assert told[-1] == "and 56 more sources are refused"
