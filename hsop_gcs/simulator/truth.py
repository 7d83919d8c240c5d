"""True threats: where they really are, from a truth file (JSON).

    {"epoch": "2026-01-31T12:00:00Z",
     "threats": [{"id": "t1", "position_m": [12.0, 40.0, 30.0], "velocity_mps": [1.5, -0.5, 0.0], "size_m": 1.0,
                  "start_s": 0.0, "end_s": 60.0,
                  "turns": [{"at_s": 5.0, "for_s": 9.0, "rate_deg_s": 10.0}]},
                 {"id": "t2", "lat_deg": 47.4, "lon_deg": 8.5, "altitude_amsl_m": 520.0, "velocity_mps": [3.0, 0.0],
                  "waypoints_m": [[80.0, 0.0, 30.0], [80.0, 90.0, 30.0]]}]}

Only ``id`` and a position are needed. Positions are ENU metres of the simulator's origin, or WGS-84 and AMSL. A threat
exists from ``start_s`` to ``end_s`` after the epoch (by default, when the simulator starts). ``turns`` are level and
clockwise positive, their times count from the threat's start. A threat with ``waypoints_m`` passes them in order at the
speed of its velocity and flies on straight after the last. A scenario file is a truth file too.
"""

import json
import math
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.reports import Vector3

