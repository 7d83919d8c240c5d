"""Candidates: places where rays of different hosts meet that no known threat explains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsop_gcs.detections.fix import Belief, Fix, fix_of
from hsop_gcs.detections.ray import Ray
from hsop_gcs.detections.rules import DetectionRules

_PASSING = 5.0
"""Rays that pass each other by more than so many standard deviations do not meet."""


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """Rays of two hosts or more that may show one threat."""

    rays: tuple[int, ...]
    hosts: int
    time_s: float
    fix: Fix


def meetings(rays: Sequence[Ray], rules: DetectionRules) -> list[Meeting]:
    """Return meetings that share no ray, the best supported first.

    Rays of two hosts towards several threats at one height meet in ghosts as well as in the threats. A third host
    tells them apart; where there is none, rays that meet more than one ray of an image are left alone.
    """
    pairs = [each for each in (_meeting(rays, pair, rules) for pair in _near_pairs(rays, rules)) if each is not None]
    grown = [_grown(each, rays, rules) for each in pairs]
    used: set[int] = set()
    found: list[Meeting] = []
    for each in sorted(grown, key=lambda each: (-each.hosts, -len(each.rays), each.fix.misfit, each.rays)):
        if used.isdisjoint(each.rays) and (each.hosts > 2 or not _rivalled(each, pairs, rays, used)):
            found.append(each)
            used.update(each.rays)
    return found


def _near_pairs(rays: Sequence[Ray], rules: DetectionRules) -> list[tuple[int, int]]:
    """Return the pairs of different hosts, near in time, that pass each other closely, ahead and within range."""
    if len(rays) < 2:
        return []
    first, second = np.triu_indices(len(rays), 1)
    origins, directions = np.array([ray.origin_m for ray in rays]), np.array([ray.direction for ray in rays])
    times_s = np.array([ray.time_s for ray in rays])
    hosts = np.array([ray.detection.host for ray in rays])
    worst = np.array([max(ray.sigma_rad) for ray in rays])
    apart_s = np.abs(times_s[first] - times_s[second])
    chosen = (hosts[first] != hosts[second]) & (apart_s <= rules.together_s)
    first, second, apart_s = first[chosen], second[chosen], apart_s[chosen]
    baseline = origins[second] - origins[first]
    u, v = directions[first], directions[second]
    cosine = (u * v).sum(axis=1)
    sine_squared = np.maximum(1 - cosine**2, 1e-9)
    along_u, along_v = (baseline * u).sum(axis=1), (baseline * v).sum(axis=1)
    depth_u = (along_u - cosine * along_v) / sine_squared
    depth_v = (cosine * along_u - along_v) / sine_squared
    passing_m = np.linalg.norm(baseline + depth_v[:, None] * v - depth_u[:, None] * u, axis=1)
    sigma_m = np.sqrt(
        np.square(worst[first] * depth_u)
        + np.square(worst[second] * depth_v)
        + np.square(rules.candidate_speed_mps * apart_s)
        + 2 * rules.host_sigma_m**2
    )
    near = (
        (np.minimum(depth_u, depth_v) >= rules.nearest_m)
        & (np.maximum(depth_u, depth_v) <= rules.farthest_m)
        & (passing_m <= _PASSING * sigma_m)
    )
    return list(zip(first[near].tolist(), second[near].tolist(), strict=True))


def _meeting(rays: Sequence[Ray], chosen: tuple[int, ...], rules: DetectionRules) -> Meeting | None:
    members = [rays[index] for index in chosen]
    time_s = max(ray.time_s for ray in members)
    belief = Belief(velocity_mps=(0.0, 0.0, 0.0), speed_sigma_mps=rules.candidate_speed_mps)
    fix = fix_of(members, time_s, belief, rules)
    if fix is None or fix.ranges_m.min() < rules.nearest_m or fix.ranges_m.max() > rules.farthest_m:
        return None
    return Meeting(chosen, len({ray.detection.host for ray in members}), time_s, fix)


def _grown(meeting: Meeting, rays: Sequence[Ray], rules: DetectionRules) -> Meeting:
    """Add every ray that goes through the meeting, at most one of each image."""
    for index, ray in enumerate(rays):
        taken = {rays[member].look for member in meeting.rays}
        if ray.look not in taken and abs(ray.time_s - meeting.time_s) <= rules.together_s:
            meeting = _meeting(rays, tuple(sorted((*meeting.rays, index))), rules) or meeting
    return meeting


def _rivalled(meeting: Meeting, pairs: list[Meeting], rays: Sequence[Ray], used: set[int]) -> bool:
    """Whether a ray of the meeting also meets another ray of an image that takes part in it."""
    looks = {rays[index].look for index in meeting.rays}
    for pair in pairs:
        mine = [index for index in pair.rays if index in meeting.rays]
        others = [index for index in pair.rays if index not in meeting.rays]
        if len(mine) == 1 and others[0] not in used and rays[others[0]].look in looks:
            return True
    return False
