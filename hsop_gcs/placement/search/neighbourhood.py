"""Large-neighbourhood search: anneal a few hosts near one or two threats again, keep what is better.

Plain Python on top of kernels: calling one takes microseconds, and whatever contains ``anneal`` and ``polish`` would
compile them once more.
"""

import math

import numpy as np

from hsop_gcs.placement.search.anneal import State, anneal, copy_state, scatter, totals
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.compiled import kernel
from hsop_gcs.placement.search.model import Ints, Question
from hsop_gcs.placement.search.polish import polish

POLISH_STEPS = 80
STIFFNESS = 3.0
MENDING_STIFFNESS = 60.0
"""Of penalties while no placement keeps every rule: cost matters little then."""


@kernel
def mark_nearest(q: Question, s: State, threat: int, count: int, marks: Ints) -> None:
    """Mark the hosts of a threat, then those nearest to the middle of its path, ``count`` more in all."""
    hosts = s.degree.shape[0]
    x = 0.5 * (q.points_m[threat, 0, 0] + q.points_m[threat, 1, 0])
    y = 0.5 * (q.points_m[threat, 0, 1] + q.points_m[threat, 1, 1])
    for end in range(2):
        if marks[s.pairs[threat, end]] == 0:
            marks[s.pairs[threat, end]] = 1
            count -= 1
    while count > 0:
        nearest, least = -1, math.inf
        for host in range(hosts):
            d = (s.positions[host, 0] - x) ** 2 + (s.positions[host, 1] - y) ** 2
            if marks[host] == 0 and d < least:
                nearest, least = host, d
        if nearest < 0:
            return
        marks[nearest] = 1
        count -= 1


def costlier(s: State, chance: Chance) -> int:
    """Draw two threats and return the costlier one."""
    first, second = below(chance, s.cost.shape[0]), below(chance, s.cost.shape[0])
    return first if s.cost[first] >= s.cost[second] else second


def marked(marks: Ints) -> Ints:
    """Return the indices of the ones."""
    return np.nonzero(marks)[0].astype(np.int64)


def better(cost: float, violation: float, than_cost: float, than_violation: float) -> bool:
    """Compare placements: first by broken rules, then by cost."""
    if violation > 0 or than_violation > 0:
        return violation < than_violation
    return cost < than_cost


def fresh(
    q: Question, s: State, trial: State, moves: int, hot: float, cold: float, reach_m: float, chance: Chance
) -> None:
    """Anneal an empty state from random poses, leaving the polished result in ``s``."""
    scatter(q, trial, chance)
    hosts = np.arange(s.degree.shape[0])
    anneal(q, trial, s, hosts, np.arange(s.pairs.shape[0]), moves, hot, cold, reach_m, STIFFNESS, chance)
    polish(q, s, np.ones(hosts.size, np.int64), POLISH_STEPS)


def shake(q: Question, s: State, trial: State, moves: int, hot: float, reach_m: float, chance: Chance) -> None:
    """Anneal all of ``trial`` again from a moderate temperature, leaving the polished result in ``s``."""
    hosts = np.arange(s.degree.shape[0])
    anneal(q, trial, s, hosts, np.arange(s.pairs.shape[0]), moves, hot, 1e-3, reach_m, MENDING_STIFFNESS, chance)
    polish(q, s, np.ones(hosts.size, np.int64), POLISH_STEPS)


def improve(
    q: Question, s: State, trial: State, best: State, rounds: int, moves_per_host: int, reach_m: float, chance: Chance
) -> int:
    """Anneal neighbourhoods of ``s`` again, ``rounds`` times. Returns how many rounds helped."""
    threats, hosts = s.pairs.shape[0], s.degree.shape[0]
    cost, violation = totals(q, s)
    helped = 0
    for _ in range(rounds):
        marks = np.zeros(hosts, np.int64)
        mark_nearest(q, s, costlier(s, chance), 2 + below(chance, 4), marks)
        if uniform(chance) < 0.5:
            mark_nearest(q, s, below(chance, threats), 1 + below(chance, 3), marks)
        chosen = marked(marks)
        inside = np.zeros(threats, np.int64)
        for threat in range(threats):
            inside[threat] = marks[s.pairs[threat, 0]] * marks[s.pairs[threat, 1]]
        hot = 10 ** (-2 + 2 * uniform(chance))
        copy_state(s, trial)
        stiffness = MENDING_STIFFNESS if violation > 0 else STIFFNESS
        reach = reach_m * uniform(chance)
        moves = moves_per_host * chosen.size
        anneal(q, trial, best, chosen, marked(inside), moves, hot, 2e-3, reach, stiffness, chance)
        new_cost, new_violation = totals(q, best)
        if new_violation <= 0 and (violation > 0 or new_cost < cost * 1.05):
            polish(q, best, marks, POLISH_STEPS)
            new_cost, new_violation = totals(q, best)
        if better(new_cost, new_violation, cost * (1 - 1e-9), violation):
            copy_state(best, s)
            cost, violation = new_cost, new_violation
            helped += 1
    return helped
