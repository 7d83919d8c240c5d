"""The simulated vehicle's files over MAVLink FTP."""

import struct

import pytest

from hsop_gcs.link.messages import FileTransferProtocol
from hsop_gcs.simulator.files import Opcode, Refusal
from tests.simulator.station import px4

LIST, OPEN, READ = Opcode.LIST_DIRECTORY, Opcode.OPEN_FILE_RO, Opcode.READ_FILE


def ask(
    opcode: int, data: bytes = b"", *, session: int = 0, offset: int = 0, size: int | None = None
) -> tuple[bool, bytes]:
    """Send one request; return whether it was acknowledged, and with what."""
    header = struct.pack("<HBBBBBxI", 65535, session, opcode, len(data) if size is None else size, 0, 0, offset)
    payload = tuple((header + data).ljust(251, b"\0"))
    heard = px4().send(FileTransferProtocol(target_system=1, target_component=1, payload=payload))
    (answer,) = (each for each in heard if isinstance(each, FileTransferProtocol))
    assert (answer.target_system, answer.target_component) == (255, 190)
    sequence, _, verdict, found, asked, _, _ = struct.unpack_from("<HBBBBBxI", bytes(answer.payload))
    assert (sequence, asked) == (0, opcode), "the next sequence number, and the opcode that was asked for"
    return verdict == Opcode.ACK, bytes(answer.payload)[12 : 12 + found]


def test_a_file_is_listed_opened_and_read_piece_by_piece_to_its_end() -> None:
    good, entry = ask(LIST, b"/\0")
    name, size = entry.rstrip(b"\0").removeprefix(b"F").split(b"\t")
    assert (good, name) == (True, b"parameters.txt")
    assert ask(LIST, b"/\0", offset=1) == (False, bytes([Refusal.END_OF_FILE]))
    assert ask(OPEN, b"/" + name) == (True, int(size).to_bytes(4, "little"))
    content, piece = b"", b"more"
    while piece:
        good, piece = ask(READ, size=50, offset=len(content))
        content += piece if good else b""
        piece = piece if good else b""
    assert len(content) == int(size)
    assert b"MIS_TAKEOFF_ALT 2.5\n" in content
    assert ask(Opcode.TERMINATE_SESSION) == (True, b"")


@pytest.mark.parametrize(
    ("opcode", "data", "session", "refusal"),
    [
        (LIST, b"/etc", 0, Refusal.NOT_FOUND),
        (OPEN, b"none.txt", 0, Refusal.NOT_FOUND),
        (OPEN, b"\xff\xfe", 0, Refusal.NOT_FOUND),
        (READ, b"", 7, Refusal.INVALID_SESSION),
        (7, b"", 0, Refusal.UNKNOWN_COMMAND),
        (200, b"", 255, Refusal.UNKNOWN_COMMAND),
    ],
)
def test_what_cannot_be_had_is_refused_with_its_reason(
    opcode: int, data: bytes, session: int, refusal: Refusal
) -> None:
    assert ask(opcode, data, session=session) == (False, bytes([refusal]))
