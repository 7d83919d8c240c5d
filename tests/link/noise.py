"""Frames as a bad radio and an ill-meaning neighbour send them: random, truncated and mutated, good ones in between."""

from collections.abc import Callable, Iterator
from random import Random

from hsop_gcs.link.codec import Encoder
from hsop_gcs.link.enums import MavAutopilot, MavCmd, MavType
from hsop_gcs.link.messages import Attitude, CommandAck, GlobalPositionInt, Heartbeat, Message, StatusText, Timesync

GOOD_EVERY = 10


def noise(rng: Random, frames: int, *, sign: Callable[[bytes], bytes] | None = None) -> Iterator[tuple[bytes, bool]]:
    """Yield frames, or what is left of them, and whether each is good: every tenth is, on average.

    Changes of a frame that undo each other leave a good one.
    """
    good, bad = Encoder(system=1, component=1, sign=sign), Encoder(system=1, component=1, sign=sign)
    for number in range(frames):
        if rng.randrange(GOOD_EVERY) == 0:
            yield good.encode(_message(rng, number)), True
        else:
            raw = bad.encode(_message(rng, number))
            spoiled = _spoiled(rng, raw)
            yield spoiled, spoiled == raw


def pieces(rng: Random, stream: bytes) -> Iterator[bytes]:
    """Cut a stream as a line delivers it."""
    at = 0
    while at < len(stream):
        size = rng.randrange(1, 400)
        yield stream[at : at + size]
        at += size


def _message(rng: Random, number: int) -> Message:
    """Any of the messages that make a vehicle's machines work; ``number`` makes it unlike the others."""
    return rng.choice(
        [
            Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4, custom_mode=number),
            Attitude(time_boot_ms=number, yaw=rng.uniform(-3.0, 3.0), roll=rng.uniform(-3.0, 3.0)),
            GlobalPositionInt(time_boot_ms=number, lat=rng.randrange(9 * 10**8), lon=number, alt=number),
            StatusText(severity=6, text=f"{number} {rng.random()}", id=number % 65536),
            CommandAck(command=MavCmd.DO_REPOSITION, result=rng.randrange(8), result_param2=number),
            Timesync(tc1=number, ts1=rng.randrange(2**60)),
        ]
    )


def _spoiled(rng: Random, raw: bytes) -> bytes:
    """Random bytes, a piece of a frame, or a frame with some bytes changed."""
    kind = rng.randrange(4)
    if kind == 0:
        return rng.randbytes(rng.randrange(1, 280))
    if kind == 1:
        return raw[: rng.randrange(1, len(raw))]
    if kind == 2:
        return b"\xfd" + rng.randbytes(rng.randrange(1, 60))
    changed = bytearray(raw)
    for _ in range(rng.randrange(1, 4)):
        changed[rng.randrange(len(changed))] ^= rng.randrange(1, 256)
    return bytes(changed)
