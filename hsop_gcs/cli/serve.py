"""``hsop-gcs serve``: the service."""

from pathlib import Path
from typing import Annotated

import typer

from hsop_gcs.errors import BadInput


def register(app: typer.Typer) -> None:
    @app.command()
    def serve(
        config: Annotated[Path, typer.Option(help="The fleet file, FLEET.toml.", metavar="FLEET.toml")],
        host: Annotated[str | None, typer.Option(help="Instead of the file's service.host.")] = None,
        port: Annotated[int | None, typer.Option(help="Instead of the file's service.port.")] = None,
        journal: Annotated[str | None, typer.Option(help="Instead of the file's service.journal.")] = None,
    ) -> None:
        """Run the service: threat reports in over HTTP, hover points and camera aims out over MAVLink."""
        import asyncio
        import logging

        from hsop_gcs.app import serve as run
        from hsop_gcs.cli.options import within
        from hsop_gcs.settings import read_settings

        if port is not None:
            within("--port", port, 0, 65535)
        for option, value in (("--host", host), ("--journal", journal)):
            if value == "":
                raise BadInput(option, "is empty")
        settings = read_settings(config)
        given = {
            name: value for name, value in (("host", host), ("port", port), ("journal", journal)) if value is not None
        }
        settings = settings.model_copy(update={"service": settings.service.model_copy(update=given)})
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")

        def ready(address: str) -> None:
            typer.echo(f"hsop-gcs serves {len(settings.hosts)} hosts at {address} (API: {address}/docs)", err=True)

        asyncio.run(run(settings, ready))
