"""A placement for as many threats as can be seen: those that nobody can see are told apart first, and all by name."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.reasons import out_of_sight, why_left, why_not_two, why_unseen
from hsop_gcs.placement.solution import Placement, Status

REASONING_ROUNDS = 3
"""How many rounds of the search it takes to believe that there is nothing to find."""


def place_some(
    problem: Problem,
    *,
    n_hosts: int | None,
    seed: int,
    deadline: float,
    now: Callable[[], float],
    iterations: int | None,
    warm_start: Placement | None,
    target_error_m: float | None,
    until_settled: bool,
    thorough_bound: bool,
    most_rounds: int | None,
) -> Placement:
    """Return a placement that sees the most valuable threats, and says of each other one why not.

    Infeasible: no threat is seen; then ``left_out`` has those of which it is known why, and ``reason`` says it if that
    is all of them. The arguments are those of ``place``, with a deadline on the clock ``now``.
    """
    from hsop_gcs.placement.search import search

    unseen = out_of_sight(problem)
    within = without(problem, unseen)
    if not within.threats:
        return Placement(
            status=Status.INFEASIBLE,
            formulation=problem.formulation,
            objective=problem.objective,
            reason=next(iter(unseen.values())),
            left_out=unseen,
        )
    placement = search(
        within,
        n_hosts=None if n_hosts is None else max(2, min(n_hosts, 2 * len(within.threats))),
        seed=seed,
        deadline=deadline,
        now=now,
        iterations=iterations,
        warm_start=warm_start,
        target_error_m=target_error_m,
        until_settled=until_settled,
        thorough_bound=thorough_bound,
        partial=True,
        most_rounds=most_rounds,
    )
    seen, hopeless = {pair.threat for pair in placement.pairs}, placement.left_out
    if placement.status is Status.INFEASIBLE:
        return replace(placement, left_out=unseen)
    for threat in within.threats:
        if threat.id in hopeless:
            alone = without(problem, {other.id: "" for other in problem.threats if other.id != threat.id})
            why = None
            if iterations is None:
                why = why_unseen(
                    alone,
                    possible=lambda asked, count: is_possible(asked, count, seed, now),
                    late=lambda: now() > deadline,
                )
            unseen[threat.id] = why or why_not_two(threat.id)
        elif threat.id not in seen:
            unseen[threat.id] = why_left(threat.id, len(placement.hosts), len(seen), len(within.threats))
    if not unseen:
        return placement
    left_out = {threat.id: unseen[threat.id] for threat in problem.threats if threat.id in unseen}
    return replace(placement, status=Status.PARTIAL, left_out=left_out)


def without(problem: Problem, left_out: Mapping[str, str]) -> Problem:
    """Return the problem in which nobody has to see some of the threats; hosts keep clear of them as of the others."""
    if not left_out:
        return problem
    return replace(
        problem,
        threats=tuple(threat for threat in problem.threats if threat.id not in left_out),
        bystanders=(*problem.bystanders, *(threat for threat in problem.threats if threat.id in left_out)),
    )


def is_possible(problem: Problem, n_hosts: int, seed: int, now: Callable[[], float]) -> bool:
    """Return whether a few rounds of the search find any placement."""
    from hsop_gcs.placement.search import search

    found = search(problem, n_hosts=n_hosts, seed=seed, deadline=math.inf, now=now, iterations=REASONING_ROUNDS)
    return found.status is not Status.INFEASIBLE
