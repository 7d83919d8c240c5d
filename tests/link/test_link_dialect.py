"""Every message of the dialect, with values nobody should send, against a host in flight: nothing raises, orders go on
or are given up with a reason, and a hold is obeyed."""

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link.codec import Decoder, Frame
from hsop_gcs.link.events import Arrived, CommandFinished, OrderFailed
from tests.link.two_ends import BOTH, Stack, TwoEnds

COMPONENTS = (1, 0, 2, 25, 100, 154, 158, 171, 190, 191, 255)
"""The autopilot's own, and those of cameras, gimbals, companions and stations."""
EXTREME_FLOATS = (0.0, -0.0, 1e-45, -1e38, 3.4e38, math.inf, -math.inf, math.nan, 180.0, -7.0)
RANGES = {
    "int8_t": (-(2**7), 2**7 - 1),
    "uint8_t": (0, 2**8 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "uint64_t": (0, 2**64 - 1),
}


def frames(rng: random.Random, *, often: int) -> Iterator[Frame]:
    """Yield every message of the dialect so many times, in any order, from any component of system 1."""
    numbers = list(dialect.mavlink_map) * often
    rng.shuffle(numbers)
    mav = dialect.MAVLink(None, srcSystem=1)
    for number in numbers:
        kind = dialect.mavlink_map[number]
        mav.srcComponent = COMPONENTS[0] if rng.random() < 0.5 else rng.choice(COMPONENTS)
        mav.seq = rng.randrange(256)
        yield from Decoder().feed_datagram(kind(*_values(rng, kind)).pack(mav))


def _values(rng: random.Random, kind: Any) -> list[Any]:
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return [
        _value(rng, name, field_type, lengths[name])
        for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]


def _value(rng: random.Random, name: str, field_type: str, length: int) -> Any:
    if field_type == "char":
        return rng.randbytes(rng.randrange(length + 1)) if length else rng.randbytes(1)
    if name in ("target_system", "target_component") and rng.random() < 0.5:
        return 0
    if length:
        return [_number(rng, field_type) for _ in range(length)]
    return _number(rng, field_type)


def _number(rng: random.Random, field_type: str) -> float | int:
    if field_type in ("float", "double"):
        return rng.choice(EXTREME_FLOATS) if rng.random() < 0.8 else rng.uniform(-10.0, 10.0)
    least, most = RANGES[field_type]
    return rng.choice((least, most, 0, 1, most - 1, rng.randint(least, most)))


class Flooded(TwoEnds):
    """Two ends, between which somebody puts the messages of the dialect under the vehicle's system id."""

    def __init__(self, stack: Stack, seed: int, *, often: int = 2) -> None:
        super().__init__(stack, seed=seed)
        self._flood = frames(random.Random(seed), often=often)
        self.speaks = False
        self.over = False

    def _step(self) -> None:
        super()._step()
        for _ in range(2 if self.speaks else 0):
            frame = next(self._flood, None)
            if frame is None:
                self.over = True
                return
            self.vehicle.receive(
                frame.message, self.now, component=frame.component, sequence=frame.sequence, raw=frame.raw
            )
            self.events += [(self.now, event) for event in self.vehicle.take_events()]


@BOTH
@pytest.mark.parametrize("seed", range(1))
def test_the_whole_dialect_at_its_worst_raises_nothing_and_orders_end_with_a_reason(stack: Stack, seed: int) -> None:
    ends = Flooded(stack, seed)
    ends.ready()
    given = 0
    ends.speaks = True
    while not ends.over:
        if ends.vehicle.progress is None:
            given += 1
            ends.order(f"o{given}", east_m=40.0 if given % 2 else -40.0)
        ends.run(1.0)
        assert ends.vehicle.faults == 0, ends.vehicle.trace
    reasons = {event.reason for event in ends.of(OrderFailed) if isinstance(event, OrderFailed)}
    assert all(reasons)
    assert given == len(ends.of(OrderFailed)) + (ends.vehicle.progress is not None)
    ends.speaks = False
    ends.run(30.0)
    ends.events.clear()
    ends.until(lambda: ends.vehicle.why_not_ready(ends.now) is None)
    ends.order("last")
    ends.until(lambda: ends.saw(Arrived, "last"))
    ends.vehicle.hold(ends.now)
    ends.until(lambda: ends.saw(CommandFinished))
    assert ends.of(CommandFinished) == [CommandFinished(system=1, command="hold", problem=None)]
    assert ends.vehicle.faults == 0
