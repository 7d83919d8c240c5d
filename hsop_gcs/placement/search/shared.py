"""A cost that no placement with so many hosts can beat, when they are too few for every threat to have two of its own.

Let b_t be what threat t costs at least (``own_pair_bound``), and φ_t(x) what it costs at least when one of its hosts is
at x, wherever the other one is. In a placement let A threats have two hosts that see nothing else, B threats one such
host, C threats none; the other K hosts are shared, each sees at least two threats, and 2A + B + K is the number of
hosts. The first kind costs b_t or more; the second, with a shared host at x, φ_t(x) or more; the third, with shared
hosts at x and y, (φ_t(x) + φ_t(y)) / 2 or more: what is not below either is not below their mean. So with any prices α
and β of being of the first and the second kind, and π_t and ρ_t of being seen by the only and by one of two shared
hosts, the whole cost is no less than

    Σ_t min(b_t + α, π_t + β, 2ρ_t) - αA - βB + K min_x [Σ_seen (φ_t(x) - π_t or φ_t(x) / 2 - ρ_t)],

in which each price is added as often as it is subtracted, and the bracket is the least over sets of at least two
threats seen from x. The prices that raise it most come from a linear program; whatever that answers, the bound is
computed from the prices, and holds. The bound of a number of hosts is the least over all A and B that it allows.

φ_t is bounded over square cells, by branch and bound for the other host. A cell's central camera sees only what may fit
a window of its field of view; the fisheyes see everything in range. Cells that hold the bound down are split.
"""

from collections.abc import Mapping
from concurrent.futures import Executor

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from hsop_gcs.placement.search.bounds import partner_bound, reach_m
from hsop_gcs.placement.search.model import CENTRAL, PERIPHERAL, Floats, Ints, Question

FIRST_HALF_M = 5.0
FINEST_HALF_M = 0.3
BOXES = 120
"""Looked at for the other host of one threat in one cell."""
CUTS = 24
"""Added to a linear program at a time."""
MOST_PROGRAMS = 30
SETTLED = 1e-3
"""A bound so near to the linear program's own has settled, relative."""
ACTIVE = 0.02
"""Cells whose bracket is less than this share of the bound above the least hold it down."""


def shared_bounds(
    q: Question, costs: Mapping[int, float], own: Floats, executor: Executor, *, most_cells: int
) -> dict[int, float]:
    """Return for each number of hosts a cost that no placement with exactly so many goes below; plane geometry only.

    costs: by the number of hosts, fewer than two for each threat, the best cost known: a bound that reaches it is good
    enough. own: (threats,) what each threat costs at least by itself. Places of shared hosts are split into at most
    ``most_cells`` for each number; what is known of them serves all numbers.
    """
    cells = _Cells(q, own, executor)
    return {n_hosts: _bound(cells, n_hosts, own, cost, most_cells) for n_hosts, cost in costs.items()}


def _bound(cells: "_Cells", n_hosts: int, own: Floats, cost: float, most_cells: int) -> float:
    kinds = [_Kinds(own, a, b, n_hosts, cost) for a, b in _kinds(len(own), n_hosts)]
    bound, left = float(own.sum()), most_cells
    while kinds and len(cells.half):
        lowest = min(kind.settle(cells.costs) for kind in kinds)
        bound = max(bound, lowest)
        brackets = np.min(
            [kind.above_least(cells.costs) for kind in kinds if kind.bound < cost], axis=0, initial=np.inf
        )
        active = np.unique(cells.of_row[brackets < ACTIVE * bound])
        active = active[cells.half[active] > FINEST_HALF_M]
        left -= 4 * active.size
        if not active.size or left < 0:
            break
        cells.split(active)
    return bound


def _kinds(threats: int, n_hosts: int) -> list[tuple[int, int]]:
    """Return the numbers A and B that so many hosts allow."""
    found = []
    for a in range(threats):
        for b in range(threats - a + 1):
            neither, shared = threats - a - b, n_hosts - 2 * a - b
            views = b + 2 * neither
            if shared >= (2 if neither else 1) and 2 * shared <= views <= shared * (threats - a):
                found.append((a, b))
    return found


