"""Detections into the picture: rays, association, fixes, tracks; and what came of each detection.

detections ──pose at that time──▶ rays ──all hosts of one moment──▶ threat ──▶ of several hosts: a fix
                                   │                                      └──▶ of one host: its bearings
                                   └─ no threat explains it ──▶ held ──▶ two hosts' meet: a candidate
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.detections.association import Doubt, associate
from hsop_gcs.detections.candidates import meetings
from hsop_gcs.detections.detection import Detection, Reason, Refused, Unusable
from hsop_gcs.detections.fix import Belief, Fix, fix_of
from hsop_gcs.detections.merging import SOURCE, merged
from hsop_gcs.detections.own import seen_host, squared_of
from hsop_gcs.detections.poses import PoseHistory
from hsop_gcs.detections.ray import Ray, to_ray
from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.triangulation import Place
from hsop_gcs.reports import Bearing, Matrix3, Measurement, Report, ReportRules, Vector3, check_time
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, Track, TrackRules, update
from hsop_gcs.tracks.gate import predicted
from hsop_gcs.tracks.history import state_before
from hsop_gcs.tracks.own import OwnAircraft


class Fate(StrEnum):
    """What became of a detection."""

    FIX = "fix"
    """Its threat was fixed together with other hosts."""
    BEARING = "bearing"
    """It corrected its threat alone."""
    CANDIDATE = "candidate"
    """It began a threat, together with another host."""
    HELD = "held"
    """No threat explains it; it waits a moment for another host."""
    AMBIGUOUS = "ambiguous"
    """More than one threat may be what it shows: not used."""
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """On one detection."""

    fate: Fate
    threat: str | None = None
    """Its track's id."""
    refusal: Refused | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Since the mission began: fixes and candidates by themselves, all else in detections."""

    received: int = 0
    used: int = 0
    """In fixes, as bearings or in candidates."""
    bearing_only: int = 0
    fixes: int = 0
    candidates: int = 0
    ambiguous: int = 0
    unexplained: int = 0
    """Held in vain."""
    refused: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """By reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """What is kept from one call to the next."""

    held: tuple[Ray, ...] = ()
    """Rays that no threat explains, in order of time."""
    recent: tuple[frozenset[Detection], frozenset[Detection]] = (frozenset(), frozenset())
    """To know a repeated one by: those since ``recent_since_s``, and those of as long before."""
    recent_since_s: float = 0.0
    counts: Counts = Counts()


@dataclass(frozen=True, slots=True, kw_only=True)
class Assimilated:
    """The picture and the watch after some detections, and a verdict on each, in their order."""

    picture: Picture
    watch: Watch
    verdicts: tuple[Verdict, ...]


def rays_of(
    detections: Sequence[Detection],
    poses: Mapping[str, PoseHistory],
    rigs: Mapping[str, CameraRig],
    rules: DetectionRules,
) -> tuple[Ray | Refused, ...]:
    """Return each detection's ray, from where its host was and how it was turned then, or why there is none.

    poses, rigs: of every host that may be named.
    """
    return tuple(_ray_or_refusal(detection, poses, rigs, rules) for detection in detections)


def assimilate(
    picture: Picture,
    watch: Watch,
    rays: Sequence[Ray | Refused],
    now_s: float,
    *,
    own: OwnAircraft,
    rules: DetectionRules,
    track_rules: TrackRules,
    clock: ReportRules,
) -> Assimilated:
    """Take the rays of detections that arrived together, at ``now_s``, into the picture.

    own: our own aircraft. clock: how far a detection's time may be from ours. The same calls in the
    same order give the same pictures, to the bit.
    """
    work = _Work(picture, watch, now_s, own, rules, track_rules, clock)
    usable: list[tuple[int, Ray]] = []
    for index, ray in enumerate(rays):
        refusal = ray if isinstance(ray, Refused) else work.screen(ray)
        if refusal is not None:
            work.refuse(index, refusal)
        elif isinstance(ray, Ray):
            usable.append((index, ray))
    for moment in _moments(usable, rules):
        work.take(moment)
    work.begin_candidates()
    return Assimilated(
        picture=merged(work.picture, now_s, rules, track_rules),
        watch=work.watch(received=len(rays)),
        verdicts=tuple(work.verdicts[index] for index in range(len(rays))),
    )


def let_go(watch: Watch, now_s: float, rules: DetectionRules) -> Watch:
    """Return the watch without the rays that have waited too long; the same one if there is none."""
    kept = tuple(ray for ray in watch.held if now_s - ray.time_s <= rules.hold_s)
    in_vain = len(watch.held) - len(kept)
    if not in_vain:
        return watch
    return replace(watch, held=kept, counts=replace(watch.counts, unexplained=watch.counts.unexplained + in_vain))


