"""The placements a study compares, for every number of hosts. Replace ``frontier`` here to study another search."""

from dataclasses import replace
from enum import StrEnum

import numpy as np

from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.search import frontier
from hsop_gcs.placement.solution import Placement
from hsop_gcs.study.assumptions import Assumptions
from hsop_gcs.study.coverage import cover


class Kind(StrEnum):
    HSOP = "hsop"
    """The letter's Eq. 8 under its constraints 9-12."""
    COVERAGE_ONLY = "coverage-only"
    """The same constraints, no cost."""
    RMS = "rms"
    """The same constraints, least predicted root-mean-square error."""
    OPERATIONAL = "operational"
    """Least predicted error, with the safety distance to whole paths and hosts apart: what the service flies."""


def placements(
    problem: Problem, kind: Kind, assumptions: Assumptions, *, rounds: int, seed: int
) -> dict[int, Placement]:
    """Return a placement for each number of hosts, 2 to 2 N_t, for which one was found.

    The same arguments give the same placements: the search runs ``rounds`` rounds, whatever time they take.
    """
    if kind is Kind.COVERAGE_ONLY:
        rng = np.random.default_rng(seed)
        found = {n: cover(problem, n, assumptions, rng) for n in range(2, 2 * len(problem.threats) + 1)}
        return {n: placement for n, placement in found.items() if placement is not None}
    asked = replace(
        problem,
        formulation=Formulation.OPERATIONAL if kind is Kind.OPERATIONAL else Formulation.LETTER,
        objective=Objective.LETTER if kind is Kind.HSOP else Objective.RMS,
    )
    return frontier(asked, seed=seed, deadline=0.0, now=lambda: 0.0, iterations=rounds, thorough_bound=False)
