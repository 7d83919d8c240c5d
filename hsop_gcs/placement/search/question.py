"""From a ``Problem`` to the arrays of the kernels, and from a state of the search to a ``Placement``."""

import math

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.objective import PIXEL_NOISE_PX, evaluate, threat_points_m
from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.search.anneal import State, new_state, refresh, set_view
from hsop_gcs.placement.search.frame import GRID_M, Frame
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL, Floats, Question, view_window
from hsop_gcs.placement.solution import HoverPose, Placement, Status, ThreatPair, View

KINDS = {PERIPHERAL: CameraKind.PERIPHERAL, CENTRAL: CameraKind.CENTRAL}
STRICTER_M = 4 * GRID_M
"""The search keeps so much more distance than asked, because its points are on a grid."""
STRICTER = 1e-7
"""And so much, relative or in radians, of every other rule."""


def frame_of(problem: Problem) -> Frame:
    """Return the frame in which the problem is searched."""
    return Frame.of(threat_points_m(problem).reshape(-1, 3))


def question_of(problem: Problem, frame: Frame) -> Question:
    """Return the problem as the kernels see it: plane geometry at one altitude."""
    points = frame.inward(threat_points_m(problem))
    points[:, :, 2] = 0.0
    peripheral, central = problem.rig.peripheral, problem.rig.central
    sizes = np.array([threat.size_m for threat in problem.threats])
    operational = problem.formulation is Formulation.OPERATIONAL
    focal_px = np.array([[peripheral.focal_length_px], [central.focal_length_px]])
    least_px = np.array([[peripheral.min_pixels], [central.min_pixels]])
    noise_px = np.array([[PIXEL_NOISE_PX[KINDS[PERIPHERAL]]], [PIXEL_NOISE_PX[KINDS[CENTRAL]]]])
    rms = problem.objective is Objective.RMS
    return Question(
        points_m=points,
        weight=np.array([threat.weight if operational else 1.0 for threat in problem.threats]),
        range_m=focal_px * sizes / least_px * (1 - STRICTER),
        factor=np.broadcast_to(noise_px / focal_px, (2, len(sizes))).copy() if rms else 1 / (focal_px * sizes),
        distortion=np.array(peripheral.distortion, dtype=np.float64),
        fov_rad=2 * central.half_fov_rad - STRICTER,
        fov_cosine=math.cos(2 * central.half_fov_rad - STRICTER),
        safety_m=problem.safety_distance_m + STRICTER_M,
        separation_m=problem.min_separation_m + STRICTER_M if operational and problem.min_separation_m > 0 else 0.0,
        whole_path=operational,
        rms=rms,
        floor_m=0.0,
        ceiling_m=0.0,
    )


def names_of(problem: Problem, positions_m: Floats) -> list[str]:
    """Return who takes which hover point: least distance flown in total; h1, h2, ... when no hosts are given."""
    if not problem.hosts:
        return [f"h{k + 1}" for k in range(len(positions_m))]
    now_m = np.array([host.position_m[:2] for host in problem.hosts])
    _, chosen = linear_sum_assignment(cdist(positions_m[:, :2], now_m))
    return [problem.hosts[host].id for host in chosen]


def placement_of(problem: Problem, frame: Frame, q: Question, state: State) -> Placement:
    """Turn a state that keeps every rule into the answer, valued by the exact reference."""
    altitude = float(threat_points_m(problem)[:, :, 2].mean())
    positions = frame.outward(state.positions)
    positions[:, 2] = altitude
    names = names_of(problem, positions)
    poses = tuple(_pose(problem, frame, q, state, host, name, positions[host]) for host, name in enumerate(names))
    views = {}
    for threat, pair, cameras in zip(problem.threats, state.pairs, state.cameras, strict=True):
        first, second = (View(host=names[h], camera=KINDS[int(c)]) for h, c in zip(pair, cameras, strict=True))
        views[threat.id] = (first, second)
    worth = evaluate(problem, poses, views)
    costs = worth.expected_errors_m if problem.objective is Objective.RMS else worth.pair_costs
    if problem.objective is Objective.RMS:
        costs = {t.id: float(w) * costs[t.id] for t, w in zip(problem.threats, q.weight, strict=True)}
    return Placement(
        status=Status.FEASIBLE,
        formulation=problem.formulation,
        objective=problem.objective,
        hosts=poses,
        pairs=tuple(
            ThreatPair(threat=t, views=v, cost=costs[t], expected_error_m=worth.expected_errors_m[t])
            for t, v in views.items()
        ),
        cost=sum(costs.values()),
    )


