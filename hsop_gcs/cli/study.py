"""``hsop-gcs study``: Monte Carlo studies of placements and estimators."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.cli.options import one_of
from hsop_gcs.cli.output_file import require_directory, write
from hsop_gcs.errors import BadInput

if TYPE_CHECKING:
    from hsop_gcs.study.results import Results
    from hsop_gcs.study.trial import Record, Study

commands = typer.Typer(name="study", help="Monte Carlo studies of placements and estimators.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    app.add_typer(commands)


@commands.command()
def letter(
    scenarios: Annotated[int, typer.Option(help="Random scenarios for each number of threats.")] = 100,
    draws: Annotated[int, typer.Option(help="Noise draws per threat, half now and half after the horizon.")] = 10_000,
    threats: Annotated[str, typer.Option(help="Numbers of threats, separated by commas.")] = "2,3,4",
    seed: Annotated[int, typer.Option(help="The same seed gives the same numbers, for any number of jobs.")] = 0,
    jobs: Annotated[int | None, typer.Option(help="Processes.", show_default="one per core")] = None,
    rounds: Annotated[int, typer.Option(help="Rounds of the placement search for each number of hosts.")] = 3,
    size: Annotated[float, typer.Option(help="Width of the threats, metres; the letter does not say.")] = 1.5,
    area: Annotated[float, typer.Option(help="Side of the threats' square, metres; the letter does not say.")] = 40.0,
    placement: Annotated[
        str, typer.Option(help="Placements to compare, separated by commas.")
    ] = "hsop,coverage-only,rms,operational",
    dask: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://...", show_default=False)] = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory for results, tables and Fig. 11.", show_default=False)
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the rows here.", show_default=False)] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the results in --out.")] = False,
) -> None:
    """Repeat the letter's study (its Fig. 11), and compare what goes beyond it."""
    from hsop_gcs.study.assumptions import Assumptions
    from hsop_gcs.study.placements import Kind
    from hsop_gcs.study.results import Results
    from hsop_gcs.study.trial import Study

    names = placement.split(",")
    for name in names:
        one_of("--placement", name, Kind)
    study = Study(
        threats=tuple(_whole(text, "--threats") for text in threats.split(",")),
        scenarios=scenarios,
        draws=draws,
        seed=seed,
        rounds=rounds,
        kinds=tuple(kind for kind in Kind if kind.value in names),
        assumptions=Assumptions(size_m=size, area_m=area, coverage_start_m=area),
    )
    if resume and out is None:
        raise BadInput("--resume", "names nothing to go on with; give the directory with --out")
    require_directory("--json", json_file)
    results = Results(study, None if out is None else out / "trials.jsonl")
    results.begin(resume=resume)
    records, seconds = _run(results, jobs, dask)
    _report(study, records, seconds, json_file, out)


@commands.command()
def sensitivity(
    scenarios: Annotated[int, typer.Option(help="Random scenarios for each number of threats.")] = 30,
    draws: Annotated[int, typer.Option(help="Noise draws per threat.")] = 2000,
    threats: Annotated[str, typer.Option(help="Numbers of threats, separated by commas.")] = "2,3",
    seed: Annotated[int, typer.Option(help="The same seed gives the same numbers.")] = 0,
    jobs: Annotated[int | None, typer.Option(help="Processes.", show_default="one per core")] = None,
    rounds: Annotated[int, typer.Option(help="Rounds of the placement search for each number of hosts.")] = 3,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the errors here.", show_default=False)] = None,
) -> None:
    """Vary what the letter does not state, one thing at a time, and print what becomes of its numbers."""
    import json

    from hsop_gcs.study.results import Results
    from hsop_gcs.study.sensitivity import outcome, table_line, table_title, variants
    from hsop_gcs.study.trial import Study

    require_directory("--json", json_file)
    counts = tuple(_whole(text, "--threats") for text in threats.split(","))
    outcomes = []
    typer.echo(table_title())
    for variant in variants():
        study = Study(
            threats=counts,
            scenarios=scenarios,
            draws=draws,
            seed=seed,
            rounds=rounds,
            kinds=variant.kinds,
            assumptions=variant.assumptions,
        )
        records, _ = _run(Results(study, None), jobs, None)
        outcomes.append(outcome(variant, records))
        typer.echo(table_line(outcomes[-1]))
    if json_file is not None:
        write(json_file, json.dumps([found.as_json() for found in outcomes], indent=1) + "\n")


def _run(results: "Results", jobs: int | None, dask: str | None) -> "tuple[list[Record], float]":
    """Run with a progress bar on stderr; return the records and the seconds it took."""
    import os
    import time

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from hsop_gcs.study.engine import run

    if jobs is not None and jobs < 1:
        raise BadInput("--jobs", f"must be at least 1, not {jobs}")
    started = time.monotonic()
    columns = (TextColumn("scenarios"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("scenarios", total=None)
        records = run(
            results,
            jobs=jobs or os.cpu_count() or 1,
            dask=dask,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    return records, time.monotonic() - started


def _report(study: "Study", records: "list[Record]", seconds: float, json_file: Path | None, out: Path | None) -> None:
    import json

    from hsop_gcs.study.claims import claims, claims_markdown, shares, shares_markdown
    from hsop_gcs.study.summary import markdown, rows

    table, found, compared = rows(records), claims(records), shares(records)
    text = markdown(table) + "\n" + claims_markdown(found)
    if compared:
        text += "\nShares of the error of HSOP with Eq. 5:\n\n" + shares_markdown(compared)
    typer.echo(text)
    typer.echo(f"{len(records)} scenarios in {seconds:.0f} s")
    content = {
        "study": study.as_json(),
        "rows": [row.as_json() for row in table],
        "claims": [claim.as_json() for claim in found],
        "shares": compared,
    }
    for path in [json_file, None if out is None else out / "rows.json"]:
        if path is not None:
            write(path, json.dumps(content, indent=1) + "\n")
    if out is not None:
        write(out / "study.md", text)


def _whole(text: str, option: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise BadInput(option, f"{text!r} is not a whole number") from None
