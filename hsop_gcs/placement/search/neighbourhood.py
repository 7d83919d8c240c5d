"""Large-neighbourhood search: anneal a few hosts near one or two threats again, or put one across a path; keep what is
better.

Plain Python on top of kernels: calling one takes microseconds, and whatever contains ``anneal`` and ``polish`` would
compile them once more.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from hsop_gcs.geometry.compiled import kernel
from hsop_gcs.placement.search.anneal import anneal, scatter
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.known import NO_POSES, poses_about
from hsop_gcs.placement.search.model import Floats, Ints, Question, edge_energy
from hsop_gcs.placement.search.moves import jump, keep_clear, mirror
from hsop_gcs.placement.search.parts import Part, groups, put_together, question_about
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.poses import anneal_poses, decided_by_poses, shares_nothing, sight_of
from hsop_gcs.placement.search.state import State, copied, copy_state, new_state, refresh, set_view, totals

POLISH_STEPS = 80
STIFFNESS = 15.0
HARDENING = 100.0
"""By how much penalties grow during an anneal over poses."""
HOT, COLD = 0.5, 1e-3
"""First and last temperature of anneals from random poses."""
COLD_AGAIN = 2e-3
"""Last temperature of anneals of what was good before."""
MENDING_STIFFNESS = 60.0
"""Of penalties while no placement keeps every rule: cost matters little then."""
MENDING_STIFFNESS_OF_POSES = 200.0
"""The same for anneals over poses: where two hosts see eight threats, 3 of 4 then keep every rule, else none."""
OTHER_SIDE, OVER_POSES = 0.15, 0.55
"""Of a draw for every trial: below the first a host goes to the other side of a threat's path, below the second poses
are annealed, where that holds."""
TRANSFERS = 0.6
"""Share of the others that begin by giving a host to another threat."""
COOLEST, HOTTEST = -1.5, 0.0
"""First temperatures, as powers of ten."""
PROMISING = 0.02
"""What is annealed to within this share of its former cost is polished."""
SAME_PLACE_M = 0.7
MOST_TOGETHER = 4
"""How many threats ``gathered`` takes at most."""
JOINT = 0.5
"""Share of the parts grown again that take another one beside them in."""
GROWING_MOVES = 1_000
"""For each threat of what is annealed by itself."""
MOST_POSES, MOST_POLISHED = 1_500, 48
"""Threats times hosts up to which poses are annealed, and hosts that are polished together: beyond, both take long."""

Found = tuple[State, Sequence[int]]
"""A placement and the numbers of the threats it has."""


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


def starts_quickly(q: Question, s: State) -> bool:
    """Whether ``fresh`` takes few moves: over poses alone, or threat by threat."""
    return decided_by_poses(q, s) or shares_nothing(q, s)


def fresh(
    q: Question,
    s: State,
    trial: State,
    moves: int,
    reach_m: float,
    known: Floats,
    chance: Chance,
    *,
    mending: bool = False,
) -> None:
    """Anneal an empty state from random poses, leaving the polished result in ``s``.

    known: poses of which some are tried again. mending: others kept breaking rules.
    """
    hosts, threats = np.arange(s.degree.shape[0]), np.arange(s.pairs.shape[0])
    if shares_nothing(q, s):
        alone = []
        for threat in range(threats.size):
            alone.append(Part((threat,), new_state(1, 2)))
            own = question_about(q, [threat])
            fresh(own, alone[-1].state, new_state(1, 2), moves // threats.size, reach_m, NO_POSES, chance)
        copy_state(put_together(q, alone), s)
        return
    if decided_by_poses(q, s):
        scatter(q, s, chance)
        soft = MENDING_STIFFNESS_OF_POSES if mending else STIFFNESS
        anneal_poses(q, sight_of(q), s, hosts, moves, HOT, COLD, reach_m, soft, HARDENING * soft, known, chance)
    else:
        scatter(q, trial, chance)
        anneal(q, trial, s, hosts, threats, moves, HOT, COLD, reach_m, STIFFNESS, chance)
    polish(q, s, np.ones(hosts.size, np.int64), POLISH_STEPS)


def shake(q: Question, s: State, trial: State, moves: int, hot: float, reach_m: float, chance: Chance) -> None:
    """Anneal all of ``trial`` again from a moderate temperature, leaving the polished result in ``s``."""
    hosts = np.arange(s.degree.shape[0])
    anneal(q, trial, s, hosts, np.arange(s.pairs.shape[0]), moves, hot, COLD, reach_m, MENDING_STIFFNESS, chance)
    polish(q, s, np.ones(hosts.size, np.int64), POLISH_STEPS)


@kernel
def hand_over(q: Question, s: State, host: int, marks: Ints, price: float) -> bool:
    """Give each view of a host to the marked one that bears it best; False, and ``s`` spoilt, if there is none."""
    while s.degree[host] > 0:
        threat, end = s.incident[host, 0] // 2, s.incident[host, 0] % 2
        partner, beside = s.pairs[threat, 1 - end], s.cameras[threat, 1 - end]
        least, heir, with_camera = math.inf, -1, 0
        for other in range(s.degree.shape[0]):
            if marks[other] == 0 or other in (host, partner):
                continue
            for camera in range(2):
                cost, violation = edge_energy(q, s.positions, s.axes, s.rigs, threat, other, partner, camera, beside)
                if cost + price * violation < least:
                    least, heir, with_camera = cost + price * violation, other, camera
        if heir < 0:
            return False
        set_view(s, threat, end, heir, with_camera)
    return True


def transfer(q: Question, s: State, threat: int, marks: Ints, chance: Chance) -> bool:
    """Take a host from what it sees, wherever it is, and give it one view of a threat; False if that fails.

    Marks the hosts that this concerns; ``s`` is spoilt if it fails. Only a threat that shares a host is given one.
    """
    end = below(chance, 2)
    if s.degree[s.pairs[threat, end]] == 1:
        end = 1 - end
    if s.degree[s.pairs[threat, end]] == 1:
        return False
    host = below(chance, s.degree.shape[0])
    if host in (s.pairs[threat, 0], s.pairs[threat, 1]):
        return False
    left = s.incident[host, below(chance, s.degree[host])] // 2
    mark_nearest(q, s, left, below(chance, 3), marks)
    marks[host] = 1
    if not hand_over(q, s, host, marks, STIFFNESS * s.cost.mean()):
        return False
    set_view(s, threat, end, host, below(chance, 2))
    jump(q, s, host, threat, end, chance)
    keep_clear(q, s, host)
    refresh(q, s)
    return True


@kernel
def cross(q: Question, s: State, threat: int, end: int) -> None:
    """Put one host of a threat on the other side of its path."""
    host = s.pairs[threat, end]
    mirror(q, s, host, threat, end)
    keep_clear(q, s, host)
    refresh(q, s)


def same_place(s: State, other: State) -> bool:
    """Return whether two states see every threat alike, with all hosts in nearly the same places."""
    alike = np.array_equal(s.pairs, other.pairs) and np.array_equal(s.cameras, other.cameras)
    return alike and bool(np.abs(s.positions - other.positions).max() < SAME_PLACE_M)


def grown(q: Question, threats: list[int], hosts: int, reach_m: float, known: Floats, chance: Chance) -> Found:
    """Anneal some threats by themselves from random poses, with so many hosts if that is two or more and there are."""
    count = min(max(2, hosts), 2 * len(threats), int(q.hosts_of_rig.sum()))
    state, trial = new_state(len(threats), count), new_state(len(threats), count)
    moves, poses = GROWING_MOVES * len(threats), poses_about(known, threats)
    fresh(question_about(q, threats), state, trial, moves, reach_m, poses, chance)
    return state, threats


def gathered(q: Question, reach_m: float, chance: Chance) -> Found:
    """Anneal a few threats that are near one another, as if there were no others."""
    places = q.points_m.mean(axis=1)
    away = np.abs(places - places[below(chance, len(places))]).sum(axis=1)
    count = min(2 + below(chance, MOST_TOGETHER - 1), len(places))
    first, *near = np.argsort(away, kind="stable")[: count + 2].tolist()
    threats = sorted([first, *(near.pop(below(chance, len(near))) for _ in range(count - 1))])
    return grown(q, threats, 2 + below(chance, count), reach_m, NO_POSES, chance)


def regrown(q: Question, s: State, reach_m: float, known: Floats, chance: Chance) -> Found:
    """Anneal a part of ``s``, or two beside each other, from random poses, with as many hosts or one more or less."""
    apart = list(groups(s))
    threat = costlier(s, chance)
    threats, hosts = apart.pop(next(n for n, (threats, _) in enumerate(apart) if threat in threats))
    if apart and uniform(chance) < JOINT:
        away = np.abs(q.points_m.mean(axis=1) - q.points_m[threat].mean(axis=0)).sum(axis=1)
        beside, more = min(apart, key=lambda other: float(away[other[0]].min()))
        threats, hosts = sorted(threats + beside), hosts + more
    return grown(q, threats, len(hosts) + below(chance, 3) - 1, reach_m, known, chance)


def improve(
    q: Question,
    s: State,
    trial: State,
    best: State,
    rounds: int,
    moves_per_host: int,
    reach_m: float,
    known: Floats,
    chance: Chance,
    found: list[Found],
    late: Callable[[], bool] = lambda: False,
) -> int:
    """Anneal neighbourhoods of ``s`` again, ``rounds`` times; whatever is polished goes to ``found`` too.

    late: whether to stop before. Returns how many rounds helped.
    """
    threats, hosts = s.pairs.shape[0], s.degree.shape[0]
    sight = sight_of(q) if decided_by_poses(q, s) and threats * hosts <= MOST_POSES else None
    cost, violation = totals(q, s)
    helped = 0
    for _ in range(rounds):
        if late():
            break
        marks = np.zeros(hosts, np.int64)
        threat = costlier(s, chance)
        mark_nearest(q, s, threat, 2 + below(chance, 4), marks)
        hot = 10 ** (COOLEST + (HOTTEST - COOLEST) * uniform(chance))
        stiffness = MENDING_STIFFNESS if violation > 0 else STIFFNESS
        kind = uniform(chance)
        if kind < OTHER_SIDE:
            most = math.inf
            copy_state(s, best)
            cross(q, best, threat, below(chance, 2))
            if hosts <= MOST_POLISHED:
                marks[:] = 1
        elif kind < OVER_POSES and sight is not None:
            most = cost * (1 + PROMISING)
            copy_state(s, best)
            chosen, stiff = marked(marks), HARDENING * stiffness
            moves = moves_per_host * chosen.size
            anneal_poses(q, sight, best, chosen, moves, hot, COLD_AGAIN, reach_m, stiffness, stiff, known, chance)
            marks[:] = 1  # others may see something else now
        else:
            copy_state(s, trial)
            if uniform(chance) < TRANSFERS:
                if not transfer(q, trial, threat, marks, chance):
                    copy_state(s, trial)
            elif uniform(chance) < 0.5:
                mark_nearest(q, s, below(chance, threats), 1 + below(chance, 3), marks)
            chosen = marked(marks)
            inside = marked(marks[trial.pairs].min(axis=1))
            most = cost + PROMISING * s.cost[inside].sum()
            moves = moves_per_host * chosen.size
            reach = reach_m * uniform(chance)
            anneal(q, trial, best, chosen, inside, moves, hot, COLD_AGAIN, reach, stiffness, chance)
        new_cost, new_violation = totals(q, best)
        promising = new_violation <= 0 and (violation > 0 or new_cost < most)
        if promising and not (violation <= 0 and new_cost >= cost and same_place(s, best)):
            polish(q, best, marks, POLISH_STEPS)
            new_cost, new_violation = totals(q, best)
            found.append((copied(best), range(threats)))
        if better(new_cost, new_violation, cost * (1 - 1e-9), violation):
            copy_state(best, s)
            cost, violation = new_cost, new_violation
            helped += 1
    return helped
