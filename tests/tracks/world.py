"""Threats that fly as the filter assumes, or straight, and what sources make of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsop_gcs.reports import Bearing, Measurement, Report, Vector3
from hsop_gcs.tracks import Picture, State, TrackRules, Verdict, kernels, update
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.history import Log
from hsop_gcs.tracks.measured import rows_of

T0_S = 1_700_000_000.0
RULES = TrackRules()


def vector(values: Sequence[float] | FloatArray) -> Vector3:
    east, north, up = (float(value) for value in values)
    return (east, north, up)


def report(time_s: float, east: float, north: float = 0.0, up: float = 40.0, **given: Any) -> Report:
    """A radar's report of its threat t1, ``time_s`` after the beginning."""
    fields: dict[str, Any] = {"source": "radar", "threat_id": "t1", "position_m": (east, north, up)}
    return Report(time_s=T0_S + time_s, **(fields | given))


def bearing(time_s: float, origin_m: Vector3, towards_m: Vector3, sigma_rad: float, **given: Any) -> Bearing:
    direction = vector(np.array(towards_m) - np.array(origin_m))
    fields: dict[str, Any] = {"source": "h1/central"}
    return Bearing(
        time_s=T0_S + time_s, origin_m=origin_m, direction=direction, sigma_rad=sigma_rad, **(fields | given)
    )


def after(*measurements: Report | Bearing, rules: TrackRules = RULES, picture: Picture | None = None) -> Picture:
    """The picture after measurements that arrive one by one, in no time, and are all accepted."""
    picture = picture or Picture()
    for each in measurements:
        picture, (verdict,) = update(picture, [each], each.time_s, rules)
        assert isinstance(verdict, str), verdict
    return picture


def first_state(measured: Report, rules: TrackRules = RULES) -> State:
    """What one report alone says."""
    log = Log()
    return log.state(log.follow(np.array([-1]), [measured], rows_of([measured], rules), rules).item())


def advance(states: Sequence[State], measurements: Sequence[Measurement], rules: TrackRules = RULES) -> list[State]:
    """Each state after its measurement, which is not older."""
    log, rows = Log(), rows_of(measurements, rules)
    before = [log.add(-1, *each) for each in zip(measurements, rows, states, strict=True)]
    return [log.state(at) for at in log.follow(np.array(before), measurements, rows, rules).tolist()]


def distances(states: Sequence[State], reports: Sequence[Measurement]) -> FloatArray:
    """The squared Mahalanobis distance of each report from its state."""
    log, rows = Log(), rows_of(reports, RULES)
    before = [log.add(-1, *each) for each in zip(reports, rows, states, strict=True)]
    return kernels.distances(*log.steps[:3], np.array(before), rows, RULES.acceleration_psd_m2ps3)


def verdict_on(picture: Picture, measurement: Report | Bearing, **given: Any) -> Verdict:
    now_s = given.pop("now_s", measurement.time_s)
    return update(picture, [measurement], now_s, RULES, **given)[1][0]


def wandering(
    rng: np.random.Generator, start: FloatArray, steps: int, step_s: float, acceleration_psd_m2ps3: float
) -> FloatArray:
    """Return (steps, 6): positions and velocities of a threat with white-noise acceleration."""
    transition = np.eye(6) + step_s * np.eye(6, k=3)
    one_axis = np.array([[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]])
    root = np.kron(np.linalg.cholesky(acceleration_psd_m2ps3 * one_axis), np.eye(3))
    states = [start]
    for _ in range(steps - 1):
        states.append(transition @ states[-1] + root @ rng.normal(size=6))
    return np.array(states)


def off_by(rng: np.random.Generator, direction: FloatArray, sigma_rad: float) -> Vector3:
    """Return the direction as a camera measures it."""
    along = direction / np.linalg.norm(direction)
    right = np.cross(along, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    noise = rng.normal(0.0, sigma_rad, 2)
    return vector(along + noise[0] * right + noise[1] * np.cross(right, along))