def _ray_or_refusal(
    detection: Detection, poses: Mapping[str, PoseHistory], rigs: Mapping[str, CameraRig], rules: DetectionRules
) -> Ray | Refused:
    history = poses.get(detection.host)
    if history is None:
        problem = f"{detection.host!r} is no host whose telemetry is heard"
        return Refused(reason=Reason.NO_POSE, field="host", problem=problem)
    try:
        return to_ray(detection, history.at(detection.time_s, rules.pose_limit_s), rigs[detection.host])
    except Unusable as error:
        return Refused(reason=error.reason, field=error.field, problem=error.problem)


class _Work:
    """One call in progress."""

    def __init__(
        self,
        picture: Picture,
        watch: Watch,
        now_s: float,
        own: OwnAircraft,
        rules: DetectionRules,
        track_rules: TrackRules,
        clock: ReportRules,
    ) -> None:
        self.picture = picture
        self.verdicts: dict[int, Verdict] = {}
        self._counts = watch.counts
        self._held: list[tuple[int | None, Ray]] = [(None, ray) for ray in watch.held]
        self._recent_since_s = watch.recent_since_s
        self._recent, self._before = set(watch.recent[0]), watch.recent[1]
        if now_s - watch.recent_since_s > rules.max_age_s + clock.max_future_s:
            self._recent_since_s, self._recent, self._before = now_s, set(), watch.recent[0]
        self._own = own
        self._now_s = now_s
        self._rules = rules
        self._track_rules = track_rules
        self._clock = replace(clock, max_age_s=min(clock.max_age_s, rules.max_age_s))

    def screen(self, ray: Ray) -> Refused | None:
        """Return why a ray cannot be used whatever it shows."""
        detection = ray.detection
        try:
            check_time(detection.time_s, self._now_s, self._clock)
        except BadInput as error:
            return Refused(reason=Reason.CLOCK, field=error.field, problem=error.problem)
        if detection in self._recent or detection in self._before:
            problem = f"{detection.source} has already sent this detection"
            return Refused(reason=Reason.DUPLICATE, field="time", problem=problem)
        self._recent.add(detection)
        return None

    def refuse(self, index: int, refusal: Refused) -> None:
        self.verdicts[index] = Verdict(fate=Fate.REFUSED, refusal=refusal)
        refused = self._counts.refused
        self._counts = replace(
            self._counts,
            refused=MappingProxyType({**refused, refusal.reason: refused.get(refusal.reason, 0) + 1}),
        )

    def take(self, moment: Sequence[tuple[int, Ray]]) -> None:
        """Use the rays of one moment, all hosts together."""
        time_s = moment[-1][1].time_s
        rays = [ray for _, ray in sorted(moment, key=lambda each: (each[1].look, each[0]))]
        indices = [index for index, _ in sorted(moment, key=lambda each: (each[1].look, each[0]))]
        shown = associate(rays, self.picture.tracks, time_s, self._track_rules, self._rules)
        of_threat: dict[str, list[tuple[int, Ray]]] = {}
        for index, ray, threat in zip(indices, rays, map(self._not_own, rays, shown), strict=True):
            if isinstance(threat, Refused):
                self.refuse(index, threat)
            elif threat is Doubt.UNEXPLAINED:
                self.verdicts[index] = Verdict(fate=Fate.HELD)
                self._held.append((index, ray))
            elif threat is Doubt.AMBIGUOUS:
                self.verdicts[index] = Verdict(fate=Fate.AMBIGUOUS)
                self._counts = replace(self._counts, ambiguous=self._counts.ambiguous + 1)
            else:
                of_threat.setdefault(threat, []).append((index, ray))
        measurements: list[Measurement] = []
        members: list[list[int]] = []
        for threat, seen in of_threat.items():
            track = self.picture.tracks[threat]
            fix = self._fix(track, [ray for _, ray in seen], time_s)
            if fix is not None:
                measurements.append(_report(fix, time_s, track_id=threat))
                members.append([index for index, _ in seen])
            else:
                measurements += [self._bearing(ray, track) for _, ray in seen]
                members += [[index] for index, _ in seen]
        self._update(measurements, members)

    def begin_candidates(self) -> None:
        """Begin a threat wherever held rays meet."""
        rays = [ray for _, ray in self._held]
        found = meetings(rays, self._rules)
        for meeting in found:
            report = _report(meeting.fix, meeting.time_s, track_id=None)
            known = set(self.picture.tracks)
            indices = [self._held[number][0] for number in meeting.rays]
            threat = self._update([report], [[index for index in indices if index is not None]], Fate.CANDIDATE)
            self._counts = replace(
                self._counts,
                candidates=self._counts.candidates + bool(set(self.picture.tracks) - known),
                used=self._counts.used + (sum(index is None for index in indices) if threat else 0),
            )
        met = {number for meeting in found for number in meeting.rays}
        self._held = [each for number, each in enumerate(self._held) if number not in met]

    def watch(self, *, received: int) -> Watch:
        held = sorted((ray for _, ray in self._held), key=lambda ray: ray.time_s)
        kept = held[-self._rules.most_held :]
        counts = replace(
            self._counts,
            received=self._counts.received + received,
            unexplained=self._counts.unexplained + len(held) - len(kept),
        )
        watch = Watch(
            held=tuple(kept),
            recent=(frozenset(self._recent), self._before),
            recent_since_s=self._recent_since_s,
            counts=counts,
        )
        return let_go(watch, self._now_s, self._rules)

    def _not_own(self, ray: Ray, threat: str | Doubt) -> str | Doubt | Refused:
        """Return what a ray shows, but for an aircraft of ours: that begins no threat, and carries none off."""
        seen = seen_host(ray, self._own)
        if seen is None or threat is Doubt.AMBIGUOUS:
            return threat
        host, squared = seen
        if isinstance(threat, Doubt):
            problem = f"host {host!r} lies there, as {ray.detection.source!r} sees it"
            return Refused(reason=RefusalKind.OWN_HOST, field="host", problem=problem)
        track = self.picture.tracks[threat]
        return threat if squared_of(ray, track, self._track_rules) < squared else Doubt.AMBIGUOUS

    def _fix(self, track: Track, rays: list[Ray], time_s: float) -> Fix | None:
        if len({ray.detection.host for ray in rays}) < 2:
            return None
        mean, covariance = predicted([state_before(track.steps, time_s)], [time_s], self._track_rules)
        east, north, up = mean[0, 3:].tolist()
        belief = Belief(
            velocity_mps=(east, north, up),
            speed_sigma_mps=math.sqrt(float(covariance[0, 3:, 3:].trace()) / 3),
            place=Place(mean[0, :3], np.asarray(np.linalg.inv(covariance[0, :3, :3]))),
        )
        return fix_of(rays, time_s, belief, self._rules)

    def _bearing(self, ray: Ray, track: Track) -> Bearing:
        """The tracker's bearing has one sigma; that of the ray along its two axes differs by less than a half."""
        range_m = max(float(np.linalg.norm(np.subtract(track.position_at(ray.time_s), ray.origin_m))), 1.0)
        variance = sum(sigma**2 for sigma in ray.sigma_rad) / 2 + (self._rules.host_sigma_m / range_m) ** 2
        return Bearing(
            source=ray.detection.source,
            time_s=ray.time_s,
            origin_m=ray.origin_m,
            direction=ray.direction,
            sigma_rad=variance**0.5,
            track_id=track.id,
        )

    def _update(
        self, measurements: Sequence[Measurement], members: Sequence[list[int]], fate: Fate | None = None
    ) -> str | None:
        """Give measurements to the tracker and its verdicts to the detections behind each; return the last's track."""
        self.picture, verdicts = update(
            self.picture, measurements, self._now_s, self._track_rules, own=self._own, clock=self._clock
        )
        threat = None
        for measurement, indices, verdict in zip(measurements, members, verdicts, strict=True):
            fix = isinstance(measurement, Report)
            if isinstance(verdict, Refusal):
                for index in indices:
                    self.refuse(index, Refused(reason=verdict.kind, field=verdict.field, problem=verdict.problem))
                threat = None
                continue
            threat = verdict
            for index in indices:
                self.verdicts[index] = Verdict(fate=fate or (Fate.FIX if fix else Fate.BEARING), threat=threat)
            self._counts = replace(
                self._counts,
                used=self._counts.used + len(indices),
                bearing_only=self._counts.bearing_only + (not fix),
                fixes=self._counts.fixes + fix,
            )
        return threat


def _moments(rays: Iterable[tuple[int, Ray]], rules: DetectionRules) -> list[list[tuple[int, Ray]]]:
    """Part rays into moments: in order of time, each no longer than rays may be apart and still be together."""
    moments: list[list[tuple[int, Ray]]] = []
    for index, ray in sorted(rays, key=lambda each: (each[1].look[1], each[1].look[0], each[0])):
        if not moments or ray.time_s - moments[-1][0][1].time_s > rules.together_s:
            moments.append([])
        moments[-1].append((index, ray))
    return moments


def _report(fix: Fix, time_s: float, *, track_id: str | None) -> Report:
    east, north, up = fix.position_m.tolist()
    return Report(
        source=SOURCE,
        threat_id=None,
        time_s=time_s,
        position_m=(east, north, up),
        covariance_m2=_matrix(fix.covariance_m2),
        common_m2=_matrix(fix.common_m2),
        track_id=track_id,
    )


def _matrix(values: np.typing.NDArray[np.float64]) -> Matrix3:
    rows: list[Vector3] = [(float(a), float(b), float(c)) for a, b, c in ((values + values.T) / 2).tolist()]
    return (rows[0], rows[1], rows[2])
