"""Tracks: reports in, one believed state per threat out. Pure: every function returns new values."""

from hsop_gcs.tracks.picture import Picture, TrackRules, prune, update
from hsop_gcs.tracks.track import Track

__all__ = ["Picture", "Track", "TrackRules", "prune", "update"]
