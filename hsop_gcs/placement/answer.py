"""From poses and views to a ``Placement``: who takes which hover point, and what it is worth by the exact reference."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL
from hsop_gcs.placement.fusion import with_more_views
from hsop_gcs.placement.hsop import Choice
from hsop_gcs.placement.objective import FloatArray, Views, evaluate, weight
from hsop_gcs.placement.problem import Objective, Problem
from hsop_gcs.placement.solution import HoverPose, Placement, Status, ThreatPair, View

KINDS = {PERIPHERAL: CameraKind.PERIPHERAL, CENTRAL: CameraKind.CENTRAL}
PROVEN_GAP = 1e-3


def names_of(problem: Problem, positions_m: FloatArray, rigs: Sequence[CameraRig]) -> list[str]:
    """Return who takes which hover point: least distance flown in total; h1, h2, ... when no hosts are given.

    positions_m: (n, 2 or more), ENU. rigs: what each of them was chosen for; no more of a kind than there are.
    """
    if not problem.hosts:
        return [f"h{k + 1}" for k in range(len(positions_m))]
    now_m = np.array([host.position_m[:2] for host in problem.hosts])
    flight_m = cdist(positions_m[:, :2], now_m)
    fits = np.array([[(host.rig or problem.rig) == rig for host in problem.hosts] for rig in rigs])
    _, chosen = linear_sum_assignment(np.where(fits, flight_m, 1.0 + flight_m.sum()))
    return [problem.hosts[host].id for host in chosen]


def compass_deg(angle_rad: float) -> float:
    """Return a compass angle as degrees in [0, 360); rounding just below north must not give 360."""
    return math.degrees(angle_rad) % 360.0 % 360.0


def hover_pose(host: str, position_m: FloatArray, heading_deg: float, rig: CameraRig, aim: Aim | None) -> HoverPose:
    """Return a pose whose aim the gimbal can give: either end of the fisheye axis may be the nose."""
    if aim is not None:
        behind_deg = (heading_deg + 180.0) % 360.0
        if rig.gimbal_room_deg(aim, heading_deg) < min(0.0, rig.gimbal_room_deg(aim, behind_deg)):
            heading_deg = behind_deg
        aim = rig.nearest_aim(aim, heading_deg)
    east, north, up = (float(value) for value in position_m)
    return HoverPose(
        host=host,
        position_m=(east, north, up),
        heading_deg=heading_deg,
        pan_deg=None if aim is None else aim.pan_deg,
        tilt_deg=0.0 if aim is None else aim.tilt_deg,
    )


def valued(problem: Problem, hosts: Sequence[HoverPose], views: Views, *, lower_bound: float = 0.0) -> Placement:
    """Return the placement of the hosts at their poses, with the problem's cost, expected errors and further views."""
    worth = evaluate(problem, hosts, views)
    placement = Placement(
        status=Status.FEASIBLE,
        formulation=problem.formulation,
        objective=problem.objective,
        hosts=tuple(hosts),
        pairs=tuple(
            ThreatPair(
                threat=threat.id,
                views=views[threat.id],
                cost=(
                    weight(problem, threat) * worth.expected_errors_m[threat.id]
                    if problem.objective is Objective.RMS
                    else worth.pair_costs[threat.id]
                ),
                expected_error_m=worth.expected_errors_m[threat.id],
            )
            for threat in problem.threats
        ),
        lower_bound=lower_bound,
    )
    cost = sum(pair.cost for pair in placement.pairs)
    proven = cost <= lower_bound * (1 + PROVEN_GAP)
    placement = replace(placement, cost=cost, status=Status.OPTIMAL if proven else Status.FEASIBLE)
    return with_more_views(problem, placement)


def chosen(problem: Problem, choice: Choice, hosts: Sequence[HoverPose], *, lower_bound: float = 0.0) -> Placement:
    """Return the placement of a pair set with its cameras; its hosts at their poses, in order."""
    views = {}
    for index, (threat, pair) in enumerate(zip(problem.threats, choice.pair_set, strict=True)):
        first, second = (View(host=hosts[h].host, camera=KINDS[choice.camera(h, index)]) for h in pair)
        views[threat.id] = (first, second)
    return valued(problem, hosts, views, lower_bound=lower_bound)
