"""Measurements side by side, a row of numbers each, as the kernels take them."""

from collections.abc import Sequence

import numpy as np

from hsop_gcs.reports import Bearing, Matrix3, Measurement, Report
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.gate import gate_of
from hsop_gcs.tracks.rules import ConfirmAtOnce, TrackRules

_AT_REST = (0.0, 0.0, 0.0)
_NOTHING = (0.0,) * 11


def rows_of(measurements: Sequence[Measurement], rules: TrackRules) -> FloatArray:
    """Return (measurements, ROW); see ``kernels``. No gate lets a bearing's row through: it is no report."""
    position_gate, velocity_gate = gate_of(3, rules), gate_of(6, rules)
    numbers: list[float] = []
    given: dict[int, Matrix3] = {}
    for index, each in enumerate(measurements):
        named = each.threat_id is not None or each.track_id is not None
        if isinstance(each, Bearing):
            numbers += (each.time_s, 0.0, -1.0, *_NOTHING, named, False)
            continue
        sigma_m = rules.default_sigma_m if each.sigma_m is None else max(each.sigma_m, rules.min_sigma_m)
        if each.velocity_mps is None:
            numbers += (each.time_s, 3.0, position_gate, *each.position_m, *_AT_REST, sigma_m, 0.0, sigma_m**2, 0.0)
        else:
            sigma_mps = _velocity_sigma_mps(each, rules)
            numbers += (each.time_s, 6.0, velocity_gate, *each.position_m, *each.velocity_mps)
            numbers += (sigma_m, sigma_mps, sigma_m**2, sigma_mps**2)
        numbers += (each.size_m or 0.0, named, named and _confirms(each, rules))
        if each.covariance_m2 is not None:
            given[index] = each.covariance_m2
    rows = np.zeros((len(measurements), kernels.ROW))
    rows[:, : kernels.COVARIANCE] = np.array(numbers).reshape(-1, kernels.COVARIANCE)
    for index, covariance_m2 in given.items():
        rows[index, kernels.SIGMA], rows[index, kernels.COVARIANCE :] = 0.0, np.ravel(covariance_m2)
    return rows


def _confirms(report: Report, rules: TrackRules) -> bool:
    """Whether a report confirms its track by itself."""
    if report.threat_id is None:
        return False
    match rules.confirm_at_once:
        case ConfirmAtOnce.ID:
            return True
        case ConfirmAtOnce.ID_AND_VELOCITY:
            return report.velocity_mps is not None
        case ConfirmAtOnce.NEVER:
            return False


def _velocity_sigma_mps(report: Report, rules: TrackRules) -> float:
    sigma_mps = report.velocity_sigma_mps
    return rules.velocity_sigma_mps if sigma_mps is None else max(sigma_mps, rules.min_velocity_sigma_mps)
