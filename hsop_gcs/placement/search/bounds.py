"""What no placement can beat: a cost, and a number of hosts."""

import itertools
import math

import numpy as np

from hsop_gcs.placement.search.model import Question


def lower_bound(q: Question) -> float:
    """Return a cost that no placement goes below, whatever the number of hosts.

    The sum over threats of what each would cost with two hosts at the safety distance from both of its points, the
    sharper camera, right angles. Sharing hosts between threats only adds constraints.
    """
    factor = (q.factor * (q.safety_m if q.rms else q.safety_m**2)).min(axis=0)
    if q.rms:
        return float((q.weight * np.sqrt(2.5 * factor**2)).sum())
    return float((q.weight * 2 * factor**2).sum())


def fewest_hosts(q: Question) -> int:
    """Return a number of hosts that no placement can do with less.

    Two threats with points farther apart than the sum of their ranges share no host; each of a set of such threats
    needs two of its own. The set is grown greedily from every threat.
    """
    reach = q.range_m.max(axis=0)
    count = len(reach)
    apart = np.zeros((count, count), dtype=bool)
    for i, j in itertools.combinations(range(count), 2):
        widest = max(math.dist(a, b) for a in q.points_m[i] for b in q.points_m[j])
        apart[i, j] = apart[j, i] = widest > reach[i] + reach[j]
    largest = 1
    for first in range(count):
        group = [first]
        for other in np.argsort(-apart.sum(axis=1), kind="stable"):
            if all(apart[other, member] for member in group):
                group.append(int(other))
        largest = max(largest, len(group))
    return 2 * largest
