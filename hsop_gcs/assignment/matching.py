"""Who flies where: the longest flight as short as possible, and the rest short as well."""

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

FloatArray = npt.NDArray[np.float64]


def assign(flight_m: FloatArray) -> list[int] | None:
    """Return the host for each hover point, or None if there is no assignment.

    flight_m: (hosts, points), metres; infinity where a flight must not be made. Minimizes the longest flight (a
    bottleneck search over the lengths that occur), then the total among the assignments that keep to it.
    """
    hosts, points = flight_m.shape
    if points > hosts:
        return None
    lengths = np.unique(flight_m[np.isfinite(flight_m)])
    low, high = 0, len(lengths)
    while low < high:
        middle = (low + high) // 2
        if _within(flight_m, lengths[middle]) is None:
            low = middle + 1
        else:
            high = middle
    return None if low == len(lengths) else _within(flight_m, lengths[low])


def _within(flight_m: FloatArray, longest_m: float) -> list[int] | None:
    """The assignment of least total length in which no flight is longer than ``longest_m``; None if there is none."""
    allowed = flight_m <= longest_m
    forbidden = float(np.sum(flight_m[allowed])) + 1.0
    rows, columns = linear_sum_assignment(np.where(allowed, flight_m, forbidden))
    if not allowed[rows, columns].all():
        return None
    host_of = dict(zip(columns.tolist(), rows.tolist(), strict=True))
    return [host_of[point] for point in range(flight_m.shape[1])]
