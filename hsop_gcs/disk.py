"""The disks that the service writes to: which faults pass, and how much room there is.

Room is looked at in a thread of its own: a disk that does not answer, as over a network, must not stop who asks.
"""

import errno
import shutil
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

PASSING_FAULTS = frozenset(
    {
        errno.ENOSPC,
        errno.EDQUOT,
        errno.EFBIG,
        errno.EROFS,
        errno.EIO,
        errno.ESTALE,
        errno.ENODEV,
        errno.ENXIO,
    }
)
"""What a disk may say and be mended: a service starts and goes on all the same. Else a path is wrong."""
_EVERY_S = 1.0
_SILENT_S = 10.0
"""A disk that has not answered for this long is told."""
_ENOUGH = 1.1
"""Room counts as enough again once there is this much of the reserve: not back and forth with every line."""

Free = Callable[[Path], int]
"""The bytes that may still be written to a folder's file system. Raises OSError."""


def free_bytes(folder: Path) -> int:
    """Return the bytes that may still be written to a folder's file system. Raises OSError."""
    return shutil.disk_usage(folder).free


class DiskWatch:
    """Watches that a reserve is left on the file systems of some folders. Use as a context manager."""

    def __init__(self, folders: Iterable[Path], reserve_bytes: int, *, free: Free = free_bytes) -> None:
        self._folders = tuple(dict.fromkeys(folders))
        self._reserve_bytes = reserve_bytes
        self._free = free
        self._problem: str | None = None
        self._looked_at_s = time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="disk watch", daemon=True)

    @property
    def problem(self) -> str | None:
        """Why the reserve is not there, for a person; None: it is."""
        silent_s = time.monotonic() - self._looked_at_s
        if self._thread.is_alive() and silent_s > _SILENT_S:
            return f"the disk of {self._folders[0]} has not answered for {silent_s:.0f} s"
        return self._problem

    def look(self) -> None:
        """Look now. Waits for the disks."""
        wanted = self._reserve_bytes * (_ENOUGH if self._problem is not None else 1.0)
        problems = [each for folder in self._folders if (each := self._look_at(folder, wanted)) is not None]
        self._problem = "; ".join(problems) or None
        self._looked_at_s = time.monotonic()

    def _look_at(self, folder: Path, wanted: float) -> str | None:
        try:
            free = self._free(folder)
        except OSError as error:
            return f"{folder}: {error.strerror or error}"
        if free >= wanted:
            return None
        return f"{folder}: {free / 1e6:,.0f} MB free, less than the reserve of {self._reserve_bytes / 1e6:,.0f} MB"

    def __enter__(self) -> "DiskWatch":
        self.look()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(_EVERY_S)

    def _run(self) -> None:
        while not self._ended.wait(_EVERY_S):
            self.look()


def is_passing(error: OSError) -> bool:
    """Return whether a fault may be mended while the service runs."""
    return error.errno in PASSING_FAULTS
