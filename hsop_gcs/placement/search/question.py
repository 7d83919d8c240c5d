"""From a ``Problem`` to the arrays of the kernels, and from a state of the search to a ``Placement``."""

import math
from dataclasses import replace

import numpy as np

from hsop_gcs.cameras.rig import CameraKind, CameraRig
from hsop_gcs.geometry.frames import Aim
from hsop_gcs.placement.airspace import Airspace
from hsop_gcs.placement.answer import KINDS, compass_deg, hover_pose, names_of, valued
from hsop_gcs.placement.objective import hover_altitudes_m, noise_rad, threat_points_m, threat_ways_m, weight
from hsop_gcs.placement.problem import Formulation, Objective, Problem
from hsop_gcs.placement.search.areas import STRICTER_M, areas_of
from hsop_gcs.placement.search.frame import GRID_M, Frame
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL, Floats, Question, central_aim, view_window
from hsop_gcs.placement.search.state import State, left_over, new_state, refresh, set_view
from hsop_gcs.placement.solution import HoverPose, Placement, View

TARGET_POWER = 8.0
STRICTER = 1e-7
"""The search keeps so much more of every rule without a length, relative or in radians, than asked."""


def frame_of(problem: Problem) -> Frame:
    """Return the frame in which the problem is searched."""
    return Frame.of(threat_points_m(problem).reshape(-1, 3))


def question_of(problem: Problem, frame: Frame) -> Question:
    """Return the problem as the kernels see it; the letter's lies in one plane."""
    operational = problem.formulation is Formulation.OPERATIONAL
    points, paths = frame.inward(threat_points_m(problem)), frame.inward(threat_ways_m(problem))
    floor_m, ceiling_m = (float(np.round(up / GRID_M) * GRID_M) for up in hover_altitudes_m(problem))
    if operational:
        floor_m, ceiling_m = _within(problem, floor_m, ceiling_m)
    else:
        points[:, :, 2] = paths[:, :, 2] = floor_m = ceiling_m = 0.0
    rigs = problem.rigs
    sizes = np.array([threat.size_m for threat in problem.threats])
    cameras = [camera for rig in rigs for camera in (rig.peripheral, rig.central)]
    focal_px = np.array([[camera.focal_length_px] for camera in cameras])
    least_px = np.array([[camera.min_pixels] for camera in cameras])
    rms = problem.objective is Objective.RMS
    angular = [noise_rad(rig, problem.attitude_sigma_rad) for rig in rigs]
    noises = np.array([[noise[KINDS[camera]]] for noise in angular for camera in (PERIPHERAL, CENTRAL)])
    fov_rad = np.array([2 * rig.central.half_fov_rad - STRICTER for rig in rigs])
    gimbal_rad, limited = _gimbals(problem, frame)
    carried = [host.rig or problem.rig for host in problem.hosts] or [problem.rig] * (2 * len(sizes))
    sides, areas = areas_of(problem.airspace if operational else Airspace(), frame)
    return Question(
        points_m=points,
        paths_m=paths,
        weight=np.array([weight(problem, threat) for threat in problem.threats]),
        range_m=focal_px * sizes / least_px * (1 - STRICTER),
        factor=np.repeat(noises, len(sizes), axis=1) if rms else 1 / (focal_px * sizes),
        distortion=np.array([rig.peripheral.distortion for rig in rigs], dtype=np.float64),
        fov_rad=fov_rad,
        fov_cosine=np.cos(fov_rad),
        height_rad=np.array([2 * rig.central.half_height_rad - STRICTER for rig in rigs]),
        gimbal_rad=gimbal_rad,
        limited=limited,
        hosts_of_rig=np.array([carried.count(rig) for rig in rigs], dtype=np.int64),
        safety_m=problem.safety_distance_m + STRICTER_M,
        separation_m=problem.min_separation_m + STRICTER_M if operational and problem.min_separation_m > 0 else 0.0,
        whole_path=operational,
        rms=rms,
        power=1.0,
        position_sigma_m=problem.position_sigma_m,
        plane=not limited
        and floor_m == ceiling_m
        and bool((points[:, :, 2] == floor_m).all() and (paths[:, :, 2] == floor_m).all()),
        floor_m=floor_m,
        ceiling_m=ceiling_m,
        sides_m=sides,
        areas=areas,
    )


def aimed_at(problem: Problem, frame: Frame, target_error_m: float) -> Question:
    """Return the question whose cost is governed by the largest expected error; below 1, all are within the target."""
    q = question_of(replace(problem, objective=Objective.RMS), frame)
    return q._replace(power=TARGET_POWER, weight=np.full(len(q.weight), target_error_m**-TARGET_POWER))


def _gimbals(problem: Problem, frame: Frame) -> tuple[Floats, bool]:
    """Return the gimbals' limits, (rigs, 4) radians in the frame, and whether any counts; the letter tilts nothing."""
    limits = np.radians([(*rig.tilt_deg, *rig.pan_deg) for rig in problem.rigs])
    if problem.formulation is Formulation.LETTER:
        limits[:, :2] = -math.pi / 2, math.pi / 2
    # Either end of the fisheye axis may be the nose: no pan is out of reach that is not beyond both.
    tilts = (limits[:, 0] > -math.pi / 2) | (limits[:, 1] < math.pi / 2)
    pans = (limits[:, 2] > -math.pi / 2) | (limits[:, 3] < math.pi / 2)
    if np.linalg.det(frame.turn) < 0:
        limits[:, 2:] = -limits[:, [3, 2]]
    limits += STRICTER * np.array([1.0, -1.0, 1.0, -1.0])
    return limits, bool((tilts | pans).any())


