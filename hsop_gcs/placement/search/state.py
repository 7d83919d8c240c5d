"""The state of a search: poses, rigs, pairs and cameras, and the energies of its parts.

It names for every threat its two hosts and cameras, so that a change re-evaluates only the threats it touches.
"""

from typing import NamedTuple

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.model import Floats, Ints, Question, crowding, edge_energy, host_violation

Pose = tuple[float, float, float, float, float]
"""East, north, up, metres; east and north of the fisheye axis."""


class State(NamedTuple):
    """A placement, valid or not, and the energies of its parts; the arrays are changed in place."""

    positions: Floats
    """(hosts, 3)"""
    axes: Floats
    """(hosts, 2): east and north of the fisheye axis."""
    rigs: Ints
    """(hosts,): what each carries."""
    pairs: Ints
    """(threats, 2): the two hosts of every threat."""
    cameras: Ints
    """(threats, 2): their cameras."""
    incident: Ints
    """(hosts, threats): each host's views as 2 * threat + end; the first ``degree`` count."""
    degree: Ints
    cost: Floats
    violation: Floats
    """(threats,)"""
    window: Floats
    """(hosts,): violations of single hosts."""


def new_state(threats: int, hosts: int) -> State:
    """Return an empty state: nothing is seen yet."""
    axes = np.zeros((hosts, 2))
    axes[:, 1] = 1
    return State(
        np.zeros((hosts, 3)),
        axes,
        np.zeros(hosts, np.int64),
        np.full((threats, 2), -1, np.int64),
        np.zeros((threats, 2), np.int64),
        np.zeros((hosts, threats), np.int64),
        np.zeros(hosts, np.int64),
        np.zeros(threats),
        np.zeros(threats),
        np.zeros(hosts),
    )


@kernel
def copy_state(source: State, target: State) -> None:
    """Copy all arrays."""
    target.positions[:] = source.positions
    target.axes[:] = source.axes
    target.rigs[:] = source.rigs
    target.pairs[:] = source.pairs
    target.cameras[:] = source.cameras
    target.incident[:] = source.incident
    target.degree[:] = source.degree
    target.cost[:] = source.cost
    target.violation[:] = source.violation
    target.window[:] = source.window


def copied(state: State) -> State:
    """Return a copy with arrays of its own."""
    result = new_state(*state.cost.shape, *state.degree.shape)
    copy_state(state, result)
    return result


@lean_kernel
def set_view(s: State, threat: int, end: int, host: int, camera: int) -> None:
    """Give one end of a threat's pair to a host (-1: to nobody)."""
    view = 2 * threat + end
    old = s.pairs[threat, end]
    if old >= 0:
        last = s.degree[old] - 1
        for n in range(last):
            if s.incident[old, n] == view:
                s.incident[old, n] = s.incident[old, last]
                break
        s.degree[old] = last
    s.pairs[threat, end] = host
    s.cameras[threat, end] = camera
    if host >= 0:
        s.incident[host, s.degree[host]] = view
        s.degree[host] += 1


@lean_kernel
def pose_of(s: State, host: int) -> Pose:
    """Return where a host is and how it is turned."""
    return s.positions[host, 0], s.positions[host, 1], s.positions[host, 2], s.axes[host, 0], s.axes[host, 1]


@lean_kernel
def set_pose(s: State, host: int, pose: Pose) -> None:
    """Put a host where it was, turned as it was."""
    s.positions[host, 0], s.positions[host, 1], s.positions[host, 2], s.axes[host, 0], s.axes[host, 1] = pose


@lean_kernel
def threat_energy(q: Question, s: State, threat: int) -> tuple[float, float]:
    """Return cost and violation of a threat as its hosts stand now."""
    return edge_energy(
        q,
        s.positions,
        s.axes,
        s.rigs,
        threat,
        s.pairs[threat, 0],
        s.pairs[threat, 1],
        s.cameras[threat, 0],
        s.cameras[threat, 1],
    )


@lean_kernel
def window_violation(q: Question, s: State, host: int) -> float:
    """Return the violation of a host by itself as it stands now."""
    return host_violation(q, s.positions, s.axes, s.rigs, host, s.incident[host], s.degree[host], s.cameras)


@lean_kernel
def refresh_threat(q: Question, s: State, threat: int) -> None:
    """Recompute the energy of a threat."""
    s.cost[threat], s.violation[threat] = threat_energy(q, s, threat)


@lean_kernel
def refresh_host(q: Question, s: State, host: int) -> None:
    """Recompute everything a host's pose and views decide, crowding excepted."""
    for n in range(s.degree[host]):
        refresh_threat(q, s, s.incident[host, n] // 2)
    s.window[host] = window_violation(q, s, host)


@lean_kernel
def refresh(q: Question, s: State) -> None:
    """Recompute everything."""
    for threat in range(s.pairs.shape[0]):
        refresh_threat(q, s, threat)
    for host in range(s.degree.shape[0]):
        s.window[host] = window_violation(q, s, host)


@lean_kernel
def totals(q: Question, s: State) -> tuple[float, float]:
    """Return the cost and the violation of the whole state."""
    cost = violation = 0.0
    for threat in range(s.cost.shape[0]):
        cost += s.cost[threat]
        violation += s.violation[threat]
    for host in range(s.window.shape[0]):
        violation += s.window[host]
        if q.separation_m > 0:
            violation += 0.5 * crowding(q, s.positions, host)
    return cost, violation


@lean_kernel
def left_over(q: Question, s: State, rig: int) -> int:
    """Return how many hosts with a rig are not placed."""
    count = q.hosts_of_rig[rig]
    for host in range(s.rigs.shape[0]):
        if s.rigs[host] == rig:
            count -= 1
    return int(count)
