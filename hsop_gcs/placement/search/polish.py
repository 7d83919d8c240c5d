"""Exact local solve: a primal-dual interior-point method on the active pair set, in compiled code.

Starting from a placement that keeps every rule, it minimizes cost - μ Σ log(margin) while μ falls, and never leaves the
inside of the rules; so any intermediate point is a valid placement. Gradients are analytic, second derivatives are
differences of gradients, element by element (one threat, or one rule).
Source: Nocedal and Wright, Numerical Optimization, ch. 19.
"""

import math

import numpy as np

from hsop_gcs.geometry.compiled import kernel, lean_kernel
from hsop_gcs.placement.search.elements import COST, element, keeps_aim, list_elements, poses_of
from hsop_gcs.placement.search.model import PERIPHERAL, Floats, Ints, Question
from hsop_gcs.placement.search.state import State, refresh, totals

DIFFERENCE = 1e-6


@kernel
def solve_positive(a: Floats, b: Floats, shift: float) -> bool:
    """Solve (a + shift I) x = b in place of b, by Cholesky; False if the matrix is not positive."""
    n = b.size
    lower = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if total <= 1e-13 * (1 + abs(a[i, i])):
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= lower[i, k] * b[k]
        b[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= lower[k, i] * b[k]
        b[i] /= lower[i, i]
    return True


@lean_kernel
def barrier_value(q: Question, rows: Ints, poses: Floats, mu: float, margins: Floats, g: Floats, work: Floats) -> float:
    """Return cost - μ Σ log(margin), infinite outside the rules; fills the margins."""
    value = 0.0
    for m in range(rows.shape[0]):
        margins[m] = element(q, rows[m], poses, g, work)
        if rows[m, 0] == COST:
            value += margins[m]
        elif margins[m] <= 0:
            return math.inf
        else:
            value -= mu * math.log(margins[m])
    return value


@kernel
def polish(q: Question, s: State, moving: Ints, steps: int) -> bool:
    """Improve the poses of the hosts marked 1 in ``moving`` to a local optimum; False if nothing was gained.

    ``s`` must keep every rule; afterwards it still does, and its energies are fresh.
    """
    hosts = s.degree.shape[0]
    start_cost, start_violation = totals(q, s)
    if start_violation > 0:
        return False
    rows = list_elements(q, s, moving)
    column = np.full((hosts, 4), -1, np.int64)
    n = 0
    for host in range(hosts):
        if moving[host] == 0:
            continue
        turns = False
        for v in range(s.degree[host]):
            turns |= s.cameras[s.incident[host, v] // 2, s.incident[host, v] % 2] == PERIPHERAL
        turns &= not keeps_aim(q, s, host)
        for axis in range(4):
            if (axis == 2 and q.ceiling_m <= q.floor_m) or (axis == 3 and not turns):
                continue
            column[host, axis] = n
            n += 1
    poses = poses_of(q, s)
    # Lengths in units of ten metres, so that positions and angles weigh alike.
    unit = np.array([10.0, 10.0, 10.0, 1.0])
    count = rows.shape[0]
    margins, trial_margins, z = np.empty(count), np.empty(count), np.zeros(count)
    g, g2, work = np.empty(8), np.empty(8), np.empty((6, 5))
    if barrier_value(q, rows, poses, 0.0, margins, g, work) == math.inf:
        return False
    scale = start_cost
    mu = 1e-3 * scale / max(1, count)
    last_mu = 1e-10 * scale
    for m in range(count):
        if rows[m, 0] != COST:
            z[m] = min(mu / margins[m], 10 * scale)
    shift = 0.0
    gradients = np.empty((count, 8))
    columns = np.empty((count, 8), np.int64)
    for m in range(count):
        for v in range(8):
            host = rows[m, 1] if v < 4 else rows[m, 2]
            columns[m, v] = column[host, v % 4] if host >= 0 else -1
    stalled = 0
    for _ in range(steps):
        hessian = np.zeros((n, n))
        downhill, inward = np.zeros(n), np.zeros(n)
        stationarity = np.zeros(n)
        cost = logarithms = 0.0
        for m in range(count):
            margins[m] = element(q, rows[m], poses, g, work)
            is_cost = rows[m, 0] == COST
            if is_cost:
                cost += margins[m]
            else:
                logarithms += math.log(margins[m])
            for v in range(8):
                gradients[m, v] = g[v] * unit[v % 4]
            dual = 1.0 if is_cost else -z[m]
            stiff = 0.0 if is_cost else z[m] / margins[m]
            for v in range(8):
                a = columns[m, v]
                if a < 0:
                    continue
                if is_cost:
                    downhill[a] -= gradients[m, v]
                else:
                    inward[a] += gradients[m, v] / margins[m]
                stationarity[a] += dual * gradients[m, v]
                if stiff > 0:
                    for w in range(8):
                        b = columns[m, w]
                        if b >= 0:
                            hessian[a, b] += stiff * gradients[m, v] * gradients[m, w]
            if is_cost or z[m] > 1e-3 * scale:
                for v in range(8):
                    a = columns[m, v]
                    if a < 0:
                        continue
                    host = rows[m, 1] if v < 4 else rows[m, 2]
                    saved = poses[host, v % 4]
                    poses[host, v % 4] = saved + DIFFERENCE * unit[v % 4]
                    element(q, rows[m], poses, g2, work)
                    poses[host, v % 4] = saved
                    for w in range(8):
                        b = columns[m, w]
                        if b >= 0:
                            h = 0.5 * dual * (g2[w] * unit[w % 4] - gradients[m, w]) / DIFFERENCE
                            hessian[a, b] += h
                            hessian[b, a] += h
        while True:
            error = np.abs(stationarity).max()
            for m in range(count):
                if rows[m, 0] != COST:
                    error = max(error, abs(z[m] * margins[m] - mu))
            settled = error < 10 * mu or stalled > 3
            if not settled or mu <= last_mu:
                break
            mu = max(last_mu, min(0.15 * mu, mu**1.4 * scale**-0.4))
            stalled = 0
        if settled:
            break
        value = cost - mu * logarithms
        residual = downhill + mu * inward
        step = residual.copy()
        while not solve_positive(hessian, step, shift):
            shift = max(1e-6 * scale, 8 * shift)
            step[:] = residual
            if shift > 1e12 * scale:
                break
        shift = shift / 4 if shift > 1e-6 * scale else 0.0
        descent = 0.0
        longest = 0.0
        for a in range(n):
            descent -= residual[a] * step[a]
            longest = max(longest, abs(step[a]))
        length = min(1.0, 1.0 / (longest + 1e-300))
        before = poses.copy()
        accepted = False
        for _halving in range(30):
            for host in range(hosts):
                for axis in range(4):
                    if column[host, axis] >= 0:
                        poses[host, axis] = before[host, axis] + length * step[column[host, axis]] * unit[axis]
            new = barrier_value(q, rows, poses, mu, trial_margins, g, work)
            inside = new < math.inf
            if inside:
                for m in range(count):
                    inside &= rows[m, 0] == COST or trial_margins[m] >= 0.01 * margins[m]
            if inside and new <= value + 1e-4 * length * descent + 1e-14 * scale:
                accepted = True
                break
            length *= 0.5
        if not accepted:
            poses[:] = before
            stalled = 10
            continue
        stalled = stalled + 1 if length < 1e-3 else 0
        for m in range(count):
            if rows[m, 0] == COST:
                continue
            along = 0.0
            for v in range(8):
                if columns[m, v] >= 0:
                    along += gradients[m, v] * step[columns[m, v]]
            change = (mu - z[m] * along) / margins[m] - z[m]
            share = 1.0 if change >= 0 else min(1.0, -0.99 * z[m] / change)
            z[m] += share * change
            target = mu / trial_margins[m]
            z[m] = min(max(z[m], 1e-3 * target), 1e3 * target)
    kept = s.positions.copy()
    kept_axes = s.axes.copy()
    for host in range(hosts):
        if moving[host] > 0:
            s.positions[host] = poses[host, :3]
            s.axes[host, 0] = math.sin(poses[host, 3])
            s.axes[host, 1] = math.cos(poses[host, 3])
    refresh(q, s)
    cost, violation = totals(q, s)
    if violation > 0 or cost >= start_cost:
        s.positions[:] = kept
        s.axes[:] = kept_axes
        refresh(q, s)
        return False
    return True
