"""A cost that no placement can go below."""

import numpy as np

from hsop_gcs.placement.instance import Instance


def lower_bound(instance: Instance) -> float:
    """Return a lower bound of Eq. 8 over all placements, any number of hosts.

    The sum over threats of what each would cost with two hosts of its own, standing at the safety distance from both of
    its points, whichever camera is sharper, and looking at right angles. Valid: no host may be nearer (Eq. 11), d / α
    only grows with the distance and with the angle off a fisheye's axis, no sine exceeds 1, and sharing hosts between
    threats only adds constraints. Exact for a threat at rest that the central camera can see.
    """
    sharpest = (instance.scale * np.array([[instance.best_relative_size], [1.0]])).max(axis=0)
    factor = instance.safety_distance_m**2 / sharpest
    return float((2 * instance.weights * factor**2).sum())
