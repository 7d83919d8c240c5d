"""How far a picture is from the truth: the generalised optimal sub-pattern assignment metric.

Source: Rahmathullah, Garcia-Fernandez and Svensson, Generalized optimal sub-pattern assignment metric, 2017.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

CUT_OFF_M = 10.0
Position = Sequence[float]


def gospa_m(truths_m: Sequence[Position], tracks_m: Sequence[Position]) -> float:
    """Return GOSPA, p = 2, alpha = 2, metres; a threat missed, or a track of none, costs half the square of 10 m."""
    count = len(truths_m) + len(tracks_m)
    if not truths_m or not tracks_m:
        return float(np.sqrt(count * CUT_OFF_M**2 / 2))
    apart_m = np.linalg.norm(np.array(truths_m)[:, None, :] - np.array(tracks_m)[None, :, :], axis=2)
    cost = np.minimum(apart_m, CUT_OFF_M) ** 2
    rows, columns = linear_sum_assignment(cost)
    close = apart_m[rows, columns] < CUT_OFF_M
    unmatched = count - 2 * int(close.sum())
    return float(np.sqrt(cost[rows, columns][close].sum() + unmatched * CUT_OFF_M**2 / 2))
