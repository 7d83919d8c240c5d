#!/usr/bin/env python3
"""Recompute a plan's cost (letter, Eq. 8) and constraint margins (Eqs. 9-11) from its poses alone.

    check_plan.py SCENARIO.json PLAN.json [--segment]

Prints one JSON object; exits 0 when every constraint holds and the plan's own `cost` agrees, 1 otherwise.
`--segment` also asks for the safety distance from every threat's whole predicted path (not only from the
end points of the assigned threats). It needs nothing but the standard library, and shares no code with the project.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

DEFAULTS: dict[str, Any] = dict(
    horizon_s=10.0,
    safety_distance_m=20.0,
    peripheral=dict(
        focal_length_mm=1.0, sensor_width_mm=3.3, resolution_px=1504, distortion=[0, 0, 0, 0], min_pixels=5.0
    ),
    central=dict(focal_length_mm=4.8, sensor_width_mm=4.8, resolution_px=1280, fov_deg=53.0, min_pixels=30.0),
)
TOL = 1e-6


def merged(parameters: dict[str, Any] | None) -> dict[str, Any]:
    out = {k: dict(v) if isinstance(v, dict) else v for k, v in DEFAULTS.items()}
    for k, v in (parameters or {}).items():
        if isinstance(v, dict):
            out.setdefault(k, {}).update(v)
        else:
            out[k] = v
    return out


def relative_pixel_size(theta: float, k: list[float]) -> float:
    """theta_d / tan(theta): 1 on the boresight, 0 at 90 degrees."""
    if theta < 1e-9:
        return 1.0
    if theta >= math.pi / 2:
        return 0.0
    t2 = theta * theta
    return theta * (1 + k[0] * t2 + k[1] * t2**2 + k[2] * t2**3 + k[3] * t2**4) / math.tan(theta)


def wrap(a: float) -> float:
    return (a + math.pi) % (2 * math.pi) - math.pi


def segment_distance(p: list[float], a: list[float], b: list[float]) -> float:
    ab = [b[i] - a[i] for i in range(2)]
    ap = [p[i] - a[i] for i in range(2)]
    n = ab[0] ** 2 + ab[1] ** 2
    s = 0.0 if n == 0 else max(0.0, min(1.0, (ap[0] * ab[0] + ap[1] * ab[1]) / n))
    return math.hypot(ap[0] - s * ab[0], ap[1] - s * ab[1])


def check(scenario: dict[str, Any], plan: dict[str, Any], segment: bool = False) -> dict[str, Any]:
    q = merged(scenario.get("parameters"))
    per, cen = q["peripheral"], q["central"]
    kp = per["focal_length_mm"] * per["resolution_px"] / per["sensor_width_mm"]
    kc = cen["focal_length_mm"] * cen["resolution_px"] / cen["sensor_width_mm"]
    threats = {t["id"]: t for t in scenario["threats"]}
    hosts = {h["id"]: h for h in plan["hosts"]}
    problems, cost, margins = [], 0.0, dict(pixels=math.inf, fov_deg=math.inf, distance_m=math.inf)
    if sorted(p["threat"] for p in plan["pairs"]) != sorted(threats):
        problems.append("not exactly one host-threat pair per threat")
    used = {v["host"] for p in plan["pairs"] for v in p["views"]}
    if used != set(hosts):
        problems.append(f"hosts placed and hosts used differ: {sorted(set(hosts) ^ used)}")
    for pair in plan["pairs"]:
        t = threats[pair["threat"]]
        size = t.get("size_m", 1.0)
        views = pair["views"]
        if len({v["host"] for v in views}) != 2 or len(views) != 2:
            problems.append(f"{t['id']}: needs two different hosts")
            continue
        p0 = t["position_m"][:2]
        v = t.get("velocity_mps", [0, 0])[:2]
        p1 = [p0[i] + q["horizon_s"] * v[i] for i in range(2)]
        for point in (p0, p1):
            factor, rays = 1.0, []
            for view in views:
                h = hosts[view["host"]]
                x = h["position_m"]
                e, n = point[0] - x[0], point[1] - x[1]
                d = math.hypot(e, n)
                bearing = math.atan2(e, n)
                rays.append((e / d, n / d))
                margins["distance_m"] = min(margins["distance_m"], d - q["safety_distance_m"])
                if view["camera"] == "central":
                    pixels = kc * size / d
                    margins["pixels"] = min(margins["pixels"], pixels - cen["min_pixels"])
                    if h.get("pan_deg") is None:
                        problems.append(f"{h['id']}: central camera used without pan_deg")
                        continue
                    off = abs(math.degrees(wrap(bearing - math.radians(h["pan_deg"]))))
                    margins["fov_deg"] = min(margins["fov_deg"], cen["fov_deg"] / 2 - off)
                elif view["camera"] == "peripheral":
                    off = abs(wrap(bearing - math.radians(h["heading_deg"])))
                    off = min(off, math.pi - off)
                    pixels = kp * size / d * relative_pixel_size(off, per["distortion"])
                    margins["pixels"] = min(margins["pixels"], pixels - per["min_pixels"])
                else:
                    problems.append(f"unknown camera {view['camera']!r}")
                    continue
                factor *= d / pixels if pixels > 0 else math.inf
            sine = abs(rays[0][0] * rays[1][1] - rays[0][1] * rays[1][0])
            cost += factor / sine if sine > 0 else math.inf
        if segment:
            for h in hosts.values():
                margins["distance_m"] = min(
                    margins["distance_m"], segment_distance(h["position_m"], p0, p1) - q["safety_distance_m"]
                )
    for name, m in margins.items():
        if m < -TOL * 100:
            problems.append(f"{name} margin {m:.6g} < 0")
    if "cost" in plan and not math.isclose(plan["cost"], cost, rel_tol=1e-6):
        problems.append(f"plan says cost {plan['cost']:.9g}, its poses give {cost:.9g}")
    return dict(
        ok=not problems,
        n_hosts=len(hosts),
        cost=cost,
        margins={k: (v if math.isfinite(v) else None) for k, v in margins.items()},
        problems=problems,
    )


if __name__ == "__main__":
    args = [a for a in sys.argv[1:] if not a.startswith("--")]
    if len(args) != 2:
        sys.exit(__doc__)
    scenario, plan = (json.loads(Path(a).read_text()) for a in args)
    result = check(scenario, plan, segment="--segment" in sys.argv)
    print(json.dumps(result, indent=2))  # noqa: T201
    sys.exit(0 if result["ok"] else 1)
