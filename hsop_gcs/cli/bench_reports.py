"""``hsop-gcs bench reports``: what threat reports cost the service, and how fast they are in the picture."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.cli.bench_machine import this_machine
from hsop_gcs.cli.options import within
from hsop_gcs.cli.output_file import require_directory

if TYPE_CHECKING:
    from rich.console import Console

    from hsop_gcs.bench.reports import Result


def reports(
    threats: Annotated[int, typer.Option(help="Reported at the same time.")] = 50,
    rate: Annotated[float, typer.Option(help="Reports of each threat a second.")] = 10.0,
    duration: Annotated[float, typer.Option(help="Of each load, seconds.")] = 15.0,
    single: Annotated[int, typer.Option(help="Reports to an idle service; 0: none.")] = 100,
    seed: Annotated[int, typer.Option(help="Of the threats.")] = 0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write what was measured here.")] = None,
) -> None:
    """Report threats to the service over HTTP: processor time, and the time from a report to the picture."""
    from rich.console import Console

    from hsop_gcs.bench.reports import measure

    within("--threats", threats, 1, 1000)
    within("--rate", rate, 0.1, 100, "Hz")
    within("--duration", duration, 1, 86_400, "s")
    within("--single", single, 0, 10_000)
    require_directory("--json", json_file)
    machine = this_machine()
    with Console(stderr=True).status("beginning") as status:
        result = measure(
            threats=threats, rate_hz=rate, duration_s=duration, reports=single, seed=seed, step=status.update
        )
    _print(result, Console())
    machine.tell(result.to_json(), json_file)


def _print(result: "Result", console: "Console") -> None:
    from rich.table import Table

    table = Table(title=f"{result.threats} threats at {result.rate_hz:g} Hz; idle: {result.idle_cores:.1%} of a core")
    for heading in ("requests", "ids", "reports/s", "tracks", "% of a core"):
        table.add_column(heading, justify="right")
    for load in result.loads:
        table.add_row(
            "one a report" if load.one_by_one else "one a scan",
            "yes" if load.ids else "no",
            f"{load.reports_per_s:.0f}",
            str(load.tracks),
            f"{100 * load.service_cores:.1f}",
        )
    console.print(table)
    for what, each in (("new", result.new_in_picture), ("known", result.known_in_picture)):
        if each is not None:
            console.print(
                f"a report of a {what} threat is in the picture after {1e3 * each.p50_s:.1f} ms (p50),"
                f" {1e3 * each.p99_s:.1f} ms (p99), {1e3 * each.worst_s:.1f} ms (worst of {each.count})",
                highlight=False,
            )
