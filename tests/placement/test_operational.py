"""Placements that are flown: whatever the threats, fences and altitudes, no margin is broken.

The margins are taken from the poses by sampling, by other formulas than the planner's.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.errors import BadInput
from hsop_gcs.placement import Method, place
from hsop_gcs.placement.airspace import Airspace, KeepOut, Polygon
from hsop_gcs.placement.holding import held_over
from hsop_gcs.placement.objective import evaluate
from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Point, Problem, Threat
from hsop_gcs.placement.search import search
from hsop_gcs.placement.solution import HoverPose, Placement, Status
from tests.placement.examples import random_threats

MICROMETRE = 1e-6
MICRORADIAN = 1e-6
STEP_S = 0.05


def unhurried() -> float:
    """A clock that stands still: no time limit is ever reached."""
    return 0.0


def solve(problem: Problem, n_hosts: int, rounds: int = 2) -> Placement:
    return search(problem, n_hosts=n_hosts, seed=0, deadline=math.inf, now=unhurried, iterations=rounds)


def square(east_m: float, north_m: float, half_m: float) -> Polygon:
    return tuple((east_m + x * half_m, north_m + y * half_m) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def flying(count: int, seed: int, *, spread_m: float = 15.0, side_m: float = 80.0) -> tuple[Threat, ...]:
    """Threats that climb and sink, of several sizes."""
    rng = np.random.default_rng(seed)
    threats = []
    for threat in random_threats(count, rng, side_m):
        up, climb = 45 + rng.uniform(-spread_m, spread_m), rng.uniform(-1, 1)
        threats.append(
            replace(
                threat,
                position_m=(*threat.position_m[:2], float(up)),
                velocity_mps=(*threat.velocity_mps[:2], float(climb)),
                size_m=float(rng.uniform(0.8, 1.5)),
            )
        )
    return tuple(threats)


def axis_of(azimuth_deg: float, elevation_deg: float = 0.0) -> Point:
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (math.cos(e) * math.sin(a), math.cos(e) * math.cos(a), math.sin(e))


def off_axis_rad(axis: Point, pose: HoverPose, point: Point) -> float:
    """The angle of a point from an axis through the host, by the chord between their unit vectors."""
    distance = math.dist(pose.position_m, point)
    unit = [(p - h) / distance for p, h in zip(point, pose.position_m, strict=True)]
    return 2 * math.asin(min(1.0, math.dist(unit, axis) / 2))


def assert_flyable(problem: Problem, placement: Placement) -> None:
    """Hold a placement against every rule of the operational formulation."""
    assert placement.status is not Status.INFEASIBLE, placement.reason
    poses = {pose.host: pose for pose in placement.hosts}
    fence = shapely.union_all([shapely.Polygon(area) for area in problem.airspace.inside])
    for pose in placement.hosts:
        east, north, up = pose.position_m
        for threat in problem.threats:
            count = math.ceil((problem.lead_s + problem.horizon_s) / STEP_S) + 1
            steps = np.linspace(-problem.lead_s, problem.horizon_s, count)
            nearest = min(math.dist(pose.position_m, threat.predicted_m(float(t))) for t in steps)
            assert nearest >= problem.safety_distance_m - 0.5 * STEP_S * math.hypot(*threat.velocity_mps)
            for ends in (-problem.lead_s, 0.0, problem.horizon_s):
                assert math.dist(pose.position_m, threat.predicted_m(ends)) >= problem.safety_distance_m
        if problem.airspace.inside:
            assert shapely.Point(east, north).within(fence)
        for area in problem.airspace.keep_outs:
            beside = not shapely.Point(east, north).within(shapely.Polygon(area.polygon))
            assert beside or up <= area.floor_m or up >= area.ceiling_m
        assert problem.airspace.floor_m is None or up >= problem.airspace.floor_m
        assert problem.airspace.ceiling_m is None or up <= problem.airspace.ceiling_m
    for a, b in itertools.combinations(placement.hosts, 2):
        assert math.dist(a.position_m, b.position_m) >= problem.min_separation_m
    rigs = {pose.host: problem.rig for pose in placement.hosts}
    rigs |= {host.id: host.rig for host in problem.hosts if host.rig is not None}
    for threat, pair in zip(problem.threats, placement.pairs, strict=True):
        assert pair.threat == threat.id
        assert pair.views[0].host != pair.views[1].host
        for view, after_s in itertools.product(pair.views, (0.0, problem.horizon_s)):
            pose, point, rig = poses[view.host], threat.predicted_m(after_s), rigs[view.host]
            distance = math.dist(pose.position_m, point)
            if view.camera is CameraKind.CENTRAL:
                assert pose.pan_deg is not None
                off = off_axis_rad(axis_of(pose.pan_deg, pose.tilt_deg), pose, point)
                assert off <= math.radians(rig.central.fov_deg) / 2 + MICRORADIAN
                aside = math.radians(pose.pan_deg) - math.atan2(
                    point[0] - pose.position_m[0], point[1] - pose.position_m[1]
                )
                raised, tilt = math.asin((point[2] - pose.position_m[2]) / distance), math.radians(pose.tilt_deg)
                ahead = math.cos(tilt) * math.cos(raised) * math.cos(aside) + math.sin(tilt) * math.sin(raised)
                up = math.cos(tilt) * math.sin(raised) - math.sin(tilt) * math.cos(raised) * math.cos(aside)
                assert abs(up) <= ahead * 0.5 * rig.central.height_px / rig.central.focal_length_px + MICRORADIAN
                assert rig.central.focal_length_px * threat.size_m / distance >= rig.central.min_pixels
            else:
                off = min(off_axis_rad(axis_of(pose.heading_deg + turn), pose, point) for turn in (0.0, 180.0))
                width = rig.peripheral.focal_length_px * threat.size_m / distance * off / math.tan(off)
                assert width >= rig.peripheral.min_pixels


@pytest.mark.parametrize("objective", list(Objective))
@pytest.mark.parametrize("seed", range(6))
def test_no_margin_is_broken_in_space_among_fences_and_keep_outs(seed: int, objective: Objective) -> None:
    rng = np.random.default_rng([seed, 7])
    obstacles = tuple(
        KeepOut(
            polygon=square(float(rng.uniform(0, 80)), float(rng.uniform(0, 80)), float(rng.uniform(5, 15))),
            floor_m=0.0,
            ceiling_m=float(rng.uniform(30, 90)),
        )
        for _ in range(3)
    )
    slanted = ((-30.0, -20.0), (95.0, -35.0), (120.0, 60.0), (70.0, 115.0), (-25.0, 100.0))
    problem = Problem(
        threats=flying(3, seed),
        airspace=Airspace(inside=(slanted,), keep_outs=obstacles, floor_m=5.0, ceiling_m=100.0),
        objective=objective,
        lead_s=4.0,
        safety_distance_m=15.0,
    )
    assert_flyable(problem, solve(problem, 3 + seed % 4))


@pytest.mark.parametrize("seed", range(4))
def test_without_limits_hosts_keep_to_the_altitudes_of_the_threats(seed: int) -> None:
    problem = Problem(threats=flying(3, seed))
    placement = solve(problem, 4)
    assert_flyable(problem, placement)
    heights = [threat.predicted_m(t)[2] for threat in problem.threats for t in (0.0, problem.horizon_s)]
    for pose in placement.hosts:
        assert min(heights) - MICROMETRE <= pose.position_m[2] <= max(heights) + MICROMETRE


@pytest.mark.parametrize("seed", range(3))
def test_room_above_and_below_never_costs_more_than_level_flight(seed: int) -> None:
    level = Problem(threats=flying(3, seed, spread_m=0.0))
    level = replace(level, threats=tuple(replace(t, velocity_mps=(*t.velocity_mps[:2], 0.0)) for t in level.threats))
    free = replace(level, airspace=Airspace(floor_m=5.0, ceiling_m=120.0))
    in_plane, in_space = solve(level, 3, rounds=8), solve(free, 3, rounds=8)
    assert_flyable(free, in_space)
    assert (in_space.cost or math.inf) <= 1.01 * (in_plane.cost or 0.0)
    assert in_space.lower_bound <= (in_space.cost or 0.0)


def test_a_keep_out_over_the_best_hover_points_is_left_alone_and_can_be_flown_over() -> None:
    threat = Threat(id="a", position_m=(0.0, 0.0, 40.0))
    wide = KeepOut(polygon=square(0.0, 0.0, 200.0), ceiling_m=45.0)
    problem = Problem(threats=(threat,), airspace=Airspace(keep_outs=(wide,), floor_m=5.0, ceiling_m=100.0))
    placement = solve(problem, 2)
    assert_flyable(problem, placement)
    assert all(pose.position_m[2] >= 45.0 for pose in placement.hosts)


def test_two_fences_are_both_hovered_in() -> None:
    left, right = square(-25.0, 0.0, 8.0), square(0.0, 25.0, 8.0)
    problem = Problem(threats=(Threat(id="a", position_m=(0.0, 0.0, 0.0)),), airspace=Airspace(inside=(left, right)))
    placement = solve(problem, 2)
    assert_flyable(problem, placement)
    assert any(shapely.Point(p.position_m[:2]).within(shapely.Polygon(left)) for p in placement.hosts)
    assert any(shapely.Point(p.position_m[:2]).within(shapely.Polygon(right)) for p in placement.hosts)


def test_hosts_keep_clear_of_where_threats_fly_before_the_window_opens() -> None:
    threat = Threat(id="a", position_m=(0.0, 0.0, 0.0), velocity_mps=(4.0, 0.0, 0.0), size_m=1.5)
    at_once = Problem(threats=(threat,))
    later = replace(at_once, lead_s=20.0)
    assert_flyable(later, solve(later, 2))
    before = replace(threat, position_m=(-80.0, 0.0, 0.0), velocity_mps=(0.0, 0.0, 0.0))
    standing = HoverPose(host="h1", position_m=(-70.0, 5.0, 0.0), heading_deg=90.0, pan_deg=90.0)
    other = HoverPose(host="h2", position_m=(20.0, 40.0, 0.0), heading_deg=90.0, pan_deg=180.0)
    views = {pair.threat: pair.views for pair in solve(at_once, 2).pairs}
    assert evaluate(at_once, [standing, other], views).margins.distance_m > 0
    assert evaluate(later, [standing, other], views).margins.distance_m == pytest.approx(5.0 - 20.0, abs=MICROMETRE)
    assert before.position_m == later.threats[0].predicted_m(-20.0)


def test_the_path_of_a_threat_that_nobody_watches_from_there_still_keeps_hosts_away() -> None:
    threats = (
        Threat(id="t1", position_m=(0.0, 0.0, 50.0)),
        Threat(id="t2", position_m=(-35.0, 21.0, 40.0), velocity_mps=(5.0, 0.0, 2.0)),
    )
    problem = Problem(threats=threats, airspace=Airspace(floor_m=10.0, ceiling_m=110.0))
    assert_flyable(problem, solve(problem, 4))


def test_a_flying_placement_holds_while_its_threats_stay_and_falls_with_a_new_keep_out() -> None:
    problem = Problem(threats=flying(2, 3), airspace=Airspace(floor_m=5.0, ceiling_m=100.0))
    placement = solve(problem, 4)
    held = held_over(placement, problem)
    assert held is not None
    assert held.cost == pytest.approx(placement.cost, rel=1e-9)
    assert_flyable(problem, held)
    east, north, _ = placement.hosts[0].position_m
    closed = replace(problem, airspace=replace(problem.airspace, keep_outs=(KeepOut(polygon=square(east, north, 2)),)))
    assert held_over(placement, closed) is None


STILL = Threat(id="t1", position_m=(0.0, 0.0, 40.0))


def why_not(problem: Problem, n_hosts: int | None = None) -> str:
    placement = place(problem, n_hosts=n_hosts, now=unhurried, iterations=3)
    assert placement.status is Status.INFEASIBLE
    return placement.reason


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (
            Problem(threats=(STILL,), airspace=Airspace(inside=(square(300.0, 0.0, 20.0),))),
            "threat t1 cannot be seen by any two hosts: the fence is in the way",
        ),
        (
            Problem(threats=(STILL,), airspace=Airspace(keep_outs=(KeepOut(polygon=square(0.0, 0.0, 150.0)),))),
            "threat t1 cannot be seen by any two hosts: the keep-out area is in the way",
        ),
        (
            Problem(
                threats=(STILL,), airspace=Airspace(keep_outs=(KeepOut(polygon=square(0.0, 0.0, 150.0), host="h9"),))
            ),
            "threat t1 cannot be seen by any two hosts: h9 is in the way",
        ),
        (
            Problem(threats=(STILL,), airspace=Airspace(floor_m=150.0, ceiling_m=200.0)),
            "threat t1 is 110.0 m beyond the floor of 150 m, and is detected no farther than 91.2 m away",
        ),
        (
            Problem(threats=(STILL,), min_separation_m=200.0),
            "threat t1 cannot be seen by any two hosts: the separation of 200 m between hosts is in the way",
        ),
        (
            Problem(threats=(STILL, replace(STILL, id="t2", position_m=(190.0, 0.0, 40.0))), max_hosts=3),
            "3 hosts are available; at least 4 are needed to see every threat",
        ),
    ],
)
def test_a_placement_that_cannot_be_flown_says_which_rule_is_in_the_way(problem: Problem, reason: str) -> None:
    assert why_not(problem) == reason


def test_the_letters_method_refuses_what_its_plane_does_not_hold() -> None:
    uneven = Problem(threats=(STILL, replace(STILL, id="t2", position_m=(30.0, 0.0, 60.0))))
    fenced = Problem(threats=(STILL,), airspace=Airspace(inside=(square(0.0, 0.0, 50.0),)))
    for problem in (uneven, fenced):
        with pytest.raises(BadInput, match="method: 'letter' knows only threats at one altitude"):
            place(problem, method=Method.LETTER, now=unhurried)


@pytest.mark.parametrize(("n_hosts", "seed"), [(2, 0), (3, 1), (4, 2)])
def test_at_one_altitude_the_geometry_is_that_of_the_letter(n_hosts: int, seed: int) -> None:
    threats = random_threats(2, np.random.default_rng(seed))
    raised = tuple(replace(t, position_m=(*t.position_m[:2], 30.0)) for t in threats)
    flown = solve(Problem(threats=raised), n_hosts)
    views = {pair.threat: pair.views for pair in flown.pairs}
    in_plane = evaluate(Problem(threats=threats, formulation=Formulation.LETTER), flown.hosts, views)
    in_space = evaluate(Problem(threats=raised), flown.hosts, views)
    assert in_space.cost == pytest.approx(in_plane.cost, rel=1e-12)
    assert in_space.margins.pixels == pytest.approx(in_plane.margins.pixels, abs=1e-9)
    assert in_space.margins.fov_deg == pytest.approx(in_plane.margins.fov_deg, abs=1e-6)


def test_hosts_that_know_their_pose_less_well_expect_larger_errors_and_are_placed_by_them() -> None:
    threats = random_threats(2, np.random.default_rng(5))
    sure = Problem(threats=threats, objective=Objective.RMS, hosts=())
    unsure = replace(sure, position_sigma_m=0.5, attitude_sigma_rad=math.radians(1.0))
    placed, cautious = solve(sure, 3, rounds=6), solve(unsure, 3, rounds=6)
    views = {pair.threat: pair.views for pair in placed.pairs}
    known, unknown = (sum(evaluate(p, placed.hosts, views).expected_errors_m.values()) for p in (sure, unsure))
    assert unknown > known
    assert (cautious.cost or math.inf) <= unknown * (1 + 1e-6)
    assert cautious.lower_bound <= (cautious.cost or 0.0)


def test_more_views_make_better_fixes_of_the_same_placement_and_all_of_them_see() -> None:
    pairs_only = Problem(threats=flying(3, 2), airspace=Airspace(floor_m=5.0, ceiling_m=100.0))
    everything = replace(pairs_only, max_views=8)
    two, many = solve(pairs_only, 4), solve(everything, 4)
    assert [pose.position_m for pose in two.hosts] == [pose.position_m for pose in many.hosts]
    assert two.cost == many.cost
    assert any(pair.more_views for pair in many.pairs)
    for pair, fused in zip(two.pairs, many.pairs, strict=True):
        assert (fused.expected_error_m or math.inf) <= (pair.expected_error_m or 0.0)
        assert bool(fused.more_views) == ((fused.expected_error_m or 0.0) < (pair.expected_error_m or 0.0))
        for view in fused.more_views:
            assert view not in fused.views
            seen = {other.threat: other.views for other in many.pairs}
            # With the further view in the place of one of the pair, every constraint still holds.
            kept = next(other for other in fused.views if other.host != view.host)
            seen[fused.threat] = (kept, view)
            assert evaluate(everything, many.hosts, seen).margins.smallest >= -MICRORADIAN
    three = solve(replace(pairs_only, max_views=3), 4)
    assert all(len(pair.more_views) <= 1 for pair in three.pairs)


@pytest.mark.parametrize("seed", range(3))
def test_with_more_views_the_error_that_is_minimised_is_that_of_the_fused_fix(seed: int) -> None:
    pairs_only = Problem(
        threats=flying(3, seed), airspace=Airspace(floor_m=5.0, ceiling_m=100.0), objective=Objective.RMS
    )
    everything = replace(pairs_only, max_views=8)
    two, many = solve(pairs_only, 5, rounds=3), solve(everything, 5, rounds=3)
    assert_flyable(everything, many)
    assert many.cost == pytest.approx(sum(pair.expected_error_m or math.inf for pair in many.pairs), rel=1e-12)
    held = held_over(two, everything)
    assert held is not None
    assert (many.cost or math.inf) <= (held.cost or 0.0) <= (two.cost or 0.0)
    assert 0 < many.lower_bound <= (many.cost or 0.0)


def test_the_nearest_hosts_are_named_for_hover_points_in_space() -> None:
    hosts = tuple(
        AvailableHost(id=n, position_m=(e, 0.0, 40.0)) for n, e in (("far", 900.0), ("w", -40.0), ("e", 40.0))
    )
    placement = place(Problem(threats=(STILL,), hosts=hosts), now=unhurried, iterations=2)
    assert {pose.host for pose in placement.hosts} == {"w", "e"}
