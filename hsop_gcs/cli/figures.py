"""``hsop-gcs figures``: the letter's figures, redrawn from this system's own cameras and placements."""

from pathlib import Path
from typing import Annotated

import typer

from hsop_gcs.cli.options import one_of
from hsop_gcs.errors import BadInput


def register(app: typer.Typer) -> None:
    @app.command()
    def figures(
        out: Annotated[Path, typer.Option(help="Directory for the SVG and PNG files.")] = Path("figures"),
        only: Annotated[
            str | None, typer.Option(help="Names of figures, separated by commas.", show_default="all")
        ] = None,
        rows: Annotated[
            Path | None,
            typer.Option(help="A study's JSON rows for Fig. 11.", show_default="the study that comes with the package"),
        ] = None,
    ) -> None:
        """Draw the letter's Figs. 1, 2, 3, 6, 7, 8, 9, 10 and 11, each as SVG and PNG, and print what was measured."""
        from hsop_gcs.study.figures import FIGURES, draw

        names = list(FIGURES) if only is None else only.split(",")
        for name in names:
            one_of("--only", name, FIGURES)
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadInput("--out", f"{out}: {error.strerror or error}") from None
        for name in names:
            for line in draw(name, out, rows):
                typer.echo(f"{name}: {line}")
