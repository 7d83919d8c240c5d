"""Signing keys and timestamps on disk."""

import os
from pathlib import Path

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.link.signing import KEY_BYTES


def read_key(path: Path) -> bytes:
    """Read a signing key: 32 bytes, or 64 hexadecimal digits and perhaps a line's end.

    Raises BadInput for a file that is not there, is no key, or that others than its owner may read or write.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode & 0o777
            content = file.read(4 * KEY_BYTES)
    except OSError as error:
        raise BadInput("key_file", f"cannot read {str(path)!r}: {error.strerror}") from error
    if mode & 0o077:
        raise BadInput("key_file", f"{str(path)!r} is open to others (mode {mode:04o}): chmod 600 it")
    if len(content) == KEY_BYTES:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise BadInput("key_file", f"{str(path)!r} is no key: neither {KEY_BYTES} bytes nor {2 * KEY_BYTES} hex digits")
    return key


class TimestampFile:
    """The newest signing timestamp, so that a ground station that starts again is not taken for a replay of itself."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> int:
        """Return what was saved last; 0 before the first time. Raises Unavailable for a file that is none of ours."""
        try:
            return int(self._path.read_text(encoding="ascii"))
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            raise Unavailable(f"signing timestamps: cannot read {str(self._path)!r}: {error}") from error

    def save(self, timestamp: int) -> None:
        """Replace what was saved. Raises OSError."""
        fresh = self._path.with_name(self._path.name + ".new")
        fresh.write_text(f"{timestamp}\n", encoding="ascii")
        fresh.replace(self._path)
