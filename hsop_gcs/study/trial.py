"""One trial of a study: a random scenario, all its placements, their errors; its arguments decide all of it."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.errors import BadInput
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.solution import Placement
from hsop_gcs.study.assumptions import Assumptions, MeasuredAt
from hsop_gcs.study.localization import Estimator, threat_errors
from hsop_gcs.study.placements import Kind, placements

MOST_THREATS = 6

Record = dict[str, Any]
"""A trial's outcome as it goes to the results file: ``threats``, ``index`` and ``results``, one for each placement."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What is run: ``scenarios`` trials for each number of threats. Raises BadInput."""

    threats: tuple[int, ...] = (2, 3, 4)
    scenarios: int = 100
    draws: int = 10_000
    """Per threat, half of them where it is now and half where it will be."""
    seed: int = 0
    rounds: int = 3
    """Rounds of the placement search for each number of hosts."""
    kinds: tuple[Kind, ...] = tuple(Kind)
    assumptions: Assumptions = field(default_factory=Assumptions)

    def __post_init__(self) -> None:
        if not self.threats or any(not 1 <= n <= MOST_THREATS for n in self.threats):
            raise BadInput("threats", f"numbers from 1 to {MOST_THREATS} are wanted, not {list(self.threats)}")
        if len(set(self.threats)) != len(self.threats):
            raise BadInput("threats", f"{list(self.threats)} names a number twice")
        for name, least in (("scenarios", 1), ("draws", 2), ("seed", 0), ("rounds", 1)):
            if getattr(self, name) < least:
                raise BadInput(name, f"must be at least {least}, not {getattr(self, name)}")

    def trials(self) -> list["Trial"]:
        """Return all trials, in the order in which results are reported."""
        return [Trial(threats=n, index=k) for n in self.threats for k in range(self.scenarios)]

    def as_json(self) -> dict[str, Any]:
        """Return everything the results depend on."""
        return {**asdict(self), "assumptions": self.assumptions.as_json()}


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Trial:
    """One random scenario of a study: its number of threats, and its number among those."""

    threats: int
    index: int


def scenario(study: Study, trial: Trial) -> Problem:
    """Return the trial's scenario."""
    return study.assumptions.problem(trial.threats, np.random.default_rng(_seeds(study, trial, 0)))


def run_trial(study: Study, trial: Trial) -> Record:
    """Place, add noise, triangulate; return a record that JSON keeps to the last bit."""
    problem = scenario(study, trial)
    results = []
    for kind in study.kinds:
        order = list(Kind).index(kind)
        search_seed = int(_seeds(study, trial, 1, order).generate_state(1)[0]) >> 1
        found = placements(problem, kind, study.assumptions, rounds=study.rounds, seed=search_seed)
        for n_hosts, placement in sorted(found.items()):
            rng = np.random.default_rng(_seeds(study, trial, 2, order, n_hosts))
            results.append({"placement": kind.value, "hosts": n_hosts, **_measured(study, problem, placement, rng)})
    return {"threats": trial.threats, "index": trial.index, "results": results}


def _seeds(study: Study, trial: Trial, *purpose: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(study.seed, spawn_key=(trial.threats, trial.index, *purpose))


def _measured(study: Study, problem: Problem, placement: Placement, rng: np.random.Generator) -> dict[str, Any]:
    """Average over threats and their points."""
    at = {MeasuredAt.BOTH: (0, 1), MeasuredAt.NOW: (0,), MeasuredAt.LATER: (1,)}[study.assumptions.measured_at]
    errors = threat_errors(problem, placement, study.draws, rng)
    points = [both[k] for both in errors for k in at]
    cameras = [view.camera for pair in placement.pairs for view in pair.views]
    angles = [math.pi / 2 - abs(math.pi / 2 - point.angle_rad) for point in points]
    return {
        "mean_error_m": {e.value: float(np.mean([point.mean_error_m[e] for point in points])) for e in Estimator},
        "rms_error_m": {
            e.value: math.sqrt(float(np.mean([point.rms_error_m[e] ** 2 for point in points]))) for e in Estimator
        },
        "bound_m": math.sqrt(float(np.mean([point.bound_m**2 for point in points]))),
        "angle_deg": math.degrees(float(np.mean(angles))),
        "central_share": cameras.count(CameraKind.CENTRAL) / len(cameras),
    }
