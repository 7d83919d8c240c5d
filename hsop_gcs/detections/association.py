"""Which threat each ray of one moment shows, over all hosts and cameras at once.

The likeliest ways to explain all rays so far are followed side by side while the rays are taken one by one: a beam
search. A ray is used only if it goes the same way in all likely hypotheses. Of threats that are known as well as the
cameras see, each image is explained by itself. Of threats that are known coarsely, one camera alone would often choose
wrongly, and rays of different threats would meet in a ghost: all their images are explained together, a
multidimensional assignment problem in which each hypothesis keeps what its own choices say of every threat. Which of
two such threats all those rays are of, ``naming`` judges by itself.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.sight import FloatArray
from hsop_gcs.detections.naming import doubtful
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.tracks import Track, TrackRules
from hsop_gcs.tracks.gate import predicted, threshold
from hsop_gcs.tracks.history import state_before

_HOPELESS = 30.0
"""A hypothesis this much costlier than the best will not come back: e^15 times less likely."""
_NONE = -1
_WELL_KNOWN = 100.0
"""A threat is known well to a camera if det S is at most so many times det R: other rays could tell it little more."""


class Doubt(StrEnum):
    """Why a ray was given to no threat."""

    UNEXPLAINED = "no known threat lies there"
    AMBIGUOUS = "more than one threat may lie there"


def associate(
    rays: Sequence[Ray], tracks: Mapping[str, Track], time_s: float, track_rules: TrackRules, rules: DetectionRules
) -> list[str | Doubt]:
    """Return the id of the track that each ray shows, or why it shows none.

    rays: those of one image next to each other. They may differ a little in time from ``time_s``.
    """
    if not tracks or not rays:
        return [Doubt.UNEXPLAINED] * len(rays)
    ids = list(tracks)
    states = [state_before(track.steps, time_s) for track in tracks.values()]
    mean, covariance = predicted(states, [time_s] * len(states), track_rules)
    threats = _Threats(mean[:, :3], mean[:, 3:], covariance[:, :3, :3])
    index = {track_id: number for number, track_id in enumerate(ids)}
    hints = [index.get(ray.detection.threat_id or "", _NONE) for ray in rays]
    shown = _by_image(rays, threats, time_s, hints, rules)
    rest = [number for number in range(len(rays)) if number not in shown]
    elsewhere = {each for each in shown.values() if not isinstance(each, Doubt)}
    together = _together(
        [rays[number] for number in rest], threats, time_s, [hints[number] for number in rest], rules, elsewhere
    )
    shown.update(zip(rest, together, strict=True))
    return [each if isinstance(each := shown[number], Doubt) else ids[each] for number in range(len(rays))]


class _Threats(NamedTuple):
    """What is believed of the known threats at one time, ENU metres."""

    mean: FloatArray
    """(threats, 3)"""
    velocity: FloatArray
    """(threats, 3)"""
    covariance: FloatArray
    """(threats, 3, 3)"""


class _Comparison(NamedTuple):
    """Rays beside beliefs of threats; the leading axes are those of both, broadcast."""

    miss: FloatArray
    """(..., 2), metres across the ray."""
    shadow: FloatArray
    """(..., 2, 3), covariance of that with the threat's position."""
    weight: FloatArray
    """(..., 2, 2), inverse covariance of the miss."""
    squared: FloatArray
    """(...,), squared Mahalanobis distance; NaN where the threat is not ahead."""
    cost: FloatArray
    """(...,), -2 log likelihood of the direction, per steradian."""
    ahead: npt.NDArray[np.bool_]
    """(...,)"""
    well_known: npt.NDArray[np.bool_]
    """(...,)"""


@dataclass(slots=True)
class _Beam:
    """Hypotheses, best first."""

    cost: FloatArray
    """(hypotheses,), -2 log likelihood."""
    mean: FloatArray
    """(hypotheses, threats, 3)"""
    covariance: FloatArray
    """(hypotheses, threats, 3, 3)"""
    taken: npt.NDArray[np.bool_]
    """(hypotheses, threats), by a ray of the same image."""
    choices: npt.NDArray[np.int64]
    """(hypotheses, rays so far), index of the threat or none."""


