"""Placement: problem in, hover points, headings, pans and camera choices out. Pure and deterministic."""

from hsop_gcs.placement.place import place
from hsop_gcs.placement.solution import Method

__all__ = ["Method", "place"]
