"""Pair sets against brute force, and the letter's own examples."""

from itertools import combinations, permutations, product

import pytest

from hsop_gcs.placement.pair_sets import (
    PairSet,
    all_pair_sets,
    components,
    generate_pairs,
    initial_observers,
    observed_threats,
    observer_pair_sets,
)


def orbits(n_threats: int, n_hosts: int) -> set[frozenset[tuple[frozenset[int], ...]]]:
    """All pair sets that use every host, gathered by renaming hosts in every way."""
    found = set()
    for pairs in product([frozenset(p) for p in combinations(range(n_hosts), 2)], repeat=n_threats):
        if len(frozenset().union(*pairs)) == n_hosts:
            found.add(
                frozenset(
                    tuple(frozenset(names[host] for host in pair) for pair in pairs)
                    for names in permutations(range(n_hosts))
                )
            )
    return found


@pytest.mark.parametrize(("n_threats", "n_hosts"), [(t, h) for t in (1, 2, 3) for h in range(2, 2 * t + 1)] + [(4, 4)])
def test_every_pair_set_appears_once_up_to_the_names_of_hosts(n_threats: int, n_hosts: int) -> None:
    expected = orbits(n_threats, n_hosts)
    generated = [tuple(frozenset(pair) for pair in pair_set) for pair_set in all_pair_sets(n_threats, n_hosts)]
    assert len(generated) == len(expected)
    assert all(any(pair_set in orbit for pair_set in generated) for orbit in expected)


def test_no_pair_set_uses_more_than_two_hosts_per_threat() -> None:
    assert list(all_pair_sets(2, 5)) == []


def test_three_threats_and_four_hosts_give_the_letters_27_pair_sets() -> None:
    assert len(set(observer_pair_sets((0, 1, 2), 4))) == 27


@pytest.mark.parametrize(("n_threats", "n_hosts"), [(1, 2), (2, 3), (3, 5), (4, 3)])
def test_initial_observers_give_all_but_one_hosts_to_the_power_of_threats(n_threats: int, n_hosts: int) -> None:
    observers = tuple(threat % n_hosts for threat in range(n_threats))
    assert len(list(observer_pair_sets(observers, n_hosts))) == (n_hosts - 1) ** n_threats


def test_two_threats_and_three_hosts_give_the_four_pair_sets_of_section_iv_a() -> None:
    assert set(observer_pair_sets((0, 1), 3)) == {
        ((0, 1), (1, 0)),
        ((0, 1), (1, 2)),
        ((0, 2), (1, 0)),
        ((0, 2), (1, 2)),
    }


def test_a_pruned_branch_is_not_followed_further_as_in_fig_7() -> None:
    examined: list[PairSet] = []

    def feasible(pair_set: PairSet) -> bool:
        examined.append(pair_set)
        return pair_set[:2] != ((0, 1), (1, 0))

    left = list(observer_pair_sets((0, 1, 2), 4, feasible))
    assert len(left) == 27 - 3
    assert [len(p) for p in examined].count(2) == 9
    assert not [p for p in examined if len(p) == 3 and p[:2] == ((0, 1), (1, 0))]


def test_algorithm_1_pairs_the_initial_observer_with_every_other_host() -> None:
    assert generate_pairs(4, 2) == [(2, 0), (2, 1), (2, 3)]


def test_a_threat_is_first_observed_by_the_nearest_host_that_is_still_free() -> None:
    assert initial_observers([(0.0, 0.0), (1.0, 0.0), (50.0, 0.0)], [(2.0, 0.0), (9.0, 0.0), (60.0, 0.0)]) == (0, 1, 2)


def test_with_fewer_hosts_than_threats_the_later_threats_share_the_nearest() -> None:
    assert initial_observers([(0.0, 0.0), (10.0, 0.0), (1.0, 0.0)], [(0.0, 1.0), (10.0, 1.0)]) == (0, 1, 0)


def test_hosts_are_told_apart_by_the_threats_they_observe() -> None:
    assert observed_threats(((0, 1), (1, 2), (1, 0))) == [0b101, 0b111, 0b010]


def test_parts_of_the_graph_share_no_host() -> None:
    assert sorted(components(((0, 1), (2, 3), (1, 4), (2, 3)))) == [([0, 1, 4], [0, 2]), ([2, 3], [1, 3])]