def _compare(rays: Sequence[Ray], mean: FloatArray, covariance: FloatArray, rules: DetectionRules) -> _Comparison:
    """Compare rays, along the first axis, with beliefs, (rays or 1, threats, 3) and (..., 3, 3).

    The distance across a ray is linear in the threat's position, so that no guess of its depth can mislead; only what
    a metre across is worth as an angle depends on that guess.
    """
    across = np.array([ray.across for ray in rays])[:, None]
    reach = mean - np.array([ray.origin_m for ray in rays])[:, None]
    depth = (reach * np.array([ray.direction for ray in rays])[:, None]).sum(axis=-1)
    ahead = depth > rules.nearest_m
    depth = np.where(ahead, depth, np.nan)
    miss = (across @ reach[..., None])[..., 0]
    shadow = across @ covariance
    expected = shadow @ across.swapaxes(-1, -2)
    noise = np.square(np.array([ray.sigma_rad for ray in rays])[:, None] * depth[..., None]) + rules.host_sigma_m**2
    a, b, c = expected[..., 0, 0] + noise[..., 0], expected[..., 1, 1] + noise[..., 1], expected[..., 0, 1]
    determinant = a * b - c * c
    weight = np.empty((*determinant.shape, 2, 2))
    weight[..., 0, 0], weight[..., 1, 1] = b / determinant, a / determinant
    weight[..., 0, 1] = weight[..., 1, 0] = -c / determinant
    x, y = miss[..., 0], miss[..., 1]
    squared = (x * x * b - 2 * x * y * c + y * y * a) / determinant
    return _Comparison(
        miss=miss,
        shadow=shadow,
        weight=weight,
        squared=squared,
        cost=squared + np.log(determinant) - 4 * np.log(depth) + 2 * math.log(2 * math.pi),
        ahead=ahead,
        well_known=determinant <= _WELL_KNOWN * noise[..., 0] * noise[..., 1],
    )


def _possible(
    seen: _Comparison, hints: Sequence[int], free: npt.NDArray[np.bool_], rules: DetectionRules
) -> npt.NDArray[np.bool_]:
    """Return which threats each ray may show, (rays, threats): that of its hint if it can be, else those it gates."""
    possible: npt.NDArray[np.bool_] = seen.ahead & free & (seen.squared <= threshold(2, 1.0 - rules.gate_probability))
    can_be = seen.ahead & free & (seen.squared <= threshold(2, rules.impossible_probability))
    for number, hint in enumerate(hints):
        if hint != _NONE and can_be[number, hint]:
            possible[number] = False
            possible[number, hint] = True
    return possible


def _by_image(
    rays: Sequence[Ray], threats: _Threats, time_s: float, hints: Sequence[int], rules: DetectionRules
) -> dict[int, int | Doubt]:
    """Return what the rays show of those images in which every threat that may be seen is known well."""
    elapsed_s = np.array([ray.time_s for ray in rays]) - time_s
    seen = _compare(rays, threats.mean + elapsed_s[:, None, None] * threats.velocity, threats.covariance, rules)
    possible = _possible(seen, hints, np.ones_like(seen.ahead), rules)
    unclear = [bool(each.any()) for each in possible & ~seen.well_known]
    shown: dict[int, int | Doubt] = {}
    for _, image in itertools.groupby(range(len(rays)), key=lambda number: rays[number].look):
        members = list(image)
        if not any(unclear[number] for number in members):
            shown.update(zip(members, _of_image(members, seen.cost, possible, hints, rules), strict=True))
    return shown


def _of_image(
    members: Sequence[int],
    cost: FloatArray,
    possible: npt.NDArray[np.bool_],
    hints: Sequence[int],
    rules: DetectionRules,
) -> list[int | Doubt]:
    """Return what the rays of one image show: the beam search without anything to learn on the way."""
    hypotheses: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    for number in members:
        options = [(float(cost[number, threat]), int(threat)) for threat in np.nonzero(possible[number])[0]]
        if hints[number] == _NONE or not possible[number, hints[number]]:
            options.append((_unexplained(rules), _NONE))
        grown = [
            (total + more, (*choices, choice))
            for total, choices in hypotheses
            for more, choice in options
            if choice == _NONE or choice not in choices
        ]
        # Two rays that are hinted at one threat cannot both have it: the second goes free.
        grown = grown or [(total + _unexplained(rules), (*choices, _NONE)) for total, choices in hypotheses]
        grown.sort(key=lambda each: each[0])
        hypotheses = [each for each in grown[: rules.hypotheses] if each[0] <= grown[0][0] + _HOPELESS]
    costs, choices = zip(*hypotheses, strict=True)
    return _agreed(np.array(costs), np.array(choices), rules)


