"""Who sends: MAVLink's pair of ids."""

from dataclasses import dataclass

from hsop_gcs.link.enums import MavComponent


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """The sender of a MAVLink frame. 255/190 is the ground station that ArduPilot's failsafe listens for."""

    system: int = 255
    component: int = int(MavComponent.MISSIONPLANNER)


GROUND_STATION = Identity()
