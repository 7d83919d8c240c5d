"""``hsop-gcs replay``: a recorded mission run again, headless, and held against what was recorded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hsop_gcs.replay import Outcome

_SHOWN = 20


def register(app: typer.Typer) -> None:
    @app.command()
    def replay(
        journal: Annotated[Path, typer.Argument(help="The journal of a service, or with --tlog a telemetry log.")],
        from_s: Annotated[float, typer.Option("--from", help="Seconds after the first entry.")] = 0.0,
        to_s: Annotated[float | None, typer.Option("--to", help="Seconds after the first entry.")] = None,
        tlog: Annotated[bool, typer.Option("--tlog", help="Show what a vehicle was told and what it did.")] = False,
        as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    ) -> None:
        """Run a recorded mission again and list what comes out otherwise. Exit 1 if anything does."""
        import json
        import sys
        from dataclasses import asdict

        from rich.progress import Progress

        from hsop_gcs.replay import replay as run
        from hsop_gcs.replay.telemetry import retell

        if tlog:
            for line in retell(journal):
                typer.echo(json.dumps(asdict(line)) if as_json else str(line))
            return
        with Progress(disable=not sys.stderr.isatty(), transient=True) as bar:
            task = bar.add_task("replaying", total=None)
            outcome = run(
                journal,
                from_s=from_s,
                to_s=float("inf") if to_s is None else to_s,
                progress=lambda entries: bar.update(task, completed=entries),
            )
        typer.echo(json.dumps(asdict(outcome)) if as_json else _told(outcome))
        if outcome.differences:
            raise SystemExit(1)


def _told(outcome: "Outcome") -> str:
    lines = [
        f"entry {each.entry}: {each.what}: recorded {each.recorded!r}, replayed {each.replayed!r}"
        for each in outcome.differences[:_SHOWN]
    ]
    if len(outcome.differences) > _SHOWN:
        lines.append(f"... and {len(outcome.differences) - _SHOWN} more")
    lines.append(
        f"{outcome.entries} entries ({outcome.reports} reports, {outcome.detections} detections,"
        f" {outcome.decisions} decisions) of {outcome.recorded_s:.0f} s replayed in {outcome.replayed_in_s:.1f} s:"
        f" {len(outcome.differences)} differences"
    )
    return "\n".join(lines)
