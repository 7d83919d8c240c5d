"""Refusals shared by the camera models."""

import math

from hsop_gcs.errors import BadInput


def require_positive(field: str, value: float) -> None:
    """Refuse anything but a finite number above zero. Raises BadInput."""
    if not (math.isfinite(value) and value > 0):
        raise BadInput(field, f"must be a finite number above 0, not {value!r}")
