"""Which threat each ray of one moment shows, over all hosts and cameras at once.

Where threats are known only coarsely, each camera by itself would often choose wrongly, and rays of different threats
would meet in a ghost. So the rays are taken one by one, and the likeliest ways to explain all of them so far are
followed side by side: a beam search through the multidimensional assignment problem, in which each hypothesis keeps
what its own choices say of every threat. A ray is used only if it goes the same way in all likely hypotheses.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.tracks import Track, TrackRules
from hsop_gcs.tracks.gate import predicted, threshold
from hsop_gcs.tracks.history import state_before

_HOPELESS = 30.0
"""A hypothesis this much costlier than the best will not come back: e^15 times less likely."""
_NONE = -1


class Doubt(StrEnum):
    """Why a ray was given to no threat."""

    UNEXPLAINED = "no known threat lies there"
    AMBIGUOUS = "more than one threat may lie there"


@dataclass(slots=True)
class _Beam:
    """Hypotheses, best first. Costs are -2 log likelihood."""

    cost: FloatArray
    """(hypotheses,)"""
    mean: FloatArray
    """(hypotheses, threats, 3), ENU metres, all at one time."""
    covariance: FloatArray
    """(hypotheses, threats, 3, 3)"""
    taken: npt.NDArray[np.bool_]
    """(hypotheses, threats), by a ray of the same image."""
    choices: npt.NDArray[np.int64]
    """(hypotheses, rays so far), index of the threat or -1."""


def associate(
    rays: Sequence[Ray], tracks: Mapping[str, Track], time_s: float, track_rules: TrackRules, rules: DetectionRules
) -> list[str | Doubt]:
    """Return the id of the track that each ray shows, or why it shows none.

    rays: those of one image next to each other. They may differ a little in time from ``time_s``.
    """
    if not tracks:
        return [Doubt.UNEXPLAINED] * len(rays)
    ids = list(tracks)
    states = [state_before(track.steps, time_s) for track in tracks.values()]
    mean, covariance = predicted(states, [time_s] * len(states), track_rules)
    beam = _Beam(
        cost=np.zeros(1),
        mean=mean[None, :, :3],
        covariance=covariance[None, :, :3, :3],
        taken=np.zeros((1, len(ids)), dtype=np.bool_),
        choices=np.empty((1, 0), dtype=np.int64),
    )
    look = None
    for ray in rays:
        if ray.look != look:
            look = ray.look
            beam.taken = np.zeros_like(beam.taken)
        named = ray.detection.threat_id
        hint = ids.index(named) if named is not None and named in tracks else None
        _extend(beam, ray, mean[:, 3:] * (ray.time_s - time_s), hint, rules)
    return [_verdict(beam, number, ids, rules) for number in range(len(rays))]


def _extend(beam: _Beam, ray: Ray, moved_m: FloatArray, hint: int | None, rules: DetectionRules) -> None:
    """Follow every hypothesis into every way to explain one more ray.

    The distance across the ray is linear in the threat's position, so that no guess of its depth can mislead; only
    what a metre across is worth as an angle depends on that guess.
    """
    across = np.array(ray.across)
    reach = beam.mean + moved_m - np.array(ray.origin_m)
    depth = reach @ np.array(ray.direction)
    ahead = depth > rules.nearest_m
    depth = np.where(ahead, depth, np.nan)
    miss = reach @ across.T
    shadow = across @ beam.covariance
    expected = shadow @ across.T
    for axis in range(2):
        expected[..., axis, axis] += np.square(ray.sigma_rad[axis] * depth) + rules.host_sigma_m**2
    a, b, c = expected[..., 0, 0], expected[..., 1, 1], expected[..., 0, 1]
    determinant = a * b - c * c
    weight = np.stack([np.stack([b, -c], -1), np.stack([-c, a], -1)], -2) / determinant[..., None, None]
    squared = np.einsum("hti,htij,htj->ht", miss, weight, miss)
    cost = squared + np.log(determinant) - 4 * np.log(depth) + 2 * math.log(2 * math.pi)
    gate = threshold(2, 1.0 - rules.gate_probability)
    possible = ahead & ~beam.taken & (squared <= gate)
    none = np.full(len(cost), -2 * math.log(rules.unexplained_per_sr))
    if hint is not None:
        hinted = (
            ahead[:, hint] & ~beam.taken[:, hint] & (squared[:, hint] <= threshold(2, rules.impossible_probability))
        )
        if hinted.any():
            possible[:] = False
            possible[:, hint] = hinted
            none[hinted] = np.inf
    options = np.column_stack([np.where(possible, cost, np.inf), none]) + beam.cost[:, None]
    flat = options.ravel()
    order = np.argsort(flat, kind="stable")[: rules.hypotheses]
    order = order[flat[order] <= flat[order[0]] + _HOPELESS]
    parent, choice = np.divmod(order, options.shape[1])
    choice = np.where(choice == options.shape[1] - 1, _NONE, choice)
    beam.cost = flat[order]
    beam.mean, beam.covariance, beam.taken = beam.mean[parent], beam.covariance[parent], beam.taken[parent]
    beam.choices = np.column_stack([beam.choices[parent], choice])
    (chosen,) = np.nonzero(choice != _NONE)
    at, by = (parent[chosen], choice[chosen]), (chosen, choice[chosen])
    gain = shadow[at].transpose(0, 2, 1) @ weight[at]
    beam.mean[by] -= (gain @ miss[at][:, :, None])[:, :, 0]
    beam.covariance[by] -= gain @ shadow[at]
    beam.taken[by] = True


def _verdict(beam: _Beam, number: int, ids: list[str], rules: DetectionRules) -> str | Doubt:
    choice = int(beam.choices[0, number])
    rivals = beam.cost[beam.choices[:, number] != choice]
    if len(rivals) and rivals.min() - beam.cost[0] < 2 * math.log(rules.sure_odds):
        return Doubt.AMBIGUOUS
    return Doubt.UNEXPLAINED if choice == _NONE else ids[choice]
