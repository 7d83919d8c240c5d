"""The loop closed, without I/O: coarse reports, hosts on station at 5 Hz, tracks beside the truth.

Targets on station: median error 0.5 m with central pairs, 2.5 m with peripheral views. Consistency is judged on threats
that fly as the tracker assumes: there the squared error in the track's own covariance averages 6.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tests.detections.examples import METRE
from tests.detections.loop import EPOCH_S, PERIOD_S, Flight, Hover, Loop

WARNING_S = 10.0
"""A radar reports each second before the hosts are on station."""
SETTLED_S = 2.0
STATION_S = 8.0

ONE = (
    Hover(host="h1", position_m=(-25.0, 0.0, 30.0), heading_deg=90.0, follows="t1"),
    Hover(host="h2", position_m=(0.0, -27.0, 30.0), heading_deg=0.0, follows="t1"),
)
TWO = (
    Hover(host="h1", position_m=(-35.0, 0.0, 30.0), heading_deg=90.0, follows="t1"),
    Hover(host="h2", position_m=(-8.0, -27.0, 30.0), heading_deg=0.0, follows="t1"),
    Hover(host="h3", position_m=(36.0, 8.0, 30.0), heading_deg=270.0, follows="t2"),
    Hover(host="h4", position_m=(12.0, -24.0, 30.0), heading_deg=0.0, follows="t2"),
)


def peripheral(hovers: tuple[Hover, ...]) -> tuple[Hover, ...]:
    return tuple(replace(hover, follows=None) for hover in hovers)


def threats(count: int, psd_m2ps3: float = 0.0) -> list[Flight]:
    both = [
        Flight("t1", (-10.0, 0.0, 30.0), (1.5, -0.5, 0.0), psd_m2ps3=psd_m2ps3),
        Flight("t2", (15.0, 5.0, 33.0), (-1.0, 0.5, 0.0), psd_m2ps3=psd_m2ps3),
    ]
    return both[:count]


def flown(
    flights: list[Flight], hovers: tuple[Hover, ...], seed: int
) -> tuple[Loop, list[float], list[float], dict[str, float]]:
    """Fly a scenario; return the loop, errors (metres) and NEES once settled, and the errors before the first fix."""
    loop = Loop(flights=flights, hovers=hovers, seed=seed)
    errors_m: list[float] = []
    nees: list[float] = []
    for tick in range(round((WARNING_S + STATION_S) / PERIOD_S)):
        if tick % 5 == 0:
            loop.report(15.0)
        if tick * PERIOD_S < WARNING_S:
            loop.wait()
            before_m = loop.errors_m()
            continue
        loop.step()
        if (tick + 1) * PERIOD_S > WARNING_S + SETTLED_S:
            errors_m += loop.errors_m().values()
            nees += loop.nees().values()
    assert loop.time_s == pytest.approx(EPOCH_S + WARNING_S + STATION_S, abs=1e-3)
    return loop, errors_m, nees, before_m


@pytest.mark.parametrize(
    ("count", "hovers", "limit_m"),
    [
        pytest.param(1, ONE, 0.5, id="a central pair"),
        pytest.param(2, TWO, 0.5, id="two central pairs"),
        pytest.param(1, peripheral(ONE), 2.5, id="two peripheral views"),
        pytest.param(2, peripheral(TWO), 2.5, id="four peripheral views of two threats"),
    ],
)
def test_on_station_the_median_error_is_within_its_target(
    count: int, hovers: tuple[Hover, ...], limit_m: float
) -> None:
    errors_m: list[float] = []
    before_m: list[float] = []
    for seed in range(5):
        loop, errors, _, before = flown(threats(count), hovers, seed)
        assert sorted(loop.picture.tracks) == [f"t{number + 1}" for number in range(count)]
        assert np.median(errors) <= limit_m * METRE, f"seed {seed}"
        errors_m += errors
        before_m += before.values()
    assert np.median(errors_m) < 0.4 * np.median(before_m), "the cameras sharpen what the radar knows"


@pytest.mark.parametrize(
    "hovers",
    [pytest.param(TWO, id="central"), pytest.param(peripheral(TWO), id="peripheral")],
)
def test_tracks_are_as_good_as_they_say(hovers: tuple[Hover, ...]) -> None:
    """Over runs, which are independent, the mean of each run's NEES stays within the 95 % bounds of their mean.

    Samples within a run hang together over about a second: a run of 6 s counts for 5 samples, not for 30.
    """
    runs = [float(np.mean(flown(threats(2, psd_m2ps3=0.25), hovers, seed)[2])) for seed in range(6)]
    samples = 5 * 2 * len(runs)
    low, high = (float(chi2.ppf(share, 6 * samples)) / samples for share in (0.025, 0.975))
    assert low < np.mean(runs) < high


def test_straight_threats_are_tracked_no_worse_than_said() -> None:
    _, _, nees, _ = flown(threats(2), TWO, seed=3)
    assert np.mean(np.array(nees) > chi2.ppf(0.975, 6)) <= 0.025


@pytest.mark.parametrize("central", [True, False], ids=["central", "peripheral"])
@pytest.mark.parametrize("seed", range(3))
def test_threats_that_pass_at_10_m_keep_their_names(central: bool, seed: int) -> None:
    """Head on at 6 m/s; for two of four hosts one passes before the other."""
    hovers = (
        Hover(host="h1", position_m=(-12.0, -32.0, 30.0), heading_deg=0.0, follows="t1"),
        Hover(host="h2", position_m=(14.0, -30.0, 30.0), heading_deg=0.0, follows="t1"),
        Hover(host="h3", position_m=(-32.0, 14.0, 30.0), heading_deg=90.0, follows="t2"),
        Hover(host="h4", position_m=(15.0, 32.0, 30.0), heading_deg=180.0, follows="t2"),
    )
    flights = [Flight("t1", (-15.0, -5.0, 30.0), (3.0, 0.0, 0.0)), Flight("t2", (15.0, 5.0, 30.0), (-3.0, 0.0, 0.0))]
    loop = Loop(flights=flights, hovers=hovers if central else peripheral(hovers), seed=seed)
    loop.report(2.0)
    nearest_m = math.inf
    while loop.time_s < EPOCH_S + 10.0:
        loop.step()
        first, second = (flight.state().position_m for flight in flights)
        nearest_m = min(nearest_m, math.dist(first, second))
        assert sorted(loop.picture.tracks) == ["t1", "t2"]
        for name, other in ((0, second), (1, first)):
            track_m = loop.picture.tracks[f"t{name + 1}"].position_at(loop.time_s)
            assert math.dist(track_m, (first, second)[name]) < math.dist(track_m, other), "it follows the other threat"
    assert nearest_m == pytest.approx(10.0, abs=0.2 * METRE)


def test_hosts_that_see_a_threat_nobody_reports_find_it_by_themselves() -> None:
    loop = Loop(flights=[Flight("unknown", (0.0, 0.0, 30.0), (1.0, 1.0, 0.0))], hovers=peripheral(ONE), seed=1)
    while loop.time_s < EPOCH_S + 6.0:
        loop.step()
    (track,) = loop.picture.tracks.values()
    assert track.source == "cameras"
    assert math.dist(track.position_at(loop.time_s), loop.flights[0].state().position_m) < 2.5 * METRE


def test_the_same_seed_gives_the_same_loop_to_the_bit() -> None:
    def run() -> Loop:
        return flown(threats(2), TWO, seed=4)[0]

    first, second = run(), run()
    assert first.picture == second.picture
    assert first.watch == second.watch
