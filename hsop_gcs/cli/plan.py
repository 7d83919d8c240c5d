"""``hsop-gcs plan``: one scenario in, one plan out."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.errors import BadInput

if TYPE_CHECKING:
    from hsop_gcs.placement.problem import Problem
    from hsop_gcs.placement.solution import Placement

INFEASIBLE_EXIT = 3


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
        time_limit: Annotated[float, typer.Option(help="Seconds of solving at most.")] = 1.0,
        seed: Annotated[int, typer.Option(help="The same seed gives the same plan.")] = 0,
        as_json: Annotated[bool, typer.Option("--json", help="Print the plan file instead of the table.")] = False,
        output: Annotated[Path | None, typer.Option("-o", "--output", help="Write the plan file here.")] = None,
    ) -> None:
        """Place hosts for one scenario. Exit 0: a plan; 3: infeasible, and the plan file says why; 2: bad input."""
        import json
        import time

        from hsop_gcs.placement import Method, place
        from hsop_gcs.placement.problem import Formulation, Objective
        from hsop_gcs.placement.scenario import parse_json, plan_to_json, problem_from_json
        from hsop_gcs.placement.solution import Status

        problem = problem_from_json(
            parse_json(_read(scenario), scenario),
            formulation=Formulation(_one_of("--formulation", formulation, list(Formulation))),
            objective=Objective(_one_of("--objective", objective, list(Objective))),
        )
        most = 2 * len(problem.threats)
        if hosts is not None and not 2 <= hosts <= most:
            raise BadInput("--hosts", f"{hosts} is outside 2..{most}: a threat takes two hosts, and more have no use")
        if not 0 < time_limit <= 86_400:
            raise BadInput("--time-limit", f"must be above 0 and at most 86400 seconds, not {time_limit!r}")
        if seed < 0:
            raise BadInput("--seed", f"must not be negative, not {seed}")
        if output is not None and not output.parent.is_dir():
            raise BadInput("--output", f"{output}: there is no directory {output.parent}")
        placement = place(
            problem,
            n_hosts=hosts,
            seed=seed,
            time_limit_s=time_limit,
            now=time.monotonic,
            method=None if method is None else Method(_one_of("--method", method, list(Method))),
            initial_observers=initial_observers,
        )
        text = json.dumps(plan_to_json(placement), indent=2)
        if output is not None:
            _write(output, text + "\n")
        if as_json:
            typer.echo(text)
        if placement.status is Status.INFEASIBLE:
            typer.echo(f"hsop-gcs: infeasible: {placement.reason}", err=True)
            raise SystemExit(INFEASIBLE_EXIT)
        if not as_json:
            _print_tables(problem, placement)


def _one_of(option: str, value: str, known: list[str]) -> str:
    if value not in known:
        raise BadInput(option, f"{value!r} is not one of {', '.join(map(str, known))}")
    return value


def _read(source: str) -> str:
    import sys

    try:
        raw = sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes()
        return raw.decode("utf-8-sig")
    except OSError as error:
        raise BadInput(source, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        raise BadInput(source, f"not UTF-8 text: byte {error.start}") from None


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(str(path), f"cannot be written: {error.strerror or error}") from None


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
