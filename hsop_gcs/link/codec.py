"""Bytes to messages and back: the only module that knows pymavlink.

One ``Encoder`` per sending identity, one ``Decoder`` per peer. A frame that does not decode is counted, never raised:
what arrives from a radio is not a programming error.

The dialect is ardupilotmega, which holds common as well and speaks to PX4 alike (CRC_EXTRA is equal
for all shared ids).
"""

import struct
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, fields
from functools import partial
from itertools import accumulate
from operator import itemgetter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link import messages
from hsop_gcs.link.messages import Message, Unknown

STX_V1, STX_V2 = 0xFE, 0xFD
_SIGNED = 0x01
SIGNATURE_BYTES = 13
_KNOWN_INCOMPAT_FLAGS = _SIGNED

_CLASSES: dict[int, type[Message]] = {
    cls.ID: cls
    for cls in vars(messages).values()
    if isinstance(cls, type) and issubclass(cls, Message) and hasattr(cls, "ID")
}


@dataclass(frozen=True, slots=True)
class _Form:
    """How one of our messages lies in a payload.

    pymavlink's own decoder builds a message object of some thirty attributes for each frame, at twice the time.
    """

    cls: type[Message]
    layout: struct.Struct
    names: tuple[str, ...]
    """Of the fields, in the order of the wire."""
    gather: tuple[Any, ...] | None
    """What makes each field of the numbers on the wire; None if every field is one number."""

    def read(self, payload: bytes) -> Message:
        missing = self.layout.size - len(payload)
        values = self.layout.unpack_from(payload + bytes(missing) if missing > 0 else payload)
        if self.gather is not None:
            values = tuple(each(values) for each in self.gather)
        return self.cls(**dict(zip(self.names, values, strict=True)))


def _form(cls: type[Message]) -> _Form:
    wire = dialect.mavlink_map[cls.ID]
    texts = {field.name for field in fields(cls) if field.type is str}
    spans = zip(accumulate(wire.lengths, initial=0), wire.lengths, strict=False)
    gather = [
        partial(_text_at, start) if name in texts else itemgetter(slice(start, start + count) if is_array else start)
        for name, (start, count), is_array in zip(wire.ordered_fieldnames, spans, wire.array_lengths, strict=True)
    ]
    plain = not any(wire.array_lengths)
    return _Form(cls, wire.unpacker, tuple(wire.ordered_fieldnames), None if plain else tuple(gather))


def _text_at(index: int, values: tuple[Any, ...]) -> str:
    text: bytes = values[index]
    return text.split(b"\0", 1)[0].decode(errors="replace")


