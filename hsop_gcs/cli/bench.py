"""``hsop-gcs bench``: quality and time, in one run."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.cli.bench_link import link
from hsop_gcs.cli.bench_machine import this_machine
from hsop_gcs.cli.bench_reports import reports
from hsop_gcs.cli.output_file import require_directory
from hsop_gcs.cli.plots import new_figure, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from hsop_gcs.bench.measure import Growth, Report

commands = typer.Typer(
    name="bench",
    help="Quality and time of placements, cost and delays of the link and of reports.",
    no_args_is_help=True,
)


def register(app: typer.Typer) -> None:
    commands.command()(link)
    commands.command()(reports)
    app.add_typer(commands)


@commands.command()
def placement(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer cases and less time for each.")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write what was measured here.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw how time grows with the threats: a PNG.")] = None,
) -> None:
    """Compare the global search with the letter's method, differential evolution and IPOPT at equal time."""
    from rich.console import Console
    from rich.progress import Progress

    from hsop_gcs.bench.measure import FULL, QUICK, measure, steps

    require_directory("--json", json_file)
    require_directory("--plot", plot)
    figure = None if plot is None else new_figure(6, 4.5)
    effort = QUICK if quick else FULL
    machine = this_machine()
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("warming up", total=steps(effort))
        done = -1

        def step(what: str) -> None:
            nonlocal done
            done += 1
            progress.update(task, description=what, completed=done)

        report = measure(effort, step=step)
    _print(report, Console())
    machine.tell(report.to_json(), json_file)
    if figure is not None and plot is not None:
        _draw_growth(figure, report.growth, report.exponent)
        save(figure, plot)


def _print(report: "Report", console: "Console") -> None:
    from rich.table import Table

    from hsop_gcs.bench.measure import best_of, rows

    names = [run.contender for run in report.comparisons[0].runs]
    table = Table(title=f"Cost over the least found, {report.effort.time_limit_s:g} s each", padding=0)
    for heading in ("case", "hosts", *names, "letter uncut", "in s", "letter's cost after s"):
        name = heading == "case"
        table.add_column(heading, justify="left" if name else "right", overflow="fold", no_wrap=name)
    for comparison, ratios in rows(report):
        shown = [f"{ratios[name]:.3f}" if ratios[name] < float("inf") else "-" for name in names]
        seconds, uncut = comparison.seconds_to_letters_cost, comparison.uncut
        shown += ["", ""] if uncut is None else [f"{uncut.cost / best_of(comparison):.3f}", f"{uncut.seconds:.1f}"]
        table.add_row(comparison.case, str(comparison.n_hosts), *shown, "-" if seconds is None else f"{seconds:.2f}")
    console.print(table)
    growth = Table(title=f"Time to within 5 % of {report.effort.reference_s:g} s of search")
    for heading in ("threats", "hosts", "seconds", "missed"):
        growth.add_column(heading, justify="right")
    for each in report.growth:
        growth.add_row(str(each.threats), str(each.n_hosts), f"{each.seconds:.2f}", str(each.missed))
    console.print(growth)
    console.print(f"seconds grow as threats to the power of {report.exponent:.2f}")


def _draw_growth(figure: "Figure", growth: "Sequence[Growth]", exponent: float) -> None:
    """Every case, the medians and the power of the threats that is fitted to them, on logarithmic axes."""
    known = [each for each in growth if each.each_s]
    threats = [each.threats for each in known]
    axes = figure.subplots()
    for each in known:
        axes.plot([each.threats] * len(each.each_s), each.each_s, "o", color="0.7", markersize=4)
    axes.plot(threats, [each.seconds for each in known], "o-", label="median")
    if known:
        middle = sum(math.log(each.seconds / each.threats**exponent) for each in known) / len(known)
        fitted = [math.exp(middle) * each.threats**exponent for each in known]
        axes.plot(threats, fitted, "--", label=f"threats to the power of {exponent:.2f}")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(threats, [str(number) for number in threats])
    axes.minorticks_off()
    axes.set_xlabel("threats, three hosts for every two")
    axes.set_ylabel("seconds to a plan within 5 %")
    axes.grid(alpha=0.3)
    axes.legend()
