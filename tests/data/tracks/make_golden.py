# mypy: ignore-errors
"""Writes kalman.json and scans.json: what Stone Soup makes of the same inputs as hsop_gcs.

    python tests/data/tracks/make_golden.py       in an environment with stonesoup 1.9.1 and this package

kalman.json: states of its Kalman filter. scans.json: truth and unlabelled plots of three scenarios, the mean GOSPA of
its global-nearest-neighbour tracker in each, and how long it took per scan.
"""

import json
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.tracker.simple import MultiTargetTracker
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import KalmanUpdater

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2]))

from hsop_gcs.tracks import TrackRules  # noqa: E402
from hsop_gcs.tracks.gate import threshold  # noqa: E402
from tests.tracks.gospa import gospa_m  # noqa: E402

RULES = TrackRules()
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
SCAN_S = 0.5
SIGMA_M = 2.0
TIMEOUT_S, TENTATIVE_TIMEOUT_S = 3.0, 1.5
TO_STONE_SOUP = np.array([0, 3, 1, 4, 2, 5])
"""Its states interleave position and velocity."""
FROM_STONE_SOUP = np.argsort(TO_STONE_SOUP)
MOTION = CombinedLinearGaussianTransitionModel([ConstantVelocity(RULES.acceleration_psd_m2ps3)] * 3)


def kalman(rng: np.random.Generator) -> dict[str, list]:
    """One filter through every kind of linear measurement: positions, full covariances, velocities, uneven times."""
    predictor, updater = KalmanPredictor(MOTION), KalmanUpdater(None)
    position, velocity = np.array([40.0, -90.0, 35.0]), np.array([-3.0, 2.0, 0.5])
    time_s, state, reports, states = 0.0, None, [], []
    for number in range(60):
        time_s += float(np.round(rng.uniform(0.0, 0.8), 3))
        kind = ("position", "velocity", "covariance")[number % 3] if number else "position"
        sigma_m = float(np.round(rng.uniform(0.5, 15.0), 2))
        noise = np.eye(3) * sigma_m**2
        report = {"kind": kind, "time_s": time_s, "sigma_m": sigma_m}
        mapping = TO_STONE_SOUP[:6:2] * 2
        if kind == "covariance":
            root = rng.normal(size=(3, 3)) * 2.0
            noise = np.round(root @ root.T + 0.1 * np.eye(3), 4)
            report["covariance_m2"] = noise.tolist()
        measured = position + velocity * time_s + rng.multivariate_normal(np.zeros(3), noise)
        mapping = np.array([0, 2, 4])
        if kind == "velocity":
            measured = np.hstack([measured, velocity + rng.normal(0, RULES.velocity_sigma_mps, 3)])
            noise = np.diag([sigma_m**2] * 3 + [RULES.velocity_sigma_mps**2] * 3)
            mapping = np.array([0, 2, 4, 1, 3, 5])
            report["velocity_mps"] = measured[3:].tolist()
        report["position_m"] = measured[:3].tolist()
        stamp = BEGIN + timedelta(seconds=time_s)
        if state is None:
            first = np.hstack([measured, np.zeros(3)])[TO_STONE_SOUP]
            spread = np.diag([sigma_m**2] * 3 + [RULES.first_velocity_sigma_mps**2] * 3)
            state = GaussianState(first, spread[np.ix_(TO_STONE_SOUP, TO_STONE_SOUP)], timestamp=stamp)
        else:
            model = LinearGaussian(ndim_state=6, mapping=mapping, noise_covar=noise)
            detection = Detection(measured, timestamp=stamp, measurement_model=model)
            predicted = predictor.predict(state, timestamp=stamp)
            state = updater.update(SingleHypothesis(predicted, detection))
        mean = np.asarray(state.mean, dtype=float).ravel()[FROM_STONE_SOUP]
        covariance = np.asarray(state.covar, dtype=float)[np.ix_(FROM_STONE_SOUP, FROM_STONE_SOUP)]
        reports.append(report)
        states.append({"mean": mean.tolist(), "covariance": covariance.tolist()})
    return {"reports": reports, "states": states}


