"""What differs between the autopilots; chosen by what a vehicle's HEARTBEAT says it is."""

from hsop_gcs.link.adapters.adapter import Adapter
from hsop_gcs.link.adapters.ardupilot import ARDUPILOT
from hsop_gcs.link.adapters.px4 import PX4
from hsop_gcs.link.enums import MavAutopilot


def adapter_for(autopilot: int) -> Adapter | None:
    """Return the adapter of a MAV_AUTOPILOT; None if it is an autopilot that we give no orders to."""
    return {int(MavAutopilot.PX4): PX4, int(MavAutopilot.ARDUPILOTMEGA): ARDUPILOT}.get(autopilot)


__all__ = ["ARDUPILOT", "PX4", "Adapter", "adapter_for"]
