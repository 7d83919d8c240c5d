"""``hsop-gcs check-config``: everything that is wrong with a fleet file, before anything flies."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from hsop_gcs.settings import Settings


def register(app: typer.Typer) -> None:
    @app.command()
    def check_config(
        config: Annotated[Path, typer.Argument(help="The fleet file.", metavar="FLEET.toml")],
        as_json: Annotated[bool, typer.Option("--json", help="Faults and summary as JSON.")] = False,
    ) -> int:
        """Check FLEET.toml and the files it names, as a whole: exit 0, or 2 with a line for every fault."""
        import json
        from dataclasses import asdict

        from hsop_gcs.settings import check_settings

        settings, faults = check_settings(config)
        summary = None if settings is None else _summary(settings)
        if as_json:
            typer.echo(json.dumps({"faults": [asdict(fault) for fault in faults], "fleet": summary}, indent=2))
        elif summary is not None:
            for line in _lines(summary):
                typer.echo(line)
        else:
            for fault in faults:
                place = str(config) if fault.line is None else f"{config}:{fault.line}"
                typer.echo(f"{place}: {fault}", err=True)
        return 2 if faults else 0


_SHOWN = {"id", "system_id", "connection", "mavsdk_port", "address"}


def _summary(settings: "Settings") -> dict[str, Any]:
    import shapely

    airspace = settings.to_airspace()
    return {
        "origin": settings.site.origin.model_dump(),
        "autonomy": str(settings.service.autonomy),
        "hosts": [host.model_dump(include=_SHOWN) for host in settings.hosts],
        "limits": settings.limits.model_dump(),
        "fence_m2": [round(shapely.Polygon(polygon).area) for polygon in airspace.inside],
        "keep_outs_m2": [round(shapely.Polygon(area.polygon).area) for area in airspace.keep_outs],
        "journal": settings.service.journal,
    }


def _lines(summary: dict[str, Any]) -> list[str]:
    origin, limits, fences = summary["origin"], summary["limits"], summary["fence_m2"]
    fence = " + ".join(f"{area:,} m²" for area in fences) if fences else "none: hosts may be sent anywhere"
    return [
        f"origin    {origin['lat_deg']:.6f}°, {origin['lon_deg']:.6f}°, {origin['altitude_amsl_m']:g} m AMSL",
        f"autonomy  {summary['autonomy']}",
        *(f"host      {_host(**each)}" for each in summary["hosts"]),
        "limits    " + ", ".join(f"{name} {value:g}" for name, value in limits.items()),
        f"fence     {fence}",
        f"keep-outs {len(summary['keep_outs_m2'])}",
        f"journal   {summary['journal'] or 'none: a service that ends forgets its mission'}",
    ]


def _host(id: str, system_id: int, connection: str, mavsdk_port: int | None, address: str | None) -> str:
    mavsdk = "" if mavsdk_port is None else f", MAVSDK at udpout://127.0.0.1:{mavsdk_port}"
    pinned = "" if address is None else f" from {address} only"
    return f"{id}: system {system_id}, {connection}{pinned}{mavsdk}"
