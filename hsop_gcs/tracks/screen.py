"""What a measurement is refused for before any track is looked at."""

import math

from hsop_gcs.errors import BadInput
from hsop_gcs.reports import Bearing, Matrix3, Measurement, Report, ReportRules, Vector3, check_time
from hsop_gcs.tracks.sources import Refusal, RefusalKind


def refusal_of(measurement: Measurement, now_s: float, clock: ReportRules) -> Refusal | None:
    """Return why a measurement cannot be believed, whatever threats there are; None if it may be."""
    try:
        check_time(measurement.time_s, now_s, clock)
    except BadInput as error:
        return Refusal(RefusalKind.CLOCK, error.field, error.problem)
    return _no_bearing(measurement) if isinstance(measurement, Bearing) else _no_position(measurement)


def _no_bearing(bearing: Bearing) -> Refusal | None:
    if not _finite(bearing.origin_m):
        return Refusal(RefusalKind.INVALID, "origin_m", f"{bearing.origin_m} is not a place")
    if not _finite(bearing.direction) or not any(bearing.direction):
        return Refusal(RefusalKind.INVALID, "direction", f"{bearing.direction} is not a direction")
    if not 0 < bearing.sigma_rad < math.inf:
        return Refusal(RefusalKind.INVALID, "sigma_rad", f"{bearing.sigma_rad} is not a standard deviation")
    return None


def _no_position(report: Report) -> Refusal | None:
    east, north, up = report.position_m
    if not (math.isfinite(east) and math.isfinite(north) and math.isfinite(up)):
        return Refusal(RefusalKind.INVALID, "position", f"{report.position_m} is not a place")
    if report.velocity_mps is not None and not _finite(report.velocity_mps):
        return Refusal(RefusalKind.INVALID, "velocity", f"{report.velocity_mps} is not a velocity")
    if (sigma_m := report.sigma_m) is not None and not 0 <= sigma_m < math.inf:
        return Refusal(RefusalKind.INVALID, "sigma_m", f"{sigma_m} is not a standard deviation")
    if (sigma_mps := report.velocity_sigma_mps) is not None and not 0 <= sigma_mps < math.inf:
        return Refusal(RefusalKind.INVALID, "velocity_sigma_mps", f"{sigma_mps} is not a standard deviation")
    if report.covariance_m2 is not None and not _is_covariance(report.covariance_m2):
        return Refusal(RefusalKind.INVALID, "covariance_m2", f"{report.covariance_m2} is not a covariance")
    if report.common_m2 is not None and not _is_part(report.common_m2, report.covariance_m2):
        return Refusal(RefusalKind.INVALID, "common_m2", f"{report.common_m2} is no part of the report's covariance")
    return None


def _finite(vector: Vector3) -> bool:
    return all(map(math.isfinite, vector))


def _is_covariance(matrix: Matrix3) -> bool:
    """Whether it is finite, symmetric and positive definite: whether Cholesky's pivots are."""
    if [len(row) for row in matrix] != [3, 3, 3] or not all(map(_finite, matrix)):
        return False
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    if not all(math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-8) for a, b in ((xy, yx), (xz, zx), (yz, zy))) or xx <= 0:
        return False
    yy, yz, zz = yy - xy * xy / xx, yz - xy * xz / xx, zz - xz * xz / xx
    return yy > 0 and zz - yz * yz / yy > 0


def _is_part(common: Matrix3, matrix: Matrix3 | None) -> bool:
    """Whether what is left of a covariance without the common part is one."""
    if matrix is None or [len(row) for row in common] != [3, 3, 3]:
        return False
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = [
        (a[0] - b[0], a[1] - b[1], a[2] - b[2]) for a, b in zip(matrix, common, strict=True)
    ]
    return _is_covariance(((xx, xy, xz), (yx, yy, yz), (zx, zy, zz)))
