"""How much is left in a vehicle's batteries: the lowest that was told lately.

SYS_STATUS tells one number (PX4: the lowest, ArduPilot: the first battery's); BATTERY_STATUS tells each battery by its
id, from the autopilot or from a smart battery's own component. A battery that was not told for a while counts no more:
it may have been changed, or whoever told it is gone.
"""

from hsop_gcs.link.enums import MavBatteryFunction, MavComponent
from hsop_gcs.link.messages import BatteryStatus, SysStatus

BATTERIES = frozenset((MavComponent.BATTERY, MavComponent.BATTERY2))
"""Components of smart batteries that speak for themselves."""
TOLD_WITHIN_S = 30.0
"""A battery that was not told for so long does not count any more; each is asked for every two seconds."""
_MOST_BATTERIES = 16
_TOLD_IN_SUM = (-1, -1)

_Key = tuple[int, int]
"""The component that told it and the battery's id."""


class Batteries:
    """What was told of every battery, and when."""

    def __init__(self) -> None:
        self._told: dict[_Key, tuple[float, float]] = {}

    def receive(self, message: SysStatus | BatteryStatus, now: float, *, component: int) -> None:
        """Take a status; one that does not know its charge, or is of a payload's battery, says nothing."""
        if not 0 <= message.battery_remaining <= 100:
            return
        key = _TOLD_IN_SUM
        if isinstance(message, BatteryStatus):
            if message.battery_function == MavBatteryFunction.PAYLOAD:
                return
            key = (component, message.id)
        if key in self._told or len(self._told) < _MOST_BATTERIES:
            self._told[key] = (now, float(message.battery_remaining))

    def lowest_percent(self, now: float) -> float | None:
        """Return the lowest charge told lately, percent; None if none was."""
        self._told = {key: told for key, told in self._told.items() if now - told[0] <= TOLD_WITHIN_S}
        return min((percent for _, percent in self._told.values()), default=None)

    def forget(self) -> None:
        """Forget all batteries: the autopilot is a new one."""
        self._told.clear()
