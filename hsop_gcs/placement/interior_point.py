"""Solve-Problem(S): a log-barrier interior-point method on many starts at once (letter, section IV.C; Algorithm 3).

Minimises log J - μ Σ log(margin) for a falling μ. The logarithm makes μ relative: near a solution, n active margins
leave the cost within about n μ of its optimum. Each μ is solved by quasi-Newton steps (BFGS), all starts in step.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.terms import Terms, Views, evaluate

BARRIERS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
INSIDE = 1e-7
"""Relative margin of a placement that counts as feasible: a tenth of a millimetre stays far above rounding."""

Rows = npt.NDArray[np.intp]
Function = Callable[[FloatArray, Rows], tuple[FloatArray, FloatArray]]
"""Values (b,) and slopes (b, n) of the rows named, at points (b, n); infinite outside its domain."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Where each start of a batch ended."""

    batch: FloatArray
    cost: FloatArray
    """(B,); infinite where no feasible placement was found."""


def barrier(margin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return -log(margin) and its slope; infinite at and beyond the boundary."""
    inside = margin > 0
    safe = np.where(inside, margin, 1.0)
    return np.where(inside, -np.log(safe), np.inf), np.where(inside, -1 / safe, 0.0)


def shortfall(margin: FloatArray, wanted: float = 1e-3) -> tuple[FloatArray, FloatArray]:
    """Return the square of what a margin lacks to a little more than nothing, and its slope."""
    lack = np.maximum(wanted - margin, 0.0)
    return lack * lack, -2 * lack


def minimise(
    function: Function, start: FloatArray, *, steps: int, tolerance: float, longest_step: float = 0.5
) -> FloatArray:
    """Minimise row by row by BFGS; every row has its own step length, and leaves when it has converged.

    start: (B, n), all where the function is finite. ``tolerance``: stop when a full step promises less.
    """
    points, n = start.copy(), start.shape[1]
    rows = np.arange(len(points))
    value, slope = function(points, rows)
    inverse = np.tile(np.eye(n), (len(points), 1, 1))
    fresh = np.ones(len(points), dtype=bool)
    length = np.ones(len(points))
    x = points.copy()
    for _ in range(steps):
        step = -(inverse @ slope[:, :, None])[:, :, 0]
        promise = -(step * slope).sum(axis=1)
        size = np.abs(step).max(axis=1)
        step *= np.minimum(1.0, longest_step / np.maximum(size, 1e-300))[:, None] * length[:, None]
        stuck = length < 1e-9
        done = (promise < tolerance) | (stuck & fresh)
        if done.any():
            points[rows[done]] = x[done]
            going = ~done
            if not going.any():
                return points
            rows, x, value, slope, inverse = rows[going], x[going], value[going], slope[going], inverse[going]
            fresh, length, step, stuck = fresh[going], length[going], step[going], stuck[going]
        inverse[stuck], fresh[stuck], length[stuck] = np.eye(n), True, 1.0
        trial = x + np.where(stuck[:, None], 0.0, step)
        trial_value, trial_slope = function(trial, rows)
        better = (trial_value <= value + 1e-4 * (step * slope).sum(axis=1)) & ~stuck
        if better.any():
            _update(inverse, better, step[better], trial_slope[better] - slope[better], fresh)
            fresh[better] = False
        x[better], value[better], slope[better] = trial[better], trial_value[better], trial_slope[better]
        length = np.where(better, 1.0, np.where(stuck, 1.0, length * 0.3))
    points[rows] = x
    return points


def _update(
    inverse: FloatArray,
    chosen: npt.NDArray[np.bool_],
    step: FloatArray,
    change: FloatArray,
    fresh: npt.NDArray[np.bool_],
) -> None:
    """Apply the BFGS update of the inverse Hessian to the chosen rows, in place; rows without curvature stay."""
    curvature = (step * change).sum(axis=1)
    usable = curvature > 1e-12 * np.linalg.norm(step, axis=1) * np.linalg.norm(change, axis=1)
    index = np.flatnonzero(chosen)[usable]
    step, change, curvature = step[usable], change[usable], curvature[usable]
    h = inverse[index]
    scale = np.where(fresh[index], curvature / (change * change).sum(axis=1), 1.0)
    h = h * scale[:, None, None]
    h_change = (h @ change[:, :, None])[:, :, 0]
    factor = (1 + (change * h_change).sum(axis=1) / curvature) / curvature
    cross = step[:, :, None] * h_change[:, None, :] / curvature[:, None, None]
    inverse[index] = h + factor[:, None, None] * step[:, :, None] * step[:, None, :] - cross - cross.transpose(0, 2, 1)


def _units(instance: Instance) -> FloatArray:
    """Return the length of one unit of each pose variable, so that a step of 1 is large for all of them."""
    return np.array([instance.safety_distance_m, instance.safety_distance_m, 1.0, 1.0])


def reach_feasibility(instance: Instance, start: FloatArray, views: Views, *, steps: int = 60) -> FloatArray:
    """Move placements until all margins are positive, as far as that succeeds: (B, H, 4) in, (B, H, 4) out."""
    units = _units(instance)

    def function(points: FloatArray, rows: Rows) -> tuple[FloatArray, FloatArray]:
        batch = points.reshape(len(points), -1, 4) * units
        terms = evaluate(instance, batch, views.rows(rows), shortfall, with_cost=False)
        return terms.shaped, (terms.shaped_slope * units).reshape(points.shape)

    flat = (start / units).reshape(len(start), -1)
    return minimise(function, flat, steps=steps, tolerance=1e-14).reshape(start.shape) * units


def solve(
    instance: Instance, start: FloatArray, views: Views, *, barriers: tuple[float, ...] = BARRIERS, steps: int = 60
) -> Solution:
    """Minimise Eq. 8 subject to Eqs. 9-11 from every start of a batch: (B, H, 4).

    Starts without positive margins are first moved to where they have them; where that fails the cost is infinite.
    """
    units = _units(instance)
    batch = start.copy()
    outside = np.flatnonzero(margins(instance, batch, views).margin < INSIDE)
    if outside.size:
        batch[outside] = reach_feasibility(instance, batch[outside], views.rows(outside))
    inside = np.flatnonzero(margins(instance, batch, views).margin >= INSIDE)
    cost = np.full(len(batch), np.inf)
    if not inside.size:
        return Solution(batch, cost)
    chosen = views.rows(inside)
    flat = (batch[inside] / units).reshape(len(inside), -1)
    for weight in barriers:

        def function(points: FloatArray, rows: Rows, weight: float = weight) -> tuple[FloatArray, FloatArray]:
            terms = evaluate(instance, points.reshape(len(points), -1, 4) * units, chosen.rows(rows), barrier)
            slope = terms.log_cost_slope + weight * terms.shaped_slope
            return terms.log_cost + weight * terms.shaped, (slope * units).reshape(points.shape)

        flat = minimise(function, flat, steps=steps, tolerance=0.1 * weight)
    batch[inside] = flat.reshape(len(inside), -1, 4) * units
    cost[inside] = np.exp(margins(instance, batch[inside], chosen).log_cost)
    return Solution(batch, cost)


def margins(instance: Instance, batch: FloatArray, views: Views, *, with_cost: bool = True) -> Terms:
    """Evaluate a batch for its cost and smallest margins alone."""
    return evaluate(instance, batch, views, shortfall, with_cost=with_cost)
