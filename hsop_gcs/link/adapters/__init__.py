"""What differs between the autopilots; chosen by what a vehicle's HEARTBEAT says it is."""

from hsop_gcs.link.adapters.adapter import Adapter
from hsop_gcs.link.adapters.ardupilot import ARDUPILOT, ardupilot_of
from hsop_gcs.link.adapters.px4 import PX4
from hsop_gcs.link.enums import MavAutopilot


def adapter_for(autopilot: int, vehicle_type: int) -> Adapter | None:
    """Return the adapter of a MAV_AUTOPILOT on a MAV_TYPE; None if it is an autopilot that we give no orders to."""
    match autopilot:
        case MavAutopilot.PX4:
            return PX4
        case MavAutopilot.ARDUPILOTMEGA:
            return ardupilot_of(vehicle_type)
    return None


__all__ = ["ARDUPILOT", "PX4", "Adapter", "adapter_for"]
