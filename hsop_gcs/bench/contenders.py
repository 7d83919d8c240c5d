"""Other ways to place hosts, on the same question with the same time: none knows anything of the others.

All but the letter's own method work on the arrays of the global search, so that all are judged by the same code.
"""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.optimize import Bounds, OptimizeResult, differential_evolution

from hsop_gcs.bench.scenarios import Case
from hsop_gcs.placement import Method, place
from hsop_gcs.placement.search import search
from hsop_gcs.placement.search.model import CENTRAL, Floats, Question
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.question import frame_of, question_of
from hsop_gcs.placement.search.state import State, new_state, refresh, set_view, totals

ROOM_M = 45.0
"""Hosts stand at most so far outside the box around the threats: farther, no camera detects anything."""
PENALTY = 1e3
POPULATION = 10
POLISH_STEPS = 80
INSIDE = 1e-6
"""Relative: interior-point answers end this far inside their constraints."""

Contender = Callable[[Case, float], float]
"""Takes a case and a time limit, seconds; returns the cost of its best placement, infinite without one."""


def by_search(case: Case, time_limit_s: float) -> float:
    """The global search."""
    deadline = time.monotonic() + time_limit_s
    found = search(case.problem, n_hosts=case.n_hosts, seed=0, deadline=deadline, now=time.monotonic)
    return math.inf if found.cost is None else found.cost


def by_letter(case: Case, time_limit_s: float) -> float:
    """The letter's Algorithm 3: an interior-point solve of every pair set and camera choice."""
    found = place(
        case.problem, n_hosts=case.n_hosts, time_limit_s=time_limit_s, now=time.monotonic, method=Method.LETTER
    )
    return math.inf if found.cost is None else found.cost


def by_differential_evolution(case: Case, time_limit_s: float) -> float:
    """scipy's differential evolution over poses, pairs and cameras; the search's local solve polishes its best."""
    q, hosts = question_of(case.problem, frame_of(case.problem)), case.n_hosts
    choices = _choices(hosts)
    threats, deadline = len(q.weight), time.monotonic() + time_limit_s
    low, high = q.points_m.min(axis=(0, 1))[:2] - ROOM_M, q.points_m.max(axis=(0, 1))[:2] + ROOM_M
    least_x = np.repeat([low[0], low[1], 0.0, 0.0], [hosts, hosts, hosts, threats])
    most_x = np.repeat([high[0], high[1], 2 * math.pi, len(choices) - 1], [hosts, hosts, hosts, threats])
    integrality = [False] * (3 * hosts) + [True] * threats
    best, least = new_state(threats, hosts), math.inf

    def value(x: Floats) -> float:
        nonlocal best, least
        state = _state(q, hosts, x[: 3 * hosts].reshape(3, hosts).T, [choices[int(k)] for k in x[3 * hosts :]])
        idle = int((state.degree == 0).sum())
        cost, violation = totals(q, state)
        if violation <= 0 and idle == 0 and cost < least:
            best, least = state, cost
        return cost + PENALTY * (violation + idle) if math.isfinite(cost + violation) else 1e9

    def late(intermediate_result: OptimizeResult) -> None:  # noqa: ARG001 - scipy goes by the name
        if time.monotonic() > deadline:
            raise StopIteration

    seed = 0
    while time.monotonic() < deadline:
        differential_evolution(
            value,
            Bounds(least_x, most_x),
            integrality=integrality,
            popsize=POPULATION,
            maxiter=100_000,
            polish=False,
            rng=np.random.default_rng(seed),
            callback=late,
        )
        seed += 1
    if math.isfinite(least):
        polish(q, best, np.ones(hosts, np.int64), POLISH_STEPS)
        least = totals(q, best)[0]
    return least