def _pose(
    problem: Problem, frame: Frame, q: Question, state: State, host: int, name: str, position_m: Floats
) -> HoverPose:
    """Pan and tilt to the middle of what the central camera sees; an unused fisheye axis follows the pan."""
    low, high, _, _, count = view_window(
        q, state.positions, host, state.incident[host], int(state.degree[host]), state.cameras
    )
    held = [int(v) // 2 for v in state.incident[host, : state.degree[host]] if state.cameras[v // 2, v % 2] == CENTRAL]
    middle = 0.5 * (low + high)
    aim = frame.vectors_outward(np.array([math.sin(middle), math.cos(middle)]))
    axis = frame.vectors_outward(state.axes[host]) if count < state.degree[host] else aim
    tilt = 0.0
    if held:
        centre = threat_points_m(problem)[held].reshape(-1, 3).mean(axis=0)
        tilt = math.atan2(centre[2] - position_m[2], math.dist(centre[:2], position_m[:2]))
    return HoverPose(
        host=name,
        position_m=(float(position_m[0]), float(position_m[1]), float(position_m[2])),
        heading_deg=_compass_deg(axis),
        pan_deg=_compass_deg(aim) if count > 0 else None,
        tilt_deg=math.degrees(tilt),
    )


def _compass_deg(vector: Floats) -> float:
    """Return a direction as degrees in [0, 360); rounding just below north must not give 360."""
    return math.degrees(math.atan2(vector[0], vector[1])) % 360.0 % 360.0


def state_of(problem: Problem, frame: Frame, q: Question, placement: Placement, n_hosts: int) -> State:
    """Return an earlier placement as a state for ``n_hosts`` hosts and today's threats.

    Threats are recognised by id. A new threat is given to the two nearest hosts; the least busy hosts leave first;
    hosts that are added stand beside the costliest threats. Rules may be broken: the search mends that.
    """
    leaving = len(placement.hosts) - n_hosts
    views = [view.host for pair in placement.pairs for view in pair.views]
    kept = sorted(placement.hosts, key=lambda pose: views.count(pose.host))[max(0, leaving) :]
    index = {pose.host: k for k, pose in enumerate(kept)}
    state = new_state(len(problem.threats), n_hosts)
    for k, pose in enumerate(kept):
        state.positions[k] = frame.inward(np.array(pose.position_m))
        heading = math.radians(pose.heading_deg)
        state.axes[k] = frame.vectors_inward(np.array([math.sin(heading), math.cos(heading)]))
    state.positions[:, 2] = 0.0
    known = {pair.threat: pair for pair in placement.pairs}
    middles = q.points_m.mean(axis=1)
    costliest = sorted(
        range(len(problem.threats)),
        key=lambda t: -known[problem.threats[t].id].cost if problem.threats[t].id in known else -math.inf,
    )
    for k in range(len(kept), n_hosts):
        beside = costliest[(k - len(kept)) % len(costliest)]
        state.positions[k] = q.points_m[beside, 0] + np.array([q.safety_m, 0.0, 0.0])
    for t, threat in enumerate(problem.threats):
        views_of_it = known[threat.id].views if threat.id in known else ()
        seeing = [
            (index[v.host], CENTRAL if v.camera is CameraKind.CENTRAL else PERIPHERAL)
            for v in views_of_it
            if v.host in index
        ]
        near = np.argsort(np.hypot(*(state.positions[:, :2] - middles[t, :2]).T), kind="stable")
        seeing += [(int(h), PERIPHERAL) for h in near if h not in [s[0] for s in seeing]]
        for end in range(2):
            set_view(state, t, end, *seeing[end])
    for host in np.flatnonzero(state.degree == 0):
        _employ(state, int(host), costliest)
    refresh(q, state)
    return state


def _employ(state: State, host: int, costliest: list[int]) -> None:
    """Give an idle host the first view, in the order of the threats, that another can spare."""
    for threat in costliest:
        for end in range(2):
            if state.degree[state.pairs[threat, end]] > 1 and state.pairs[threat, 1 - end] != host:
                set_view(state, threat, end, host, CENTRAL)
                return