def _within(problem: Problem, floor_m: float, ceiling_m: float) -> tuple[float, float]:
    """Keep rounded altitudes within the airspace's own limits."""
    airspace = problem.airspace
    if airspace.floor_m is not None:
        floor_m = max(floor_m, airspace.floor_m)
    if airspace.ceiling_m is not None:
        ceiling_m = min(ceiling_m, airspace.ceiling_m)
    return floor_m, max(floor_m, ceiling_m)


def placement_of(problem: Problem, frame: Frame, q: Question, state: State) -> Placement:
    """Turn a state that keeps every rule into the answer, valued by the exact reference."""
    positions = frame.outward(state.positions)
    if problem.formulation is Formulation.LETTER:
        positions[:, 2] = hover_altitudes_m(problem)[0]
    rigs = problem.rigs
    carried = [rigs[rig] for rig in state.rigs]
    names = names_of(problem, positions, carried)
    poses = tuple(
        _pose(problem, frame, q, state, host, name, positions[host], carried[host]) for host, name in enumerate(names)
    )
    views = {}
    for threat, pair, cameras in zip(problem.threats, state.pairs, state.cameras, strict=True):
        first, second = (View(host=names[h], camera=KINDS[int(c)]) for h, c in zip(pair, cameras, strict=True))
        views[threat.id] = (first, second)
    return valued(problem, poses, views)


def _pose(
    problem: Problem,
    frame: Frame,
    q: Question,
    state: State,
    host: int,
    name: str,
    position_m: Floats,
    rig: CameraRig,
) -> HoverPose:
    """Pan and tilt to the middle of what the central camera sees; an unused fisheye axis follows the pan."""
    degree = int(state.degree[host])
    seen = (host, state.incident[host], degree, state.cameras)
    low, high, count = view_window(q, state.positions, *seen)
    held = [int(v) // 2 for v in state.incident[host, :degree] if state.cameras[v // 2, v % 2] == CENTRAL]
    middle, tilt = 0.5 * (low + high), 0.0
    aim = frame.vectors_outward(np.array([math.sin(middle), math.cos(middle)]))
    if held and not q.plane:
        x, y, z, _ = central_aim(q, state.positions, state.axes, state.rigs, *seen)
        aim, tilt = frame.vectors_outward(np.array([x, y])), math.atan2(z, math.hypot(x, y))
    if held and (q.plane or problem.formulation is Formulation.LETTER):
        centre = threat_points_m(problem)[held].reshape(-1, 3).mean(axis=0)
        tilt = math.atan2(centre[2] - position_m[2], math.dist(centre[:2], position_m[:2]))
    axis = frame.vectors_outward(state.axes[host]) if count < degree else aim
    looks = Aim(pan_deg=compass_deg(math.atan2(*aim)), tilt_deg=math.degrees(tilt)) if held else None
    return hover_pose(name, position_m, compass_deg(math.atan2(*axis)), rig, looks)


def state_of(problem: Problem, frame: Frame, q: Question, placement: Placement, n_hosts: int) -> State:
    """Return an earlier placement as a state for ``n_hosts`` hosts and today's threats.

    Threats and hosts are recognised by id. A new threat is given to the two nearest hosts; the least busy hosts leave
    first; hosts that are added stand beside the costliest threats, with rigs that are left over. Rules may be broken:
    the search mends that.
    """
    leaving = len(placement.hosts) - n_hosts
    views = [view.host for pair in placement.pairs for view in pair.views]
    kept = sorted(placement.hosts, key=lambda pose: views.count(pose.host))[max(0, leaving) :]
    index = {pose.host: k for k, pose in enumerate(kept)}
    state = new_state(len(problem.threats), n_hosts)
    carried = {host.id: problem.rigs.index(host.rig or problem.rig) for host in problem.hosts}
    state.rigs[:] = [carried.get(pose.host, -1) for pose in kept] + [-1] * max(0, -leaving)
    for unknown in np.flatnonzero(state.rigs < 0):
        state.rigs[unknown] = max(range(len(problem.rigs)), key=lambda rig: left_over(q, state, rig))
    for k, pose in enumerate(kept):
        state.positions[k] = frame.inward(np.array(pose.position_m))
        heading = math.radians(pose.heading_deg)
        state.axes[k] = frame.vectors_inward(np.array([math.sin(heading), math.cos(heading)]))
    state.positions[:, 2] = np.clip(state.positions[:, 2], q.floor_m, q.ceiling_m)
    known = {pair.threat: pair for pair in placement.pairs}
    middles = q.points_m.mean(axis=1)
    costliest = sorted(
        range(len(problem.threats)),
        key=lambda t: -known[problem.threats[t].id].cost if problem.threats[t].id in known else -math.inf,
    )
    for k in range(len(kept), n_hosts):
        beside = costliest[(k - len(kept)) % len(costliest)]
        state.positions[k] = q.points_m[beside, 0] + np.array([q.safety_m, 0.0, 0.0])
        state.positions[k, 2] = np.clip(state.positions[k, 2], q.floor_m, q.ceiling_m)
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
