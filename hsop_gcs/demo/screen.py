"""What a person sees while the demonstration runs."""

from typing import Any, Self

from rich.console import Console
from rich.live import Live
from rich.table import Table


class Screen:
    """Progress for a person: a live table on a terminal, plain lines elsewhere; always on stderr."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._live = Live(console=self._console, refresh_per_second=4, transient=True)
        self._is_terminal = self._console.is_terminal

    def __enter__(self) -> Self:
        if self._is_terminal:
            self._live.__enter__()
        return self

    def __exit__(self, *exit_info: Any) -> None:
        if self._is_terminal:
            self._live.__exit__(*exit_info)

    def say(self, line: str) -> None:
        """Print a line that stays."""
        self._console.print(line, highlight=False)

    def show(self, hosts: list[dict[str, Any]], track_error_m: float | None) -> None:
        """Show hosts as the API does, and how far tracks are from the truth; only a terminal has room for that."""
        if self._is_terminal:
            self._live.update(_live_table(hosts, track_error_m))


def _live_table(hosts: list[dict[str, Any]], track_error_m: float | None) -> Table:
    track = "" if track_error_m is None else f"tracks are {track_error_m:.2f} m from the truth"
    table = Table(caption=track)
    for heading in ("host", "mode", "altitude", "order", "to go", "heading", "gimbal"):
        table.add_column(heading)
    for host in hosts:
        order = host["order"] or {}
        local = host["position_enu_m"]
        table.add_row(
            host["id"],
            host["mode"] or host["unavailable_reason"] or "",
            "" if local is None else f"{local[2]:.0f} m",
            order.get("status", ""),
            _shown(order.get("hover_error_m"), " m"),
            _shown(order.get("heading_error_deg"), "°"),
            _shown(order.get("gimbal_error_deg"), "°"),
        )
    return table


def _shown(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.1f}{unit}"
