"""Our own aircraft beside what sources report: where each was lately, and which reports may be of it.

A report is late by what the sensor, its tracker and its way to us took, and its time says so, or not: many sources
stamp what they send. So it is held against where a host was at the report's time and, as far as a velocity in it does
not speak against that, against all of the host's way since then, and of the last ``host_lag_s``.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from hsop_gcs.reports import Bearing, Measurement, Report, Vector3
from hsop_gcs.tracks.filter import State
from hsop_gcs.tracks.rules import TrackRules
from hsop_gcs.tracks.sources import Refusal, RefusalKind

HOST_SIGMA_M = 1.0
"""Standard deviation of a host's own place beside what others measure of it, each axis."""
_OTHERWISE_MPS = 3.0
"""A velocity this far from a host's, besides its own doubt, is of something else that crosses the host's way."""
_SURELY_APART = 5.0
"""Standard deviations: what sources make of a host is farther from it once in a day."""
OVERSHOOTS_FOR_S = 8.0
_OVERSHOOT = 0.5
"""How far a track of a host that stops or turns goes on, as a share of the way that the host has flown lately."""
_SLACK_S = 0.25
"""How far a host's telemetry may be dated wrongly itself."""

Sample = tuple[float, Vector3]
"""When, and where, ENU metres."""
Path = tuple[Sample, ...]
"""Oldest first; straight on between two samples, at rest before the first and after the last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnAircraft:
    """What is known of our own aircraft when measurements arrive."""

    paths: Mapping[str, Path] = field(default_factory=dict)
    """Where hosts were lately: those that one of the measurements may be of."""
    unheard: tuple[str, ...] = ()
    """Hosts whose place is not known now: nothing proves that a threat is not one of them."""

    @classmethod
    def at_rest(cls, places_m: Mapping[str, Vector3]) -> "OwnAircraft":
        """Return hosts that have always been where they are."""
        return cls(paths={host: ((0.0, place),) for host, place in places_m.items()})


NO_OWN = OwnAircraft()


class Suspicion(NamedTuple):
    """That a report is of a host of ours."""

    host: str
    cost: float
    """-2 log likelihood of the report if it is, to hold against that of a track."""
    refusal: Refusal


def suspicion(measurement: Measurement, now_s: float, rules: TrackRules, own: OwnAircraft) -> Suspicion | None:
    """Return which host of ours a measurement, which arrived at ``now_s``, is likeliest of; None if it is of none."""
    if isinstance(measurement, Bearing):
        return None
    found = (each for host, path in own.paths.items() if (each := _of(measurement, host, path, now_s, rules)))
    return min(found, key=lambda each: each.cost, default=None)


def hosts_it_may_be(state: State, now_s: float, rules: TrackRules, own: OwnAircraft) -> dict[str, bool]:
    """Return the hosts from which a track is not surely apart, by its state, which many reports make better than one;
    and whether it is surely that host: as near as a report of it would be taken for it, and known so well.
    """
    east, north, up = state.mean[:3].tolist()
    doubt_m = _SURELY_APART * math.sqrt(state.position_variance_m2 + HOST_SIGMA_M**2)
    found = {}
    for host, path in own.paths.items():
        ways = _ways(path, min(state.time_s, now_s - rules.host_lag_s) - _SLACK_S)
        away_m = min(math.dist((east, north, up), _nearest((east, north, up), a, b)) for a, b, _ in ways)
        flown_m = sum(math.dist(a, b) for a, b, _ in _ways(path, now_s - OVERSHOOTS_FOR_S))
        limit_m = max(doubt_m, rules.max_host_radius_m) + _OVERSHOOT * flown_m
        if away_m <= min(limit_m, rules.host_doubt_m):
            found[host] = doubt_m <= rules.max_host_radius_m
    return found


def position_at(path: Path, time_s: float) -> Vector3:
    """Return where a host was, ENU metres."""
    for (before_s, a), (after_s, b) in pairwise(path):
        if before_s <= time_s <= after_s:
            share = (time_s - before_s) / (after_s - before_s) if after_s > before_s else 1.0
            return (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))
    return path[0][1] if time_s < path[0][0] else path[-1][1]


def remote_id(text: str) -> str:
    """Return an id as it is compared: receivers differ in case and put in blanks."""
    return "".join(text.split()).casefold()


def is_remote_id(threat_id: str, host: str) -> Refusal:
    """Return why a report under a remote id of a host is refused."""
    return Refusal(RefusalKind.OWN_HOST, "threat_id", f"{threat_id!r} is a remote id of host {host!r}", host=host)


def _of(report: Report, host: str, path: Path, now_s: float, rules: TrackRules) -> Suspicion | None:
    away_m = math.dist(report.position_m, position_at(path, report.time_s))
    nearest_m = away_m
    # without a doubt about its time a report of a host that hovers costs no more than this
    if away_m > _radius_m(report, position_at(path, report.time_s), rules):
        nearest_m = math.inf
        for a, b, velocity_mps in _ways(path, min(report.time_s, now_s - rules.host_lag_s) - _SLACK_S):
            place = _nearest(report.position_m, a, b)
            distance_m = math.dist(report.position_m, place)
            if distance_m <= _radius_m(report, place, rules) and not _flies_otherwise(report, velocity_mps, rules):
                nearest_m = min(nearest_m, distance_m)
        if nearest_m == math.inf:
            return None
    problem = f"{nearest_m:.1f} m from host {host!r}: taken for that host"
    refusal = Refusal(RefusalKind.OWN_HOST, "position", problem, host=host)
    return Suspicion(host, _cost(report, nearest_m, rules), refusal)


def _ways(path: Path, from_s: float) -> Iterator[tuple[Vector3, Vector3, Vector3]]:
    """Yield the straight parts of a path since a time: their ends and the velocity on them."""
    begun = (from_s, position_at(path, from_s))
    rest = tuple(sample for sample in path if sample[0] > from_s) or (begun,)
    for (a_s, a), (b_s, b) in pairwise((begun, *rest)):
        spent_s = max(b_s - a_s, 1e-3)
        yield a, b, ((b[0] - a[0]) / spent_s, (b[1] - a[1]) / spent_s, (b[2] - a[2]) / spent_s)


def _nearest(point: Vector3, a: Vector3, b: Vector3) -> Vector3:
    along = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    length_m2 = along[0] ** 2 + along[1] ** 2 + along[2] ** 2
    if length_m2 == 0.0:
        return a
    share = sum((point[i] - a[i]) * along[i] for i in range(3)) / length_m2
    share = min(max(share, 0.0), 1.0)
    return (a[0] + share * along[0], a[1] + share * along[1], a[2] + share * along[2])


def _radius_m(report: Report, place_m: Vector3, rules: TrackRules) -> float:
    """Within this of a host a report is of it: twice its doubt in that direction, but never far."""
    sigma_m = rules.default_sigma_m if report.sigma_m is None else report.sigma_m
    if report.covariance_m2 is not None:
        off = [report.position_m[i] - place_m[i] for i in range(3)]
        length_m = math.hypot(*off) or 1.0
        unit = [each / length_m for each in off]
        variance_m2 = sum(unit[i] * report.covariance_m2[i][j] * unit[j] for i in range(3) for j in range(3))
        sigma_m = math.sqrt(max(variance_m2, 0.0))
    return min(max(rules.host_radius_m, 2 * sigma_m), rules.max_host_radius_m)


def _flies_otherwise(report: Report, velocity_mps: Vector3, rules: TrackRules) -> bool:
    if report.velocity_mps is None:
        return False
    sigma_mps = rules.velocity_sigma_mps if report.velocity_sigma_mps is None else report.velocity_sigma_mps
    return math.dist(report.velocity_mps, velocity_mps) > _OTHERWISE_MPS + 2 * sigma_mps


def _cost(report: Report, distance_m: float, rules: TrackRules) -> float:
    """As ``kernels.in_gates`` counts: squared distance and log determinant, over position alone."""
    sigma_m = rules.default_sigma_m if report.sigma_m is None else report.sigma_m
    if report.covariance_m2 is not None:
        sigma_m = math.sqrt(sum(report.covariance_m2[i][i] for i in range(3)) / 3)
    variance_m2 = sigma_m**2 + HOST_SIGMA_M**2
    return distance_m**2 / variance_m2 + 3 * math.log(variance_m2)
