"""The command line: ``hsop-gcs COMMAND``. Each command lives in a module of its own and imports what it needs late."""

import sys
import time
from typing import NoReturn

import typer

from hsop_gcs.errors import BadInput, HsopError

BEGAN_S = time.monotonic()
"""When the command was given, as nearly as a program knows."""
app = typer.Typer(
    name="hsop-gcs",
    help="Place camera aircraft where they localize intruding drones best, and fly them there.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line; a fault a user can mend is one line on stderr: exit 2 for bad input, 1 for the rest."""
    from hsop_gcs.cli import bench, check_config, demo, figures, fleet, journal, plan, replay, serve, simulate, study

    for module in (demo, serve, check_config, fleet, simulate, plan, replay, journal, study, figures, bench):
        module.register(app)
    try:
        code = app(sys.argv[1:] or ["--help"], prog_name="hsop-gcs", standalone_mode=False)
    except BadInput as error:
        _fail(error, 2)
    except typer.TyperException as error:
        _fail(error, error.exit_code)
    except HsopError as error:
        _fail(error, 1)
    raise SystemExit(code)


def _fail(error: Exception, code: int) -> NoReturn:
    message = error.format_message() if isinstance(error, typer.TyperException) else str(error)
    typer.echo(f"hsop-gcs: {message}", err=True)
    raise SystemExit(code)
