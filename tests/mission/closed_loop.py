"""The closed loop against the truth: seeded missions flown headless, tracks beside true threats."""

import itertools
import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.simulator.disturbances import GpsError
from hsop_gcs.simulator.truth import TrueState
from hsop_gcs.tracks import TrackRules
from hsop_gcs.tracks.filter import FloatArray
from tests.detections.loop import nees_of
from tests.mission.headless import EPOCH_S, Flight, Moment, Truth, decide_in_rounds, fly

SETTLED_S = 2.0
"""After two hosts have begun to see it, or its hosts have come on station, before a track is judged."""
APART_M = 10.0
"""Nearer to each other than this no threats come."""
LOST_M = 10.0
_SURELY_ELSEWHERE = float(chi2.ppf(1 - 1e-6, 3))
STEP_S = 0.1
PSD_M2PS3 = 0.05
CALMS_IN_S = 3.0
"""Gusts push threats off their straight ways as the tracker assumes, and they come back to their speed in this time,
which is long beside the tracker's memory."""
PERIOD_S = 0.2
LAGS = 25
"""Over which samples of one visit are taken to hang together."""


def wandering(rng: np.random.Generator, count: int, duration_s: float) -> Truth:
    """Threats that cross an area of 80 m at up to 2 m/s, blown about; some pass each other, never nearer than 10 m."""
    while True:
        ways = [_way(rng, duration_s) for _ in range(count)]
        apart_m = [
            np.linalg.norm(one[:, :3] - other[:, :3], axis=1).min()
            for number, one in enumerate(ways)
            for other in ways[:number]
        ]
        if min(apart_m) >= APART_M:
            break

    def at(time_s: float) -> list[TrueState]:
        place = min(time_s / STEP_S, len(ways[0]) - 1.001)
        before, share = int(place), place - int(place)
        states = []
        for number, way in enumerate(ways):
            x, y, z, vx, vy, vz = ((1 - share) * way[before] + share * way[before + 1]).tolist()
            states.append(TrueState(id=f"t{number + 1}", position_m=(x, y, z), velocity_mps=(vx, vy, vz), size_m=1.0))
        return states

    return at


def _way(rng: np.random.Generator, duration_s: float) -> FloatArray:
    """(times, 6)"""
    place = np.array([20 + rng.uniform(-40, 40), 90 + rng.uniform(-40, 40), rng.uniform(32, 42)])
    course, speed_mps = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 2.0)
    cruise = np.array([speed_mps * np.sin(course), speed_mps * np.cos(course), 0.0])
    start, velocity = place.copy(), cruise.copy()
    way = []
    for _ in range(round(duration_s / STEP_S) + 20):
        way.append([*place, *velocity])
        gust = math.sqrt(PSD_M2PS3 * STEP_S) * rng.standard_normal(3)
        pull = (cruise - velocity) / CALMS_IN_S
        pull[2] += (start[2] - place[2]) / CALMS_IN_S**2
        changed = velocity + STEP_S * pull + gust
        place = place + STEP_S * (velocity + changed) / 2
        velocity = changed
    return np.array(way)


