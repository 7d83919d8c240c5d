"""One threat, two tracks: cameras began one where a coarse report was too far off, and it is the reported threat.

Cameras look at where a threat is reported to be. If for a while they have seen nothing of it there, but a threat nearby
that nobody reports, the two are one: the reported track keeps its name and believes what the cameras know.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from types import MappingProxyType

import numpy as np

from hsop_gcs.detections.rules import DetectionRules
from hsop_gcs.tracks import Picture, Track, TrackRules, TrackStatus
from hsop_gcs.tracks.gate import predicted, threshold

SOURCE = "cameras"
"""Who reports fixes."""

_STATE = 6


def is_only_seen(track: Track) -> bool:
    """Return whether nobody but cameras has ever told of a track."""
    return track.source == SOURCE and not track.sources


def merged(picture: Picture, time_s: float, rules: DetectionRules, track_rules: TrackRules) -> Picture:
    """Return the picture in which tracks that only cameras know of, and reported ones beside them, are one.

    Each with the one that it is nearest to, as far as both states may be one threat's at ``time_s``.
    """
    tracks = picture.tracks.values()
    strange = [track for track in tracks if is_only_seen(track) and _is_seen(track, time_s - rules.merge_after_s)]
    reported = [track for track in tracks if not is_only_seen(track)]
    unseen = [track for track in reported if _last_seen_s(track) < time_s - rules.merge_after_s]
    gate = threshold(_STATE, 1.0 - track_rules.gate_probability)
    apart = _distances(strange, unseen, time_s, track_rules)
    after = dict(picture.tracks)
    for distance, one, other in sorted((apart[one, other], one, other) for one, other in np.ndindex(apart.shape)):
        known, named = strange[one], unseen[other]
        if distance > gate or known.id not in after or after[named.id] is not named:
            continue
        del after[known.id]
        after[named.id] = replace(
            known,
            id=named.id,
            source=named.source,
            source_threat_id=named.source_threat_id,
            sources=named.sources,
            size_m=named.size_m,
            reports=named.reports + known.reports,
            first_seen_s=min(named.first_seen_s, known.first_seen_s),
        )
    return picture if len(after) == len(picture.tracks) else picture._replace(tracks=MappingProxyType(after))


def _is_seen(track: Track, since_s: float) -> bool:
    """Whether cameras have followed a track of their own since then."""
    return track.status is TrackStatus.CONFIRMED and track.first_seen_s <= since_s <= track.time_s


def _last_seen_s(track: Track) -> float:
    """When cameras saw a threat last, as far as its track remembers."""
    return max((each.time_s for each in track.steps if each.track_id is not None), default=-np.inf)


def _distances(
    ones: Sequence[Track], others: Sequence[Track], time_s: float, rules: TrackRules
) -> np.typing.NDArray[np.float64]:
    """The squared Mahalanobis distances between tracks' states, (ones, others)."""
    if not ones or not others:
        return np.empty((len(ones), len(others)))
    states = [track.state for track in (*ones, *others)]
    means, covariances = predicted(states, [time_s] * len(states), rules)
    result = np.empty((len(ones), len(others)))
    for i, j in product(range(len(ones)), range(len(others))):
        apart = means[i] - means[len(ones) + j]
        result[i, j] = apart @ np.linalg.solve(covariances[i] + covariances[len(ones) + j], apart)
    return result
