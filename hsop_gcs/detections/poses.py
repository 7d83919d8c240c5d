"""Where a host was and how it was turned, lately: telemetry kept for the detections that come after it.

Position, attitude and gimbal arrive at rates of their own; each is a series, interpolated by itself.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise

from hsop_gcs.detections.detection import Reason, Unusable
from hsop_gcs.geometry.frames import Aim, wrap_deg
from hsop_gcs.reports import Vector3

MEMORY_S = 6.0
"""Longer than the tracker takes late reports, and the way of a detection to us."""
_SAME_SAMPLE_S = 1e-3
"""Two clocks read one after the other differ by less; no telemetry comes so often."""
_DATED_S = 0.02
"""Standard deviation of when a sample was taken."""
_OFF_S = math.sqrt(3) * _DATED_S
"""Looked at so much earlier and later, a sixth of each weight: what Gauss and Hermite take for a normal error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A host at one time: ENU metres, compass heading, roll right and nose up positive, the gimbal's earth-frame aim.

    The sigmas are what interpolation leaves open, each axis across a ray, radians: a gimbal that steps between two
    samples is anywhere between them.
    """

    position_m: Vector3
    heading_deg: float
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    attitude_sigma_rad: float = 0.0
    aim: Aim | None = None
    aim_sigma_rad: float = 0.0


Sample = tuple[float, Vector3]
"""Time, and three numbers."""
Series = tuple[Sample, ...]
"""Oldest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseHistory:
    """One host's telemetry of the last seconds; each sample makes a new history, one that comes late none."""

    positions: Series = ()
    attitudes: Series = ()
    """Heading, roll, pitch, degrees."""
    aims: Series = ()
    """Pan, tilt, 0, degrees."""

    def with_position(self, time_s: float, position_m: Vector3) -> "PoseHistory":
        """Add where it was, ENU."""
        return replace(self, positions=_appended(self.positions, time_s, position_m))

    def with_attitude(self, time_s: float, *, heading_deg: float, roll_deg: float, pitch_deg: float) -> "PoseHistory":
        """Add how it was turned: compass heading, right wing down and nose up positive."""
        return replace(self, attitudes=_appended(self.attitudes, time_s, (heading_deg, roll_deg, pitch_deg)))

    def with_aim(self, time_s: float, aim: Aim) -> "PoseHistory":
        """Add where its gimbal looked, in the earth frame."""
        return replace(self, aims=_appended(self.aims, time_s, (aim.pan_deg, aim.tilt_deg, 0.0)))

    def at(self, time_s: float, limit_s: float) -> Pose:
        """Return the pose at ``time_s``. Raises Unusable if position or attitude are not known within ``limit_s``.

        Beyond the newest sample a position goes on as it moved, angles stay.
        """
        _require_near(self.positions, time_s, limit_s, "position")
        _require_near(self.attitudes, time_s, limit_s, "attitude")
        attitude, open_deg2 = _angles_at(self.attitudes, time_s)
        turning_deg2 = _misdated(self.attitudes, time_s, attitude)
        heading_deg, roll_deg, pitch_deg = attitude
        pose = Pose(
            position_m=_position_at(self.positions, time_s),
            heading_deg=heading_deg % 360.0,
            roll_deg=roll_deg,
            pitch_deg=pitch_deg,
            attitude_sigma_rad=_across_rad(open_deg2 + sum(turning_deg2)),
        )
        if _outside_s(self.aims, time_s) > limit_s:
            return pose
        looking, open_deg2 = _angles_at(self.aims, time_s)
        # where the gimbal looks in the earth's frame hangs on the nose as well
        open_deg2 += sum(_misdated(self.aims, time_s, looking)) + turning_deg2[0]
        aim = Aim(pan_deg=looking[0] % 360.0, tilt_deg=looking[1])
        return replace(pose, aim=aim, aim_sigma_rad=_across_rad(open_deg2))


def _across_rad(open_deg2: float) -> float:
    """Return the standard deviation of a direction along each of its two axes."""
    return math.radians(math.sqrt(open_deg2 / 2))