def by_ipopt(case: Case, time_limit_s: float) -> float:
    """IPOPT through CasADi from random poses, pairs and cameras, again and again. Raises ImportError without CasADi."""
    import casadi

    q, hosts = question_of(case.problem, frame_of(case.problem)), case.n_hosts
    rng, deadline, least = np.random.default_rng(0), time.monotonic() + time_limit_s, math.inf
    for views in _random_views(len(q.weight), hosts, rng):
        left_s = deadline - time.monotonic()
        if left_s <= 0:
            return least
        poses = _random_poses(q, views, hosts, rng)
        x, cost, constraints = _nonlinear_program(casadi, q, views, hosts)
        solver = casadi.nlpsol(
            "solver",
            "ipopt",
            {"x": x, "f": cost, "g": casadi.vertcat(*constraints)},
            {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_wall_time": left_s},
        )
        solution = solver(x0=poses.ravel(), lbg=0, ubg=casadi.inf)
        ended = np.array(solution["x"], dtype=np.float64).reshape(hosts, 4)
        if not np.isfinite(ended).all():
            continue
        cost_m, violation = totals(q, _state(q, hosts, ended[:, :3], views))
        if violation <= 0:
            least = min(least, cost_m)
    return least


Views = tuple[tuple[int, int], tuple[int, int]]
"""The two hosts of a threat, and their cameras."""


def _choices(hosts: int) -> list[Views]:
    """Return every pair of hosts with every choice of cameras."""
    return [
        ((first, second), (one, other))
        for first in range(hosts)
        for second in range(first + 1, hosts)
        for one in range(2)
        for other in range(2)
    ]


def _state(q: Question, hosts: int, poses: Floats, views: list[Views]) -> State:
    """Return the state with poses (hosts, 3): east, north, heading."""
    state = new_state(len(views), hosts)
    state.positions[:, :2] = poses[:, :2]
    state.axes[:, 0], state.axes[:, 1] = np.sin(poses[:, 2]), np.cos(poses[:, 2])
    for threat, (pair, cameras) in enumerate(views):
        for end in range(2):
            set_view(state, threat, end, pair[end], cameras[end])
    refresh(q, state)
    return state


def _random_views(threats: int, hosts: int, rng: np.random.Generator) -> Iterator[list[Views]]:
    """Yield random pair sets that use every host, with random cameras."""
    while True:
        ends = np.concatenate((rng.permutation(hosts), rng.integers(0, hosts, 2 * threats - hosts)))
        rng.shuffle(ends)
        pairs = ends.reshape(threats, 2)
        if (pairs[:, 0] != pairs[:, 1]).all():
            cameras = rng.integers(0, 2, (threats, 2))
            yield [((int(a), int(b)), (int(c), int(d))) for (a, b), (c, d) in zip(pairs, cameras, strict=True)]


def _random_poses(q: Question, views: list[Views], hosts: int, rng: np.random.Generator) -> Floats:
    """Return poses (hosts, 4), each host somewhere around the middle of what it sees and panned there."""
    middles = q.points_m.mean(axis=1)[:, :2]
    poses = np.zeros((hosts, 4))
    for host in range(hosts):
        seen = [threat for threat, (pair, _) in enumerate(views) if host in pair]
        middle = middles[seen].mean(axis=0)
        bearing, distance_m = rng.uniform(0, 2 * np.pi), rng.uniform(q.safety_m, 2 * q.safety_m)
        poses[host, :2] = middle + distance_m * np.array([math.sin(bearing), math.cos(bearing)])
        poses[host, 2:] = bearing + np.pi
    return poses


def _nonlinear_program(ca: Any, q: Question, views: list[Views], hosts: int) -> tuple[Any, Any, list[Any]]:
    """Return the variables (east, north, heading, pan of each host), Eq. 8, and Eqs. 9-11 as what must not be negative.

    Without lens distortion the heading changes nothing: a fisheye sees as well to all sides.
    """
    x = ca.MX.sym("x", 4 * hosts)
    cost: Any = 0
    constraints: list[Any] = []
    half_fov_cosine = math.cos(0.5 * q.fov_rad[0] * (1 - INSIDE))
    for threat, (pair, cameras) in enumerate(views):
        for point in q.points_m[threat]:
            rays, lengths = [], []
            for host, camera in zip(pair, cameras, strict=True):
                ray = ca.DM(point[:2]) - x[4 * host : 4 * host + 2]
                length = ca.sqrt(ca.sumsqr(ray) + 1e-9)
                constraints.append(length / (q.safety_m * (1 + INSIDE)) - 1)
                constraints.append(1 - length / (q.range_m[camera, threat] * (1 - INSIDE)))
                if camera == CENTRAL:
                    pan = x[4 * host + 3]
                    constraints.append((ray[0] * ca.sin(pan) + ray[1] * ca.cos(pan)) / length - half_fov_cosine)
                rays.append(ray)
                lengths.append(length**2 * q.factor[camera, threat])
            sine = (rays[0][0] * rays[1][1] - rays[0][1] * rays[1][0]) / (ca.norm_2(rays[0]) * ca.norm_2(rays[1]))
            cost += q.weight[threat] * lengths[0] * lengths[1] / ca.sqrt(sine**2 + 1e-9)
    return x, cost, constraints


CONTENDERS: dict[str, Contender] = {
    "search": by_search,
    "letter": by_letter,
    "evolution": by_differential_evolution,
    "ipopt": by_ipopt,
}
