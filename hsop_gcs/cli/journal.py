"""``hsop-gcs journal``: what is in a journal, and a good one of what can be read of a damaged one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from hsop_gcs.journal.check import Contents

_SEGMENTS_TOLD = 20
_FILE = typer.Argument(help="The journal, as service.journal names it.", metavar="FILE")


def register(app: typer.Typer) -> None:
    journal = typer.Typer(help="Look at a journal, and mend it.", rich_markup_mode=None)
    app.add_typer(journal, name="journal")

    @journal.command()
    def check(
        file: Annotated[Path, _FILE],
        as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    ) -> int:
        """Tell what is in a journal: segments, entries, kinds, times, damage. Exit 1 if it is damaged."""
        import json
        from dataclasses import asdict

        from rich.console import Console

        from hsop_gcs.journal.check import check as look

        contents = look(file)
        if as_json:
            typer.echo(json.dumps(asdict(contents)))
        else:
            Console(highlight=False).print(_told(contents))
        return 1 if contents.damages or contents.missing_segments else 0

    @journal.command()
    def repair(
        file: Annotated[Path, _FILE],
        out: Annotated[Path | None, typer.Option("-o", "--out", help="The new journal.", metavar="OUT")] = None,
        replace: Annotated[
            bool, typer.Option("--replace", help="Put it in FILE's place, FILE in FILE.damaged.")
        ] = False,
        as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array.")] = False,
    ) -> None:
        """Write a good journal of what can be read, FILE.repaired if no other is named, and tell what was lost."""
        import json
        from dataclasses import asdict

        from hsop_gcs.journal.repair import put_in_place
        from hsop_gcs.journal.repair import repair as mend

        target = out or file.with_name(f"{file.name}.repaired")
        done = mend(file, target)
        if replace:
            put_in_place(file, target)
        if as_json:
            typer.echo(json.dumps([asdict(each) for each in done]))
            return
        for each in done:
            typer.echo(f"{each.file}: {each.entries} entries, {each.lost} lines lost")
        where = f"{file}, the damaged one is {file}.damaged" if replace else f"{target}; {file} is as it was"
        typer.echo(f"the repaired journal is {where}")


def _told(contents: "Contents") -> "RenderableType":
    from rich.console import Group
    from rich.table import Table

    from hsop_gcs.journal.check import DAMAGES_TOLD

    files = Table("file", box=None, pad_edge=False)
    for name in ("MB", "entries", "numbers"):
        files.add_column(name, justify="right", no_wrap=True)
    for name in ("from, UTC", "to", ""):
        files.add_column(name, no_wrap=True)
    older = contents.segments[:-_SEGMENTS_TOLD]
    if older:
        size = f"{sum(each.bytes for each in older) / 1e6:.1f}"
        files.add_row(f"({len(older)} older)", size, str(sum(each.entries for each in older)))
    for each in contents.segments[-_SEGMENTS_TOLD:]:
        numbers = f"{each.first}-{each.last}" if each.entries else "-"
        size, note = f"{each.bytes / 1e6:.1f}", "kept" if each.kept else ""
        files.add_row(each.file, size, str(each.entries), numbers, _utc(each.from_s)[5:], _utc(each.to_s)[-8:], note)
    kinds = Table("kind", box=None, pad_edge=False)
    kinds.add_column("entries", justify="right")
    for kind, count in contents.kinds.items():
        kinds.add_row(kind, str(count))
    lines = [f"{each.file}: line {each.line}: {each.what}" for each in contents.damages[:DAMAGES_TOLD]]
    if len(contents.damages) > DAMAGES_TOLD:
        lines.append(f"... and {len(contents.damages) - DAMAGES_TOLD} more")
    if contents.missing_segments:
        lines.append(f"segments that are not there: {', '.join(map(str, contents.missing_segments))}")
    if contents.torn_bytes:
        lines.append(f"a last line that was not written to its end: {contents.torn_bytes} bytes; a start cuts it off")
    if contents.given_up:
        given_up = ", ".join(f"{count} {kind}" for kind, count in contents.given_up.items())
        lines.append(f"entries that are not there, for neither disk nor memory had room, or lost since: {given_up}")
    damaged = bool(contents.damages or contents.missing_segments)
    lines.append(f"format {contents.format}, {'damaged: hsop-gcs journal repair' if damaged else 'sound'}")
    return Group(files, "", kinds, "", *lines)


def _utc(time_s: float | None) -> str:
    from datetime import UTC, datetime

    if time_s is None:
        return " " * 5 + "-"
    try:
        return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        return f"     {time_s:g}"
