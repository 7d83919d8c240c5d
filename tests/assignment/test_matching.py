"""Who flies where, against brute force."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hsop_gcs.assignment import assign

lengths = st.one_of(st.integers(0, 30).map(float), st.just(np.inf))
tables = st.integers(1, 4).flatmap(
    lambda points: st.integers(points, 5).flatmap(
        lambda hosts: hnp.arrays(np.float64, (hosts, points), elements=lengths)
    )
)


@given(tables)
def test_no_assignment_has_a_shorter_longest_flight_or_less_total_at_the_same(flight_m: np.ndarray) -> None:
    hosts, points = flight_m.shape
    possible = [
        (max(legs), sum(legs))
        for chosen in itertools.permutations(range(hosts), points)
        if np.isfinite(legs := [flight_m[host, point] for point, host in enumerate(chosen)]).all()
    ]
    found = assign(flight_m)
    if not possible:
        assert found is None
        return
    assert found is not None
    assert len(set(found)) == points
    legs = [flight_m[host, point] for point, host in enumerate(found)]
    assert (max(legs), sum(legs)) == min(possible)


def test_more_points_than_hosts_cannot_be_assigned() -> None:
    assert assign(np.ones((2, 3))) is None
