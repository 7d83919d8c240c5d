"""Seeded annealing over host poses, pairs and cameras at once, in compiled code.

Broken rules cost a penalty that stiffens as the temperature falls; the best state without any violation is kept.
Temperatures are relative to the cost of an average threat.
"""

import math

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.model import Ints, Question
from hsop_gcs.placement.search.moves import jump, mend, try_camera, try_pose, try_regroup, try_rig
from hsop_gcs.placement.search.state import State, copy_state, left_over, set_view, totals


@lean_kernel
def draw_rigs(q: Question, s: State, chance: Chance) -> None:
    """Give every host a rig at random, no more of each than there are."""
    if q.hosts_of_rig.shape[0] == 1:
        return
    s.rigs[:] = -1
    for host in range(s.rigs.shape[0]):
        rest = 0
        for rig in range(q.hosts_of_rig.shape[0]):
            rest += left_over(q, s, rig)
        drawn = below(chance, rest)
        for rig in range(q.hosts_of_rig.shape[0]):
            drawn -= left_over(q, s, rig)
            if drawn < 0:
                s.rigs[host] = rig
                break


@lean_kernel
def scatter(q: Question, s: State, chance: Chance) -> None:
    """Fill a state anew at random: hosts near threats, every threat seen by two, every host used."""
    threats, hosts = s.pairs.shape[0], s.degree.shape[0]
    draw_rigs(q, s, chance)
    for threat in range(threats):
        s.pairs[threat, 0] = s.pairs[threat, 1] = -1
    for host in range(hosts):
        s.degree[host] = 0
    for host in range(hosts):
        threat = (host + below(chance, threats)) % threats if host >= threats else host
        jump(q, s, host, threat, 0, chance)
    for threat in range(threats):
        for end in range(2):
            best, choice = math.inf, 0
            for host in range(hosts):
                if end == 1 and s.pairs[threat, 0] == host:
                    continue
                x = s.positions[host, 0] - q.points_m[threat, 0, 0]
                y = s.positions[host, 1] - q.points_m[threat, 0, 1]
                rank = math.sqrt(x * x + y * y) * (0.5 + uniform(chance))
                if s.degree[host] == 0:
                    rank *= 0.5
                if rank < best:
                    best, choice = rank, host
            set_view(s, threat, end, choice, below(chance, 2))
    for host in range(hosts):
        while s.degree[host] == 0:
            threat, end = below(chance, threats), below(chance, 2)
            if s.degree[s.pairs[threat, end]] > 1:
                set_view(s, threat, end, host, below(chance, 2))
                jump(q, s, host, threat, end, chance)
    mend(q, s)


@kernel
def anneal(
    q: Question,
    s: State,
    best: State,
    hosts: Ints,
    threats: Ints,
    moves: int,
    hot: float,
    cold: float,
    reach_m: float,
    stiffness: float,
    chance: Chance,
) -> tuple[float, float]:
    """Anneal the given hosts and threats in ``s``; the rest stands still.

    Leaves the best state of the colder half in ``best``: it may be worse than what it began with, and lie elsewhere.

    ``threats`` must be seen by ``hosts`` only. ``hot`` and ``cold`` are the first and last temperature relative to
    the cost of an average threat, ``reach_m`` the longest steps at first, ``stiffness`` the first price of a
    violation of 1, relative to the same. Returns cost and violation of ``best``.
    """
    trial = np.empty((s.pairs.shape[0], 2))
    best_cost = best_violation = math.inf
    recording = False
    chunk = 50 + 10 * hosts.size
    chunks = max(2, moves // chunk)
    for n in range(chunks):
        cost, violation = totals(q, s)
        if not recording and 2 * n >= chunks:
            recording = True
            copy_state(s, best)
            best_cost, best_violation = cost, violation
        progress = n / chunks
        mean = 0.0
        for i in range(threats.size):
            mean += s.cost[threats[i]] / threats.size
        temperature = mean * hot * (cold / hot) ** progress
        penalty = mean * stiffness * 20**progress
        reach = max(0.3, reach_m * (1 - progress) ** 2)
        for _ in range(chunk):
            kind = uniform(chance)
            if kind < 0.86:
                host = hosts[below(chance, hosts.size)]
                more, broken = try_pose(q, s, host, reach, penalty, temperature, chance, trial)
            elif kind < 0.96:
                threat = threats[below(chance, threats.size)]
                more, broken = try_camera(q, s, threat, below(chance, 2), penalty, temperature, chance)
            elif q.hosts_of_rig.shape[0] > 1 and uniform(chance) < 0.4:
                more, broken = try_rig(q, s, hosts, reach, penalty, temperature, chance, trial)
            else:
                more, broken = try_regroup(q, s, hosts, threats, reach, penalty, temperature, chance, trial)
            cost += more
            violation += broken
            if not recording:
                continue
            if violation < 1e-7 and (cost < best_cost * (1 - 1e-5) or best_violation > 0):
                exact_cost, exact_violation = totals(q, s)
                if exact_violation <= 0:
                    copy_state(s, best)
                    best_cost, best_violation = exact_cost, 0.0
            elif best_violation > 0 and violation < best_violation * (1 - 1e-3):
                copy_state(s, best)
                best_cost, best_violation = cost, violation
    return best_cost, best_violation
