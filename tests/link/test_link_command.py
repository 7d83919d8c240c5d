"""The one loop that sends, waits and sends again."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsop_gcs.link.enums import MavCmd, MavResult
from hsop_gcs.link.messages import CommandAck, CommandInt, CommandLong, Heartbeat, Message
from hsop_gcs.link.protocol.command import (
    ONCE,
    REPEATABLE,
    CommandLimits,
    CommandSender,
    Outcome,
    Request,
    Verdict,
)

LIMITS = CommandLimits()
ARM = CommandLong(target_system=1, target_component=1, command=MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
GO = CommandInt(target_system=1, target_component=1, command=MavCmd.DO_REPOSITION, param2=1.0)
MODE = CommandLong(target_system=1, target_component=1, command=MavCmd.DO_SET_MODE)


def request(
    message: CommandLong | CommandInt, *, key: str = "k", tries: int = REPEATABLE, deadline_s: float = 60.0
) -> Request:
    return Request(message=message, key=key, tries=tries, deadline_s=deadline_s)


def ack(message: CommandLong | CommandInt, result: int = MavResult.ACCEPTED, **more: int) -> CommandAck:
    return CommandAck(command=message.command, result=result, **more)


def verdicts(sender: CommandSender) -> list[Verdict]:
    return [outcome.verdict for outcome in sender.take_outcomes()]


def run_to(sender: CommandSender, end_s: float) -> list[Message]:
    """Let the sender work until a time; returns what it sent."""
    sent = sender.take_outgoing()
    while (wake_at := sender.wake_at) is not None and wake_at <= end_s:
        sender.advance(wake_at)
        sent += sender.take_outgoing()
    return sent


def test_an_accepted_command_is_sent_once() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    assert sender.take_outgoing() == [GO]
    sender.receive(ack(GO), 0.1)
    assert verdicts(sender) == [Verdict.ACCEPTED]
    assert run_to(sender, 100.0) == []
    assert sender.wake_at is None


def test_silence_repeats_the_command_and_raises_its_confirmation() -> None:
    sender = CommandSender()
    sender.submit(request(MODE), 0.0)
    sent = run_to(sender, 100.0)
    assert sent == [replace(MODE, confirmation=number) for number in range(3)]
    assert verdicts(sender) == [Verdict.NO_REPLY]
    assert sender.resent == 2


def test_a_command_int_is_repeated_as_it_was() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    assert run_to(sender, 100.0) == [GO] * 3


def test_a_command_that_could_do_harm_twice_is_sent_once() -> None:
    sender = CommandSender()
    sender.submit(request(ARM, tries=ONCE), 0.0)
    assert run_to(sender, 100.0) == [ARM]
    assert verdicts(sender) == [Verdict.NO_REPLY]


def test_a_running_command_that_falls_silent_is_not_sent_again() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    assert sender.take_outgoing() == [GO]
    sender.receive(ack(GO, MavResult.IN_PROGRESS), 0.5)
    assert run_to(sender, 0.5 + LIMITS.in_progress_s - 0.01) == []
    assert verdicts(sender) == []
    assert run_to(sender, 100.0) == []
    assert verdicts(sender) == [Verdict.NO_REPLY]


def test_progress_extends_the_patience() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    for second in range(0, 50, 5):
        sender.advance(float(second))
        sender.receive(ack(GO, MavResult.IN_PROGRESS), float(second))
    sender.receive(ack(GO), 50.0)
    assert verdicts(sender) == [Verdict.ACCEPTED]


def test_the_answer_to_our_own_second_copy_does_not_end_a_running_command() -> None:
    sender = CommandSender()
    sender.submit(request(MODE), 0.0)
    run_to(sender, LIMITS.reply_s)
    sender.receive(ack(MODE, MavResult.IN_PROGRESS), 1.3)
    sender.receive(ack(MODE, MavResult.TEMPORARILY_REJECTED), 1.4)
    sender.receive(ack(MODE), 3.0)
    assert verdicts(sender) == [Verdict.ACCEPTED]
    assert sender.noise == 1


def test_a_temporary_rejection_backs_off_and_tries_again_also_what_is_sent_once() -> None:
    sender = CommandSender()
    sender.submit(request(ARM, tries=ONCE), 0.0)
    sender.take_outgoing()
    sender.receive(ack(ARM, MavResult.TEMPORARILY_REJECTED), 0.1)
    assert run_to(sender, 0.1 + LIMITS.back_off_s - 0.01) == []
    assert run_to(sender, 0.1 + LIMITS.back_off_s) == [replace(ARM, confirmation=1)]


def test_temporary_rejections_end_at_their_limit() -> None:
    sender = CommandSender()
    sender.submit(request(MODE), 0.0)
    now, sent = 0.0, sender.take_outgoing()
    for number in range(LIMITS.rejections + 1):
        sender.receive(ack(MODE, MavResult.TEMPORARILY_REJECTED), now)
        now += LIMITS.back_off_s * (number + 1)
        sent += run_to(sender, now)
    assert len(sent) == 1 + LIMITS.rejections
    (outcome,) = sender.take_outcomes()
    assert (outcome.verdict, outcome.result) == (Verdict.REFUSED, MavResult.TEMPORARILY_REJECTED)


@pytest.mark.parametrize(
    ("result", "problem"),
    [(MavResult.DENIED, "DENIED"), (MavResult.CANCELLED, "CANCELLED"), (77, "result 77")],
)
def test_any_other_result_is_a_failure_that_says_its_name(result: int, problem: str) -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    sender.receive(ack(GO, result), 0.1)
    (outcome,) = sender.take_outcomes()
    assert not outcome.accepted
    assert outcome.problem == problem


def test_commands_of_one_id_wait_for_each_other_and_others_do_not() -> None:
    sender = CommandSender()
    for number in range(3):
        sender.submit(request(replace(MODE, param2=float(number)), key=str(number)), 0.0)
    sender.submit(request(GO), 0.0)
    assert sender.take_outgoing() == [MODE, GO]
    sender.receive(ack(MODE), 0.1)
    assert sender.take_outgoing() == [replace(MODE, param2=1.0)]
    sender.receive(ack(MODE, MavResult.DENIED), 0.2)
    assert sender.take_outgoing() == [replace(MODE, param2=2.0)]


def test_one_id_to_two_components_is_two_conversations() -> None:
    sender = CommandSender()
    other = replace(MODE, target_component=154)
    sender.submit(request(MODE), 0.0)
    sender.submit(request(other), 0.0)
    assert sender.take_outgoing() == [MODE, other]
    sender.receive(ack(MODE), 0.1, component=154)
    (outcome,) = sender.take_outcomes()
    assert outcome.request.message == other


def test_a_newer_command_takes_the_place_of_one_that_waits() -> None:
    sender = CommandSender()
    points = [replace(GO, x=number) for number in range(3)]
    tickets = [sender.submit(request(point), 0.0) for point in points]
    outcomes = sender.take_outcomes()
    assert [(outcome.ticket, outcome.verdict) for outcome in outcomes] == [(tickets[1], Verdict.SUPERSEDED)]
    sender.receive(ack(GO), 0.1)
    assert sender.take_outgoing() == [points[0], points[2]]


def test_a_superseded_command_is_not_repeated() -> None:
    sender = CommandSender()
    sender.submit(request(replace(GO, x=1)), 0.0)
    sender.submit(request(replace(GO, x=2)), 0.5)
    sent = run_to(sender, 3.0)
    assert [message.x for message in sent if isinstance(message, CommandInt)] == [1, 2]


def test_a_withdrawn_command_is_never_sent_again() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    sender.submit(request(replace(GO, x=2), key="other"), 0.0)
    assert sender.take_outgoing() == [GO]
    sender.withdraw("k", 0.1)
    sender.withdraw("other", 0.1)
    assert run_to(sender, 100.0) == []
    assert sorted(verdicts(sender)) == sorted([Verdict.SUPERSEDED, Verdict.NO_REPLY])


def test_a_late_answer_to_a_given_up_command_is_not_taken_for_the_next_ones() -> None:
    sender = CommandSender()
    sender.submit(request(GO, tries=ONCE), 0.0)
    sender.submit(request(replace(GO, x=2), key="next"), 0.0)
    assert run_to(sender, LIMITS.reply_s) == [GO]
    sender.receive(ack(GO, MavResult.DENIED), LIMITS.reply_s + 0.5)
    assert verdicts(sender) == [Verdict.NO_REPLY]
    assert sender.noise == 1
    assert run_to(sender, LIMITS.reply_s + LIMITS.settle_s) == [replace(GO, x=2)]
    sender.receive(ack(GO), LIMITS.reply_s + LIMITS.settle_s + 0.1)
    assert verdicts(sender) == [Verdict.ACCEPTED]


def test_a_second_answer_to_a_repeated_command_is_noise() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    run_to(sender, LIMITS.reply_s)
    sender.receive(ack(GO), 1.3)
    sender.submit(request(replace(GO, x=2), key="next"), 1.35)
    sender.receive(ack(GO, MavResult.FAILED), 1.4)
    assert verdicts(sender) == [Verdict.ACCEPTED]
    assert sender.noise == 1


def test_a_stale_command_is_never_sent() -> None:
    sender = CommandSender()
    sender.submit(request(GO, deadline_s=5.0), 5.0)
    assert sender.take_outgoing() == []
    assert verdicts(sender) == [Verdict.EXPIRED]


def test_a_command_that_waits_past_its_deadline_expires_at_once() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    sender.submit(request(replace(GO, x=2), key="next", deadline_s=0.5), 0.0)
    assert run_to(sender, 0.5) == [GO]
    assert verdicts(sender) == [Verdict.EXPIRED]


def test_the_last_try_is_before_the_deadline() -> None:
    sender = CommandSender()
    sender.submit(request(GO, deadline_s=1.5 * LIMITS.reply_s), 0.0)
    assert run_to(sender, 100.0) == [GO, GO]
    assert verdicts(sender) == [Verdict.NO_REPLY]


def test_an_answer_meant_for_somebody_else_is_not_ours() -> None:
    sender = CommandSender()
    sender.submit(request(GO), 0.0)
    sender.receive(ack(GO, target_system=254, target_component=190), 0.1)
    sender.receive(ack(GO, target_system=255, target_component=191), 0.1)
    assert verdicts(sender) == []
    sender.receive(ack(GO, target_system=255, target_component=190), 0.2)
    assert verdicts(sender) == [Verdict.ACCEPTED]


def test_an_answer_nobody_waits_for_is_counted() -> None:
    sender = CommandSender()
    sender.receive(ack(GO), 0.0)
    sender.receive(Heartbeat(), 0.0)
    assert sender.noise == 1
    assert verdicts(sender) == []


RESULTS = st.sampled_from([*MavResult, 99])
SCRIPT = st.lists(
    st.tuples(
        st.sampled_from(["submit", "withdraw", "ack", "wait"]),
        st.sampled_from([GO, MODE, ARM]),
        st.sampled_from(["a", "b"]),
        st.sampled_from([ONCE, REPEATABLE]),
        RESULTS,
        st.floats(0.0, 4.0),
    ),
    max_size=40,
)


@settings(max_examples=300, deadline=None)
@given(SCRIPT)
def test_every_command_ends_in_exactly_one_outcome_whatever_happens(
    script: list[tuple[str, CommandLong | CommandInt, str, int, int, float]],
) -> None:
    sender = CommandSender()
    now, tickets = 0.0, []
    outcomes: list[Outcome] = []
    for what, message, key, tries, result, pause_s in script:
        if what == "submit":
            tickets.append(sender.submit(request(message, key=key, tries=tries, deadline_s=now + 2 * pause_s), now))
        elif what == "withdraw":
            sender.withdraw(key, now)
        elif what == "ack":
            sender.receive(ack(message, result), now)
        else:
            now += pause_s
            sender.advance(now)
        outcomes += sender.take_outcomes()
    while (wake_at := sender.wake_at) is not None:
        assert math.isfinite(wake_at)
        now = max(now, wake_at)
        sender.advance(now)
        outcomes += sender.take_outcomes()
    assert sorted(outcome.ticket for outcome in outcomes) == tickets


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.9), st.floats(0.0, 0.5), st.floats(0.0, 0.8))
def test_over_any_lossy_line_commands_end_once_and_acceptance_is_true(
    seed: int, loss: float, duplication: float, delay_s: float
) -> None:
    """A vehicle that accepts everything, behind a line that loses, doubles and delays within the settling time."""
    rng = np.random.default_rng(seed)
    sender = CommandSender()
    to_vehicle: list[tuple[float, int]] = []
    to_us: list[tuple[float, CommandAck]] = []
    executed: set[int] = set()
    outcomes: list[Outcome] = []
    tickets = {sender.submit(request(replace(GO, x=x), key=str(x)), 0.0): x for x in range(5)}
    now = 0.0

    def arrivals(at: float) -> list[float]:
        copies = 0 if rng.random() < loss else 2 if rng.random() < duplication else 1
        return [at + delay_s * rng.random() / 2 for _ in range(copies)]

    while (wake_at := sender.wake_at) is not None or to_vehicle or to_us:
        times = [at for at, _ in to_vehicle] + [at for at, _ in to_us] + ([wake_at] if wake_at is not None else [])
        now = max(now, min(times))
        for at, x in [item for item in to_vehicle if item[0] <= now]:
            to_vehicle.remove((at, x))
            executed.add(x)
            to_us += [(when, ack(GO)) for when in arrivals(now)]
        for item in [item for item in to_us if item[0] <= now]:
            to_us.remove(item)
            sender.receive(item[1], now)
        sender.advance(now)
        for message in sender.take_outgoing():
            assert isinstance(message, CommandInt)
            to_vehicle += [(when, message.x) for when in arrivals(now)]
        outcomes += sender.take_outcomes()
    assert sorted(outcome.ticket for outcome in outcomes) == sorted(tickets)
    if duplication == 0.0:
        # Only a doubled answer can be mistaken; without any, what counts as accepted has been executed.
        assert {tickets[outcome.ticket] for outcome in outcomes if outcome.accepted} <= executed
