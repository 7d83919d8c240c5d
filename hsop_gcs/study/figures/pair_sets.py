"""Figs. 6 and 7: which pair sets are feasible, and the tree in which the others are pruned."""

from typing import TYPE_CHECKING

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.placement.feasibility import Screen
from hsop_gcs.placement.hsop import Search
from hsop_gcs.placement.instance import Instance
from hsop_gcs.placement.pair_sets import PairSet, backtrack, generate_pairs
from hsop_gcs.placement.problem import Formulation, Problem, Threat
from hsop_gcs.placement.solution import HoverPose, Placement
from hsop_gcs.study.coverage import placement_of
from hsop_gcs.study.figures.drawing import draw_host, draw_placement, draw_threats, frame_points, new_figure, plan_view

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HOSTS = 4
OBSERVERS = (0, 1, 2)
LEAVES = (27, 9, 3, 1)
"""Of the whole tree below a node, by how many threats have their pair."""
PRUNED, KEPT = "tab:red", "tab:green"


def _problem(*places_m: tuple[float, float]) -> Problem:
    threats = tuple(Threat(id=f"t{k + 1}", position_m=(x, y, 0.0)) for k, (x, y) in enumerate(places_m))
    return Problem(threats=threats, formulation=Formulation.LETTER)


def _shown(pair_set: PairSet) -> str:
    return "{" + ", ".join(f"(t{k + 1}, h{a + 1}, h{b + 1})" for k, (a, b) in enumerate(pair_set)) + "}"


def infeasible_and_feasible() -> "tuple[Figure, list[str]]":
    """Draw Fig. 6: two threats too far apart for hosts that share them, and two near enough."""
    far, near = _problem((-100.0, 0.0), (100.0, 0.0)), _problem((-35.0, 0.0), (35.0, 10.0))
    shared, split = ((0, 1), (1, 0)), ((0, 2), (1, 0))
    figure = new_figure(10.0, 4.6)
    left, right = figure.subplots(1, 2)
    draw_threats(left, far)
    for name, place in (("h1", (-60.0, 25.0)), ("h2", (-55.0, -30.0))):
        pose = HoverPose(host=name, position_m=(*place, 0.0), heading_deg=90.0, pan_deg=None)
        draw_host(left, far, pose, [CameraKind.PERIPHERAL])
    plan_view(left, f"(a) infeasible\n{_shown(shared)}")
    frame_points(left, [threat.position_m for threat in far.threats], 40.0)
    solved = _solved(near, split)
    draw_placement(right, near, solved)
    plan_view(right, f"(b) feasible\n{_shown(split)}")
    frame_points(right, [pose.position_m for pose in solved.hosts] + [t.position_m for t in near.threats], 30.0)
    screens = [Screen(Instance.of(problem)) for problem in (far, near)]
    reach = screens[0].reach_m[0, 0]
    return figure, [
        f"threats 200 m apart: {_shown(shared)} is {_verdict(screens[0], shared)}; "
        f"a host sees no farther than {reach:.0f} m to either side",
        f"threats 71 m apart: {_shown(split)} is {_verdict(screens[1], split)}",
    ]


def _verdict(screen: Screen, pair_set: PairSet) -> str:
    feasible = all(screen.feasible(pair_set[:depth]) for depth in range(1, len(pair_set) + 1))
    return "feasible" if feasible else "infeasible"


def _solved(problem: Problem, pair_set: PairSet) -> Placement:
    """Solve one pair set with its best cameras, as Algorithm 3 does."""
    search = Search(Instance.of(problem), seed=0, deadline=1.0, now=lambda: 0.0)
    search.solve_chunk(list(search.choices(pair_set)))
    assert search.best is not None
    return placement_of(problem, search.best.choice, search.best.poses)


def backtracking_tree() -> "tuple[Figure, list[str]]":
    """Draw Fig. 7: three threats, four hosts, 27 pair sets, and what is pruned with the first two threats far apart."""
    problem = _problem((-100.0, 0.0), (100.0, 0.0), (0.0, 60.0))
    screen = Screen(Instance.of(problem))
    examined: dict[PairSet, bool] = {}

    def feasible(pair_set: PairSet) -> bool:
        examined[pair_set] = screen.feasible(pair_set)
        return examined[pair_set]

    kept = list(backtrack(3, lambda known: generate_pairs(HOSTS, OBSERVERS[len(known)]), feasible))
    figure = new_figure(9.0, 8.6)
    axes = figure.subplots()
    _draw_tree(axes, examined)
    pruned = {depth: sum(not ok for s, ok in examined.items() if len(s) == depth) for depth in (1, 2, 3)}
    unseen = 27 - sum(len(pair_set) == 3 for pair_set in examined)
    axes.set_title(f"{len(kept)} of 27 pair sets remain; {unseen} were never looked at")
    return figure, [
        f"27 pair sets; {pruned[2]} of 9 pruned after two threats, so that {unseen} of 27 leaves were never made; "
        f"{pruned[3]} pruned as leaves; {len(kept)} feasible"
    ]


def _draw_tree(axes: "Axes", examined: dict[PairSet, bool]) -> None:
    """Lay the tree out over all 27 leaves, so that what was pruned leaves its gap."""
    axes.set_axis_off()
    choices = [generate_pairs(HOSTS, observer) for observer in OBSERVERS]

    def height(pair_set: PairSet) -> float:
        first_leaf = sum(choices[k].index(pair) * LEAVES[k + 1] for k, pair in enumerate(pair_set))
        return -first_leaf - (LEAVES[len(pair_set)] - 1) / 2

    for pair_set, ok in examined.items():
        x, y = len(pair_set), height(pair_set)
        colour = KEPT if ok else PRUNED
        parent = pair_set[:-1]
        axes.plot([x - 1 + 0.32, x - 0.3], [height(parent) if parent else -13.0, y], color=colour, linewidth=0.8)
        first, second = pair_set[-1]
        text = f"(t{x}, h{first + 1}, h{second + 1})" + ("" if ok else "  ✕")
        axes.text(x, y, text, ha="center", va="center", color=colour, fontsize=8)
    axes.text(0, -13.0, "start", ha="center", va="center")
    axes.set_xlim(-0.4, 3.5)
    axes.set_ylim(-27, 1)
