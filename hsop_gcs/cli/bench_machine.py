"""The machine a benchmark ran on, without which its figures say little."""

import json
import os
import platform
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import typer

from hsop_gcs.cli.output_file import write


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    machine: str
    cores: int | None
    python: str
    load_before: tuple[float, ...]
    """Of the last 1, 5 and 15 minutes."""

    def tell(self, figures: dict[str, Any], json_file: Path | None) -> None:
        """Print the machine; write it and the figures measured on it, if a file for them is named."""
        typer.echo(
            f"{self.machine}, {self.cores} cores, Python {self.python}, load {self.load_before[0]:g} before it began"
        )
        if json_file is not None:
            write(json_file, json.dumps(asdict(self) | figures, indent=2) + "\n")


def this_machine() -> Machine:
    """Return the machine as it is now, before a benchmark begins."""
    return Machine(
        machine=platform.machine(),
        cores=os.cpu_count(),
        python=platform.python_version(),
        load_before=tuple(round(each, 2) for each in os.getloadavg()),
    )
