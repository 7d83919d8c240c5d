"""Measurements and rules as rows of numbers, as the kernels take them."""

import math
import struct
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hsop_gcs.reports import Bearing, Measurement, Report
from hsop_gcs.tracks import kernels
from hsop_gcs.tracks.filter import FloatArray
from hsop_gcs.tracks.gate import gate_of, impossible_of
from hsop_gcs.tracks.rules import ConfirmAtOnce, TrackRules

_put_position = struct.Struct(f"{kernels.MEASURED + 3}d").pack_into
"""The first numbers of a row, which many reports have alone; faster than an array made of a list."""


@lru_cache(maxsize=8)
def numbers_of(rules: TrackRules) -> FloatArray:
    """Return (RULES,); see ``kernels``."""
    return np.array(
        [
            rules.acceleration_psd_m2ps3,
            rules.scan_s,
            rules.coast_after_s,
            rules.timeout_s,
            rules.tentative_timeout_s,
            rules.velocity_known_sigma_mps**2,
            rules.confirm_hits,
            rules.confirm_slots,
            rules.confirm_slot_s,
            rules.first_velocity_sigma_mps,
            rules.first_climb_sigma_mps,
            rules.default_size_m,
            impossible_of(3, rules),
            impossible_of(6, rules),
        ]
    )


def rows_of(measurements: Sequence[Measurement], rules: TrackRules) -> FloatArray:
    """Return (measurements, ROW); see ``kernels``. Hints are yet to be given.

    NaN stands for what is no standard deviation or matrix. No gate lets a bearing's row through: it is no report.
    """
    rows = np.zeros((len(measurements), kernels.ROW))
    room, position_gate, least_m = rows.data, gate_of(3, rules), rules.min_sigma_m
    for index, each in enumerate(measurements):
        if each.threat_id is not None or each.track_id is not None:
            rows[index, kernels.NAMED] = 1.0
        if isinstance(each, Bearing):
            rows[index, : kernels.SIGMA] = each.time_s, 0.0, -1.0
            continue
        sigma_m = each.sigma_m
        if sigma_m is None:
            sigma_m = rules.default_sigma_m
        elif not sigma_m > least_m:
            sigma_m = _at_least(sigma_m, least_m)
        at = 8 * kernels.ROW * index
        _put_position(room, at, each.time_s, 3.0, position_gate, sigma_m, sigma_m**2, *each.position_m)
        if each.threat_id is not None:
            rows[index, kernels.CONFIRMS] = _confirms(each, rules)
        if each.size_m is not None:
            rows[index, kernels.SIZE] = each.size_m
        if each.velocity_mps is not None or each.velocity_sigma_mps is not None:
            _add_velocity(rows[index], each, rules)
        if each.covariance_m2 is not None:
            covariance_m2 = [number for row in each.covariance_m2 for number in row]
            rows[index, kernels.SIGMA] = 0.0
            rows[index, kernels.COVARIANCE : kernels.COMMON] = covariance_m2 if len(covariance_m2) == 9 else math.nan
            if each.common_m2 is not None:
                rows[index, kernels.COMMON : kernels.CARRIED] = np.ravel(each.common_m2)
    return rows


def _add_velocity(row: FloatArray, report: Report, rules: TrackRules) -> None:
    sigma_mps = rules.velocity_sigma_mps
    if report.velocity_sigma_mps is not None:
        sigma_mps = _at_least(report.velocity_sigma_mps, rules.min_velocity_sigma_mps)
    row[kernels.VELOCITY_SIGMA], row[kernels.VELOCITY_VARIANCE] = sigma_mps, sigma_mps**2
    if report.velocity_mps is not None:
        row[kernels.DIMENSIONS], row[kernels.GATE] = 6.0, gate_of(6, rules)
        row[kernels.MEASURED + 3 : kernels.MEASURED + 6] = report.velocity_mps


def _at_least(sigma: float, least: float) -> float:
    """Return a standard deviation, no better than is believed; NaN if it is none."""
    if sigma > least:
        return sigma
    return least if sigma >= 0 else math.nan


def _confirms(report: Report, rules: TrackRules) -> bool:
    """Whether a report with an id confirms its track by itself."""
    match rules.confirm_at_once:
        case ConfirmAtOnce.ID:
            return True
        case ConfirmAtOnce.ID_AND_VELOCITY:
            return report.velocity_mps is not None
        case ConfirmAtOnce.NEVER:
            return False
