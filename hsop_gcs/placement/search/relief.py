"""Relief: hosts that are left take views over from shared ones, each at the post that serves the view best."""

import math

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel
from hsop_gcs.placement.search.model import Floats, Ints, Question, edge_energy
from hsop_gcs.placement.search.posts import Posts
from hsop_gcs.placement.search.state import State, new_state, refresh_threat, set_view

Flags = npt.NDArray[np.bool_]


def widened(state: State, hosts: int) -> State:
    """Return a copy with room for so many hosts; those that are added see nothing."""
    threats, count = len(state.pairs), len(state.degree)
    wide = new_state(threats, hosts)
    for name in ("positions", "axes", "rigs", "incident", "degree", "window"):
        getattr(wide, name)[:count] = getattr(state, name)
    for name in ("pairs", "cameras", "cost", "violation"):
        getattr(wide, name)[:] = getattr(state, name)
    return wide


@kernel
def exclude_place(q: Question, posts: Posts, place: Floats, usable: Flags) -> None:
    """Mark the posts as not usable that are too near to a host's place."""
    for post in range(usable.size):
        x, y, z = (
            posts.positions[post, 0] - place[0],
            posts.positions[post, 1] - place[1],
            posts.positions[post, 2] - place[2],
        )
        if math.sqrt(x * x + y * y + z * z) < q.separation_m:
            usable[post] = False


@kernel
def relieve(
    q: Question,
    posts: Posts,
    seen: Ints,
    usable: Flags,
    rigs_left: Ints,
    limits: Floats,
    s: State,
    count: int,
    open_views: Flags,
    most: int,
    exactly: bool,
) -> int:
    """Place up to so many more hosts in ``s``, of which ``count`` are placed; return how many are then.

    Always the costliest threat above its limit gets one that shares a host. exactly: also where it then costs more.
    q: what costs are measured by. seen: as in ``posts``, of the threats of ``s``. open_views: (threats, 2), those that
    are still worth a try.
    """
    for threat in range(s.pairs.shape[0]):
        refresh_threat(q, s, threat)
    added = 0
    while added < most and count < s.degree.shape[0]:
        worst, end, cost = -1, 0, 0.0
        for threat in range(s.pairs.shape[0]):
            for e in range(2):
                shared = s.degree[s.pairs[threat, e]] > 1
                if shared and open_views[threat, e] and s.cost[threat] > max(cost, limits[threat]):
                    worst, end, cost = threat, e, s.cost[threat]
        if worst < 0:
            break
        parent, partner, beside = s.pairs[worst, end], s.pairs[worst, 1 - end], s.cameras[worst, 1 - end]
        least, best, camera = math.inf if exactly else cost, -1, s.cameras[worst, end]
        for post in range(usable.size):
            if not usable[post] or seen[post, worst] == 0 or rigs_left[posts.rigs[post]] == 0:
                continue
            s.positions[count] = posts.positions[post]
            s.axes[count] = posts.axes[post]
            s.rigs[count] = posts.rigs[post]
            tried, violation = edge_energy(
                q, s.positions, s.axes, s.rigs, worst, count, partner, seen[post, worst] - 1, beside
            )
            if violation <= 0 and tried < least:
                least, best, camera = tried, post, seen[post, worst] - 1
        open_views[worst, end] = False
        if best >= 0:
            s.positions[count] = posts.positions[best]
            s.axes[count] = posts.axes[best]
            s.rigs[count] = posts.rigs[best]
        elif exactly and q.separation_m <= 0 and rigs_left[s.rigs[parent]] > 0:
            s.positions[count] = s.positions[parent]
            s.axes[count] = s.axes[parent]
            s.rigs[count] = s.rigs[parent]
        else:
            continue
        set_view(s, worst, end, count, camera)
        refresh_threat(q, s, worst)
        rigs_left[s.rigs[count]] -= 1
        exclude_place(q, posts, s.positions[count], usable)
        count += 1
        added += 1
    return count
