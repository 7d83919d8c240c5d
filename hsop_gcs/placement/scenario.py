"""Scenario files in, plan files out (JSON; design, section 2).

All hosts carry the rig of ``parameters``: ``peripheral`` and ``central`` cameras, and optionally how far the central
camera's gimbal tilts, ``tilt_deg``, and pans from the host's heading, ``pan_deg``, each [least, largest]. A host may
have any of these of its own, with the same keys; what it does not have is that of ``parameters``.
Nothing in a scenario is passed over: an unknown field, a wrong type and a value out of range are BadInput by name.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon, require_area
from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Point, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, Placement, View

FARTHEST_M = 1e6
"""Positions beyond this are no local coordinates."""
FASTEST_MPS = 1e4
_RIG_FIELDS = ("peripheral", "central", "tilt_deg", "pan_deg")
_CAMERA_FIELDS = ("focal_length_mm", "sensor_width_mm", "resolution_px", "min_pixels")


def parse_json(text: str, source: str) -> Any:
    """Read one JSON value. Raises BadInput naming the source, line and column."""
    try:
        return json.loads(text, object_pairs_hook=_without_repeats)
    except json.JSONDecodeError as error:
        raise BadInput(source, f"not JSON: {error.msg} at line {error.lineno} column {error.colno}") from None
    except ValueError as error:
        raise BadInput(source, f"not JSON: {error}") from None
    except RecursionError:
        raise BadInput(source, "not a scenario: nested too deeply") from None


def problem_from_json(
    scenario: Any,
    *,
    formulation: Formulation = Formulation.OPERATIONAL,
    objective: Objective = Objective.LETTER,
) -> Problem:
    """Turn a scenario file's content into a problem. Raises BadInput naming the field and the value."""
    fields = _object(scenario, "scenario", {"parameters", "threats", "hosts", "fence", "keep_outs"})
    if "threats" not in fields:
        raise BadInput("threats", "missing")
    threats = tuple(_threat(item, f"threats[{k}]") for k, item in enumerate(_list(fields["threats"], "threats")))
    if not threats:
        raise BadInput("threats", "there are none to place hosts for")
    _require_distinct([threat.id for threat in threats], "threats")
    given = _object(
        fields.get("parameters", {}),
        "parameters",
        {
            *("horizon_s", "safety_distance_m", "min_separation_m", "floor_m", "ceiling_m"),
            *("host_position_sigma_m", "host_attitude_sigma_deg", "max_views", *_RIG_FIELDS),
        },
    )
    rig = _rig(given, "parameters", CameraRig())
    hosts: tuple[AvailableHost, ...] = ()
    if "hosts" in fields:
        hosts = tuple(_host(item, f"hosts[{k}]", rig) for k, item in enumerate(_list(fields["hosts"], "hosts")))
        _require_distinct([host.id for host in hosts], "hosts")
    defaults = Problem(threats=threats)
    return Problem(
        threats=threats,
        hosts=hosts,
        max_hosts=len(hosts) if "hosts" in fields else None,
        rig=rig,
        horizon_s=_positive(given.get("horizon_s", defaults.horizon_s), "parameters.horizon_s", most=1e4),
        safety_distance_m=_positive(
            given.get("safety_distance_m", defaults.safety_distance_m), "parameters.safety_distance_m", most=1e5
        ),
        min_separation_m=_number(
            given.get("min_separation_m", defaults.min_separation_m), "parameters.min_separation_m", least=0.0, most=1e5
        ),
        airspace=_airspace(fields, given),
        position_sigma_m=_number(
            given.get("host_position_sigma_m", 0.0), "parameters.host_position_sigma_m", least=0.0, most=1e3
        ),
        attitude_sigma_rad=math.radians(
            _number(given.get("host_attitude_sigma_deg", 0.0), "parameters.host_attitude_sigma_deg", least=0.0, most=45)
        ),
        max_views=_views(given.get("max_views", 2), "parameters.max_views"),
        formulation=formulation,
        objective=objective,
    )


def plan_to_json(placement: Placement) -> dict[str, Any]:
    """Return a plan file's content. Every number in it is finite; what has no finite value is null."""
    return {
        "status": placement.status.value,
        **({"reason": placement.reason} if placement.reason else {}),
        **({"left_out": dict(placement.left_out)} if placement.left_out else {}),
        "formulation": placement.formulation.value,
        "objective": placement.objective.value,
        "method": str(placement.method),
        "n_hosts": len(placement.hosts),
        "cost": _finite(placement.cost),
        "lower_bound": _finite(placement.lower_bound),
        "solve_time_s": round(placement.solve_time_s, 6),
        "seed": placement.seed,
        "hosts": [_host_to_json(pose) for pose in placement.hosts],
        "pairs": [
            {
                "threat": pair.threat,
                "cost": _finite(pair.cost),
                "expected_error_m": _finite(pair.expected_error_m),
                "views": [_view_to_json(view) for view in pair.views],
                **({"more_views": [_view_to_json(view) for view in pair.more_views]} if pair.more_views else {}),
            }
            for pair in placement.pairs
        ],
    }


