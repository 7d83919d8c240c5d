"""What the benchmark measures: cost at equal time, time to an equal cost, and how time grows with the threats."""

import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hsop_gcs.bench.contenders import CONTENDERS, Contender
from hsop_gcs.bench.scenarios import Case, random_case, shipped
from hsop_gcs.placement.search import search, warm_up
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.rounds import LANES, Course

RANDOM_THREATS = (2, 3, 5, 10, 20)
GROWTH_THREATS = (2, 3, 5, 10, 15, 20)
WITHIN = 1.05
"""How near to the best cost known a plan must come for the growth of time."""
MOST_ROUNDS = 256
EQUAL = 1.0001
"""Interior-point methods end a little inside their constraints."""
UNCUT_THREATS = range(3, 6)
"""With fewer it ends within the time limit, with more it takes hours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much a benchmark takes."""

    time_limit_s: float
    """For each contender on each case."""
    reference_s: float
    """For the best cost that the growth of time is measured against."""
    uncut_s: float
    """For the letter's method once more on three to five threats; 0: not."""
    random_cases: int
    """For each number of threats."""
    growth_cases: int
    """The same for the growth of time."""
    quick: bool


QUICK = Effort(time_limit_s=0.5, reference_s=2.0, uncut_s=0.0, random_cases=1, growth_cases=1, quick=True)
FULL = Effort(time_limit_s=1.0, reference_s=4.0, uncut_s=600.0, random_cases=2, growth_cases=7, quick=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One contender on one case."""

    contender: str
    cost: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All contenders on one case with the same time limit; infinite costs: nothing found."""

    case: str
    threats: int
    n_hosts: int
    runs: tuple[Run, ...]
    uncut: Run | None
    """The letter's method with all the time it takes."""
    seconds_to_letters_cost: float | None
    """How long the search takes to the cost of the letter's method, uncut if that was run, or less; None if that found
    nothing or was sooner."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """How long the search takes to a plan within 5 % of the best cost known."""

    threats: int
    n_hosts: int
    seconds: float
    """Median over random cases."""
    each_s: tuple[float, ...]
    """Every case that came there."""
    missed: int
    """Cases in which so many rounds were not enough."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Everything that was measured."""

    effort: Effort
    comparisons: tuple[Comparison, ...]
    growth: tuple[Growth, ...]
    exponent: float
    """Of seconds over threats, fitted to the logarithms."""

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON; infinite costs are null."""
        return {name: _finite(value) for name, value in asdict(self).items()}


def cases(effort: Effort) -> list[Case]:
    """Return the cases on which contenders are compared."""
    drawn = [random_case(threats, number) for threats in RANDOM_THREATS for number in range(effort.random_cases)]
    return [*shipped(quick=effort.quick), *drawn]


def measure(effort: Effort, *, step: Callable[[str], None] = lambda _what: None) -> Report:
    """Run everything, one thing at a time; ``step`` is told what comes next."""
    warm_up()
    contenders = _installed()
    comparisons = []
    for case in cases(effort):
        step(f"{case.name}, {case.n_hosts} hosts")
        uncut_s = effort.uncut_s if len(case.problem.threats) in UNCUT_THREATS else 0.0
        comparisons.append(compare(case, contenders, effort.time_limit_s, uncut_s))
    growth = []
    for threats in GROWTH_THREATS:
        step(f"time to a 5 % plan, {threats} threats")
        growth.append(grow(threats, effort))
    return Report(effort=effort, comparisons=tuple(comparisons), growth=tuple(growth), exponent=exponent_of(growth))


def steps(effort: Effort) -> int:
    """Return how many steps ``measure`` will tell of."""
    return len(cases(effort)) + len(GROWTH_THREATS)


def compare(case: Case, contenders: dict[str, Contender], time_limit_s: float, uncut_s: float = 0.0) -> Comparison:
    """Run every contender on a case, and the letter's method once more with ``uncut_s``, unless that is 0."""
    runs = tuple(_timed(name, contender, case, time_limit_s) for name, contender in contenders.items())
    uncut = _timed("letter", contenders["letter"], case, uncut_s) if uncut_s > 0 and "letter" in contenders else None
    letter = uncut or next((run for run in runs if run.contender == "letter"), None)
    to_letter = None
    if letter is not None and math.isfinite(letter.cost):
        to_letter = seconds_to(case, letter.cost * EQUAL)
    return Comparison(
        case=case.name,
        threats=len(case.problem.threats),
        n_hosts=case.n_hosts,
        runs=runs,
        uncut=uncut,
        seconds_to_letters_cost=to_letter,
    )


def _timed(name: str, contender: Contender, case: Case, time_limit_s: float) -> Run:
    began = time.monotonic()
    cost = contender(case, time_limit_s)
    return Run(contender=name, cost=cost, seconds=time.monotonic() - began)


def seconds_to(case: Case, cost: float, *, seed: int = 0) -> float | None:
    """Return how long the search takes to this cost or less, to a round; None if it does not come there."""
    began = time.monotonic()
    course = Course(question_of(case.problem, frame_of(case.problem)), case.n_hosts, seed)
    with ThreadPoolExecutor(LANES) as executor:
        for _ in range(MOST_ROUNDS):
            course.advance(executor)
            if course.pool.cost <= cost:
                return time.monotonic() - began
    return None


def grow(threats: int, effort: Effort) -> Growth:
    """Measure the time to a 5 % plan on random cases of so many threats."""
    taken, missed = [], 0
    drawn = [random_case(threats, number) for number in range(effort.growth_cases)]
    for case in drawn:
        deadline = time.monotonic() + effort.reference_s
        best = search(case.problem, n_hosts=case.n_hosts, seed=1, deadline=deadline, now=time.monotonic).cost
        seconds = None if best is None else seconds_to(case, WITHIN * best)
        missed += seconds is None
        if seconds is not None:
            taken.append(seconds)
    median_s = statistics.median(taken) if taken else math.inf
    return Growth(threats=threats, n_hosts=drawn[0].n_hosts, seconds=median_s, each_s=tuple(taken), missed=missed)


def exponent_of(growth: Sequence[Growth]) -> float:
    """Return the slope of log seconds over log threats; nan with fewer than two numbers of threats."""
    known = [each for each in growth if math.isfinite(each.seconds)]
    if len(known) < 2:
        return math.nan
    slope, _ = np.polyfit(np.log([each.threats for each in known]), np.log([each.seconds for each in known]), 1)
    return float(slope)


def _installed() -> dict[str, Contender]:
    """Return the contenders; the one that needs CasADi only where that is installed."""
    try:
        import casadi  # noqa: F401
    except ImportError:
        return {name: contender for name, contender in CONTENDERS.items() if name != "ipopt"}
    return dict(CONTENDERS)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value


def best_of(comparison: Comparison) -> float:
    """Return the least cost any contender found."""
    least = min(run.cost for run in comparison.runs)
    return least if comparison.uncut is None else min(least, comparison.uncut.cost)


def rows(report: Report) -> Iterator[tuple[Comparison, dict[str, float]]]:
    """Yield each comparison with every contender's cost over the least of all."""
    for comparison in report.comparisons:
        least = best_of(comparison)
        yield comparison, {run.contender: run.cost / least for run in comparison.runs}
