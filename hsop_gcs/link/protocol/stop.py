"""Staying where a stop has ended, for an autopilot that flies back to where it had expected to stop.

    idle ──a stop is ordered at speed──► braking ──at rest for the first time──► idle: the stop is ordered once more
     ▲                                      │
     └──another order, or it takes too long─┘

PX4 expects its place from its speed alone: by what it still gathers while it leans back it overshoots, 10 m and more,
and would fly back, towards what it may have been stopped for.
"""

import math

from hsop_gcs.link.protocol.telemetry import VehicleState

_MOVING_MPS, _AT_REST_MPS = 1.5, 0.8
_GIVE_UP_S = 15.0


class Stop:
    """Knows when a stop has ended. See the module's diagram."""

    def __init__(self) -> None:
        self._until_s: float | None = None

    def start(self, state: VehicleState, now: float) -> None:
        """A stop was ordered; of one that hardly moves nothing is to be awaited."""
        speed_mps = _speed_mps(state)
        self._until_s = now + _GIVE_UP_S if speed_mps is not None and speed_mps >= _MOVING_MPS else None

    def cancel(self) -> None:
        """Another order took its place."""
        self._until_s = None

    def ends(self, state: VehicleState, now: float) -> bool:
        """Whether it has come to rest now, for the first time since the order: true once."""
        if self._until_s is None:
            return False
        if now >= self._until_s or not state.link_up:
            self._until_s = None
            return False
        speed_mps = _speed_mps(state)
        if speed_mps is None or speed_mps > _AT_REST_MPS:
            return False
        self._until_s = None
        return True


def _speed_mps(state: VehicleState) -> float | None:
    return None if state.velocity_enu_mps is None else math.hypot(*state.velocity_enu_mps[:2])
