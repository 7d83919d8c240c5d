"""``hsop-gcs bench link``: what a large fleet costs the service, and how fast a report becomes a waypoint."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsop_gcs.cli.bench_machine import this_machine
from hsop_gcs.cli.options import within
from hsop_gcs.cli.output_file import require_directory

if TYPE_CHECKING:
    from rich.console import Console

    from hsop_gcs.bench.link import Result


def link(
    vehicles: Annotated[int, typer.Option(help="At full telemetry; 0 leaves this part out.")] = 100,
    duration: Annotated[float, typer.Option(help="Of that part, seconds.")] = 60.0,
    reports: Annotated[int, typer.Option(help="Pairs of threats reported to four hosts; 0: none.")] = 100,
    velocity: Annotated[
        bool, typer.Option("--velocity/--no-velocity", help="Whether these reports carry one; without, tracks wait.")
    ] = True,
    seed: Annotated[int, typer.Option(help="Of the threats and of who is held.")] = 0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write what was measured here.")] = None,
) -> int:
    """Run the service beside a fleet in a process of its own: its cost, its delays, and report to first waypoint.

    Exit code 0 if every limit holds, 1 if one does not.
    """
    from rich.console import Console

    from hsop_gcs.bench.link import measure

    within("--vehicles", vehicles, 0, 250)
    within("--duration", duration, 1, 86_400, "s")
    within("--reports", reports, 0, 10_000)
    require_directory("--json", json_file)
    machine = this_machine()
    with Console(stderr=True).status("beginning") as status:
        result = measure(
            vehicles=vehicles, duration_s=duration, reports=reports, velocity=velocity, seed=seed, step=status.update
        )
    _print(result, Console())
    machine.tell(result.to_json(), json_file)
    return int(not all(limit.holds for limit in result.limits()))


def _print(result: "Result", console: "Console") -> None:
    from rich.table import Table

    load, latency = result.load, result.report_to_waypoint
    spreads = {}
    if load is not None:
        spreads = {
            "operator's command to its acknowledgement": load.command_to_ack,
            "camera aims, beside their period": load.aim_jitter,
            "heartbeats, beside their period": load.heartbeat_jitter,
        }
        console.print(
            f"{load.vehicles} vehicles, {load.messages_per_s:.0f} messages/s for {load.duration_s:.0f} s:"
            f" service {load.service_cores:.2f} cores, planner {load.planner_cores:.2f} cores,"
            f" {load.dropped} datagrams dropped",
            highlight=False,
        )
        memory = " ".join(f"{each:.0f}" for each in load.resident_mib)
        console.print(f"memory of the service at each tenth, MiB: {memory}", highlight=False)
    if latency is not None:
        spreads["report to first waypoint, 2 threats, 4 hosts"] = latency
        console.print(f"{result.missed} reports without a waypoint within 10 s", highlight=False)
    table = Table(title="Milliseconds")
    table.add_column("what")
    for heading in ("number", "p50", "p99", "worst"):
        table.add_column(heading, justify="right")
    for what, each in spreads.items():
        table.add_row(what, str(each.count), *(f"{1e3 * s:.0f}" for s in (each.p50_s, each.p99_s, each.worst_s)))
    console.print(table)
    limits = Table(title="Asked of 100 vehicles for ten minutes, and of a report in auto")
    for heading in ("what", "measured", "at most", "holds"):
        limits.add_column(heading, justify="left" if heading == "what" else "right")
    for limit in result.limits():
        measured, at_most = (f"{each:.4g} {limit.unit}" for each in (limit.measured, limit.at_most))
        limits.add_row(limit.what, measured, at_most, "yes" if limit.holds else "NO")
    console.print(limits)
