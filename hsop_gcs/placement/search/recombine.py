"""Recombination: the hosts of many placements are candidates, and an anneal that needs no geometry chooses among them.

What any two candidates make of every threat is tabulated once. Exchanging one of those chosen then takes a few rows of
the table, a tenth of the time of a move of ``anneal_poses``, and it leads from one good pose to another.
"""

import math

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.chance import State as Chance
from hsop_gcs.placement.search.chance import below, uniform
from hsop_gcs.placement.search.known import NO_POSES
from hsop_gcs.placement.search.model import Floats, Ints, Question
from hsop_gcs.placement.search.neighbourhood import COLD_AGAIN, HARDENING, POLISH_STEPS, STIFFNESS
from hsop_gcs.placement.search.polish import polish
from hsop_gcs.placement.search.poses import VIEW, Sight, anneal_poses, assign, best_pair, look, pair_energy, sight_of
from hsop_gcs.placement.search.state import State, new_state, refresh

Singles = npt.NDArray[np.float32]
"""A table of doubles is twice as large."""

EXCHANGES_PER_HOST, MOST_EXCHANGES = 2_000, 20_000
HOT, COLD, PENALTY = 0.3, 0.01, 30.0
"""First and last temperature, and the price of a violation of 1, relative to the cost of an average threat."""
DEAREST = 6.0
"""No threat counts for more than this, relative to the same: what is dearer is as bad as unseen."""
REFINING_MOVES_PER_HOST, REFINING_HOT, REFINING_REACH_M = 300, 0.03, 5.0


def recombined(q: Question, s: State, known: Floats, mean_cost: float, chance: Chance) -> None:
    """Leave in ``s`` a placement of hosts chosen among known poses, refined and polished.

    known: see ``KnownPoses``. mean_cost: that of a threat in a good placement.
    """
    candidates = new_state(len(q.weight), len(known))
    candidates.positions[:, :2], candidates.axes[:] = known[:, :2], known[:, 2:4]
    sight, views = sight_of(q), np.empty((len(known), len(q.weight), VIEW))
    table = np.empty((len(known), len(known), len(q.weight)), np.float32)
    penalty = PENALTY * mean_cost
    look_around(q, sight, candidates, known[:, 4:].astype(np.int64), views)
    tabulate(q, views, penalty, DEAREST * mean_cost, table)
    chosen = np.array([below(chance, len(known)) for _ in s.degree])
    exchanges = min(EXCHANGES_PER_HOST * len(chosen), MOST_EXCHANGES)
    choose(table, chosen, exchanges, HOT * mean_cost, COLD * mean_cost, chance)
    put_chosen(q, candidates, views[chosen], chosen, penalty, s)
    hosts, moves = np.arange(len(chosen)), REFINING_MOVES_PER_HOST * len(chosen)
    stiff = HARDENING * STIFFNESS
    anneal_poses(
        q, sight, s, hosts, moves, REFINING_HOT, COLD_AGAIN, REFINING_REACH_M, STIFFNESS, stiff, NO_POSES, chance
    )
    polish(q, s, np.ones(len(chosen), np.int64), POLISH_STEPS)


@lean_kernel
def look_around(q: Question, sight: Sight, candidates: State, aims: Ints, views: Floats) -> None:
    """Fill (candidates, threats, VIEW): what every candidate sees."""
    for one in range(views.shape[0]):
        look(q, sight, candidates, aims, one, views[one])


@lean_kernel
def tabulate(q: Question, views: Floats, penalty: float, dearest: float, table: Singles) -> None:
    """Fill (candidates, candidates, threats), its lower half: the energy of a threat seen by two candidates."""
    for one in range(views.shape[0]):
        for other in range(one + 1):
            for threat in range(views.shape[1]):
                energy = dearest
                if penalty * views[one, threat, 6] < dearest and other != one:
                    energy = pair_energy(q, threat, views[one, threat], views[other, threat], penalty, dearest)
                table[one, other, threat] = min(energy, dearest)


@lean_kernel
def energy_of(table: Singles, one: int, other: int, threat: int) -> float:
    """Look it up for two candidates."""
    return float(table[max(one, other), min(one, other), threat])


@lean_kernel
def least_without(table: Singles, chosen: Ints, threat: int, without: int) -> tuple[float, int, int]:
    """Return the least energy of a threat with two of those chosen but one (-1: with any), and which two, by place."""
    least, one, other = math.inf, -1, -1
    for i in range(chosen.size):
        for j in range(i):
            if i != without and j != without:
                energy = energy_of(table, chosen[i], chosen[j], threat)
                if energy < least:
                    least, one, other = energy, i, j
    return least, one, other


@lean_kernel
def fill_rests(table: Singles, chosen: Ints, rests: Singles) -> None:
    """Fill (hosts, threats): the least energy of every threat when one host is taken away."""
    for threat in range(table.shape[2]):
        least, one, other = least_without(table, chosen, threat, -1)
        for host in range(chosen.size):
            rests[host, threat] = least
        for host in (one, other):
            rests[host, threat] = least_without(table, chosen, threat, host)[0]


@lean_kernel
def exchanged(table: Singles, chosen: Ints, rests: Singles, host: int, candidate: int, energies: Singles) -> float:
    """Fill (threats,) with the energies after an exchange of one host for a candidate; return their sum."""
    for threat in range(energies.size):
        energies[threat] = rests[host, threat]
    for other in range(chosen.size):
        if other != host:
            row = table[max(candidate, chosen[other]), min(candidate, chosen[other])]
            for threat in range(energies.size):
                energies[threat] = min(energies[threat], row[threat])
    total = 0.0
    for threat in range(energies.size):
        total += energies[threat]
    return total


@kernel
def choose(table: Singles, chosen: Ints, exchanges: int, hot: float, cold: float, chance: Chance) -> None:
    """Anneal a choice of candidates by exchanging one at a time; the best is left. Temperatures are energies."""
    rests, energies = np.empty((chosen.size, table.shape[2]), np.float32), np.empty(table.shape[2], np.float32)
    best = chosen.copy()
    energy = least = math.inf
    fill_rests(table, chosen, rests)
    for n in range(exchanges):
        temperature = hot * (cold / hot) ** (n / exchanges)
        host, candidate = below(chance, chosen.size), below(chance, table.shape[0])
        total = exchanged(table, chosen, rests, host, candidate, energies)
        if total <= energy - temperature * math.log(uniform(chance) + 1e-300):
            chosen[host], energy = candidate, total
            fill_rests(table, chosen, rests)
            if energy < least:
                least = energy
                best[:] = chosen
    chosen[:] = best


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