_FARTHEST_M = 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueState:
    """A threat at one time, ENU metres and metres per second."""

    id: str
    position_m: Vector3
    velocity_mps: Vector3
    size_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A straight flight or a level turn; times are seconds from the threat's start."""

    starts_s: float
    position_m: Vector3
    velocity_mps: Vector3
    turn_rad_s: float = 0.0
    """Clockwise positive."""

    def at(self, time_s: float) -> tuple[Vector3, Vector3]:
        """Return position and velocity, whether or not the leg lasts that long."""
        (x, y, z), (vx, vy, vz) = self.position_m, self.velocity_mps
        elapsed_s = time_s - self.starts_s
        angle = self.turn_rad_s * elapsed_s
        cos, sin = math.cos(angle), math.sin(angle)
        # sin(a)/a and (1 - cos(a))/a, which are 1 and 0 on a straight leg.
        ahead_s = elapsed_s * (sin / angle if angle else 1.0)
        aside_s = elapsed_s * ((1 - cos) / angle if angle else 0.0)
        position = (x + vx * ahead_s + vy * aside_s, y + vy * ahead_s - vx * aside_s, z + vz * elapsed_s)
        return position, (vx * cos + vy * sin, vy * cos - vx * sin, vz)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueThreat:
    """One threat's whole flight; times are seconds since the truth's epoch."""

    id: str
    size_m: float
    legs: tuple[Leg, ...]
    """In order of time, the first at 0."""
    start_s: float = 0.0
    end_s: float = math.inf

    def at(self, time_s: float) -> TrueState | None:
        """Return the threat ``time_s`` after the epoch; None while it is not there."""
        if not self.start_s <= time_s <= self.end_s:
            return None
        flown_s = time_s - self.start_s
        leg = self.legs[max(bisect_right(self.legs, flown_s, key=lambda each: each.starts_s) - 1, 0)]
        position, velocity = leg.at(flown_s)
        return TrueState(id=self.id, position_m=position, velocity_mps=velocity, size_m=self.size_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """All threats of one truth file."""

    threats: tuple[TrueThreat, ...]
    epoch_s: float | None = None
    """Seconds since the Unix epoch; None: when the simulator starts."""

    def at(self, time_s: float) -> list[TrueState]:
        """Return the threats that are there ``time_s`` after the epoch."""
        return [state for threat in self.threats if (state := threat.at(time_s)) is not None]


def read_truth(path: Path, origin: GeodeticPoint) -> Truth:
    """Read a truth file. Raises BadInput that names the field and the value of the first fault."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput("--truth", f"cannot read {str(path)!r}: {error}") from None
    return truth_from_text(text, origin, source=repr(str(path)))


def truth_from_text(text: str, origin: GeodeticPoint, *, source: str = "standard input") -> Truth:
    """Return the truth that a JSON text describes. Raises BadInput that names the field and the value."""
    try:
        given = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise BadInput("--truth", f"{source} is not JSON: {error}") from None
    return truth_from_json(given, origin)


def truth_from_json(given: Any, origin: GeodeticPoint) -> Truth:
    """Return the truth in the ENU frame of ``origin``. Raises BadInput that names the field and the value."""
    try:
        file = _File.model_validate(given)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in fault["loc"]) or "truth"
        shown = "" if fault["type"] in ("missing", "value_error") else f" (given: {fault['input']!r:.80})"
        raise BadInput(field, fault["msg"].removeprefix("Value error, ") + shown) from None
    frame = LocalFrame(origin)
    return Truth(
        threats=tuple(_threat(each, frame) for each in file.threats),
        epoch_s=None if file.epoch is None else file.epoch.timestamp(),
    )


_Metres = Annotated[float, Field(strict=True, ge=-_FARTHEST_M, le=_FARTHEST_M)]
_Speed = Annotated[float, Field(strict=True, ge=-200, le=200)]
_Seconds = Annotated[float, Field(strict=True, ge=0, le=1e6)]
_Place = Annotated[tuple[_Metres, ...], Field(min_length=2, max_length=3)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Turn(_Section):
    at_s: _Seconds
    for_s: _Seconds
    rate_deg_s: Annotated[float, Field(strict=True, ge=-360, le=360)]


class _Threat(_Section):
    id: Annotated[str, Field(min_length=1, max_length=64)]
    position_m: _Place | None = None
    lat_deg: Annotated[float, Field(strict=True, ge=-90, le=90)] | None = None
    lon_deg: Annotated[float, Field(strict=True, ge=-180, le=180)] | None = None
    altitude_amsl_m: Annotated[float, Field(strict=True, ge=-1000, le=20_000)] | None = None
    velocity_mps: Annotated[tuple[_Speed, ...], Field(min_length=2, max_length=3)] = (0.0, 0.0)
    size_m: Annotated[float, Field(strict=True, gt=0, le=50)] = 1.0
    weight: float = 1.0
    """Of a scenario; the truth does not weigh."""
    start_s: _Seconds = 0.0
    end_s: _Seconds | None = None
    turns: tuple[_Turn, ...] = ()
    waypoints_m: tuple[_Place, ...] = ()

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        geodetic = (self.lat_deg, self.lon_deg, self.altitude_amsl_m)
        given = sum(value is not None for value in geodetic)
        if (self.position_m is None) != (given == 3) or given not in (0, 3):
            raise ValueError(f"{self.id!r} needs position_m, or lat_deg, lon_deg and altitude_amsl_m")
        if self.turns and self.waypoints_m:
            raise ValueError(f"{self.id!r} has turns and waypoints_m; it can fly only one of them")
        if self.waypoints_m and not any(self.velocity_mps):
            raise ValueError(f"{self.id!r} has waypoints_m and no velocity_mps to reach them with")
        if self.end_s is not None and self.end_s < self.start_s:
            raise ValueError(f"{self.id!r} ends at {self.end_s:g} s, before it starts")
        for before, after in zip(self.turns, self.turns[1:], strict=False):
            if after.at_s < before.at_s + before.for_s:
                raise ValueError(f"{self.id!r} turns at {after.at_s:g} s while it is still turning")
        return self


class _File(_Section):
    epoch: AwareDatetime | None = None
    threats: Annotated[tuple[_Threat, ...], Field(min_length=1, max_length=1000)]
    parameters: Any = None
    hosts: Any = None
    fence: Any = None
    keep_outs: Any = None
    """A scenario file has these; they are nothing to the truth."""

    @model_validator(mode="after")
    def _unique(self) -> Self:
        seen: set[str] = set()
        for threat in self.threats:
            if threat.id in seen:
                raise ValueError(f"two threats have id {threat.id!r}")
            seen.add(threat.id)
        return self


def _threat(given: _Threat, frame: LocalFrame) -> TrueThreat:
    velocity = _vector(given.velocity_mps)
    start = _position(given, frame)
    legs = (
        _legs_by_waypoints(start, velocity, [_vector(each) for each in given.waypoints_m])
        if given.waypoints_m
        else _legs_with_turns(start, velocity, given.turns)
    )
    end_s = math.inf if given.end_s is None else given.end_s
    return TrueThreat(id=given.id, size_m=given.size_m, legs=legs, start_s=given.start_s, end_s=end_s)


def _position(given: _Threat, frame: LocalFrame) -> Vector3:
    if given.position_m is not None:
        return _vector(given.position_m)
    assert given.lat_deg is not None
    assert given.lon_deg is not None
    assert given.altitude_amsl_m is not None
    point = GeodeticPoint(lat_deg=given.lat_deg, lon_deg=given.lon_deg, altitude_amsl_m=given.altitude_amsl_m)
    return _vector(tuple(frame.to_enu(point).tolist()))


def _legs_with_turns(position: Vector3, velocity: Vector3, turns: tuple[_Turn, ...]) -> tuple[Leg, ...]:
    legs = [Leg(starts_s=0.0, position_m=position, velocity_mps=velocity)]
    for turn in turns:
        for time_s, rate_deg_s in ((turn.at_s, turn.rate_deg_s), (turn.at_s + turn.for_s, 0.0)):
            position, velocity = legs[-1].at(time_s)
            turn_rad_s = math.radians(rate_deg_s)
            legs.append(Leg(starts_s=time_s, position_m=position, velocity_mps=velocity, turn_rad_s=turn_rad_s))
    return tuple(legs)


def _legs_by_waypoints(position: Vector3, velocity: Vector3, waypoints: list[Vector3]) -> tuple[Leg, ...]:
    speed_mps = math.hypot(*velocity)
    legs: list[Leg] = []
    time_s = 0.0
    for waypoint in waypoints:
        way = np.subtract(waypoint, position)
        length_m = float(np.linalg.norm(way))
        if length_m > 0:
            velocity = _vector(tuple((way * (speed_mps / length_m)).tolist()))
            legs.append(Leg(starts_s=time_s, position_m=position, velocity_mps=velocity))
            time_s += length_m / speed_mps
            position = waypoint
    legs.append(Leg(starts_s=time_s, position_m=position, velocity_mps=velocity))
    return tuple(legs)


def _vector(values: tuple[float, ...]) -> Vector3:
    """Return three numbers; a third that is not given is 0."""
    x, y, z = (*values, 0.0)[:3]
    return (x, y, z)
