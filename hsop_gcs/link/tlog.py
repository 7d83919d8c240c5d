"""Telemetry logs: each record is a big-endian count of microseconds since the Unix epoch and one raw MAVLink frame.

The form that every ground station reads and writes.  Source: MAVLink developer guide, "Telemetry log".
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from hsop_gcs.errors import Unavailable
from hsop_gcs.link.codec import STX_V1, STX_V2, Decoder, Frame, frame_length, message_id

_STAMP_BYTES = 8
_SETUP_SIGNING = 256
_DAY_US = 86_400 * 1_000_000


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
    """Appends frames to an open binary file; the caller opens and closes it.

    A file that cannot be written any more ends the recording, and never the flight.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.fault: str | None = None
        """Why the recording ended; None while it goes on."""

    def write(self, time_s: float, raw: bytes) -> None:
        """Write one frame. time_s: seconds since the Unix epoch. A frame that hands over a signing key is left out."""
        if self.fault is not None or message_id(raw) == _SETUP_SIGNING:
            return
        try:
            self._file.write(round(time_s * 1e6).to_bytes(_STAMP_BYTES, "big") + raw)
        except OSError as error:
            self.fault = f"cannot be written any more: {error.strerror}"


def create_tlog(folder: Path, time_s: float) -> BinaryIO:
    """Create a log named after the time its run began, seconds since the Unix epoch; unbuffered: a kill loses nothing.

    Raises Unavailable if that is not possible.
    """
    path = folder / f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%dT%H-%M-%S.%fZ}.tlog"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return path.open("xb", buffering=0)
    except OSError as error:
        raise Unavailable(f"telemetry log {str(path)!r}: {error.strerror}") from error
