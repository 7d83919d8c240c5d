"""Telemetry logs: each record is a big-endian count of microseconds since the Unix epoch and one raw MAVLink frame.

The form that every ground station reads and writes.  Source: MAVLink developer guide, "Telemetry log".
"""

import errno
import itertools
import logging
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, Self

from hsop_gcs.disk import is_passing
from hsop_gcs.errors import HsopError, Unavailable
from hsop_gcs.link.codec import STX_V1, STX_V2, Decoder, Frame, frame_length, message_id

_STAMP_BYTES = 8
_SETUP_SIGNING = 256
_DAY_US = 86_400 * 1_000_000
_MOST_WAITING_BYTES = 8_000_000
"""Minutes of a fleet's frames."""
_BATCH = 4096
_GATHER_S = 0.1
_RETRY_S = 0.5
_CLOSING_S = 2.0

log = logging.getLogger(__name__)


def read_tlog(file: BinaryIO) -> Iterator[tuple[float, Frame]]:
    """Yield (seconds since the Unix epoch, frame) in the order of the file.

    A record that was cut off at the end of the file ends the reading; a record whose frame does not decode is left out;
    bytes that are no record are skipped until a frame follows a stamp less than a day from the one before.
    """
    data = file.read()
    decoder = Decoder()
    at = 0
    last_us: int | None = None
    while at + _STAMP_BYTES + 3 <= len(data):
        start = at + _STAMP_BYTES
        length = frame_length(data, start) if data[start] in (STX_V1, STX_V2) else None
        if length is None:
            at += 1
            continue
        stamp_us = int.from_bytes(data[at:start], "big")
        frames = decoder.feed_datagram(data[start : start + length])
        plausible = last_us is None or abs(stamp_us - last_us) < _DAY_US
        if not plausible or len(frames) != 1 or len(frames[0].raw) != length:
            at += 1
            continue
        yield stamp_us / 1e6, frames[0]
        last_us = stamp_us
        at = start + length


class TlogWriter:
    """Appends frames to a file, in a thread of its own: no disk, full, slow or gone, ever stops the link.

    What the disk does not take waits in memory, within a bound; what has no room there is left out and counted. Frames
    are written within a tenth of a second: so much a kill may lose.
    """

    def __init__(self, file: BinaryIO | None, *, reopen: Callable[[], BinaryIO] | None = None) -> None:
        """file: open and unbuffered. reopen: makes another one if the file is None or was removed underneath.

        With ``reopen`` files are the writer's own, to close as well.
        """
        self._file = file
        self._reopen = reopen
        self._end = 0 if file is None else file.tell()
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._problem: str | None = None
        self.lost = 0
        """Frames that were left out: there was no room for them, neither on the disk nor in memory."""
        self.pausing = False
        """While this is set nothing is recorded: what room there is, is for what matters more."""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="telemetry log", daemon=True)
        self._thread.start()

    @property
    def fault(self) -> str | None:
        """Why frames are not on the disk, for a person; None: they are."""
        lost = f"; {self.lost} frames are left out" if self.lost else ""
        if self._problem is not None:
            return f"cannot be written: {self._problem}{lost}"
        return f"pauses, the disk is almost full{lost}" if self.pausing else None

    def write(self, time_s: float, raw: bytes) -> None:
        """Record one frame. time_s: seconds since the Unix epoch. A frame that hands over a signing key is left out."""
        if message_id(raw) == _SETUP_SIGNING:
            return
        if self.pausing:
            self.lost += 1
            return
        record = round(time_s * 1e6).to_bytes(_STAMP_BYTES, "big") + raw
        with self._lock:
            self._waiting.append(record)
            self._waiting_bytes += len(record)
            while self._waiting_bytes > _MOST_WAITING_BYTES:
                self._waiting_bytes -= len(self._waiting.popleft())
                self.lost += 1

    def close(self) -> None:
        """Write what waits, if the disk takes it, and close the file if it is the writer's own."""
        self._ended.set()
        self._thread.join(_CLOSING_S)
        if self._file is not None and self._reopen is not None and not self._thread.is_alive():
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        while True:
            ended = self._ended.wait(_GATHER_S if self._problem is None else _RETRY_S)
            try:
                self._write()
                self._problem = None
            except (OSError, HsopError) as error:
                self._problem = getattr(error, "strerror", None) or str(error)
            except Exception as error:  # the thread must outlast whatever it meets
                log.exception("the telemetry log cannot be written")
                self._problem = type(error).__name__
            if ended:
                return

    def _write(self) -> None:
        """Write what waits, whole records only. Raises OSError; what was not written waits on."""
        while self._waiting:
            file = self._opened()
            with self._lock:
                batch = list(itertools.islice(self._waiting, _BATCH))
            done = file.write(b"".join(batch)) or 0
            whole = 0
            for record in batch:
                if len(record) > done:
                    break
                done -= len(record)
                whole += 1
                self._end += len(record)
            self._forget(batch[:whole])
            if whole < len(batch):
                # what was begun of a record is cut off: the next one follows a whole one
                file.seek(self._end)
                file.truncate()
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _forget(self, written: Sequence[bytes]) -> None:
        with self._lock:
            for record in written:
                # meanwhile the oldest may have been left out
                if self._waiting and self._waiting[0] is record:
                    self._waiting.popleft()
                    self._waiting_bytes -= len(record)

    def _opened(self) -> BinaryIO:
        file = self._file
        if file is not None and self._reopen is not None and os.fstat(file.fileno()).st_nlink == 0:
            log.warning("the telemetry log was removed; another one is begun")
            file.close()
            file = self._file = None
        if file is None:
            if self._reopen is None:
                raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
            file = self._file = self._reopen()
            self._end = 0
        return file


def open_tlog(folder: Path, clock: Callable[[], float]) -> TlogWriter:
    """Begin a log named after the time of its first frame. clock: UTC, seconds since the Unix epoch.

    Raises Unavailable if that is not possible and will not be; a disk that is full or read-only is tried again.
    """
    try:
        file = create_tlog(folder, clock())
    except Unavailable as error:
        if not isinstance(error.__cause__, OSError) or not is_passing(error.__cause__):
            raise
        file = None
    return TlogWriter(file, reopen=lambda: create_tlog(folder, clock()))


def create_tlog(folder: Path, time_s: float) -> BinaryIO:
    """Create a log named after the time its run began, seconds since the Unix epoch; unbuffered.

    Raises Unavailable if that is not possible.
    """
    path = folder / f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%dT%H-%M-%S.%fZ}.tlog"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return path.open("xb", buffering=0)
    except OSError as error:
        raise Unavailable(f"telemetry log {str(path)!r}: {error.strerror}") from error
