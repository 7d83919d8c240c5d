"""``hsop-gcs fleet``: what is heard of the fleet, live: from a running service, or from the links themselves."""

from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hsop_gcs.errors import BadInput, Unavailable

if TYPE_CHECKING:
    from rich.table import Table

    from hsop_gcs.fleet import Host
    from hsop_gcs.link.pump import Link

_EVERY_S = 1.0
_LISTEN_S = 3.0
"""So long a single look at the links takes: heartbeats come once a second."""
_OF_THE_VEHICLE = ("autopilot", "vehicle_type", "firmware", "link_up", "battery_percent", "mode", "armed", "in_air")
_OF_ITS_LINK = ("rate_hz", "loss", "round_trip_ms")
"""What a row shows of either, under the names that the service's answer has, too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One host, or one system that is not in the fleet (then it has no ``host``)."""

    host: str | None
    system_id: int
    autopilot: str | None = None
    vehicle_type: str | None = None
    firmware: str | None = None
    link_up: bool = False
    rate_hz: float = 0.0
    loss: float | None = None
    round_trip_ms: float | None = None
    battery_percent: float | None = None
    mode: str | None = None
    armed: bool | None = None
    in_air: bool | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None
    altitude_amsl_m: float | None = None
    order: str | None = None
    note: str | None = None


def register(app: typer.Typer) -> None:
    @app.command()
    def fleet(
        config: Annotated[Path | None, typer.Option(help="Listen on the links of this FLEET.toml.")] = None,
        url: Annotated[str | None, typer.Option(help="Ask a running service, such as http://127.0.0.1:8080.")] = None,
        as_json: Annotated[bool, typer.Option("--json", help="One JSON array a line.")] = False,
        once: Annotated[bool, typer.Option("--once", help="Look once, instead of until interrupted.")] = False,
    ) -> None:
        """List what is heard: system, autopilot, link, battery, mode, position and order of every host, live."""
        import asyncio

        if (config is None) == (url is None):
            raise BadInput("--config", "needed, or --url; one of them")
        looks = _from_links(config, once=once) if config is not None else _from_service(str(url), once=once)
        try:
            asyncio.run(_show(looks, as_json=as_json, once=once))
        except KeyboardInterrupt:
            raise SystemExit(130) from None


async def _show(looks: AsyncIterator[list[Row]], *, as_json: bool, once: bool) -> None:
    import json
    from contextlib import nullcontext

    from rich.console import Console
    from rich.live import Live

    console = Console()
    live = None if as_json or once else Live(console=console, auto_refresh=False)
    with live or nullcontext():
        async for rows in looks:
            if as_json:
                typer.echo(json.dumps([asdict(row) for row in rows]))
            elif live is None:
                console.print(_table(rows))
            else:
                live.update(_table(rows), refresh=True)


async def _from_service(url: str, *, once: bool) -> AsyncIterator[list[Row]]:
    import asyncio

    import httpx2

    async with httpx2.AsyncClient(base_url=url, timeout=5) as client:
        while True:
            try:
                answer = (await client.get("/api/v1/hosts")).raise_for_status()
                yield [_row_of_answer(host) for host in answer.json()]
            except (httpx2.HTTPError, httpx2.InvalidURL, ValueError, KeyError) as error:
                raise Unavailable(f"no service answers at {url}: {error}") from error
            if once:
                return
            await asyncio.sleep(_EVERY_S)


def _row_of_answer(host: dict[str, Any]) -> Row:
    link, order, position = host["link"], host["order"] or {}, host["position"] or {}
    return Row(
        host=host["id"],
        system_id=host["system_id"],
        **{name: host[name] for name in _OF_THE_VEHICLE},
        **{name: link[name] for name in _OF_ITS_LINK},
        **position,
        order=order.get("status"),
        note=host["unavailable_reason"] or order.get("note") or None,
    )


async def _from_links(config: Path, *, once: bool) -> AsyncIterator[list[Row]]:
    import asyncio

    from hsop_gcs.app import link_of
    from hsop_gcs.settings import read_settings

    settings = read_settings(config)
    async with link_of(settings) as link:
        while True:
            await asyncio.sleep(_LISTEN_S if once else _EVERY_S)
            rows = [_row_of_host(host, link) for host in settings.to_fleet().hosts]
            rows += [
                Row(host=None, system_id=each.system, note=f"not in the fleet, at {each.peer.address}")
                for each in link.strangers
            ]
            yield rows
            if once:
                return


def _row_of_host(host: "Host", link: "Link") -> Row:

    vehicle, share = link.vehicles[host.system_id], link.vehicle_link(host.system_id)
    position = vehicle.state.position
    return Row(
        host=host.id,
        system_id=host.system_id,
        **{name: getattr(vehicle.state, name) for name in _OF_THE_VEHICLE},
        **{name: getattr(share, name) for name in _OF_ITS_LINK},
        **({} if position is None else asdict(position)),
        note=vehicle.why_not_ready(link.now()),
    )


def _table(rows: list[Row]) -> "Table":
    """Return a table that 80 columns hold; notes go below it."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0), caption_justify="left", caption_style="")
    for heading in ("host", "sys", "autopilot", "link", "bat", "mode", "air", "lat, lon, AMSL", "order"):
        table.add_column(heading, no_wrap=True, justify="right" if heading in ("sys", "bat") else "left")
    for row in rows:
        if row.host is not None:
            table.add_row(
                row.host[:8],
                str(row.system_id),
                " ".join(each for each in (row.autopilot, row.firmware) if each)[:11] or "-",
                _link(row) if row.link_up else "silent",
                "-" if row.battery_percent is None else f"{row.battery_percent:.0f}%",
                (row.mode or "-")[:8],
                "-" if row.in_air is None else "air" if row.in_air else "armed" if row.armed else "ground",
                _place(row),
                row.order or "-",
            )
    notes = [f"{row.host or f'system {row.system_id}'}: {row.note}" for row in rows if row.note]
    table.caption = "\n".join(notes) or None
    return table


def _link(row: Row) -> str:
    loss = "" if row.loss is None else f" {row.loss:.0%}"
    delay = "" if row.round_trip_ms is None else f" {row.round_trip_ms:.0f}ms"
    return f"{row.rate_hz:.0f}/s{loss}{delay}"


def _place(row: Row) -> str:
    if row.lat_deg is None or row.lon_deg is None or row.altitude_amsl_m is None:
        return "-"
    return f"{row.lat_deg:.4f} {row.lon_deg:.4f} {row.altitude_amsl_m:.0f}"
