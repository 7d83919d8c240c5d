"""Which of a vehicle's gimbals is led, and whose reports are that gimbal's.

A gimbal manager names the device that it manages: 1 to 6 for a gimbal on the manager's own outputs, else the component
id of a gimbal that speaks MAVLink itself. Reports name the device in the same way, or leave it at 0: then it is the
gimbal of the component that reports.  Source: MAVLink developer guide, "Gimbal protocol v2".
"""

from dataclasses import dataclass

from hsop_gcs.link.enums import MavComponent, MavType
from hsop_gcs.link.messages import Heartbeat, Message

_LAST_OF_OWN = 6
_NOT_NAMED = 0
_ALONE_FOR_S = 2.0
_MOST_DEVICES = 16
_COMPONENTS = frozenset(
    (
        MavComponent.GIMBAL,
        MavComponent.GIMBAL2,
        MavComponent.GIMBAL3,
        MavComponent.GIMBAL4,
        MavComponent.GIMBAL5,
        MavComponent.GIMBAL6,
    )
)


@dataclass(frozen=True, slots=True)
class GimbalDevice:
    """A gimbal by its manager's component and the id under which that manages it."""

    manager: int
    id: int

    @property
    def component(self) -> int:
        """The component that reports of it."""
        return self.id if self.id > _LAST_OF_OWN else self.manager

    def is_reported(self, component: int, device_id: int) -> bool:
        """Whether a report of ``component`` about ``device_id`` is one of this gimbal."""
        if component == self.component and device_id in (_NOT_NAMED, self.id):
            return True
        return component == self.manager and device_id == self.id


class LedGimbal:
    """Tells the reports of the led gimbal from those of any other."""

    def __init__(self) -> None:
        self.device: GimbalDevice | None = None
        """None while no manager is known."""
        self._heard: dict[tuple[int, int], float] = {}

    def is_reported(self, component: int, device_id: int, now: float) -> bool:
        """Whether a report is of the led gimbal. While no manager is known, a gimbal counts that is the only one."""
        if self.device is not None:
            return self.device.is_reported(component, device_id)
        self._heard = {key: at for key, at in self._heard.items() if now - at <= _ALONE_FOR_S}
        if len(self._heard) < _MOST_DEVICES:
            self._heard[component, device_id] = now
        return len(self._heard) == 1


def is_gimbals(message: Message, component: int) -> bool:
    """Whether a message is the heartbeat of a gimbal, by its component or by what it says that it is."""
    return isinstance(message, Heartbeat) and (component in _COMPONENTS or message.type == MavType.GIMBAL)
