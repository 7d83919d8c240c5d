"""``hsop-gcs demo``: the whole job on one machine: threats reported, a plan made, simulated hosts flying to it."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hsop_gcs.demo import Outcome


def register(app: typer.Typer) -> None:
    @app.command()
    def demo(
        autopilot: Annotated[str, typer.Option(help="px4 or ardupilot: how the simulated hosts behave.")] = "px4",
        as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
    ) -> None:
        """Watch it work: service and simulated fleet on loopback UDP, threats fly in, hosts fly out to see them."""
        import asyncio
        import json
        from dataclasses import asdict

        from hsop_gcs.demo import run_demo
        from hsop_gcs.errors import BadInput

        if autopilot not in ("px4", "ardupilot"):
            raise BadInput("--autopilot", f"{autopilot!r} is not 'px4' or 'ardupilot'")
        try:
            outcome = asyncio.run(run_demo(autopilot))
        except (KeyboardInterrupt, asyncio.CancelledError):
            typer.echo("hsop-gcs: stopped", err=True)
            raise SystemExit(130) from None
        if as_json:
            typer.echo(json.dumps(asdict(outcome.summary)))
        else:
            _print_table(outcome)
        if not outcome.summary.all_arrived:
            typer.echo(f"hsop-gcs: {outcome.problem}", err=True)
            raise SystemExit(1)


def _print_table(outcome: "Outcome") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Hosts on station" if outcome.summary.all_arrived else "Not all hosts are on station")
    for heading in ("host", "status", "hover error", "heading error", "gimbal error", "sees"):
        table.add_column(heading, justify="left" if heading in ("host", "status", "sees") else "right")
    for row in outcome.rows:
        table.add_row(
            row.host,
            row.status,
            _number(row.hover_error_m, " m"),
            _number(row.heading_error_deg, "°"),
            _number(row.gimbal_error_deg, "°"),
            ", ".join(f"{threat} ({camera})" for threat, camera in row.sees),
        )
    console = Console()
    console.print(table)
    if outcome.plan_cost is None:
        return
    errors = outcome.errors
    console.print(
        f"{outcome.summary.threats} threats, {outcome.summary.hosts} hosts, plan cost {outcome.plan_cost:.4f},"
        f" {outcome.summary.duration_s:.0f} s"
    )
    console.print(
        f"Distance from the truth: reports {_number(errors.reports_m, ' m')}, after the first fix"
        f" {_number(errors.first_fix_m, ' m')}, at the end {_number(errors.final_m, ' m')}"
    )
    console.print(f"Journal: {outcome.summary.journal} (hsop-gcs replay runs it again)", soft_wrap=True)


def _number(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.2f}{unit}"
