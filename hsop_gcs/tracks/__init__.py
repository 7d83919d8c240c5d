"""Tracks: reports in, one believed state per threat out. Pure: every function returns new values.

``picture.update`` shows the whole of it: screen → scans → gate → associate → filter (with replay of what came late)
→ lifecycle.
"""

from hsop_gcs.tracks.filter import State
from hsop_gcs.tracks.history import state_before
from hsop_gcs.tracks.picture import Picture, Verdict, dismiss, prune, update
from hsop_gcs.tracks.rules import ConfirmAtOnce, TrackRules
from hsop_gcs.tracks.sources import Refusal, RefusalKind, SourceWatch
from hsop_gcs.tracks.track import Track, TrackStatus

__all__ = [
    "ConfirmAtOnce",
    "Picture",
    "Refusal",
    "RefusalKind",
    "SourceWatch",
    "State",
    "Track",
    "TrackRules",
    "TrackStatus",
    "Verdict",
    "dismiss",
    "prune",
    "state_before",
    "update",
]
