"""``hsop-gcs serve``: the service."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    @app.command()
    def serve(
        config: Annotated[Path, typer.Option(help="The fleet file, FLEET.toml.", metavar="FLEET.toml")],
        port: Annotated[int | None, typer.Option(help="Instead of the file's service.port.")] = None,
    ) -> None:
        """Run the service: threat reports in over HTTP, hover points and camera aims out over MAVLink."""
        import asyncio
        import logging

        from hsop_gcs.app import serve as run
        from hsop_gcs.settings import read_settings

        settings = read_settings(config)
        if port is not None:
            service = settings.service.model_copy(update={"port": port})
            settings = settings.model_copy(update={"service": service})
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")

        def ready(address: str) -> None:
            typer.echo(f"hsop-gcs serves {len(settings.hosts)} hosts at {address} (API: {address}/docs)", err=True)

        asyncio.run(run(settings, ready))