def _together(
    rays: Sequence[Ray],
    threats: _Threats,
    time_s: float,
    hints: Sequence[int],
    rules: DetectionRules,
    elsewhere: set[int],
) -> list[int | Doubt]:
    """Return what the rays of all images show; elsewhere: the threats that further images show for sure."""
    beam = _Beam(
        cost=np.zeros(1),
        mean=threats.mean[None],
        covariance=threats.covariance[None],
        taken=np.zeros((1, len(threats.mean)), dtype=np.bool_),
        choices=np.empty((1, 0), dtype=np.int64),
    )
    look = None
    for ray, hint in zip(rays, hints, strict=True):
        if ray.look != look:
            look = ray.look
            beam.taken = np.zeros_like(beam.taken)
        _extend(beam, ray, threats.velocity * (ray.time_s - time_s), hint, rules)
    agreed = _agreed(beam.cost, beam.choices, rules)
    return _surely_named(agreed, beam.choices[0].tolist(), rays, threats, hints, rules, elsewhere=elsewhere)


def _surely_named(
    agreed: Sequence[int | Doubt],
    likeliest: Sequence[int],
    rays: Sequence[Ray],
    threats: _Threats,
    hints: Sequence[int],
    rules: DetectionRules,
    *,
    elsewhere: set[int],
) -> list[int | Doubt]:
    """Return the choices without those for threats whose rays, all of the likeliest hypothesis, may be another's.

    elsewhere: the threats that other images show for sure. A host's own word names its threat.
    """
    groups: dict[int, list[int]] = {}
    for number, choice in enumerate(likeliest):
        if choice != _NONE and choice not in elsewhere:
            groups.setdefault(choice, []).append(number)
    if not groups:
        return list(agreed)
    open_to = [threat for threat in range(len(threats.mean)) if threat not in elsewhere]
    seen = {open_to.index(threat): [rays[number] for number in group] for threat, group in groups.items()}
    doubted = {open_to[each] for each in doubtful(seen, threats.mean[open_to], threats.covariance[open_to], rules)}
    doubted -= {threat for threat, group in groups.items() if any(hints[number] != _NONE for number in group)}
    return [Doubt.AMBIGUOUS if each in doubted else each for each in agreed]


def _agreed(cost: FloatArray, choices: npt.NDArray[np.int64], rules: DetectionRules) -> list[int | Doubt]:
    """Return the choice of the best hypothesis for each ray, unless a likely one chooses otherwise.

    cost: (hypotheses,), ascending; choices: (hypotheses, rays).
    """
    found: list[int | Doubt] = []
    for number, choice in enumerate(choices[0].tolist()):
        rivals = cost[choices[:, number] != choice]
        if len(rivals) and rivals[0] - cost[0] < 2 * math.log(rules.sure_odds):
            found.append(Doubt.AMBIGUOUS)
        else:
            found.append(Doubt.UNEXPLAINED if choice == _NONE else choice)
    return found


def _extend(beam: _Beam, ray: Ray, moved_m: FloatArray, hint: int, rules: DetectionRules) -> None:
    """Follow every hypothesis into every way to explain one more ray."""
    hypotheses = len(beam.cost)
    seen = _compare([ray], beam.mean + moved_m, beam.covariance, rules)
    possible = _possible(seen, [hint] * hypotheses, ~beam.taken, rules)
    none = np.full(hypotheses, _unexplained(rules))
    if hint != _NONE:
        none[possible[:, hint]] = np.inf
    options = np.column_stack([np.where(possible, seen.cost, np.inf), none]) + beam.cost[:, None]
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
    gain = seen.shadow[at].transpose(0, 2, 1) @ seen.weight[at]
    beam.mean[by] -= (gain @ seen.miss[at][:, :, None])[:, :, 0]
    beam.covariance[by] -= gain @ seen.shadow[at]
    beam.taken[by] = True


def _unexplained(rules: DetectionRules) -> float:
    """Return what it costs to leave a ray to no known threat."""
    return -2 * math.log(rules.unexplained_per_sr)
