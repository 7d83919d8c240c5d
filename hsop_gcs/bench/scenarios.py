"""The questions of the benchmark: scenarios that come with the package, and random ones."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.scenario import problem_from_json

FASTEST_MPS = 5.0
SMALL_SIDE_M, LARGE_SIDE_M = 60.0, 160.0
"""The squares of up to 3 and of 10 threats; more keep the density of 10."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One placement to find, in the letter's formulation."""

    name: str
    problem: Problem
    n_hosts: int


def shipped(*, quick: bool) -> Iterator[Case]:
    """Yield the packaged scenarios, each with every number of hosts; quick: with one above the fewest."""
    folder = files("hsop_gcs.bench") / "data"
    best_known: Mapping[str, Mapping[str, float]] = json.loads((folder / "best-known.json").read_text())
    for name in sorted(best_known):
        scenario = json.loads((folder / f"{name}.json").read_text())
        problem = problem_from_json(scenario, formulation=Formulation.LETTER)
        numbers = sorted(map(int, best_known[name]))
        for n_hosts in numbers[1:2] if quick else numbers:
            yield Case(name=name, problem=problem, n_hosts=n_hosts)


def random_case(threats: int, number: int) -> Case:
    """Return the random scenario of so many threats with this number, and three hosts for every two threats."""
    rng = np.random.default_rng([threats, number])
    side_m = side_of_square_m(threats)
    places, headings = rng.uniform(0, side_m, (threats, 2)), rng.uniform(0, 2 * np.pi, threats)
    speeds = rng.uniform(0, FASTEST_MPS, threats)
    return Case(
        name=f"{threats}-random-{number}",
        problem=Problem(
            threats=tuple(
                Threat(
                    id=f"t{k + 1}",
                    position_m=(float(places[k, 0]), float(places[k, 1]), 0.0),
                    velocity_mps=(
                        float(speeds[k] * np.sin(headings[k])),
                        float(speeds[k] * np.cos(headings[k])),
                        0.0,
                    ),
                )
                for k in range(threats)
            ),
            formulation=Formulation.LETTER,
        ),
        n_hosts=max(2, round(1.5 * threats)),
    )


def side_of_square_m(threats: int) -> float:
    """Return the side of the square that so many threats are drawn in: from ten on as many of them per area."""
    if threats <= 3:
        return SMALL_SIDE_M
    if threats <= 10:
        return SMALL_SIDE_M + (LARGE_SIDE_M - SMALL_SIDE_M) * (threats - 3) / 7
    return LARGE_SIDE_M * math.sqrt(threats / 10)
