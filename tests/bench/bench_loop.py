"""The closed loop against the truth: seeded missions flown headless, tracks beside true threats while hosts see them.

python -m tests.bench.bench_loop [FIRST] [LAST]
"""

import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.simulator.truth import TrueState
from hsop_gcs.tracks import TrackRules
from hsop_gcs.tracks.filter import FloatArray
from tests.detections.loop import nees_of
from tests.mission.headless import EPOCH_S, Flight, Moment, Truth, decide_in_rounds, fly

SEEDS = 20
DURATION_S = 60.0
ROUNDS = 2
SETTLED_S = 2.0
"""After its hosts came on station, before a track is judged."""
APART_M = 10.0
"""Nearer to each other than this no threats come."""
LOST_M = 10.0
STEP_S = 0.1
PSD_M2PS3 = 0.05
CALMS_IN_S = 1.5
"""Gusts push threats off their straight ways as the tracker assumes, and they come back to their speed in this time."""


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
    """What a mission's tracks were worth while hosts of their pair were on station."""

    threats: int
    errors_m: dict[str, list[float]] = field(default_factory=lambda: {"central": [], "peripheral": []})
    """By the worse camera of the pair that the plan gives the threat."""
    nees: list[float] = field(default_factory=list)
    lost: Counter[str] = field(default_factory=Counter)
    """Moments in which two hosts saw a threat and no track of its name was near it."""
    swapped: Counter[str] = field(default_factory=Counter)
    """Moments in which a track was nearer to another threat than to its own."""
    strange: Counter[str] = field(default_factory=Counter)
    """Moments in which a confirmed track of no threat was in the picture."""
    plans: int = 0
    nearest_m: float = math.inf
    on_station_since: dict[str, float] = field(default_factory=dict)

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
            stands = [state.progress[host].status is OrderStatus.ON_STATION for host in hosts if host in state.progress]
            if len(stands) < 2 or not all(stands):
                self.on_station_since.pop(true.id, None)
                continue
            since_s = self.on_station_since.setdefault(true.id, moment.time_s)
            if moment.time_s - since_s < SETTLED_S or len(moment.seen_by.get(true.id, ())) < 2:
                continue
            track = tracks.get(true.id)
            place = None if track is None else track.position_at(EPOCH_S + moment.time_s)
            if track is None or place is None or math.dist(place, true.position_m) > LOST_M:
                self.lost[true.id] += 1
                continue
            off_m = math.dist(place, true.position_m)
            self.swapped[true.id] += any(math.dist(place, other) < off_m for other in others)
            cameras = {view.camera for view in pairs[true.id].views}
            self.errors_m["peripheral" if CameraKind.PERIPHERAL in cameras else "central"].append(off_m)
            self.nees.append(nees_of(track, true, EPOCH_S + moment.time_s, state.rules.tracks))


def fly_seed(seed: int, duration_s: float = DURATION_S) -> Score:
    """Fly one mission with 2 to 4 threats and as many hosts as a plan can use."""
    rng = np.random.default_rng([seed, 0])
    count = 2 + seed % 3
    score = Score(threats=count)
    rules = Rules(autonomy=Autonomy.AUTO, tracks=TrackRules(acceleration_psd_m2ps3=PSD_M2PS3))
    truth = wandering(rng, count, duration_s)
    flight = Flight(truth=truth, hosts=2 * count, duration_s=duration_s, seed=seed, rules=rules)
    fly(flight, score.watch, decide_in_rounds(ROUNDS))
    return score


def main() -> None:
    first, last = (int(text) for text in sys.argv[1:3]) if len(sys.argv) == 3 else (0, SEEDS - 1)
    scores = []
    low, high = chi2.ppf(0.025, 6), chi2.ppf(0.975, 6)
    for seed in range(first, last + 1):
        began_s = time.process_time()
        score = fly_seed(seed)
        scores.append(score)
        medians = ", ".join(
            f"{name} {np.median(errors):.2f} m ({len(errors)})" for name, errors in score.errors_m.items() if errors
        )
        nees = np.array(score.nees)
        sys.stdout.write(
            f"seed {seed:2d}: {score.threats} threats, nearest {score.nearest_m:.0f} m, {score.plans} plans; {medians};"
            f" NEES {nees.mean() if len(nees) else math.nan:.1f};"
            f" lost {sum(score.lost.values())}, swapped {sum(score.swapped.values())},"
            f" strange {dict(score.strange)}; {time.process_time() - began_s:.0f} s\n"
        )
        sys.stdout.flush()
    for name in ("central", "peripheral"):
        errors = [error for score in scores for error in score.errors_m[name]]
        if errors:
            sys.stdout.write(f"{name}: median {np.median(errors):.2f} m, 95 % {np.quantile(errors, 0.95):.2f} m\n")
    nees = np.concatenate([score.nees for score in scores])
    sys.stdout.write(
        f"NEES: mean {nees.mean():.2f}, {np.mean((nees > low) & (nees < high)):.1%} within the 95 % bounds"
        f" {low:.2f}..{high:.2f}, {np.mean(nees > high):.1%} above\n"
    )


if __name__ == "__main__":
    main()