@dataclass(kw_only=True)
class Score:
    """What a mission's tracks were worth: errors and NEES on station, all else whenever two hosts see a threat."""

    threats: int
    errors_m: dict[str, list[float]] = field(default_factory=lambda: {"central": [], "peripheral": []})
    """By the worse camera of the pair that the plan gives the threat."""
    nees: dict[int, list[list[float]]] = field(default_factory=lambda: {3: [], 6: []})
    """Of position and of the whole state: a list for every visit to a station."""
    lost: Counter[str] = field(default_factory=Counter)
    """Moments in which two hosts saw a threat and no track of its name was near it, or as near as it said."""
    swapped: Counter[str] = field(default_factory=Counter)
    """Moments in which a track was nearer to another threat than to its own, and said that it was not at its own."""
    strange: Counter[str] = field(default_factory=Counter)
    """Moments in which a confirmed track of no threat was in the picture."""
    plans: int = 0
    nearest_m: float = math.inf
    """Of threats to each other."""
    first_s: dict[str, float] = field(default_factory=dict)
    """When each threat's pair was on station first."""
    station_s: float = 0.0
    """On station, summed over the threats."""
    watched_s: float = 0.0
    """The same of all the time since the first report."""
    _on_station_since: dict[str, float] = field(default_factory=dict)
    _seen_since: dict[str, float] = field(default_factory=dict)

    def watch(self, moment: Moment) -> None:
        state = moment.mission.state
        tracks, flying = state.picture.tracks, state.plans.flying
        self.plans = state.plans.made
        for track_id in set(tracks) - {true.id for true in moment.truth}:
            self.strange[track_id] += 1
        pairs = {} if flying is None else {pair.threat: pair for pair in flying.decision.placement.pairs}
        for true in moment.truth:
            others = [each.position_m for each in moment.truth if each.id != true.id]
            self.nearest_m = min([self.nearest_m, *(math.dist(true.position_m, place) for place in others)])
            hosts = {view.host for view in pairs[true.id].views} if true.id in pairs else set()
            there = len(hosts) == 2 and all(
                host in state.progress and state.progress[host].status is OrderStatus.ON_STATION for host in hosts
            )
            seen = len(moment.seen_by.get(true.id, ())) >= 2
            on_station_s = _lasting(self._on_station_since, true.id, there, moment.time_s)
            seen_s = _lasting(self._seen_since, true.id, seen, moment.time_s)
            self.watched_s += PERIOD_S
            if there:
                self.station_s += PERIOD_S
                self.first_s.setdefault(true.id, moment.time_s)
                if on_station_s == 0.0:
                    for visits in self.nees.values():
                        visits.append([])
            if seen_s < SETTLED_S:
                continue
            track = tracks.get(true.id)
            at_s = EPOCH_S + moment.time_s
            if track is None:
                self.lost[true.id] += 1
                continue
            off_m = math.dist(track.position_at(at_s), true.position_m)
            nees = {size: nees_of(track, true, at_s, state.rules.tracks, size=size) for size in self.nees}
            nearer = any(math.dist(track.position_at(at_s), other) < off_m for other in others)
            self.lost[true.id] += off_m > LOST_M and nees[3] > _SURELY_ELSEWHERE
            self.swapped[true.id] += nearer and nees[3] > _SURELY_ELSEWHERE
            if on_station_s >= SETTLED_S:
                cameras = {view.camera for view in pairs[true.id].views}
                self.errors_m["peripheral" if CameraKind.PERIPHERAL in cameras else "central"].append(off_m)
                for size, visits in self.nees.items():
                    visits[-1].append(nees[size])


def _lasting(since_s: dict[str, float], name: str, now: bool, time_s: float) -> float:
    """How long something has been true of ``name``; below 0 if it is not."""
    if not now:
        since_s.pop(name, None)
        return -1.0
    return time_s - since_s.setdefault(name, time_s)


def fly_seed(seed: int, duration_s: float, *, rounds: int = 2, hosts_per_threat: int = 2) -> Score:
    """Fly one mission with 2 to 4 threats and, unless told otherwise, as many hosts as a plan can use, which misplace
    themselves slowly by as much as the service assumes."""
    rng = np.random.default_rng([seed, 0])
    count = 2 + seed % 3
    score = Score(threats=count)
    rules = Rules(autonomy=Autonomy.AUTO, tracks=TrackRules(acceleration_psd_m2ps3=PSD_M2PS3))
    truth = wandering(rng, count, duration_s)
    gps = GpsError(noise_m=rules.detections.host_sigma_m)
    flight = Flight(truth=truth, hosts=hosts_per_threat * count, duration_s=duration_s, seed=seed, rules=rules, gps=gps)
    fly(flight, score.watch, decide_in_rounds(rounds))
    return score


@dataclass(frozen=True, kw_only=True)
class Consistency:
    """A mean NEES and the 95 % bounds of the mean of so many independent samples."""

    mean: float
    low: float
    high: float
    samples: float

    @property
    def holds(self) -> bool:
        return self.low <= self.mean <= self.high


def consistency(visits: list[list[float]], size: int) -> Consistency:
    """Return the mean NEES of all visits with its bounds.

    Samples of one visit hang together. N of them are worth N / (1 + 2 Σ ρ), with their autocorrelation ρ pooled over
    all visits. Hosts whose images alternate make every second ρ small: the sum ends with the first two neighbours that
    are not above 0 together, or after five seconds. Source: Geyer, Practical Markov chain Monte Carlo, 1992, 3.3.
    """
    values = [np.array(visit) - np.mean(np.concatenate([np.array(each) for each in visits])) for visit in visits]
    count = sum(len(each) for each in values)
    variance = sum(float(each @ each) for each in values) / count
    rho = [1.0]
    for lag in range(1, LAGS + 1):
        products = [float(each[:-lag] @ each[lag:]) for each in values if len(each) > lag]
        pairs = sum(len(each) - lag for each in values if len(each) > lag)
        rho.append(sum(products) / pairs / variance if pairs else 0.0)
    together = [one + other for one, other in zip(rho[::2], rho[1::2], strict=True)]
    correlated = sum(itertools.takewhile(lambda both: both > 0, together)) - 1.0
    samples = count / (1 + 2 * correlated)
    low, high = (float(chi2.ppf(share, size * samples)) / samples for share in (0.025, 0.975))
    return Consistency(mean=float(np.mean(np.concatenate(visits))), low=low, high=high, samples=samples)