_FORMS = {number: _form(cls) for number, cls in _CLASSES.items() if number >= 0}
_CRC_EXTRA = {number: bytes([wire.crc_extra]) for number, wire in dialect.mavlink_map.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One message with the identity of its sender."""

    message: Message
    system: int
    component: int
    sequence: int
    raw: bytes
    verified: bool = True
    """False for an id outside the dialect, whose checksum cannot be checked."""


class Encoder:
    """Turns messages into MAVLink 2 frames of one sender and counts their sequence numbers."""

    def __init__(self, *, system: int, component: int, sign: Callable[[bytes], bytes] | None = None) -> None:
        """sign: given a whole frame whose header says that it is signed, returns it with its signature."""
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._sign = sign

    def encode(self, message: Message) -> bytes:
        """Return the frame. Raises ValueError naming the message if a field does not fit its wire type."""
        wire = dialect.mavlink_map[message.ID]
        values = [_to_wire(getattr(message, name)) for name in wire.fieldnames]
        sizes = dict(zip(wire.ordered_fieldnames, wire.array_lengths, strict=True))
        for name, value in zip(wire.fieldnames, values, strict=True):
            size = sizes[name]
            fits = len(value) <= size if isinstance(value, bytes) else not isinstance(value, list) or len(value) == size
            if not fits:
                raise ValueError(f"{message.NAME}.{name} has room for {size}: {message}")
        try:
            frame: bytes = wire(*values).pack(self._mav)
        except (TypeError, ValueError, OverflowError, dialect.struct.error) as error:
            raise ValueError(f"{message.NAME} cannot be encoded: {error}: {message}") from error
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame if self._sign is None else self._sign(marked_signed(frame))


@dataclass(slots=True, kw_only=True)
class DecoderCounters:
    """What went through one decoder, and what of it was no good."""

    frames: int = 0
    unknown: int = 0
    """Well-formed frames whose message id is not one of ours."""
    bad_frames: int = 0
    """Frames with a wrong checksum, a wrong length or flags nobody may ignore."""
    skipped_bytes: int = 0
    """Of no frame: another protocol, another baud rate, or frames that were cut."""


class Decoder:
    """Finds frames in what one peer sent. Holds no more than one partial frame."""

    def __init__(self) -> None:
        self._rest = b""
        self._told = 0
        """How many bytes of the rest belong to a frame that was given out, and may begin another one all the same."""
        self.counters = DecoderCounters()

    def feed_datagram(self, datagram: bytes) -> list[Frame]:
        """Decode one datagram; a frame never continues in the next one."""
        return self._scan(datagram, more_may_come=False)[0]

    def feed_stream(self, data: bytes) -> list[Frame]:
        """Decode a piece of a byte stream (TCP, serial); the incomplete end is kept for the next call."""
        frames, self._rest, self._told = self._scan(self._rest + data, more_may_come=True, told=self._told)
        return frames

    def forget_partial(self) -> None:
        """Give up the frame a stream has begun: the connection ended."""
        self.counters.skipped_bytes += self.pending_bytes
        self._rest, self._told = b"", 0

    @property
    def pending_bytes(self) -> int:
        """How much of an incomplete frame a stream has left behind; less than one longest frame."""
        return max(0, len(self._rest) - self._told)

    def _scan(self, data: bytes, *, more_may_come: bool, told: int = 0) -> tuple[list[Frame], bytes, int]:
        """Decode what is whole; ``data[:told]`` was given out before and counts no more.

        Returns the frames, the rest of the data, and how much of that has been given out.
        """
        frames: list[Frame] = []
        at = 0
        while at < len(data):
            if data[at] not in (STX_V1, STX_V2):
                self.counters.skipped_bytes += at >= told
                at += 1
                continue
            length = frame_length(data, at)
            complete = length is not None and at + length <= len(data)
            if not complete and more_may_come and (at >= told or self._is_to_come(data, at)):
                return frames, data[at:], max(0, told - at)
            frame = self._decode(data[at : at + length]) if complete and length is not None else None
            if frame is not None and at < told and not frame.verified:
                frame = None
            end = at + len(frame.raw) if frame is not None else at
            if frame is not None:
                begins = self._next_begins(data, end - _unsure_bytes(frame), end, more_may_come=more_may_come)
                if begins is not None and begins.complete:
                    frame = None
                elif begins is not None:
                    told, end = max(told, end), begins.at
            if frame is None:
                # Perhaps no frame began here at all: what follows is looked at byte by byte.
                self.counters.bad_frames += at >= told
                self.counters.skipped_bytes += at >= told
                at += 1
                continue
            self.counters.frames += 1
            self.counters.unknown += isinstance(frame.message, Unknown)
            frames.append(frame)
            at = end
        return frames, b"", 0

    def _decode(self, raw: bytes) -> Frame | None:
        version_2 = raw[0] == STX_V2
        if version_2 and raw[2] & ~_KNOWN_INCOMPAT_FLAGS:
            return None
        start = 10 if version_2 else 6
        end = start + raw[1]
        number = message_id(raw)
        crc_extra = _CRC_EXTRA.get(number)
        verified = crc_extra is not None
        if crc_extra is not None and dialect.x25crc(raw[1:end] + crc_extra).crc != raw[end] | raw[end + 1] << 8:
            return None
        form = _FORMS.get(number)
        message = Unknown(message_id=number) if form is None else form.read(raw[start:end])
        system, component, sequence = (raw[5], raw[6], raw[4]) if version_2 else (raw[3], raw[4], raw[2])
        return Frame(message=message, system=system, component=component, sequence=sequence, raw=raw, verified=verified)

    def _is_to_come(self, data: bytes, at: int) -> bool:
        """Whether what begins in a signature may be a frame: one that is whole behind it is likelier to be one."""
        return _may_be_ours(data[at:]) and self._next_begins(data, at + 1, len(data), more_may_come=False) is None

    def _next_begins(self, data: bytes, start: int, stop: int, *, more_may_come: bool) -> "_Beginning | None":
        """Return where in ``data[start:stop]`` a good frame begins, or one that may be good once the rest has come.

        An id outside the dialect has a checksum nobody can verify; a chance STX in front of such an id must not
        swallow the real frames behind it, nor must a frame that was cut in its signature or before its last byte.
        """
        for at in range(start, stop):
            if data[at] in (STX_V1, STX_V2):
                length = frame_length(data, at)
                complete = length is not None and at + length <= len(data)
                if complete and length is not None:
                    frame = self._decode(data[at : at + length])
                    if frame is not None and frame.verified:
                        return _Beginning(at, complete=True)
                elif more_may_come and _may_be_ours(data[at:]):
                    return _Beginning(at, complete=False)
        return None


@dataclass(frozen=True, slots=True)
class _Beginning:
    at: int
    complete: bool = field(kw_only=True)


def _may_be_ours(begun: bytes) -> bool:
    """Whether the beginning of a frame, as far as it has come, is one of a frame that can be verified."""
    version_2 = begun[0] == STX_V2
    if version_2 and len(begun) > 2 and begun[2] & ~_KNOWN_INCOMPAT_FLAGS:
        return False
    return len(begun) < (10 if version_2 else 6) or message_id(begun) in _CRC_EXTRA


def frame_length(data: bytes, at: int) -> int | None:
    """Whole length of the frame that starts at ``at``, bytes; None while its header is incomplete."""
    if data[at] == STX_V1:
        return data[at + 1] + 8 if at + 1 < len(data) else None
    if at + 2 >= len(data):
        return None
    return data[at + 1] + 12 + (SIGNATURE_BYTES if data[at + 2] & _SIGNED else 0)


def message_id(frame: bytes) -> int:
    """Return the id of a frame's message."""
    return int.from_bytes(frame[7:10], "little") if frame[0] == STX_V2 else frame[5]


def message_ids(names: Collection[str]) -> frozenset[int]:
    """Return the ids of messages by their MAVLink names. Raises ValueError naming one that is none."""
    ids = {cls.msgname: number for number, cls in dialect.mavlink_map.items()}
    for name in names:
        if name not in ids:
            raise ValueError(f"{name!r} is no MAVLink message")
    return frozenset(ids[name] for name in names)


def is_signed(frame: bytes) -> bool:
    """Whether a frame says that a signature is behind it."""
    return frame[0] == STX_V2 and bool(frame[2] & _SIGNED)


def marked_signed(frame: bytes) -> bytes:
    """Return an unsigned frame with the header of a signed one, and the checksum that goes with it.

    Its message must be one of the dialect's: without knowing it, no checksum can be made.
    """
    body = bytes([frame[1], frame[2] | _SIGNED]) + frame[3:-2]
    checksum: int = dialect.x25crc(body + _CRC_EXTRA[message_id(frame)]).crc
    return frame[:1] + body + checksum.to_bytes(2, "little")


def _unsure_bytes(frame: Frame) -> int:
    """How many bytes at the end of a frame may belong to another one that cut it off.

    All behind the STX if there is no checksum to go by, the signature, which no checksum covers, or else the last byte:
    that of a checksum is an STX by chance.
    """
    if not frame.verified:
        return len(frame.raw) - 1
    return SIGNATURE_BYTES if is_signed(frame.raw) else 1


def _to_wire(value: object) -> object:
    if isinstance(value, str):
        return value.encode()
    return list(value) if isinstance(value, tuple) else value
