"""Coverage only: the letter's baseline, with a stated way to pick one of its many placements.

The letter eliminates the cost "and uses the same constraints" without saying which feasible point it takes. Here hosts
start anywhere in a square and are moved until the constraints hold, as an optimizer without a cost would leave them.
"""

from dataclasses import replace

import numpy as np

from hsop_gcs.placement.answer import chosen
from hsop_gcs.placement.covering import aimed
from hsop_gcs.placement.feasibility import members
from hsop_gcs.placement.hsop import Choice, Search, views_of
from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.interior_point import INSIDE, margins, reach_feasibility
from hsop_gcs.placement.pair_sets import observed_threats
from hsop_gcs.placement.problem import Problem
from hsop_gcs.placement.solution import HoverPose, Method, Placement
from hsop_gcs.study.assumptions import Assumptions, CoverageCameras

STARTS = 8
"""Random starts of one pair set; the first that can be moved to where the constraints hold is taken."""
PAIR_SETS_TRIED = 24


def cover(problem: Problem, n_hosts: int, assumptions: Assumptions, rng: np.random.Generator) -> Placement | None:
    """Return a placement of exactly ``n_hosts`` that sees every threat, by a random pair set; None if none is found."""
    instance = Instance.of(problem)
    search = Search(instance, seed=int(rng.integers(2**31)), deadline=1.0, now=lambda: 0.0, letters_cameras=True)
    pair_sets = list(search.feasible_pair_sets(n_hosts))
    for index in rng.permutation(len(pair_sets))[:PAIR_SETS_TRIED]:
        pair_set = pair_sets[index]
        masks = observed_threats(pair_set)
        choices = [Choice(pair_set, (0,) * n_hosts)]
        if assumptions.coverage_cameras is CoverageCameras.DETERMINED:
            choices = list(search.choices(pair_set))
        if not choices:
            continue
        choice = choices[int(rng.integers(len(choices)))]
        half = assumptions.coverage_start_m / 2
        batch = np.empty((STARTS, n_hosts, 4))
        for host, mask in enumerate(masks):
            threats = np.array(members(mask))
            cameras = np.array([choice.camera(host, threat) for threat in threats])
            batch[:, host] = aimed(instance, rng.uniform(-half, half, size=(STARTS, 2)), threats, cameras)
        views = views_of([choice]).rows(np.zeros(STARTS, dtype=np.intp))
        moved = reach_feasibility(instance, batch, views)
        inside = np.flatnonzero(margins(instance, moved, views, with_cost=False).margin >= INSIDE)
        if inside.size:
            return placement_of(problem, choice, moved[inside[0]])
    return None


def placement_of(problem: Problem, choice: Choice, poses: FloatArray) -> Placement:
    """Name the hosts and value what they see; poses: (hosts, 4) east, north, heading, pan."""
    names = [f"h{k + 1}" for k in range(len(poses))]
    headings, pans = np.degrees(poses[:, 2]) % 360.0, np.degrees(poses[:, 3]) % 360.0
    hosts = tuple(
        HoverPose(
            host=name,
            position_m=(float(poses[k, 0]), float(poses[k, 1]), 0.0),
            heading_deg=float(headings[k]),
            pan_deg=float(pans[k]) if choice.central[k] else None,
        )
        for k, name in enumerate(names)
    )
    return replace(chosen(problem, choice, hosts), method=Method.COVERAGE_ONLY)
