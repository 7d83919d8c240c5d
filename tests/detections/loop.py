"""The loop without I/O: true threats, hosts that hover and look, detections, tracks. For tests and measurements."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.detections import Detection, DetectionRules, Pose, PoseHistory, Verdict, Watch, assimilate, rays_of
from hsop_gcs.geometry.frames import aim_at
from hsop_gcs.reports import Report, ReportRules, Vector3
from hsop_gcs.simulator.disturbances import GpsError, Receiver
from hsop_gcs.simulator.eyes import Viewer, look
from hsop_gcs.simulator.truth import TrueState
from hsop_gcs.tracks import Picture, Track, TrackRules, update
from hsop_gcs.tracks.gate import predicted
from hsop_gcs.tracks.own import OwnAircraft

EPOCH_S = 1_800_000_000.0
PERIOD_S = 0.2
LATENCY_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Hover:
    """A host on station. ``follows``: the track its gimbal looks at; None leaves the central camera unused."""

    host: str
    position_m: Vector3
    heading_deg: float = 0.0
    follows: str | None = None


class Flight:
    """A threat that flies as the tracker assumes: straight but for white-noise acceleration; or quite straight."""

    def __init__(self, threat: str, start_m: Vector3, velocity_mps: Vector3, *, psd_m2ps3: float = 0.0) -> None:
        self.threat = threat
        self._position = np.array(start_m)
        self._velocity = np.array(velocity_mps)
        self._psd = psd_m2ps3

    def state(self) -> TrueState:
        x, y, z = self._position.tolist()
        vx, vy, vz = self._velocity.tolist()
        return TrueState(id=self.threat, position_m=(x, y, z), velocity_mps=(vx, vy, vz), size_m=1.0)

    def fly(self, elapsed_s: float, rng: np.random.Generator) -> None:
        t, q = elapsed_s, self._psd
        self._position = self._position + t * self._velocity
        if q > 0:
            covariance = q * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
            jolt = rng.multivariate_normal([0.0, 0.0], covariance, size=3)
            self._position = self._position + jolt[:, 0]
            self._velocity = self._velocity + jolt[:, 1]


@dataclass(kw_only=True)
class Loop:
    """Steps at 5 Hz: threats fly, hosts sway and misplace themselves, gimbals follow, cameras see, tracks learn."""

    flights: Sequence[Flight]
    hovers: Sequence[Hover]
    seed: int
    noise: float = 1.0
    sway_deg: float = 2.0
    rules: DetectionRules = field(default_factory=DetectionRules)
    track_rules: TrackRules = field(default_factory=TrackRules)
    rig: CameraRig = field(default_factory=CameraRig)
    time_s: float = EPOCH_S
    picture: Picture = field(default_factory=Picture)
    watch: Watch = field(default_factory=Watch)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.poses: dict[str, PoseHistory] = {hover.host: PoseHistory() for hover in self.hovers}
        self.last: list[tuple[Detection, Verdict]] = []
        error = GpsError(noise_m=self.rules.host_sigma_m)
        self.receivers = {hover.host: Receiver(error, self.rng) for hover in self.hovers}

    def report(self, sigma_m: float, *, velocity: bool = True) -> None:
        """A radar reports all threats."""
        reports = []
        for flight in self.flights:
            state = flight.state()
            x, y, z = (np.array(state.position_m) + sigma_m * self.rng.standard_normal(3)).tolist()
            vx, vy, vz = (np.array(state.velocity_mps) + 0.5 * self.rng.standard_normal(3)).tolist()
            report = Report(
                source="radar", threat_id=state.id, time_s=self.time_s, position_m=(x, y, z), sigma_m=sigma_m
            )
            reports.append(replace(report, velocity_mps=(vx, vy, vz)) if velocity else report)
        self.picture, verdicts = update(self.picture, reports, self.time_s, self.track_rules)
        assert all(isinstance(verdict, str) for verdict in verdicts), verdicts

    def step(self) -> None:
        """Pass one period: the newest telemetry and detections arrive, those of one latency ago."""
        viewers = [Viewer(host=hover.host, pose=self._pose(hover), rig=self.rig) for hover in self.hovers]
        seen = look(viewers, [flight.state() for flight in self.flights], self.time_s, self.rng, noise=self.noise)
        for viewer in viewers:
            self._hear(viewer, self.time_s)
        rays = rays_of(seen, self.poses, dict.fromkeys(self.poses, self.rig), self.rules)
        done = assimilate(
            self.picture,
            self.watch,
            rays,
            self.time_s + LATENCY_S,
            own=OwnAircraft.at_rest({hover.host: hover.position_m for hover in self.hovers}),
            rules=self.rules,
            track_rules=self.track_rules,
            clock=ReportRules(),
        )
        self.picture, self.watch = done.picture, done.watch
        self.last = list(zip(seen, done.verdicts, strict=True))
        self.wait()

    def wait(self) -> None:
        """Pass one period in which no camera sees anything."""
        for flight in self.flights:
            flight.fly(PERIOD_S, self.rng)
        self.time_s += PERIOD_S

    def errors_m(self) -> dict[str, float]:
        """Return how far each track of a threat's name is from the truth, now."""
        return {
            flight.threat: math.dist(
                self.picture.tracks[flight.threat].position_at(self.time_s), flight.state().position_m
            )
            for flight in self.flights
            if flight.threat in self.picture.tracks
        }

    def nees(self) -> dict[str, float]:
        """Return each track's normalized estimation error squared, position and velocity, now."""
        return {
            flight.threat: nees_of(self.picture.tracks[flight.threat], flight.state(), self.time_s, self.track_rules)
            for flight in self.flights
        }

    def _pose(self, hover: Hover) -> Pose:
        track = None if hover.follows is None else self.picture.tracks.get(hover.follows)
        phase = 2 * math.pi * 0.3 * (self.time_s - EPOCH_S) + len(hover.host)
        return Pose(
            position_m=hover.position_m,
            heading_deg=hover.heading_deg,
            roll_deg=self.sway_deg * math.sin(phase),
            pitch_deg=self.sway_deg * math.cos(phase),
            aim=None if track is None else aim_at(np.array(hover.position_m), np.array(track.position_at(self.time_s))),
        )

    def _hear(self, viewer: Viewer, time_s: float) -> None:
        pose = viewer.pose
        receiver = self.receivers[viewer.host]
        receiver.step(PERIOD_S)
        x, y, z = (np.array(pose.position_m) + np.array(receiver.error_m)).tolist()
        history = self.poses[viewer.host]
        history = history.with_position(time_s, (x, y, z)).with_attitude(
            time_s, heading_deg=pose.heading_deg, roll_deg=pose.roll_deg, pitch_deg=pose.pitch_deg
        )
        self.poses[viewer.host] = history if pose.aim is None else history.with_aim(time_s, pose.aim)


def nees_of(track: Track, truth: TrueState, time_s: float, rules: TrackRules, *, size: int = 6) -> float:
    """Return the normalized estimation error squared of a track predicted to ``time_s``; ``size`` if consistent.

    size: 6 for position and velocity, 3 for the position alone.
    """
    mean, covariance = predicted([track.state], [time_s], rules)
    error: npt.NDArray[np.float64] = mean[0] - np.array([*truth.position_m, *truth.velocity_mps])
    return float(error[:size] @ np.linalg.solve(covariance[0, :size, :size], error[:size]))