class _Kinds:
    """The prices for one A and B, and the linear program they are from."""

    def __init__(self, own: Floats, first: int, second: int, n_hosts: int, most: float) -> None:
        self._own, self._first, self._second = own, first, second
        self._shared = n_hosts - 2 * first - second
        self._most = most
        self.bound = 0.0
        count = len(own)
        self._alpha = self._beta = 0.0
        self._only, self._one_of_two = np.zeros(count), np.zeros(count)
        # Columns: alpha, beta, bracket, only (threats), one of two (threats), share of every threat (threats).
        eye, none = np.eye(count), np.zeros((count, count))
        first_column, second_column, neither = (
            np.tile(row, (count, 1)) for row in np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 0]])
        )
        self._rows = np.concatenate(
            [
                np.hstack([first_column, none, none, eye]),
                np.hstack([second_column, -eye, none, eye]),
                np.hstack([neither, none, -2 * eye, eye]),
            ]
        )
        self._limits = np.concatenate([own, np.zeros(2 * count)])

    def settle(self, costs: Floats) -> float:
        """Return the bound, raised as far as prices can, where shared hosts have these costs, (rows, threats)."""
        rows, limits = self._cuts(costs, np.argsort(self._brackets(costs), kind="stable")[: 4 * CUTS])
        rows, limits = np.concatenate([self._rows, rows]), np.concatenate([self._limits, limits])
        for _ in range(MOST_PROGRAMS):
            if self.bound >= self._most:
                break
            upper = self._solve(rows, limits)
            if upper is None:
                break
            brackets = self._brackets(costs)
            self.bound = max(self.bound, self._value(float(brackets.min())))
            if upper <= self.bound * (1 + SETTLED):
                break
            more, most = self._cuts(costs, np.argsort(brackets, kind="stable")[:CUTS])
            rows, limits = np.concatenate([rows, more]), np.concatenate([limits, most])
        return self.bound

    def above_least(self, costs: Floats) -> Floats:
        """Return for each row how far its bracket is above the least of all."""
        brackets = self._brackets(costs)
        return np.asarray(brackets - brackets.min())

    def _gains(self, costs: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """Return what each threat adds to a bracket, and whether as the second kind."""
        as_only, as_one = costs - self._only, 0.5 * costs - self._one_of_two
        return np.minimum(as_only, as_one), as_only < as_one

    def _brackets(self, costs: Floats) -> Floats:
        gains = np.sort(self._gains(costs)[0], axis=1)
        return np.asarray(gains[:, :2].sum(axis=1) + np.minimum(gains[:, 2:], 0.0).sum(axis=1))

    def _value(self, bracket: float) -> float:
        shares = np.minimum.reduce([self._own + self._alpha, self._only + self._beta, 2 * self._one_of_two])
        return float(shares.sum() - self._alpha * self._first - self._beta * self._second + self._shared * bracket)

    def _cuts(self, costs: Floats, which: Ints) -> tuple[Floats, Floats]:
        costs = costs[which]
        gains, only = self._gains(costs)
        seen = (gains <= np.sort(gains, axis=1)[:, 1:2]) | (gains < 0)
        usable = np.isfinite(np.where(seen, costs, 0.0)).all(axis=1)
        costs, only, seen = costs[usable], (only & seen)[usable], seen[usable]
        one = seen & ~only
        rows = np.hstack([np.tile([0.0, 0.0, 1.0], (len(costs), 1)), only, one, np.zeros(costs.shape)])
        return rows, (np.where(only, costs, 0.0) + np.where(one, 0.5 * costs, 0.0)).sum(axis=1)

    def _solve(self, rows: Floats, limits: Floats) -> float | None:
        """Take the prices of the linear program; return its value, which is not proven, or None if it has none."""
        count, most = len(self._own), 3 * self._most
        worth = np.concatenate([[self._first, self._second, -self._shared], np.zeros(2 * count), -np.ones(count)])
        bounds = [(-most, most)] * 3 + [(0.0, most)] * (2 * count) + [(-most, most)] * count
        answer = linprog(worth, A_ub=rows, b_ub=limits, bounds=bounds)
        if answer.x is None:
            return None
        self._alpha, self._beta = float(answer.x[0]), float(answer.x[1])
        self._only, self._one_of_two = answer.x[3 : 3 + count], answer.x[3 + count : 3 + 2 * count]
        return -float(answer.fun or 0.0)


class _Cells:
    """Squares that cover every place from which a threat can be seen, and what threats cost from each."""

    def __init__(self, q: Question, own: Floats, executor: Executor) -> None:
        self.q, self._own, self._executor = q, own, executor
        reach = max(reach_m(q, threat) for threat in range(len(q.weight)))
        low, high = q.points_m.min(axis=(0, 1))[:2] - reach, q.points_m.max(axis=(0, 1))[:2] + reach
        axes = [np.arange(a + FIRST_HALF_M, b + FIRST_HALF_M, 2 * FIRST_HALF_M) for a, b in zip(low, high, strict=True)]
        x, y = np.meshgrid(*axes)
        self.middle, self.half = np.column_stack([x.ravel(), y.ravel()]), np.full(x.size, FIRST_HALF_M)
        self._set(*self._bounded(self.middle, self.half))

    def split(self, which: Ints) -> None:
        """Replace cells by their quarters."""
        quarters = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
        half = np.repeat(0.5 * self.half[which], 4)
        middle = np.repeat(self.middle[which], 4, axis=0) + np.tile(quarters, (len(which), 1)) * half[:, None]
        rest = np.setdiff1d(np.arange(len(self.half)), which)
        new = self._bounded(middle, half)
        kept = self.middle[rest], self.half[rest], self._by_camera[:, rest], self._windows[rest]
        axes = (0, 0, 1, 0)
        self._set(*(np.concatenate(pair, axis=axis) for *pair, axis in zip(kept, new, axes, strict=True)))

    def _bounded(self, middle: Floats, half: Floats) -> tuple[Floats, Floats, Floats, npt.NDArray[np.bool_]]:
        """Return places where anything is seen, their halves, costs by camera (2, cells, threats) and windows."""
        q, count = self.q, len(self.q.weight)
        squares = np.column_stack([middle, half])

        def of_threat(threat: int) -> Floats:
            around = np.array([*q.points_m[threat, :, :2].mean(axis=0), reach_m(q, threat)])
            return np.array(
                [
                    [partner_bound(q, threat, camera, square, around, BOXES) for square in squares]
                    for camera in (PERIPHERAL, CENTRAL)
                ]
            )

        costs = np.maximum(np.stack(list(self._executor.map(of_threat, range(count))), axis=-1), self._own)
        seen = np.flatnonzero(np.isfinite(costs).any(axis=(0, 2)))
        return middle[seen], half[seen], costs[:, seen], self._fitting(middle[seen], half[seen])

    def _fitting(self, middle: Floats, half: Floats) -> npt.NDArray[np.bool_]:
        """Return for each window, from one point to a field of view left of it, which threats may fit: (cells, windows,
        threats)."""
        ends = self.q.points_m[:, :, :2].reshape(-1, 2)
        rays = ends - middle[:, None]
        away = np.hypot(rays[..., 0], rays[..., 1])
        radius = half[:, None] * np.sqrt(2.0)
        spread = np.where(away > radius, np.arcsin(np.minimum(1.0, radius / np.maximum(away, 1e-9))), np.pi)
        bearing = np.arctan2(rays[..., 0], rays[..., 1])
        off = bearing[:, None, :] - bearing[:, :, None]
        slack = spread[:, None, :] + spread[:, :, None]
        # From the slack before the window's beginning, once around the compass.
        inside = (off + slack) % (2 * np.pi) <= self.q.fov_rad.max() + 2 * slack
        return np.asarray((inside | (slack >= np.pi)).reshape(len(half), len(ends), -1, 2).all(axis=-1))

    def _set(self, middle: Floats, half: Floats, by_camera: Floats, windows: npt.NDArray[np.bool_]) -> None:
        self.middle, self.half, self._by_camera, self._windows = middle, half, by_camera, windows
        peripheral, central = by_camera[0][:, None], by_camera[1][:, None]
        costs = np.where(windows, np.minimum(peripheral, central), peripheral)
        count = len(self.q.weight)
        self.costs = costs.reshape(-1, count)
        self.of_row = np.repeat(np.arange(len(half)), costs.shape[1])
