"""``hsop-gcs plan``: one scenario in, one plan out, or one for every number of hosts."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.cli.options import one_of
from hsop_gcs.cli.output_file import require_directory, write
from hsop_gcs.cli.plots import new_figure, save
from hsop_gcs.errors import BadInput

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from hsop_gcs.placement.problem import Problem
    from hsop_gcs.placement.solution import Placement

INFEASIBLE_EXIT = 3
"""Also when the plan leaves threats out, or the target error is out of reach."""
TIME_LIMIT_S = 1.0
"""Unless one is given; with --frontier for each number of hosts."""


def register(app: typer.Typer) -> None:
    @app.command()
    def plan(
        scenario: Annotated[
            str,
            typer.Argument(help="The scenario file; - reads standard input.", metavar="SCENARIO", show_default=False),
        ],
        hosts: Annotated[
            int | None, typer.Option(help="How many hosts to place.", show_default="the fewest that see every threat")
        ] = None,
        formulation: Annotated[
            str, typer.Option(help="letter, or operational: safety distance to whole paths, hosts apart.")
        ] = "operational",
        objective: Annotated[
            str, typer.Option(help="letter: its Eq. 8; rms: the predicted error (method search).")
        ] = "letter",
        method: Annotated[
            str | None,
            typer.Option(help="search, the global one; letter; coverage-only, its baseline.", show_default="search"),
        ] = None,
        initial_observers: Annotated[
            bool,
            typer.Option("--initial-observers", help="Only the letter's pairs: every threat keeps its nearest host."),
        ] = False,
        frontier: Annotated[
            bool, typer.Option("--frontier", help="A plan for every number of hosts, and what each host more gains.")
        ] = False,
        target_error: Annotated[
            float | None,
            typer.Option(help="Metres: the fewest hosts that bring every threat's expected error to this."),
        ] = None,
        time_limit: Annotated[
            float | None,
            typer.Option(
                help="Seconds at most, and all of them; loading the solver counts, up to a part.",
                show_default=f"{TIME_LIMIT_S:g} or less, of solving; with --frontier {TIME_LIMIT_S:g} for each number",
            ),
        ] = None,
        iterations: Annotated[
            int | None,
            typer.Option(help="Exactly so many rounds instead of a time limit; with --frontier for each number."),
        ] = None,
        seed: Annotated[int, typer.Option(help="The same seed gives the same plan.")] = 0,
        as_json: Annotated[bool, typer.Option("--json", help="Print the plan file instead of the table.")] = False,
        output: Annotated[Path | None, typer.Option("-o", "--output", help="Write the plan file here.")] = None,
        plot: Annotated[Path | None, typer.Option(help="With --frontier: draw it into this PNG file.")] = None,
    ) -> None:
        """Place hosts for one scenario.

        Exit 0: a plan that sees every threat; 3: a partial one, or the target error is out of reach (then the plan is
        the best there is), or infeasible; 2: bad input.
        """
        import json
        import time

        from hsop_gcs.placement import Method, place
        from hsop_gcs.placement.problem import Formulation, Objective
        from hsop_gcs.placement.scenario import parse_json, plan_to_json, problem_from_json
        from hsop_gcs.placement.solution import Status, worst_error_m

        problem = problem_from_json(
            parse_json(_read(scenario), scenario),
            formulation=Formulation(one_of("--formulation", formulation, Formulation)),
            objective=Objective(one_of("--objective", objective, Objective)),
        )
        most = 2 * len(problem.threats)
        if hosts is not None and not 2 <= hosts <= most:
            raise BadInput("--hosts", f"{hosts} is outside 2..{most}: a threat takes two hosts, and more have no use")
        if time_limit is not None and not 0 < time_limit <= 86_400:
            raise BadInput("--time-limit", f"must be above 0 and at most 86400 seconds, not {time_limit!r}")
        if seed < 0:
            raise BadInput("--seed", f"must not be negative, not {seed}")
        if iterations is not None and iterations < 1:
            raise BadInput("--iterations", f"must be 1 or more, not {iterations}")
        if target_error is not None and not 0 < target_error <= 1e6:
            raise BadInput("--target-error", f"must be above 0 and at most 1000000 m, not {target_error!r}")
        require_directory("--output", output)
        require_directory("--plot", plot)
        wanted = None if method is None else Method(one_of("--method", method, Method))
        if iterations is not None and wanted not in (None, Method.SEARCH):
            raise BadInput("--iterations", f"method {wanted} has no rounds to count")
        if plot is not None and not frontier:
            raise BadInput("--plot", "draws a frontier; give --frontier as well")
        if frontier:
            chosen = {
                "--hosts": hosts,
                "--target-error": target_error,
                "--method": None if wanted is Method.SEARCH else wanted,
                "--initial-observers": initial_observers or None,
            }
            for option, value in chosen.items():
                if value is not None:
                    raise BadInput(option, "does not go with --frontier, which searches every number of hosts")
            _frontier(problem, seed, time_limit, iterations, as_json, output, plot)
            return
        if wanted in (None, Method.SEARCH) and not initial_observers:
            _load_kernels(problem)
        placement = place(
            problem,
            n_hosts=hosts,
            seed=seed,
            time_limit_s=TIME_LIMIT_S if time_limit is None else _left_s(time_limit),
            iterations=iterations,
            now=time.monotonic,
            method=wanted,
            initial_observers=initial_observers,
            target_error_m=target_error,
            until_settled=time_limit is None,
            partial=True,
        )
        text = json.dumps(plan_to_json(placement), indent=2)
        if output is not None:
            write(output, text + "\n")
        if as_json:
            typer.echo(text)
        if placement.status is Status.INFEASIBLE:
            typer.echo(f"hsop-gcs: infeasible: {placement.reason}", err=True)
            raise SystemExit(INFEASIBLE_EXIT)
        if not as_json:
            _print_tables(problem, placement)
        for why in placement.left_out.values():
            typer.echo(f"hsop-gcs: left out: {why}", err=True)
        if placement.status is Status.PARTIAL:
            raise SystemExit(INFEASIBLE_EXIT)
        if target_error is not None and worst_error_m(placement) > target_error:
            typer.echo(
                f"hsop-gcs: expected error {worst_error_m(placement):.2f} m with {len(placement.hosts)} hosts,"
                f" the best there is; {target_error:g} m is out of reach",
                err=True,
            )
            raise SystemExit(INFEASIBLE_EXIT)


def _frontier(
    problem: "Problem",
    seed: int,
    time_limit_s: float | None,
    iterations: int | None,
    as_json: bool,
    output: Path | None,
    plot: Path | None,
) -> None:
    import json
    import time

    from hsop_gcs.placement import place
    from hsop_gcs.placement.frontier import frontier, frontier_to_json

    if time_limit_s is None:
        time_limit_s = TIME_LIMIT_S * (2 * len(problem.threats) - 1)
    figure = None if plot is None else new_figure(7, 6)
    _load_kernels(problem)
    placements = frontier(problem, seed=seed, time_limit_s=time_limit_s, iterations=iterations, now=time.monotonic)
    text = json.dumps(frontier_to_json(placements), indent=2)
    if output is not None:
        write(output, text + "\n")
    if as_json:
        typer.echo(text)
    if not placements:
        reason = place(problem, seed=seed, iterations=1, now=time.monotonic).reason
        typer.echo(f"hsop-gcs: infeasible: {reason or 'no number of hosts has a placement'}", err=True)
        raise SystemExit(INFEASIBLE_EXIT)
    if figure is not None and plot is not None:
        _draw(figure, placements)
        save(figure, plot)
    if not as_json:
        _print_frontier(problem, placements)


def _left_s(time_limit_s: float) -> float:
    """What is left of a time limit since the process began, and no less than a second and a fifth of it."""
    import time

    from hsop_gcs.cli import BEGAN_S

    return max(min(time_limit_s, 1.0 + 0.2 * time_limit_s), time_limit_s - (time.monotonic() - BEGAN_S))


def _load_kernels(problem: "Problem") -> None:
    """Load the compiled search before its clock runs."""
    from hsop_gcs.placement.search import warm_up

    warm_up(problem.formulation)


def _read(source: str) -> str:
    import sys

    try:
        raw = sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes()
        return raw.decode("utf-8-sig")
    except OSError as error:
        raise BadInput(source, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        raise BadInput(source, f"not UTF-8 text: byte {error.start}") from None


def _print_tables(problem: "Problem", placement: "Placement") -> None:
    from rich.console import Console
    from rich.table import Table

    hosts = Table(title=f"{len(placement.hosts)} hosts")
    for heading in ("host", "east m", "north m", "up m", "heading °", "pan °", "tilt °"):
        hosts.add_column(heading, justify="left" if heading == "host" else "right", overflow="fold")
    for pose in placement.hosts:
        aim = ("-", "-") if pose.pan_deg is None else (f"{pose.pan_deg:.1f}", f"{pose.tilt_deg:.1f}")
        hosts.add_row(pose.host, *(f"{value:.1f}" for value in pose.position_m), f"{pose.heading_deg:.1f}", *aim)

    pairs = Table(title=f"{len(placement.pairs)} threats")
    for heading in ("threat", "seen by", "cost", "expected error m"):
        pairs.add_column(heading, justify="left" if heading in ("threat", "seen by") else "right", overflow="fold")
    for pair in placement.pairs:
        views = ", ".join(f"{view.host} ({view.camera.value})" for view in pair.views)
        error = "-" if pair.expected_error_m is None else f"{pair.expected_error_m:.2f}"
        pairs.add_row(pair.threat, views, f"{pair.cost:.4f}", error)

    console = Console()
    console.print(hosts)
    console.print(pairs)
    console.print(
        f"{placement.status.value}, {problem.formulation.value} formulation: cost {placement.cost:.4f},"
        f" lower bound {placement.lower_bound:.4f}, {placement.solve_time_s:.2f} s",
        soft_wrap=True,
    )


def _print_frontier(problem: "Problem", placements: "Mapping[int, Placement]") -> None:
    from rich.console import Console
    from rich.table import Table

    from hsop_gcs.placement.solution import mean_error_m, worst_error_m

    table = Table(title=f"{len(problem.threats)} threats, {problem.formulation.value} formulation")
    for heading in ("hosts", "cost", "lower bound", "worst error m", "mean error m", "status"):
        table.add_column(heading, justify="left" if heading == "status" else "right", overflow="fold")
    for number, placement in placements.items():
        table.add_row(
            str(number),
            f"{placement.cost:.4f}",
            f"{placement.lower_bound:.4f}",
            f"{worst_error_m(placement):.2f}",
            f"{mean_error_m(placement):.2f}",
            placement.status.value,
        )
    Console().print(table)


def _draw(figure: "Figure", placements: "Mapping[int, Placement]") -> None:
    from hsop_gcs.placement.solution import mean_error_m, worst_error_m

    above, below = figure.subplots(2, 1, sharex=True)
    numbers = list(placements)
    above.plot(numbers, [placement.cost for placement in placements.values()], "o-", label="cost")
    above.plot(numbers, [placement.lower_bound for placement in placements.values()], "--", label="lower bound")
    above.set_ylabel("cost")
    below.plot(numbers, [worst_error_m(placement) for placement in placements.values()], "o-", label="worst threat")
    below.plot(numbers, [mean_error_m(placement) for placement in placements.values()], "s-", label="mean")
    below.set_ylabel("expected error, m")
    below.set_xlabel("hosts")
    below.xaxis.get_major_locator().set_params(integer=True)
    for axes in (above, below):
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
        axes.legend()
