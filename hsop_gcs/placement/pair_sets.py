"""Pair sets: which two hosts look at which threat (letter, section IV.A, Algorithm 1; IV.B, Fig. 7).

Hosts and threats are counted from 0 here. A pair set that is still being built covers the first threats only. Hosts
carry identical rigs, so pair sets that differ only in the hosts' names are one: what tells hosts apart is the set of
threats each one observes.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

from scipy.spatial.distance import cdist

PlanePoint = tuple[float, float]
"""East, north, metres."""
Pair = tuple[int, int]
"""The two hosts of a host-threat pair."""
PairSet = tuple[Pair, ...]
"""One pair for each threat, in the threats' order."""


def initial_observers(threats_m: Sequence[PlanePoint], hosts_m: Sequence[PlanePoint]) -> tuple[int, ...]:
    """Return each threat's initial observer: the nearest host that no threat before it has taken.

    With fewer hosts than threats the later ones get the nearest host, taken or not.
    """
    distances = cdist(threats_m, hosts_m)
    observers: list[int] = []
    for row in distances:
        free = [host for host in range(len(hosts_m)) if host not in observers]
        observers.append(min(free or range(len(hosts_m)), key=lambda host: (row[host], host)))
    return tuple(observers)


def generate_pairs(n_hosts: int, initial_observer: int) -> list[Pair]:
    """Return the pairs that one threat may have with its initial observer in them (Algorithm 1, lines 1-4)."""
    return [(initial_observer, host) for host in range(n_hosts) if host != initial_observer]


def observed_threats(pair_set: PairSet) -> list[int]:
    """Return for each host, up to the last in use, the set of threats it observes (T^h) as a bit mask."""
    masks = [0] * (1 + max((host for pair in pair_set for host in pair), default=-1))
    for threat, pair in enumerate(pair_set):
        for host in pair:
            masks[host] |= 1 << threat
    return masks


def components(pair_set: PairSet) -> list[tuple[list[int], list[int]]]:
    """Return the connected parts of the host-threat graph, hosts and threats of each; no part shares a host."""
    parts: list[tuple[set[int], list[int]]] = []
    for threat, pair in enumerate(pair_set):
        joined = [part for part in parts if not part[0].isdisjoint(pair)]
        parts = [part for part in parts if part[0].isdisjoint(pair)]
        parts.append((set(pair).union(*(h for h, _ in joined)), sorted([threat, *(t for _, ts in joined for t in ts)])))
    return [(sorted(hosts), threats) for hosts, threats in parts]


def distinct_pairs(pair_set: PairSet, n_hosts: int, n_threats: int) -> Iterator[Pair]:
    """Yield the next threat's pairs, one of each kind that renaming hosts cannot turn into another.

    Only pairs that leave it possible for all ``n_hosts`` to be used by the last threat, and no host beyond them.
    """
    masks = observed_threats(pair_set)
    known = len(masks)
    still_to_come = 2 * (n_threats - len(pair_set) - 1)
    seen: set[tuple[int, int]] = set()
    for first in range(known + 1):
        for second in range(first + 1, known + (2 if first == known else 1)):
            kind = (masks[first] if first < known else 0, masks[second] if second < known else 0)
            used = max(known, second + 1)
            if used > n_hosts or used + still_to_come < n_hosts or tuple(sorted(kind)) in seen:
                continue
            seen.add((min(kind), max(kind)))
            yield first, second


def backtrack(
    n_threats: int,
    branches: Callable[[PairSet], Iterable[Pair]],
    feasible: Callable[[PairSet], bool],
) -> Iterator[PairSet]:
    """Walk the tree of Fig. 7 threat by threat and yield the pair sets at its leaves.

    ``branches`` gives the next threat's pairs; a branch on which ``feasible`` is false is cut with all beyond it.
    """

    def descend(pair_set: PairSet) -> Iterator[PairSet]:
        if len(pair_set) == n_threats:
            yield pair_set
            return
        for pair in branches(pair_set):
            longer = (*pair_set, pair)
            if feasible(longer):
                yield from descend(longer)

    return descend(())


def all_pair_sets(
    n_threats: int, n_hosts: int, feasible: Callable[[PairSet], bool] = lambda _: True
) -> Iterator[PairSet]:
    """Yield every pair set that uses exactly ``n_hosts``, once up to the hosts' names."""
    return backtrack(n_threats, lambda known: distinct_pairs(known, n_hosts, n_threats), feasible)


def observer_pair_sets(
    observers: Sequence[int], n_hosts: int, feasible: Callable[[PairSet], bool] = lambda _: True
) -> Iterator[PairSet]:
    """Yield the letter's own (N_h - 1)^N_t pair sets: a threat's initial observer and any other host (Algorithm 1)."""
    return backtrack(len(observers), lambda known: generate_pairs(n_hosts, observers[len(known)]), feasible)