def scenario(name: str, rng: np.random.Generator) -> dict[str, list]:
    """Truth and plots of each scan. Threats keep 10 m and more from each other; plots are missed and made up."""
    if name == "crossing":
        ways = [([-75, 5 * k, 40 + 11 * k], [3.0, 0.3, 0], 0, 50) for k in range(2)]
        ways += [([6 * k, -75, 62 + 11 * k], [0.2, 3.0, 0], 0, 50) for k in range(2)]
        detected, clutter = 0.9, 0.5
    elif name == "abreast":
        ways = [([12.0 * k, -80, 50], [0.1, 4.0, 0.2], 0, 40) for k in range(3)]
        detected, clutter = 0.9, 0.5
    else:
        ways = [
            ([*rng.uniform(-150, 150, 2), 20 + 12 * k], [*rng.uniform(-4, 4, 2), 0.0], 5 * k, 30 + 5 * k)
            for k in range(6)
        ]
        detected, clutter = 0.95, 6.0
    scans = []
    for number in range(1 + int(max(way[3] for way in ways) / SCAN_S)):
        time_s = number * SCAN_S
        alive = [
            np.array(start) + np.array(velocity) * (time_s - begins_s)
            for start, velocity, begins_s, ends_s in ways
            if begins_s <= time_s < ends_s
        ]
        plots = [place + rng.normal(0, SIGMA_M, 3) for place in alive if rng.uniform() < detected]
        plots += [rng.uniform([-200, -200, 0], [200, 200, 100]) for _ in range(rng.poisson(clutter))]
        order = rng.permutation(len(plots))
        scans.append(
            {
                "time_s": time_s,
                "truth_m": [np.round(place, 3).tolist() for place in alive],
                "plots_m": [np.round(plots[index], 3).tolist() for index in order],
            }
        )
    return {"scans": scans}


def stone_soup(scans: list[dict]) -> tuple[float, float]:
    """Return the mean GOSPA of Stone Soup's tracker, metres, and its time per scan, seconds."""
    model = LinearGaussian(ndim_state=6, mapping=(0, 2, 4), noise_covar=np.eye(3) * SIGMA_M**2)
    predictor, updater = KalmanPredictor(MOTION), KalmanUpdater(model)
    reach = np.sqrt(threshold(3, 1 - RULES.gate_probability))
    associator = GNNWith2DAssignment(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=reach))
    prior = GaussianState(np.zeros(6), np.diag([0, RULES.first_velocity_sigma_mps**2] * 3), timestamp=BEGIN)
    initiator = MultiMeasurementInitiator(
        prior, UpdateTimeDeleter(timedelta(seconds=TENTATIVE_TIMEOUT_S)), associator, updater, model, min_points=3
    )
    detections = [
        (
            BEGIN + timedelta(seconds=scan["time_s"]),
            {
                Detection(np.array(plot), timestamp=BEGIN + timedelta(seconds=scan["time_s"]), measurement_model=model)
                for plot in scan["plots_m"]
            },
        )
        for scan in scans
    ]
    tracker = MultiTargetTracker(
        initiator, UpdateTimeDeleter(timedelta(seconds=TIMEOUT_S)), detections, associator, updater
    )
    found, began_s = [], time.process_time()
    for _, tracks in tracker:
        found.append([np.asarray(track.state_vector, dtype=float).ravel()[[0, 2, 4]] for track in tracks])
    per_scan_s = (time.process_time() - began_s) / len(scans)
    values = [gospa_m(scan["truth_m"], positions) for scan, positions in zip(scans, found, strict=True)]
    return float(np.mean(values)), per_scan_s


def main() -> None:
    generators = [np.random.default_rng(seed) for seed in np.random.SeedSequence(20260101).spawn(4)]
    (HERE / "kalman.json").write_text(json.dumps(kalman(generators[0])) + "\n")
    scenarios = {}
    for name, rng in zip(("crossing", "abreast", "clutter"), generators[1:], strict=True):
        scenarios[name] = scenario(name, rng)
        gospa, per_scan_s = stone_soup(scenarios[name]["scans"])
        scenarios[name]["stone_soup"] = {"mean_gospa_m": gospa, "per_scan_s": round(per_scan_s, 5)}
    rules = {"sigma_m": SIGMA_M, "timeout_s": TIMEOUT_S, "tentative_timeout_s": TENTATIVE_TIMEOUT_S}
    (HERE / "scans.json").write_text(json.dumps({"rules": rules, "scenarios": scenarios}) + "\n")


if __name__ == "__main__":
    main()