def _host_to_json(pose: HoverPose) -> dict[str, Any]:
    return {
        "id": pose.host,
        "position_m": list(pose.position_m),
        "heading_deg": pose.heading_deg,
        "pan_deg": pose.pan_deg,
        "tilt_deg": pose.tilt_deg,
    }


def _view_to_json(view: View) -> dict[str, str]:
    return {"host": view.host, "camera": view.camera.value}


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _threat(item: Any, field: str) -> Threat:
    given = _object(item, field, {"id", "position_m", "velocity_mps", "size_m", "weight"})
    return Threat(
        id=_id(given, field),
        position_m=_position(given, field),
        velocity_mps=_vector(given.get("velocity_mps", (0.0, 0.0)), f"{field}.velocity_mps", FASTEST_MPS),
        size_m=_positive(given.get("size_m", 1.0), f"{field}.size_m", most=1e3),
        weight=_positive(given.get("weight", 1.0), f"{field}.weight", most=1e6),
    )


def _host(item: Any, field: str, common: CameraRig) -> AvailableHost:
    given = _object(item, field, {"id", "position_m", *_RIG_FIELDS})
    own = _rig(given, field, common) if any(name in given for name in _RIG_FIELDS) else None
    return AvailableHost(id=_id(given, field), position_m=_position(given, field), rig=own)


def _rig(given: Mapping[str, Any], field: str, otherwise: CameraRig) -> CameraRig:
    """Return the rig of an object's sections; one that is not given is taken from another rig."""
    rig = otherwise
    if "peripheral" in given:
        rig = replace(rig, peripheral=_peripheral(given["peripheral"], f"{field}.peripheral"))
    if "central" in given:
        rig = replace(rig, central=_central(given["central"], f"{field}.central"))
    try:
        if "tilt_deg" in given:
            rig = replace(rig, tilt_deg=_pair(given["tilt_deg"], f"{field}.tilt_deg"))
        if "pan_deg" in given:
            rig = replace(rig, pan_deg=_pair(given["pan_deg"], f"{field}.pan_deg"))
    except BadInput as error:
        where = error.field if error.field.startswith(field) else f"{field}.{error.field}"
        raise BadInput(where, error.problem) from None
    return rig


def _pair(value: Any, field: str) -> tuple[float, float]:
    numbers = value if isinstance(value, list | tuple) else ()
    if len(numbers) != 2:
        raise BadInput(field, f"must be two numbers, not {_shown(value)}")
    return _number(numbers[0], field), _number(numbers[1], field)


def _airspace(fields: Mapping[str, Any], given: Mapping[str, Any]) -> Airspace:
    """Return where hosts may hover: a fence and keep-out areas, with corners in metres east and north."""
    floor_m, ceiling_m = (_limit(given, name, f"parameters.{name}") for name in ("floor_m", "ceiling_m"))
    if floor_m is not None and ceiling_m is not None and floor_m > ceiling_m:
        raise BadInput("parameters.floor_m", f"{floor_m:g} must not be above ceiling_m {ceiling_m:g}")
    return Airspace(
        inside=(_polygon(fields["fence"], "fence"),) if "fence" in fields else (),
        keep_outs=tuple(
            _keep_out(item, f"keep_outs[{k}]") for k, item in enumerate(_list(fields.get("keep_outs", []), "keep_outs"))
        ),
        floor_m=floor_m,
        ceiling_m=ceiling_m,
    )


def _views(value: Any, field: str) -> int:
    number = _number(value, field, least=2, most=100)
    if number % 1:
        raise BadInput(field, f"must be a whole number, not {_shown(value)}")
    return int(number)


def _keep_out(item: Any, field: str) -> KeepOut:
    given = _object(item, field, {"polygon", "floor_m", "ceiling_m"})
    if "polygon" not in given:
        raise BadInput(f"{field}.polygon", "missing")
    floor_m, ceiling_m = (_limit(given, name, f"{field}.{name}") for name in ("floor_m", "ceiling_m"))
    low, high = -math.inf if floor_m is None else floor_m, math.inf if ceiling_m is None else ceiling_m
    if low >= high:
        raise BadInput(f"{field}.floor_m", f"{low:g} must be below ceiling_m {high:g}")
    return KeepOut(polygon=_polygon(given["polygon"], f"{field}.polygon"), floor_m=low, ceiling_m=high)


