"""Two aircraft under one id are told from one that restarts, leaps, or whose frames come late or twice."""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import AutopilotRestarted, Event, OrderFailed, TwoAircraftHeard
from hsop_gcs.link.messages import Attitude, GlobalPositionInt, Heartbeat, Message
from hsop_gcs.link.protocol.one_aircraft import OneAircraft
from tests.link.two_ends import TwoEnds

METRE_E7 = 90.0
"""1e-7 degrees of latitude to a metre, as near as it matters here."""
BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)

Arrival = tuple[float, Message, int]
"""When it arrived, what, and the frame's sequence number."""


@dataclass(frozen=True)
class Flight:
    """What one aircraft sends in ``for_s`` seconds from ``from_s`` on: positions and attitudes at 10 Hz, heartbeats."""

    booted_s: float = -100.0
    north_m: float = 0.0
    speed_mps: float = 0.0
    from_s: float = 0.0
    for_s: float = 12.0
    first_sequence: int = 0
    clock: bool = True
    type: int = MavType.QUADROTOR

    def frames(self) -> Iterator[Arrival]:
        sequence = itertools.count(self.first_sequence)
        for tenth in range(int(self.for_s * 10)):
            now = self.from_s + tenth / 10
            boot_ms = round((now - self.booted_s) * 1000) if self.clock else 0
            north_m = self.north_m + self.speed_mps * tenth / 10
            position = GlobalPositionInt(
                time_boot_ms=boot_ms,
                lat=470_000_000 + round(north_m * METRE_E7),
                lon=80_000_000,
                alt=500_000,
                vx=round(self.speed_mps * 100),
            )
            yield now, position, next(sequence) % 256
            yield now, Attitude(time_boot_ms=boot_ms), next(sequence) % 256
            if tenth % 10 == 0:
                yield now, replace(BEAT, type=self.type), next(sequence) % 256


def hear(*flights: Iterable[Arrival]) -> tuple[OneAircraft, list[Event], float]:
    watch, events, now = OneAircraft(1), [], 0.0
    for now, message, sequence in sorted(itertools.chain(*flights), key=lambda arrival: arrival[0]):
        watch.receive(message, now, sequence=sequence)
        events += watch.take_events()
    return watch, events, now


def delayed(flight: Flight, delay_s: float, *, share: float = 1.0) -> Iterator[Arrival]:
    """Some of the frames of a flight, late."""
    rng = np.random.default_rng(1)
    return ((now + delay_s, *rest) for now, *rest in flight.frames() if rng.random() < share)  # type: ignore[misc]


ONE = Flight()
TWO = {
    "elsewhere, switched on later": Flight(booted_s=-60.0, north_m=144.0, first_sequence=77),
    "at the same place, switched on later": Flight(booted_s=-60.0, first_sequence=77),
    "switched on together, two metres beside it": Flight(north_m=2.0, first_sequence=77),
    "switched on 3 s later, two metres beside it": Flight(booted_s=-97.0, north_m=2.0, first_sequence=77),
    "switched on 3 s later, at the same place": Flight(booted_s=-97.0, first_sequence=77),
    "without a clock, elsewhere": Flight(clock=False, north_m=144.0),
    "without a clock, a hexarotor at the same place": Flight(clock=False, type=MavType.HEXAROTOR),
}


@pytest.mark.parametrize("other", TWO.values(), ids=TWO)
def test_two_aircraft_are_told(other: Flight) -> None:
    watch, events, now = hear(ONE.frames(), other.frames())
    assert watch.problem(now) is not None
    assert [type(event) for event in events if isinstance(event, TwoAircraftHeard)] == [TwoAircraftHeard]
    assert watch.problem(now + 11.0) is None, "of one that went away nothing remains"


def test_three_aircraft_are_told_whatever_their_order() -> None:
    others = [Flight(booted_s=-60.0 + 20 * n, north_m=100.0 * n) for n in range(1, 3)]
    watch, _, now = hear(ONE.frames(), *(other.frames() for other in others))
    assert watch.problem(now) is not None