def _appended(series: Series, time_s: float, values: Vector3) -> Series:
    if series and time_s < series[-1][0] + _SAME_SAMPLE_S:
        return series
    first = bisect_right(series, time_s - MEMORY_S, key=_time)
    return (*series[first:], (time_s, values))


def _time(sample: Sample) -> float:
    return sample[0]


def _outside_s(series: Series, time_s: float) -> float:
    """Return how far the nearest sample is, seconds; infinite without one."""
    place = bisect_right(series, time_s, key=_time)
    return min((abs(time_s - sample[0]) for sample in series[max(place - 1, 0) : place + 1]), default=math.inf)


def _require_near(series: Series, time_s: float, limit_s: float, what: str) -> None:
    outside_s = _outside_s(series, time_s)
    if outside_s == math.inf:
        raise Unusable(Reason.NO_POSE, "time", f"the host's {what} was never heard")
    if outside_s > limit_s:
        side = "newest" if time_s > series[-1][0] else "oldest" if time_s < series[0][0] else "nearest"
        raise Unusable(
            Reason.NO_POSE,
            "time",
            f"{outside_s:.2f} s from the {side} {what} heard of the host; the limit is {limit_s:g} s",
        )


def _bracket(series: Series, time_s: float) -> tuple[Sample, Sample, float]:
    """Return two neighbouring samples and the share of the way from one to the other: below 0 or above 1 outside."""
    if len(series) == 1:
        return series[0], series[0], 0.0
    place = min(max(bisect_right(series, time_s, key=_time), 1), len(series) - 1)
    before, after = series[place - 1], series[place]
    return before, after, (time_s - before[0]) / (after[0] - before[0])


def _position_at(series: Series, time_s: float) -> Vector3:
    (_, (x0, y0, z0)), (_, (x1, y1, z1)), share = _bracket(series, time_s)
    return (x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0))


def _angles_at(series: Series, time_s: float) -> tuple[Vector3, float]:
    """Return the angles, interpolated the short way around, and the square of what they leave open, all degrees.

    Between samples an angle may have gone over at any moment: then it has mean ``share`` of the way and variance
    share (1 - share) times its square. Outside, it may have moved on as much as in the fastest of the last intervals.
    A gimbal that turns back between two samples looks at rest there: it may have gone on as before, and come back as
    after.
    """
    before, after, share = _bracket(series, time_s)
    place = bisect_right(series, before[0], key=_time)
    nearby = [_steps(one, other) for (_, one), (_, other) in pairwise(series[max(place - 2, 0) : place + 2])]
    turned_deg = [math.hypot(*each) for each in nearby]
    inside = min(max(share, 0.0), 1.0)
    between_deg = math.hypot(*_steps(before[1], after[1]))
    if len(nearby) == 3 and sum(a * b for a, b in zip(nearby[0], nearby[2], strict=True)) < 0:
        between_deg = max(between_deg, min(turned_deg[0], turned_deg[2]))
    variance = inside * (1 - inside) * between_deg**2
    variance += min(abs(share - inside), 1.0) * max(turned_deg, default=0.0) ** 2
    return _interpolated(series, time_s), variance


def _misdated(series: Series, time_s: float, angles: Vector3) -> Vector3:
    """Return the variances of the angles at a time, square degrees: they are as wrong as samples are wrongly dated."""
    early, late = (_steps(angles, _interpolated(series, time_s + off_s)) for off_s in (-_OFF_S, _OFF_S))
    x, y, z = ((a * a + b * b) / 6 for a, b in zip(early, late, strict=True))
    return (x, y, z)


def _interpolated(series: Series, time_s: float) -> Vector3:
    (_, first), (_, second), share = _bracket(series, time_s)
    inside = min(max(share, 0.0), 1.0)
    x, y, z = (a + inside * step for a, step in zip(first, _steps(first, second), strict=True))
    return (x, y, z)


def _steps(one: Vector3, other: Vector3) -> list[float]:
    return [wrap_deg(b - a) for a, b in zip(one, other, strict=True)]
