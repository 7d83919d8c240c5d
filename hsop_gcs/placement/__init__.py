"""Placement: problem in, hover points, headings, pans and camera choices out. Pure and deterministic."""
