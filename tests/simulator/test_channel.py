import math

import numpy as np
import pytest

from hsop_gcs.simulator.channel import Channel, Impairment

SENT = 4000


def transmit(impairment: Impairment, seed: int = 3) -> list[tuple[float, int]]:
    """Send numbers at 1 kHz; return (arrival, number)."""
    channel: Channel[int] = Channel(impairment, np.random.default_rng(seed))
    arrived = []
    for number in range(SENT + 2000):
        now = number * 1e-3
        if number < SENT:
            channel.put(number, now)
        arrived += [(now, item) for item in channel.take_due(now)]
    assert channel.next_due == math.inf
    return arrived


def test_a_perfect_channel_delivers_everything_at_once_and_in_order() -> None:
    assert transmit(Impairment()) == [(number * 1e-3, number) for number in range(SENT)]


def test_losses_and_doubles_come_as_often_as_stated() -> None:
    lost = SENT - len(transmit(Impairment(loss=0.2)))
    doubled = len(transmit(Impairment(duplication=0.1))) - SENT
    # Four standard deviations of a binomial count.
    assert lost == pytest.approx(0.2 * SENT, abs=4 * math.sqrt(SENT * 0.2 * 0.8))
    assert doubled == pytest.approx(0.1 * SENT, abs=4 * math.sqrt(SENT * 0.1 * 0.9))


def test_delay_and_jitter_bound_the_time_under_way_and_reorder() -> None:
    arrived = transmit(Impairment(delay_s=0.1, jitter_s=0.05))
    under_way_s = [now - number * 1e-3 for now, number in arrived]
    assert min(under_way_s) >= 0.05 - 1e-9
    assert max(under_way_s) <= 0.15 + 1e-3
    assert sum(under_way_s) / len(under_way_s) == pytest.approx(0.1, abs=0.002)
    assert [number for _, number in arrived] != sorted(number for _, number in arrived)


def test_so_many_are_held_back_behind_those_sent_after_them() -> None:
    arrived = transmit(Impairment(reordering=0.2))
    late = [number for now, number in arrived if now - number * 1e-3 > 0.05]
    assert len(late) == pytest.approx(0.2 * SENT, abs=4 * math.sqrt(SENT * 0.2 * 0.8))
    assert sorted(number for _, number in arrived) == list(range(SENT))
    order = [number for _, number in arrived]
    assert all(order.index(number + 1) < order.index(number) for number in late[:20] if number + 1 not in late)


def test_the_same_seed_gives_the_same_losses() -> None:
    impairment = Impairment(loss=0.3, duplication=0.1, reordering=0.1, jitter_s=0.02)
    assert transmit(impairment, seed=5) == transmit(impairment, seed=5)
    assert transmit(impairment, seed=5) != transmit(impairment, seed=6)
