"""Mission time as a law: it goes on with the steady clock whatever becomes of the wall's, and every step is seen."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.clocks import STEP_S
from hsop_gcs.mission.clock import MissionClock, Timeline, likeliest_offset_s

NOON_S = 1_800_000_000.0


class Machine:
    """Its two clocks."""

    def __init__(self, wall_s: float = NOON_S, steady_s: float = 100.0) -> None:
        self.wall_s, self.steady_s = wall_s, steady_s

    def pass_s(self, seconds: float, *, drift: float = 0.0) -> None:
        self.wall_s += (1.0 + drift) * seconds
        self.steady_s += seconds

    def clock(self, before: Timeline | None = None, boot: str | None = None) -> MissionClock:
        return MissionClock(lambda: self.wall_s, lambda: self.steady_s, before=before, boot=boot)


def after(clock: MissionClock, timeline: Timeline) -> Timeline:
    """The timeline once the mission has told it the time."""
    now_s = clock()
    if clock.offset_s != timeline.offset_s:
        timeline = timeline.stepped(now_s, by_s=clock.offset_s - timeline.offset_s, offset_s=clock.offset_s)
    return timeline.at(now_s)


STEPS = st.one_of(st.just(0.0), st.floats(STEP_S + 0.1, 1e8), st.floats(-1e8, -STEP_S - 0.1))


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 1000.0), STEPS, st.floats(-5e-4, 5e-4)), min_size=1, max_size=20))
def test_mission_time_goes_on_steadily_and_the_offset_is_the_sum_of_the_steps(
    course: list[tuple[float, float, float]],
) -> None:
    machine = Machine()
    clock, before_s, passed_s, steps_s = machine.clock(), NOON_S, 0.0, 0.0
    for seconds, step_s, drift in course:
        # a clock that is read now and then sees a drift for what it is
        for _ in range(10):
            machine.pass_s(seconds / 10, drift=drift)
            now_s = clock()
            assert now_s >= before_s
            before_s = now_s
        passed_s += seconds
        machine.wall_s += step_s
        steps_s += step_s
        now_s = clock()
        assert now_s - NOON_S == pytest.approx(passed_s, rel=2.1e-3, abs=1e-3)
        assert clock.offset_s == pytest.approx(steps_s, abs=STEP_S * len(course))
        assert now_s + clock.offset_s == pytest.approx(machine.wall_s, abs=STEP_S)


def test_a_clock_that_is_slewed_for_a_day_is_followed_and_never_taken_for_one_that_is_set() -> None:
    machine = Machine()
    clock = machine.clock()
    for _ in range(8640):
        machine.pass_s(10.0, drift=500e-6)
        assert clock() == pytest.approx(machine.wall_s, abs=0.01)
    assert clock.offset_s == 0.0


def test_a_clock_that_is_read_a_million_times_loses_nothing() -> None:
    machine = Machine()
    clock = machine.clock()
    for _ in range(100_000):
        machine.pass_s(5e-8)
        now_s = clock()
    assert now_s - NOON_S == pytest.approx(0.005, abs=1e-5)


def test_a_step_while_the_service_starts_is_seen_by_the_first_look() -> None:
    machine = Machine(wall_s=0.0)
    clock = machine.clock()
    machine.pass_s(8.0)
    machine.wall_s += NOON_S
    assert clock() == 8.0
    assert clock.offset_s == NOON_S


def ended(machine: Machine, *, boot: str | None) -> Timeline:
    """A mission that has run for a minute."""
    clock = machine.clock(boot=boot)
    timeline = Timeline().started(clock(), steady_s=clock.steady_s, boot=boot).at(clock())
    machine.pass_s(60.0)
    return after(clock, timeline)


@pytest.mark.parametrize("step_s", [0.0, 20.0, -20.0, 3600.0, -3600.0])
def test_a_step_between_two_runs_of_one_boot_is_seen_and_time_goes_on_by_what_has_passed(step_s: float) -> None:
    machine = Machine()
    timeline = ended(machine, boot="a")
    machine.pass_s(3.0)
    machine.wall_s += step_s
    clock = machine.clock(timeline, boot="a")
    assert clock() - NOON_S == pytest.approx(63.0)
    assert clock.offset_s == step_s


def test_after_a_boot_with_a_clock_set_back_time_goes_on_from_where_it_was() -> None:
    machine = Machine()
    timeline = ended(machine, boot="a")
    rebooted = Machine(wall_s=NOON_S - 86_400.0, steady_s=5.0)
    clock = rebooted.clock(timeline, boot="b")
    assert clock() - NOON_S == pytest.approx(60.0)
    assert clock.offset_s == pytest.approx(-86_460.0)
    rebooted.pass_s(1.0)
    assert clock() - NOON_S == pytest.approx(61.0)


@pytest.mark.parametrize("boot", [None, "b"])
def test_after_a_boot_with_a_good_clock_it_says_how_much_time_has_passed(boot: str | None) -> None:
    machine = Machine()
    timeline = ended(machine, boot="a")
    machine.wall_s += 3600.0
    timeline = replace(timeline, offsets_s=(3600.0,))
    clock = Machine(wall_s=machine.wall_s + 90.0, steady_s=5.0).clock(timeline, boot=boot)
    assert clock() - NOON_S == pytest.approx(150.0)
    assert clock.offset_s == 3600.0


def test_steps_in_opposite_directions_leave_two_offsets() -> None:
    machine, timeline = Machine(), Timeline()
    clock = machine.clock()
    for step_s in (20.0, -20.0, 20.0):
        machine.pass_s(5.0)
        machine.wall_s += step_s
        timeline = after(clock, timeline)
    assert timeline.offsets_s == (20.0, 0.0)
    assert timeline.problem(clock()) == "clock: the system clock was set forward by 20.0 s, 0 s ago"
    machine.pass_s(301.0)
    assert timeline.problem(clock()) is None


OFFSETS_S = st.sampled_from([20.0, -20.0, 3600.0, -3600.0, 8.0, -8.0])


@given(OFFSETS_S, st.booleans(), st.floats(0.0, 1.5), st.booleans())
def test_a_source_is_understood_whether_it_follows_our_clock_or_stays(
    step_s: float, follows: bool, latency_s: float, heard: bool
) -> None:
    meant_s = step_s if follows else 0.0
    found_s = likeliest_offset_s(
        NOON_S + meant_s - latency_s,
        NOON_S,
        (step_s, 0.0),
        max_future_s=2.0,
        max_age_s=30.0,
        usual_age_s=latency_s if heard else 0.0,
    )
    assert found_s == meant_s


def test_a_source_whose_time_makes_no_sense_is_held_against_the_clock_that_people_see() -> None:
    for usual_age_s in (0.0, -3600.0, 1e9):
        limits = {"max_future_s": 2.0, "max_age_s": 30.0, "usual_age_s": usual_age_s}
        assert likeliest_offset_s(NOON_S + 700.0, NOON_S, (20.0, 0.0), **limits) == 20.0