def test_it_is_told_how_far_apart_they_are() -> None:
    _, events, _ = hear(ONE.frames(), Flight(booted_s=-99.5, north_m=144.0).frames())
    (told,) = events
    assert isinstance(told, TwoAircraftHeard)
    assert told.problem == "two aircraft speak under its system id: they are 144 m apart"


ALONE = {
    "at rest": [ONE.frames()],
    "at 25 m/s": [Flight(speed_mps=25.0).frames()],
    "its frames all come twice, 0.4 s later": [ONE.frames(), delayed(ONE, 0.4)],
    "over a second way that is 3 s slower and loses half": [ONE.frames(), delayed(ONE, 3.0, share=0.5)],
    "over two ways that share its frames": [delayed(ONE, 0.0, share=0.5), delayed(ONE, 2.0)],
    "its second channel numbers its own": [ONE.frames(), delayed(replace(ONE, first_sequence=100), 0.3)],
    "its position leaps once and stays": [
        replace(ONE, for_s=6.0).frames(),
        Flight(from_s=6.0, for_s=6.0, north_m=300.0).frames(),
    ],
    "its position is wrong for a moment": [
        replace(ONE, for_s=6.0).frames(),
        Flight(from_s=6.0, for_s=0.3, north_m=300.0).frames(),
        Flight(from_s=6.3, for_s=6.0).frames(),
    ],
    "its position leaps twice": [
        replace(ONE, for_s=4.0).frames(),
        Flight(from_s=4.0, for_s=4.0, north_m=300.0).frames(),
        Flight(from_s=8.0, for_s=4.0, north_m=-300.0).frames(),
    ],
    "all waits for 7 s and comes at once": [
        replace(ONE, for_s=5.0).frames(),
        ((12.0 + now * 1e-6, message, number) for now, message, number in Flight(from_s=5.0, for_s=7.0).frames()),
        Flight(from_s=12.1, for_s=5.0).frames(),
    ],
}


@pytest.mark.parametrize("flights", ALONE.values(), ids=ALONE)
def test_one_aircraft_is_one(flights: list[Iterator[Arrival]]) -> None:
    assert hear(*flights)[1] == []


@pytest.mark.parametrize("silent_s", [0.2, 1.5, 30.0])
def test_a_restart_is_told_once_and_is_no_second_aircraft(silent_s: float) -> None:
    back_s = 6.0 + silent_s
    _, events, _ = hear(
        replace(ONE, for_s=6.0).frames(), Flight(booted_s=back_s - 1.0, from_s=back_s, first_sequence=9).frames()
    )
    assert events == [AutopilotRestarted(system=1)]


class Twin(TwoEnds):
    """Two ends, and a second vehicle of the same id behind the same address, far away."""

    def __init__(self) -> None:
        super().__init__("px4")
        self.there = False

    def hear(self, message: Message, component: int) -> None:
        super().hear(message, component)
        if self.there and isinstance(message, GlobalPositionInt):
            moved = replace(message, time_boot_ms=message.time_boot_ms + 60_000, lat=message.lat + 12_000)
            super().hear(moved, component)


def test_a_vehicle_that_is_two_gives_its_order_up_takes_none_and_can_be_flown_when_the_other_is_gone() -> None:
    ends = Twin()
    ends.ready()
    ends.order(east_m=200.0)
    ends.run(3.0)
    ends.there = True
    ends.until(lambda: ends.saw(OrderFailed), within_s=3.0)
    (failed,) = ends.of(OrderFailed)
    assert isinstance(failed, OrderFailed)
    assert failed.reason.startswith("two aircraft speak under its system id")
    assert ends.vehicle.why_not_ready(ends.now) == failed.reason
    ends.there = False
    ends.until(lambda: ends.vehicle.why_not_ready(ends.now) is None, within_s=12.0)
