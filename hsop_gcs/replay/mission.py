"""A recorded mission run again: tracks from its reports, plans from its situations, compared entry by entry.

Placements are made again with the iterations that the solver had time for, in worker processes: each depends on nothing
but its own situation.
"""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsop_gcs.mission.core import MissionState, situation
from hsop_gcs.mission.inputs import DecisionMade, Input, RaysArrived, ReportsArrived, SolverAsked
from hsop_gcs.mission.pipeline import decide
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.records import read_inputs, to_record
from hsop_gcs.mission.recovery import Fold
from hsop_gcs.mission.snapshots import MissionSaved, to_snapshot
from hsop_gcs.placement.solution import Status
from hsop_gcs.workers import workers

_UNTIL_THE_END = float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Something that came out otherwise than recorded."""

    entry: int
    time_s: float
    what: str
    recorded: Any
    replayed: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a replay went through, and every difference it found."""

    entries: int
    reports: int
    detections: int
    decisions: int
    given_up: int
    """Entries that the journal does not have: neither disk nor memory had room, or a segment is gone."""
    recorded_s: float
    replayed_in_s: float
    differences: tuple[Difference, ...]


def replay(
    path: Path,
    *,
    from_s: float = 0.0,
    to_s: float = _UNTIL_THE_END,
    jobs: int = 2,
    now: Callable[[], float] = time.monotonic,
    progress: Callable[[int], None] = lambda _entries: None,
) -> Outcome:
    """Run a journal again and compare.

    from_s, to_s: seconds since the mission's first entry; decisions outside are taken as recorded. jobs: how many
    placements are made at a time. progress: told the number of entries done. Raises BadInput for a damaged journal.
    """
    began = now()
    differences: list[Difference] = []
    checks: list[tuple[int, DecisionMade, Future[Decision]]] = []
    fold, first, last, missing, reports, detections, first_s, last_s = Fold(), 0, 0, 0, 0, 0, None, 0.0
    with workers(jobs) as pool:
        for number, given in read_inputs(path):
            first_s = given.time_s if first_s is None else first_s
            first = first or number
            if isinstance(given, MissionSaved) and last and number > last + 1:
                # a segment that is not there any more: what is saved here goes on from it
                fold.exact, missing = False, missing + number - last - 1
            last_s, last, state = given.time_s, number, fold.state
            inside = fold.exact and from_s <= given.time_s - first_s <= to_s
            if isinstance(given, SolverAsked) and inside:
                differences += _situation_differences(number, given, state)
            if isinstance(given, DecisionMade) and inside and state.asked is not None:
                again = pool.submit(_decide_again, state.asked.situation, given.decision, state.rules.planning)
                checks.append((number, given, again))
            if isinstance(given, ReportsArrived):
                reports += len(given.measurements)
            elif isinstance(given, RaysArrived):
                detections += len(given.rays)
            elif isinstance(given, MissionSaved) and fold.begun and fold.exact:
                differences += _state_differences(number, given, state)
            fold.take(given)
            progress(number)
        for number, recorded, decided in checks:
            differences += _decision_differences(number, recorded, decided.result())
    return Outcome(
        entries=last - first + (first > 0),
        reports=reports,
        detections=detections,
        decisions=len(checks),
        given_up=fold.given_up + missing,
        recorded_s=last_s - (first_s or 0.0),
        replayed_in_s=now() - began,
        differences=tuple(sorted(differences, key=lambda each: each.entry)),
    )


def _decide_again(asked: Situation, recorded: Decision, rules: PlanningRules) -> Decision:
    return decide(asked, rules, now=time.monotonic, iterations=recorded.iterations)


def _situation_differences(number: int, given: SolverAsked, state: MissionState) -> Iterator[Difference]:
    """Whether the tracks have come to where they were when the solver was asked."""
    asked = given.situation
    again = situation(state, asked.movers, asked.now_s, standing=asked.standing)
    yield from _differences(number, given, "situation", given.situation, again)


def _state_differences(number: int, given: MissionSaved, state: MissionState) -> Iterator[Difference]:
    """Whether the mission has come to what the recorded one was saved as."""
    if state == given.state:
        return
    for path, left, right in _leaves("state", to_snapshot(given.state), to_snapshot(state)):
        yield Difference(entry=number, time_s=given.time_s, what=path, recorded=left, replayed=right)


def _decision_differences(number: int, given: DecisionMade, again: Decision) -> Iterator[Difference]:
    yield from _differences(number, given, "decision", _timeless(given.decision), _timeless(again))


def _timeless(decision: Decision) -> Decision:
    """Without what hangs on the clock: how long it took, and how much there was time to prove or to find out."""
    placement = decision.placement
    status = Status.FEASIBLE if placement.status is Status.OPTIMAL else placement.status
    placement = replace(
        placement,
        solve_time_s=0.0,
        lower_bound=0.0,
        status=status,
        reason="",
        left_out=dict.fromkeys(placement.left_out, ""),
    )
    reason = decision.reason if placement.hosts else ""
    return replace(decision, placement=placement, reason=reason, left_out=dict.fromkeys(decision.left_out, ""))


def _differences(number: int, given: Input, what: str, recorded: Any, again: Any) -> Iterator[Difference]:
    if recorded == again:
        return
    one, other = (to_record(replace(given, **{what: value}))[1][what] for value in (recorded, again))
    for path, left, right in _leaves(what, one, other):
        yield Difference(entry=number, time_s=given.time_s, what=path, recorded=left, replayed=right)


def _leaves(path: str, one: Any, other: Any) -> Iterator[tuple[str, Any, Any]]:
    """The places in which two pieces of JSON differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in {**one, **other}:
            yield from _leaves(f"{path}.{key}", one.get(key), other.get(key))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            yield from _leaves(f"{path}[{index}]", left, right)
    elif one != other:
        yield path, one, other
