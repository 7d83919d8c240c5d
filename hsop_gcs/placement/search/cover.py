"""A choice of posts that sees as much as so many hosts can, the most valuable first: greedy, in small steps."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.model import Floats, Ints, Question, edge_energy
from hsop_gcs.placement.search.posts import Posts
from hsop_gcs.placement.search.state import State, new_state, refresh, set_view, totals

LEAST_SINE = 0.15
"""The least sine of the angle at which two posts see a threat."""
LESS_VALUABLE = 1e-3
"""What a threat counts for while there are more valuable ones to be seen."""
NEARNESS = 0.9
"""By how much the threat nearest to the hosts counts more than the farthest."""
PAIRED = 140
"""How many posts of a threat are looked at in pairs: those that see most."""

Late = Callable[[], bool]
Flags = npt.NDArray[np.bool_]


@lean_kernel
def crossing(q: Question, posts: Posts, one: int, other: int, threat: int) -> bool:
    """Return whether two posts see both points of a threat at an angle that is worth something."""
    for k in range(2):
        px, py, pz = q.points_m[threat, k, 0], q.points_m[threat, k, 1], q.points_m[threat, k, 2]
        ex, ey, ez = px - posts.positions[one, 0], py - posts.positions[one, 1], pz - posts.positions[one, 2]
        gx, gy, gz = px - posts.positions[other, 0], py - posts.positions[other, 1], pz - posts.positions[other, 2]
        inner = ex * gx + ey * gy + ez * gz
        square = (ex * ex + ey * ey + ez * ez) * (gx * gx + gy * gy + gz * gz)
        if inner * inner > (1 - LEAST_SINE * LEAST_SINE) * square:
            return False
    return True


@lean_kernel
def apart(q: Question, posts: Posts, one: int, other: int) -> bool:
    """Return whether hosts may hover at two posts at the same time."""
    x = posts.positions[one, 0] - posts.positions[other, 0]
    y = posts.positions[one, 1] - posts.positions[other, 1]
    z = posts.positions[one, 2] - posts.positions[other, 2]
    return bool(math.sqrt(x * x + y * y + z * z) >= q.separation_m)


@kernel
def worth_of(posts: Posts, usable: Flags, values: Floats) -> Floats:
    """Return for each usable post what all threats are worth that are seen from it."""
    worth = np.zeros(usable.size)
    for post in range(usable.size):
        if usable[post]:
            for threat in range(values.size):
                if posts.seen[post, threat] > 0:
                    worth[post] += values[threat]
    return worth


@kernel
def best_single(q: Question, posts: Posts, usable: Flags, chosen: Ints, values: Floats) -> tuple[float, int]:
    """Return what the post gains that sees most together with those chosen, and which it is; -1: none gains."""
    best, post = 0.0, -1
    for one in range(usable.size):
        if not usable[one]:
            continue
        gain = 0.0
        for threat in range(values.size):
            if values[threat] <= 0 or posts.seen[one, threat] == 0:
                continue
            for other in chosen:
                if posts.seen[other, threat] > 0 and crossing(q, posts, one, other, threat):
                    gain += values[threat]
                    break
        if gain > best:
            best, post = gain, one
    return best, post


@kernel
def best_pair(q: Question, posts: Posts, around: Ints, values: Floats, rigs_left: Ints) -> tuple[float, int, int]:
    """Return what the two of some posts gain that see most together, and which they are; -1: no two gain."""
    best, first, second = 0.0, -1, -1
    for i in range(around.size):
        one = around[i]
        for j in range(i):
            other = around[j]
            if posts.rigs[one] == posts.rigs[other] and rigs_left[posts.rigs[one]] < 2:
                continue
            gain = 0.0
            for threat in range(values.size):
                if values[threat] > 0 and posts.seen[one, threat] > 0 and posts.seen[other, threat] > 0:
                    gain += values[threat]
            if gain <= best or not apart(q, posts, one, other):
                continue
            gain = 0.0
            for threat in range(values.size):
                both = values[threat] > 0 and posts.seen[one, threat] > 0 and posts.seen[other, threat] > 0
                if both and crossing(q, posts, one, other, threat):
                    gain += values[threat]
            if gain > best:
                best, first, second = gain, one, other
    return best, first, second


@kernel
def exclude(q: Question, posts: Posts, post: int, usable: Flags) -> None:
    """Mark the posts as not usable that are too near to one where a host hovers, and that one."""
    for other in range(usable.size):
        if usable[other] and (other == post or not apart(q, posts, post, other)):
            usable[other] = False


@kernel
def seen_by(q: Question, posts: Posts, chosen: Ints, covered: Flags) -> None:
    """Mark the threats that two of the chosen posts see."""
    for threat in range(covered.size):
        for i in range(chosen.size):
            if covered[threat] or posts.seen[chosen[i], threat] == 0:
                continue
            for j in range(i):
                if posts.seen[chosen[j], threat] > 0 and crossing(q, posts, chosen[i], chosen[j], threat):
                    covered[threat] = True
                    break


def choose(q: Question, posts: Posts, most: int, weights: Floats, nearness: Floats, late: Late) -> Ints:
    """Return the numbers of at most so many posts.

    weights: (threats,), of which the greatest come first, whatever the number of others. nearness: (threats,), from 0
    to 1, counts among those that weigh alike.
    """
    threats = len(q.weight)
    usable, covered = np.ones(len(posts.rigs), np.bool_), np.zeros(threats, np.bool_)
    rigs_left = q.hosts_of_rig.copy()
    chosen = np.zeros(0, np.int64)
    sees = posts.seen > 0
    for tier in sorted(set(weights.tolist()), reverse=True):
        waiting = weights >= tier
        while not late():
            values = np.where(waiting, 1 + NEARNESS * nearness, LESS_VALUABLE) * ~covered
            if len(chosen) >= most or not (waiting & ~covered).any():
                break
            gain, post = best_single(q, posts, usable, chosen, values)
            picked = [post] if post >= 0 and gain >= 1 else []
            pivot = -1
            if len(chosen) + 2 <= most:
                worth = worth_of(posts, usable, values)
                around, pivot = _around(sees, usable, worth, waiting & ~covered)
                if pivot >= 0:
                    both, one, other = best_pair(q, posts, around, values, rigs_left)
                    if one < 0 or values[pivot] > both:
                        waiting = waiting.copy()
                        waiting[pivot] &= bool(picked)
                    elif both > 2 * gain or not picked:
                        picked = [one, other]
            if not picked and (pivot < 0 or len(chosen) + 2 > most):
                break
            for one in picked:
                chosen = np.append(chosen, one)
                rigs_left[posts.rigs[one]] -= 1
                exclude(q, posts, one, usable)
            usable &= rigs_left[posts.rigs] > 0
            seen_by(q, posts, chosen, covered)
    return chosen


def _around(sees: Flags, usable: Flags, worth: Floats, wanted: Flags) -> tuple[Ints, int]:
    """The posts about the wanted threat from where most is seen, the best first, and that threat; -1: there is none."""
    most = np.where(sees & usable[:, None] & wanted, worth[:, None], 0.0).max(axis=0, initial=0.0)
    pivot = int(most.argmax())
    if most[pivot] <= 0:
        return np.zeros(0, np.int64), -1
    around = np.flatnonzero(sees[:, pivot] & usable)
    return around[np.argsort(-worth[around], kind="stable")[:PAIRED]], pivot


@kernel
def best_views(q: Question, posts: Posts, chosen: Ints, threat: int) -> tuple[int, int]:
    """Return the two of the chosen posts that see a threat best, as positions in ``chosen``; -1: none do."""
    best, first, second = math.inf, -1, -1
    for i in range(chosen.size):
        one = chosen[i]
        if posts.seen[one, threat] == 0:
            continue
        for j in range(i):
            other = chosen[j]
            if posts.seen[other, threat] == 0:
                continue
            cameras = posts.seen[one, threat] - 1, posts.seen[other, threat] - 1
            cost, violation = edge_energy(
                q, posts.positions, posts.axes, posts.rigs, threat, one, other, cameras[0], cameras[1]
            )
            if violation <= 0 and cost < best:
                best, first, second = cost, i, j
    return first, second


def placed(q: Question, posts: Posts, chosen: Ints) -> tuple[list[int], State] | None:
    """Return the threats that hosts at these posts see, and the state of these and of the hosts that are needed."""
    views = [best_views(q, posts, chosen, threat) for threat in range(len(q.weight))]
    seen = [threat for threat, (one, _) in enumerate(views) if one >= 0]
    if not seen:
        return None
    needed = sorted({host for threat in seen for host in views[threat]})
    number = {host: n for n, host in enumerate(needed)}
    state, at = new_state(len(seen), len(needed)), chosen[needed]
    state.positions[:], state.axes[:], state.rigs[:] = posts.positions[at], posts.axes[at], posts.rigs[at]
    for n, threat in enumerate(seen):
        for end, host in enumerate(views[threat]):
            set_view(state, n, end, number[host], int(posts.seen[chosen[host], threat]) - 1)
    return seen, state


def keeps_rules(q: Question, state: State) -> bool:
    """Return whether a state of a question keeps every rule; its energies are fresh afterwards."""
    refresh(q, state)
    return bool(totals(q, state)[1] <= 0)
