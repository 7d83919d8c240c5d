"""What becomes of closed segments: compressed, and once all of them take too much room, without their raw entries.

What operators wished, what was planned, flown and told by hosts is never deleted here. The work is done in a thread of
its own, after each new segment; the newest closed one is left as it is: a start after a loss of power may need it.
"""

import gzip
import logging
import re
import shutil
import threading
from pathlib import Path

from hsop_gcs.journal.segments import Segment, segments

KEEP_BYTES = 10_000_000_000
"""What closed segments may take, compressed, before the oldest lose their raw entries."""
_LEVEL = 6
_CHUNK_BYTES = 1 << 18
_KIND = re.compile(rb'"kind":"(\w+)"')
_KIND_WITHIN = 120
"""In so many first bytes of a line its kind is told."""

log = logging.getLogger(__name__)


class Retention:
    """Looks after the closed segments of one journal. raw: the kinds of entries that old ones do without."""

    def __init__(self, path: Path, *, raw: frozenset[str], keep_bytes: int = KEEP_BYTES) -> None:
        self._path = path
        self._raw = {kind.encode() for kind in raw}
        self._keep_bytes = keep_bytes
        self._stopped = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to work, if it is not being done; does not wait."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._run, name="journal retention", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Leave what is not done to the next time; waits a moment for what is being done."""
        self._stopped = True
        if self._thread is not None:
            self._thread.join(2.0)

    def _run(self) -> None:
        try:
            self.tidy()
        except Exception:  # nothing depends on it: it is tried again with the next segment
            log.exception("journal %s: old segments could not be compressed", self._path)

    def tidy(self) -> None:
        """Compress closed segments and thin out the oldest. Raises OSError."""
        closed = [each for each in segments(self._path) if each.number is not None]
        for segment in closed[:-1]:
            if segment.path.suffix != ".gz" and not self._stopped:
                _replace(segment.path, _compressed(segment.path))
        closed = [each for each in segments(self._path) if each.number is not None]
        sizes = {each.path: each.path.stat().st_size for each in closed}
        for segment in closed[:-1]:
            if self._stopped or sum(sizes.values()) <= self._keep_bytes:
                return
            if not segment.kept:
                kept = self._kept(segment)
                _replace(segment.path, kept)
                sizes[segment.path] = kept.stat().st_size

    def _kept(self, segment: Segment) -> Path:
        """Write a segment without its raw entries; return its path."""
        path = segment.path.with_name(segment.path.name.removesuffix(".gz") + ".kept.gz")
        part = path.with_name(path.name + ".part")
        try:
            with segment.open() as source, gzip.open(part, "wb", _LEVEL) as target:
                for line in source:
                    kind = _KIND.search(line[:_KIND_WITHIN])
                    if kind is None or kind[1] not in self._raw:
                        target.write(line)
            part.rename(path)
        finally:
            part.unlink(missing_ok=True)
        return path


def _compressed(path: Path) -> Path:
    """Write a file compressed; return its path."""
    packed = path.with_name(path.name + ".gz")
    part = packed.with_name(packed.name + ".part")
    try:
        with path.open("rb") as source, gzip.open(part, "wb", _LEVEL) as target:
            shutil.copyfileobj(source, target, _CHUNK_BYTES)
        part.rename(packed)
    finally:
        part.unlink(missing_ok=True)
    return packed


def _replace(path: Path, by: Path) -> None:
    """Remove a file whose contents have another name now."""
    if by.stat().st_size > 0:
        path.unlink()
