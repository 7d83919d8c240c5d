"""Files that commands write: looked at before the work begins, and a fault a user can mend is bad input."""

from pathlib import Path

from hsop_gcs.errors import BadInput


def require_directory(option: str, path: Path | None) -> None:
    """Raise BadInput if the directory of a file to be written does not exist."""
    if path is not None and not path.parent.is_dir():
        raise BadInput(option, f"{path}: there is no directory {path.parent}")


def write(path: Path, text: str) -> None:
    """Write a file. Raises BadInput if it cannot be written."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(str(path), f"cannot be written: {error.strerror or error}") from None
