"""The files of a simulated vehicle, over MAVLink FTP: they can be listed and read, and nothing can be written.

Without a state: a session is the number of its file, so that a request sent again is answered as before.

Source: mavlink.io/en/services/ftp.html.
"""

import struct
from collections.abc import Mapping
from enum import IntEnum

from hsop_gcs.link.messages import FileTransferProtocol
from hsop_gcs.simulator.gimbal import Identity

_HEADER = struct.Struct("<HBBBBBxI")
"""Sequence number, session, opcode, size, opcode asked for, burst complete, offset."""
_PAYLOAD_BYTES = 251
_ROOM_BYTES = _PAYLOAD_BYTES - _HEADER.size
_NO_SESSION = 255


class Opcode(IntEnum):
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    ACK = 128
    NAK = 129


class Refusal(IntEnum):
    INVALID_SESSION = 4
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    NOT_FOUND = 10


def answer(request: FileTransferProtocol, files: Mapping[str, bytes], to: Identity) -> FileTransferProtocol:
    """Return the answer to one request. files: what is in the root folder, few enough for one listing, by name."""
    raw = bytes(request.payload)
    sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(raw)
    path = raw[_HEADER.size :][:size].split(b"\0", 1)[0].decode(errors="replace").lstrip("./")
    if opcode == Opcode.OPEN_FILE_RO:
        session = list(files).index(path) if path in files else _NO_SESSION
    match opcode:
        case Opcode.TERMINATE_SESSION | Opcode.RESET_SESSIONS:
            found: bytes | Refusal = b""
        case Opcode.LIST_DIRECTORY if not path:
            entries = [f"F{name}\t{len(content)}\0".encode() for name, content in files.items()]
            found = b"".join(entries[offset:]) or Refusal.END_OF_FILE
        case Opcode.OPEN_FILE_RO if session < len(files):
            found = len(files[path]).to_bytes(4, "little")
        case Opcode.LIST_DIRECTORY | Opcode.OPEN_FILE_RO:
            found = Refusal.NOT_FOUND
        case Opcode.READ_FILE if session < len(files):
            content = list(files.values())[session]
            found = content[offset : offset + min(size, _ROOM_BYTES)] or Refusal.END_OF_FILE
        case Opcode.READ_FILE:
            found = Refusal.INVALID_SESSION
        case _:
            found = Refusal.UNKNOWN_COMMAND
    verdict, data = (Opcode.NAK, bytes([found])) if isinstance(found, Refusal) else (Opcode.ACK, found)
    header = _HEADER.pack((sequence + 1) % 2**16, session, verdict, len(data), opcode, 0, offset)
    payload = (header + data).ljust(_PAYLOAD_BYTES, b"\0")
    return FileTransferProtocol(target_system=to[0], target_component=to[1], payload=tuple(payload))
