"""What a clock that is set does to stamps that must rise."""

import pytest

from hsop_gcs.clocks import RisingClock, boot_id, read_together, steady_s
from hsop_gcs.link.signing import TICKS_PER_S, Signing, SigningClock, Verdict
from tests.link.test_link_signing import KEY, NOON_UNIX_S, Vehicle


class Machine:
    """Its two clocks."""

    def __init__(self) -> None:
        self.wall_s, self.steady_s = NOON_UNIX_S, 100.0

    def pass_s(self, seconds: float) -> None:
        self.wall_s += seconds
        self.steady_s += seconds

    @property
    def rising(self) -> RisingClock:
        return RisingClock(lambda: self.wall_s, lambda: self.steady_s)


def test_a_rising_clock_follows_the_wall_forward_and_bridges_a_step_back() -> None:
    machine = Machine()
    clock = machine.rising
    machine.pass_s(2.0)
    assert clock() == NOON_UNIX_S + 2.0
    machine.wall_s += 3600.0
    assert clock() == NOON_UNIX_S + 3602.0
    machine.wall_s -= 7200.0
    machine.pass_s(5.0)
    assert clock() == pytest.approx(NOON_UNIX_S + 3607.0)
    machine.wall_s += 7200.0
    assert clock() == NOON_UNIX_S + 3607.0


def test_a_rising_clock_keeps_to_a_wall_that_is_slewed() -> None:
    machine = Machine()
    clock = machine.rising
    for _ in range(1000):
        machine.wall_s += 1.0 - 500e-6
        machine.steady_s += 1.0
        before, now = clock(), clock()
        assert before <= now == machine.wall_s


def test_a_process_that_is_stopped_between_two_readings_sees_no_step() -> None:
    pauses = iter([20.0, 20.0])
    now_s = 0.0

    def wall() -> float:
        nonlocal now_s
        read_s = now_s
        now_s += next(pauses, 0.0)
        return NOON_UNIX_S + read_s

    assert read_together(wall, lambda: now_s) == (NOON_UNIX_S + 40.0, 40.0)


def test_the_steady_clock_of_this_machine_goes_on_and_its_run_has_one_name() -> None:
    assert steady_s() <= steady_s()
    assert boot_id() == boot_id()


@pytest.mark.parametrize("rising", [True, False])
def test_a_vehicle_that_falls_silent_is_believed_again_though_our_clock_was_set_back_meanwhile(rising: bool) -> None:
    machine = Machine()
    clock = SigningClock(lambda: machine.wall_s, rising=machine.rising if rising else None)
    ours, vehicle = Signing(KEY, clock=clock), Vehicle()
    assert ours.judge(vehicle()) is Verdict.GENUINE
    machine.wall_s -= 3600.0
    machine.pass_s(900.0)
    assert ours.judge(vehicle(at_s=900.0)) is (Verdict.GENUINE if rising else Verdict.FUTURE)


def test_our_own_signatures_rise_at_the_pace_of_time_though_our_clock_was_set_back() -> None:
    machine = Machine()
    clock = SigningClock(lambda: machine.wall_s, rising=machine.rising)
    before = clock.next()
    machine.wall_s -= 3600.0
    machine.pass_s(60.0)
    assert clock.next() == pytest.approx(before + 60 * TICKS_PER_S, abs=2)
