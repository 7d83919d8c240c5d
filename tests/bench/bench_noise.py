"""A million random, truncated and mutated frames with good ones in between: datagrams, a byte stream, a signed link.

python -m tests.bench.bench_noise [FRAMES] [SEED]

Every second frame was signed before it was spoiled, or left good. Three routers hear all of them: as datagrams, as a
stream cut anywhere, and as datagrams of a signed link, where good frames without a signature are no good either.

Exit code 1 if a good frame was not understood, the signed link believed anything else, or memory grew by more than a
megabyte after the first fifth. In a stream, a piece of a frame and the beginning of the good one behind it may together
be a frame with a good checksum, by chance. What was swallowed in that way is counted by itself; no receiver could tell.
"""

import gc
import os
import sys
import time
from collections import deque
from pathlib import Path
from random import Random

from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.router import Router
from hsop_gcs.link.signing import Signing, SigningClock
from tests.link.noise import noise, pieces

FRAME_PERIOD_S = 0.002
DATAGRAMS, STREAM, SIGNED = Peer(0, "127.0.0.1", 14541), Peer(1, "/dev/ttyUSB0", 57600), Peer(2, "127.0.0.1", 14542)
STREAM_CHUNK_BYTES = 20_000
MEGABYTE = 1e6
_HEADER_BYTES = 8


class Ear:
    """A router that hears one peer, and what of the good frames it has not understood yet."""

    def __init__(self, peer: Peer) -> None:
        self.router = Router([1], streams={STREAM.transport}, signing={SIGNED.transport: signing()})
        self.peer = peer
        self.expected: deque[bytes] = deque()
        self.missed = self.swallowed = self.unexpected = 0
        self._chance: deque[bytes] = deque(maxlen=200)
        """The frames since the last good one that have a good checksum, or an unknown one, and that nobody sent."""
        self.busy_s = 0.0

    def hear(self, data: bytes, now: float) -> None:
        started_s = time.perf_counter()
        frames = self.router.receive(data, self.peer, now)
        self.router.advance(now)
        self.router.take_outgoing()
        self.router.take_events()
        self.busy_s += time.perf_counter() - started_s
        for frame in frames:
            if frame.raw not in self.expected:
                self._chance.append(frame.raw)
                self.unexpected += 1
                continue
            while (good := self.expected.popleft()) != frame.raw:
                self.miss(good)
            self._chance.clear()

    def miss(self, good: bytes) -> None:
        """Count a good frame that was not understood."""
        if any(good[:_HEADER_BYTES] in chance or chance.endswith(_starts(good)) for chance in self._chance):
            self.swallowed += 1
        else:
            self.missed += 1


def signing() -> Signing:
    """One end of a signed link; its clock stands still, so that only counting moves its timestamps on."""
    return Signing(bytes(32), clock=SigningClock(lambda: 1.8e9))


def _starts(frame: bytes) -> tuple[bytes, ...]:
    return tuple(frame[:length] for length in range(1, _HEADER_BYTES))


def resident_bytes() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(frames: int = 1_000_000, seed: int = 0) -> int:
    rng = Random(seed)
    datagrams, stream, signed = Ear(DATAGRAMS), Ear(STREAM), Ear(SIGNED)
    plain, marked = noise(rng, frames), noise(rng, frames, sign=signing().sign)
    uncut, good, before = bytearray(), 0, 0
    for number in range(frames):
        now = number * FRAME_PERIOD_S
        raw, is_good = next(marked if number % 2 else plain)
        good += is_good
        for ear in (datagrams, stream, signed):
            if is_good and (ear is not signed or number % 2):
                ear.expected.append(raw)
        for ear in (datagrams, signed):
            ear.hear(raw, now)
            while ear.expected:
                ear.miss(ear.expected.popleft())
        uncut += raw
        if len(uncut) > STREAM_CHUNK_BYTES:
            for piece in pieces(rng, bytes(uncut)):
                stream.hear(piece, now)
            uncut.clear()
        if number == frames // 5:
            before = resident_bytes()
    for piece in pieces(rng, bytes(uncut) + bytes(600)):
        stream.hear(piece, frames * FRAME_PERIOD_S)
    grown = resident_bytes() - before
    missed = datagrams.missed + stream.missed + len(stream.expected) + signed.missed + signed.swallowed
    say(f"{frames} frames, {good} of them good, seed {seed}")
    for name, ear in (("datagrams", datagrams), ("stream", stream), ("signed", signed)):
        counters = ear.router.counters
        say(
            f"{name}: {ear.missed + len(ear.expected)} good frames missed, {ear.swallowed} swallowed,"
            f" {ear.unexpected} others believed, {counters.bad_frames} bad beginnings,"
            f" {counters.unknown_messages} unknown ids, {sum(counters.signature_refused.values())} signatures refused,"
            f" {ear.busy_s / frames * 1e6:.0f} us a frame"
        )
    say(f"memory grew by {grown / MEGABYTE:.2f} MB after the first fifth")
    return int(missed > 0 or signed.unexpected > 0 or grown > MEGABYTE)


if __name__ == "__main__":
    sys.exit(main(*(int(argument) for argument in sys.argv[1:])))
