"""Replay: a journal run again without hosts, clock or network, and held against what it recorded."""

from hsop_gcs.replay.mission import Difference, Outcome, replay

__all__ = ["Difference", "Outcome", "replay"]
