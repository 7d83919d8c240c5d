"""An order as it arrives: COMMAND_LONG and COMMAND_INT in one form."""

import math
from dataclasses import dataclass

from hsop_gcs.link.messages import CommandInt, CommandLong
from hsop_gcs.simulator.gimbal import Identity


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A COMMAND_LONG or COMMAND_INT and who sent it. ``x``, ``y`` stand as sent: integers in a COMMAND_INT."""

    command: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float
    frame: int
    integer: bool
    sender: Identity

    @property
    def lat_deg(self) -> float:
        return self.x * 1e-7 if self.integer else self.x

    @property
    def lon_deg(self) -> float:
        return self.y * 1e-7 if self.integer else self.y


def whole(value: float) -> int:
    """Return a parameter that means a whole number; what is no number at all means none, like 0."""
    return round(value) if math.isfinite(value) else 0


def read_order(message: CommandLong | CommandInt, sender: Identity) -> Order:
    """Return either message as an order."""
    x: float
    y: float
    if isinstance(message, CommandInt):
        x, y, z, frame = message.x, message.y, message.z, message.frame
    else:
        x, y, z, frame = message.param5, message.param6, message.param7, 0
    return Order(
        command=message.command,
        p1=message.param1,
        p2=message.param2,
        p3=message.param3,
        p4=message.param4,
        x=x,
        y=y,
        z=z,
        frame=frame,
        integer=isinstance(message, CommandInt),
        sender=sender,
    )
