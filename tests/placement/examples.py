"""Scenarios that several test modules share."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.scenario import problem_from_json

SCENARIOS = Path(__file__).parents[1] / "data" / "scenarios"
NAMES = sorted(path.stem for path in SCENARIOS.glob("*-threats-*.json"))


def read(name: str) -> Any:
    return json.loads((SCENARIOS / f"{name}.json").read_text())


def problem(name: str, formulation: Formulation = Formulation.LETTER) -> Problem:
    return problem_from_json(read(name), formulation=formulation)


def random_threats(count: int, rng: np.random.Generator, side_m: float = 60.0) -> tuple[Threat, ...]:
    """Threats anywhere in a square, 0-5 m/s in any direction: the letter's simulations."""
    places, headings, speeds = (
        rng.uniform(0, side_m, (count, 2)),
        rng.uniform(0, 2 * np.pi, count),
        rng.uniform(0, 5, count),
    )
    return tuple(
        Threat(
            id=f"t{k + 1}",
            position_m=(float(place[0]), float(place[1]), 0.0),
            velocity_mps=(float(speed * np.sin(heading)), float(speed * np.cos(heading)), 0.0),
        )
        for k, (place, heading, speed) in enumerate(zip(places, headings, speeds, strict=True))
    )
