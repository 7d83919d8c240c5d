"""Recombination: the hosts of many placements, and poses with long views, are candidates, and an anneal that needs no
geometry chooses among them.

What any two candidates make of every threat is tabulated once. What an exchange of any one of those chosen for another
candidate would cost is then a few rows of the table, and it leads from one good pose to another.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.known import NO_POSES
from hsop_gcs.placement.search.long_views import long_views
from hsop_gcs.placement.search.model import SMALLEST_SINE, Floats, Ints, Question, pair_cost, threat_cost
from hsop_gcs.placement.search.neighbourhood import COLD_AGAIN, HARDENING, POLISH_STEPS, STIFFNESS
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.poses import VIEW, Sight, anneal_poses, assign, best_pair, look, sight_of
from hsop_gcs.placement.search.state import State, new_state, refresh, totals

Singles = npt.NDArray[np.float32]
"""A table of doubles is twice as large."""

MOST_CHOICES, SIZE_OF_ONE = 4, 600
"""How many from one table: fewer where threats times hosts are many. All but the first avoid the place of one host of
the placement that is to be bettered."""
AVOIDED_M = 8.0
EXCHANGES_PER_HOST, MOST_EXCHANGES = 400, 4_000
HOT, COLD, PENALTY = 0.5, 0.2, 8.0
"""First and last temperature, and the price of a violation of 1, relative to the cost of an average threat."""
SLACK = 0.05
"""Violations up to this cost nothing: where candidates stand is not quite where they would beside each other."""
DEAREST = 12.0
"""No threat counts for more than this, relative to the average one: what is dearer is as bad as unseen."""
REFINING_MOVES_PER_HOST, REFINING_HOT, REFINING_REACH_M = 150, 0.03, 5.0
PROMISING_CHOICE = 1.03
"""What is refined to within this factor of the cost of the placement that is to be bettered is polished."""


def recombined(q: Question, home: State, known: Floats, chance: Chance) -> list[State]:
    """Return placements of hosts chosen among known poses and some with long views, refined; those that may be better
    than ``home`` polished.

    known: see ``KnownPoses``; at least one.
    """
    threats, hosts, cost = len(q.weight), np.arange(len(home.degree)), float(home.cost.sum())
    average, sight = cost / threats, sight_of(q)
    known = np.vstack((known, long_views(q, sight, chance)))
    candidates = new_state(threats, len(known))
    candidates.positions[:, :2], candidates.axes[:] = known[:, :2], known[:, 2:4]
    views = np.empty((len(known), threats, VIEW))
    look_around(q, sight, candidates, known[:, 4:].astype(np.int64), views)
    views[:, :, 6] = np.maximum(0.0, views[:, :, 6] - SLACK)
    table, penalty = np.empty((len(known), len(known), threats), np.float32), PENALTY * average
    tabulate(q, np.ascontiguousarray(views.transpose(1, 2, 0)), penalty, DEAREST * average, table)
    exchanges = min(EXCHANGES_PER_HOST * len(hosts), MOST_EXCHANGES)
    moves, stiff = REFINING_MOVES_PER_HOST * len(hosts), HARDENING * STIFFNESS
    choices = max(1, min(MOST_CHOICES, SIZE_OF_ONE // (threats * len(hosts))))
    found = [new_state(threats, len(hosts)) for _ in range(choices)]
    for n, s in enumerate(found):
        away = np.hypot(*(known[:, :2] - home.positions[below(chance, len(hosts)), :2]).T) > AVOIDED_M
        allowed = np.flatnonzero(away) if n > 0 and away.any() else np.arange(len(known))
        chosen = np.array([allowed[below(chance, len(allowed))] for _ in hosts])
        choose(table, allowed, chosen, exchanges, HOT * average, COLD * average, chance)
        put_chosen(q, candidates, views[chosen], chosen, penalty, s)
        anneal_poses(
            q, sight, s, hosts, moves, REFINING_HOT, COLD_AGAIN, REFINING_REACH_M, STIFFNESS, stiff, NO_POSES, chance
        )
        refined, violation = totals(q, s)
        if violation <= 0 and refined < PROMISING_CHOICE * cost:
            polish(q, s, np.ones(len(hosts), np.int64), POLISH_STEPS)
    return found


@lean_kernel
def look_around(q: Question, sight: Sight, candidates: State, aims: Ints, views: Floats) -> None:
    """Fill (candidates, threats, VIEW): what every candidate sees."""
    for one in range(views.shape[0]):
        look(q, sight, candidates, aims, one, views[one])


@lean_kernel
def fill_line(q: Question, threat: int, one: int, views: Floats, penalty: float, line: Floats) -> None:
    """Fill the first ``one`` of (candidates,): the energy of a threat seen by a candidate and every one before it.

    views: (VIEW, candidates) of this threat. Without branches, so that it is compiled for many candidates at a time.
    """
    a, b, violation = views[0, one], views[1, one], views[6, one]
    ex, ey, gx, gy = views[2, one], views[3, one], views[4, one], views[5, one]
    for other in range(one):
        first = max(abs(ex * views[3, other] - ey * views[2, other]), SMALLEST_SINE)
        second = max(abs(gx * views[5, other] - gy * views[4, other]), SMALLEST_SINE)
        both = pair_cost(q, a, views[0, other], first) + pair_cost(q, b, views[1, other], second)
        line[other] = threat_cost(q, threat, both) + penalty * (violation + views[6, other])


@kernel
def tabulate(q: Question, views: Floats, penalty: float, dearest: float, table: Singles) -> None:
    """Fill (candidates, candidates, threats), its lower half: the energy of a threat seen by two candidates.

    views: (threats, VIEW, candidates)
    """
    line = np.empty(views.shape[2])
    for threat in range(views.shape[0]):
        for one in range(views.shape[2]):
            fill_line(q, threat, one, views[threat], penalty, line)
            for other in range(one):
                table[one, other, threat] = min(line[other], dearest)
            table[one, one, threat] = dearest


class Chosen(NamedTuple):
    """Some candidates, and what every threat costs with the two of them that serve it best."""

    candidates: Ints
    """(hosts,)"""
    table: Singles
    """(threats, hosts, hosts), lower half: their part of the table."""
    pairs: Ints
    """(threats, 2): which two serve it best."""
    energy: Singles
    """(threats,)"""
    rests: Singles
    """(threats, 2): its least energy without the one or the other of the two."""
    needed: Ints
    """(threats,): a bit for every host, modulo 64, on which these numbers depend, and perhaps for others."""


@lean_kernel
def bits(one: int, other: int) -> int:
    """Return a bit for each of two hosts, modulo 64."""
    return 1 << (one & 63) | 1 << (other & 63)


@lean_kernel
def settle(chosen: Chosen, threat: int) -> None:
    """Fill what a threat costs, from the table."""
    table = chosen.table[threat]
    least, one, other = np.float32(math.inf), 1, 0
    for i in range(1, table.shape[0]):
        for j in range(i):
            if table[i, j] < least:
                least, one, other = table[i, j], i, j
    without_one = without_other = np.float32(math.inf)
    needed = first = second = bits(one, other)
    for i in range(1, table.shape[0]):
        for j in range(i):
            energy = table[i, j]
            if energy < without_one and i != one and j != one:
                without_one, first = energy, bits(i, j)
            if energy < without_other and i != other and j != other:
                without_other, second = energy, bits(i, j)
    chosen.pairs[threat, 0], chosen.pairs[threat, 1] = one, other
    chosen.energy[threat] = least
    chosen.rests[threat, 0], chosen.rests[threat, 1] = without_one, without_other
    chosen.needed[threat] = needed | first | second


@lean_kernel
def best_exchange(table: Singles, chosen: Chosen, candidate: int, rows: Singles, totals: Singles) -> tuple[float, int]:
    """Return the least energy when a candidate takes the place of one of those chosen, and of which.

    Fills rows, (hosts, threats): the candidate's energies with each of them; totals is scratch, (hosts,).
    """
    hosts = chosen.candidates.size
    for host in range(hosts):
        totals[host] = 0.0
        row = table[max(candidate, chosen.candidates[host]), min(candidate, chosen.candidates[host])]
        for threat in range(rows.shape[1]):
            rows[host, threat] = row[threat]
    base = np.float32(0.0)
    for threat in range(rows.shape[1]):
        least = second = np.float32(math.inf)
        partner = 0
        for host in range(hosts):
            energy = rows[host, threat]
            if energy < least:
                second, least, partner = least, energy, host
            elif energy < second:
                second = energy
        energy = min(chosen.energy[threat], least)
        base += energy
        one, other = chosen.pairs[threat, 0], chosen.pairs[threat, 1]
        totals[one] += min(chosen.rests[threat, 0], second if one == partner else least) - energy
        totals[other] += min(chosen.rests[threat, 1], second if other == partner else least) - energy
        if partner != one and partner != other:
            totals[partner] += min(chosen.energy[threat], second) - energy
    best = 0
    for host in range(hosts):
        if totals[host] < totals[best]:
            best = host
    return float(base + totals[best]), best


@lean_kernel
def exchange(chosen: Chosen, host: int, candidate: int, rows: Singles) -> float:
    """Put a candidate in the place of one of those chosen; return the whole energy. rows: see ``best_exchange``."""
    chosen.candidates[host] = candidate
    total = 0.0
    for threat in range(rows.shape[1]):
        stale = chosen.needed[threat] & bits(host, host) != 0
        for partner in range(rows.shape[0]):
            if partner == host:
                continue
            energy = rows[partner, threat]
            chosen.table[threat, max(host, partner), min(host, partner)] = energy
            stale |= energy < chosen.energy[threat]
            for k in range(2):
                if energy < chosen.rests[threat, k] and partner != chosen.pairs[threat, k]:
                    chosen.rests[threat, k] = energy
                    chosen.needed[threat] |= bits(host, partner)
        if stale:
            settle(chosen, threat)
        total += chosen.energy[threat]
    return total


@kernel
def chosen_of(table: Singles, candidates: Ints) -> Chosen:
    """Return what some candidates cost."""
    count, threats = candidates.size, table.shape[2]
    chosen = Chosen(
        candidates.copy(),
        np.empty((threats, count, count), np.float32),
        np.empty((threats, 2), np.int64),
        np.empty(threats, np.float32),
        np.empty((threats, 2), np.float32),
        np.empty(threats, np.int64),
    )
    for threat in range(threats):
        for i in range(count):
            for j in range(i):
                one, other = candidates[i], candidates[j]
                chosen.table[threat, i, j] = table[max(one, other), min(one, other), threat]
        settle(chosen, threat)
    return chosen


@kernel
def choose(
    table: Singles, allowed: Ints, candidates: Ints, exchanges: int, hot: float, cold: float, chance: Chance
) -> None:
    """Anneal a choice of candidates, exchanging one at a time for one of those allowed; the best is left.

    Temperatures are energies.
    """
    chosen = chosen_of(table, candidates)
    rows, totals = np.empty((candidates.size, table.shape[2]), np.float32), np.empty(candidates.size, np.float32)
    energy = least = float(chosen.energy.sum())
    for n in range(exchanges):
        temperature = hot * (cold / hot) ** (n / exchanges)
        candidate = allowed[below(chance, allowed.size)]
        total, host = best_exchange(table, chosen, candidate, rows, totals)
        if total <= energy - temperature * math.log(uniform(chance) + 1e-300):
            energy = exchange(chosen, host, candidate, rows)
            if energy < least:
                least = energy
                candidates[:] = chosen.candidates


@kernel
def put_chosen(q: Question, candidates: State, views: Floats, chosen: Ints, penalty: float, s: State) -> None:
    """Put the hosts of ``s`` where those chosen stand, with the pairs and cameras that fit all; ``views``: theirs."""
    pairs = np.empty((q.weight.size, 2), np.int64)
    for host in range(chosen.size):
        s.positions[host] = candidates.positions[chosen[host]]
        s.axes[host] = candidates.axes[chosen[host]]
    for threat in range(q.weight.size):
        _, pairs[threat, 0], pairs[threat, 1] = best_pair(q, threat, views, -1, penalty, math.inf)
    assign(s, views, pairs)
    refresh(q, s)