def _limit(given: Mapping[str, Any], name: str, field: str) -> float | None:
    value = given.get(name)
    return None if value is None else _number(value, field, least=-FARTHEST_M, most=FARTHEST_M)


def _polygon(value: Any, field: str) -> Polygon:
    corners = []
    for k, corner in enumerate(_list(value, field)):
        pair = _list(corner, f"{field}[{k}]")
        if len(pair) != 2:
            raise BadInput(f"{field}[{k}]", f"must be east and north, not {_shown(corner)}")
        east, north = (_number(n, f"{field}[{k}]", least=-FARTHEST_M, most=FARTHEST_M) for n in pair)
        corners.append((east, north))
    require_area(tuple(corners), field)
    return tuple(corners)


def _peripheral(item: Any, field: str) -> FisheyeCamera:
    given = _object(item, field, {*_CAMERA_FIELDS, "distortion"})
    values = _camera_values(given, field)
    if "distortion" in given:
        coefficients = _list(given["distortion"], f"{field}.distortion")
        values["distortion"] = tuple(_number(k, f"{field}.distortion") for k in coefficients)
    try:
        return FisheyeCamera(**values)
    except BadInput as error:
        raise BadInput(f"{field}.{error.field}", error.problem) from None


def _central(item: Any, field: str) -> PinholeCamera:
    given = _object(item, field, {*_CAMERA_FIELDS, "fov_deg"})
    values = _camera_values(given, field)
    if "fov_deg" in given:
        values["fov_deg"] = _number(given["fov_deg"], f"{field}.fov_deg")
    try:
        return PinholeCamera(**values)
    except BadInput as error:
        raise BadInput(f"{field}.{error.field}", error.problem) from None


def _camera_values(given: Mapping[str, Any], field: str) -> dict[str, Any]:
    """Return what both cameras have; the resolution is a whole number."""
    values: dict[str, Any] = {
        name: _positive(given[name], f"{field}.{name}", most=1e6) for name in _CAMERA_FIELDS if name in given
    }
    if "resolution_px" in values:
        if values["resolution_px"] % 1:
            raise BadInput(f"{field}.resolution_px", f"must be a whole number, not {_shown(given['resolution_px'])}")
        values["resolution_px"] = int(values["resolution_px"])
    return values


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(name, "given twice in one object")
    return dict(pairs)


def _object(value: Any, field: str, known: set[str]) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise BadInput(field, f"must be an object, not {_shown(value)}")
    for name in value:
        if name not in known:
            place = name if field == "scenario" else f"{field}.{name}"
            raise BadInput(place, f"unknown field; {field} may have {', '.join(sorted(known))}")
    return value


def _list(value: Any, field: str) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        raise BadInput(field, f"must be a list, not {_shown(value)}")
    return value


def _id(given: Mapping[str, Any], field: str) -> str:
    if "id" not in given:
        raise BadInput(f"{field}.id", "missing")
    value = given["id"]
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise BadInput(f"{field}.id", f"must be a printable text that is not blank, not {_shown(value)}")
    return value


def _require_distinct(ids: list[str], field: str) -> None:
    for k, name in enumerate(ids):
        if name in ids[:k]:
            raise BadInput(f"{field}[{k}].id", f"{name!r} is given twice")


def _position(given: Mapping[str, Any], field: str) -> Point:
    if "position_m" not in given:
        raise BadInput(f"{field}.position_m", "missing")
    return _vector(given["position_m"], f"{field}.position_m", FARTHEST_M)


def _vector(value: Any, field: str, most: float) -> Point:
    numbers = _list(value, field)
    if len(numbers) not in (2, 3):
        raise BadInput(field, f"must have 2 or 3 numbers, not {_shown(value)}")
    east, north, up = (_number(n, field, least=-most, most=most) for n in (*numbers, 0.0)[:3])
    return east, north, up


def _positive(value: Any, field: str, *, most: float) -> float:
    number = _number(value, field, most=most)
    if number <= 0:
        raise BadInput(field, f"must be above 0, not {_shown(value)}")
    return number


def _number(value: Any, field: str, *, least: float = -1e12, most: float = 1e12) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadInput(field, f"must be a number, not {_shown(value)}")
    if not abs(value) < math.inf:
        raise BadInput(field, f"must be finite, not {_shown(value)}")
    if not least <= value <= most:
        raise BadInput(field, f"must lie between {least:g} and {most:g}, not {_shown(value)}")
    return float(value)


def _shown(value: Any) -> str:
    text = json.dumps(value, default=repr)
    return text if len(text) <= 60 else text[:57] + "..."
