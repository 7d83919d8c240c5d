"""The command line: ``hsop-gcs COMMAND``. Each command lives in a module of its own and imports what it needs late."""

import typer

from hsop_gcs.errors import BadInput, HsopError

app = typer.Typer(
    name="hsop-gcs",
    help="Place camera aircraft where they localize intruding drones best, and fly them there.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line; a fault a user can mend is one line on stderr: exit 2 for bad input, 1 for the rest."""
    from hsop_gcs.cli import demo, plan, serve, simulate

    for module in (demo, serve, simulate, plan):
        module.register(app)
    try:
        app()
    except BadInput as error:
        typer.echo(f"hsop-gcs: {error}", err=True)
        raise SystemExit(2) from None
    except HsopError as error:
        typer.echo(f"hsop-gcs: {error}", err=True)
        raise SystemExit(1) from None
