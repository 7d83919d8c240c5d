"""What another program may tell a vehicle over our link: parameters, fences, files, logs and cameras, and no more.

Orders, modes, targets, streams and heartbeats stay with the service: whatever flies a host goes through its safety
gates, and no second heartbeat hides from the vehicle that ours has stopped. A command that does not pass is answered
DENIED in the vehicle's name; nothing else of MAVLink has an answer that would say so.
"""

from hsop_gcs.link.codec import STX_V2, Encoder, Frame, is_signed, message_id, message_ids
from hsop_gcs.link.enums import MavCmd, MavComponent, MavResult
from hsop_gcs.link.messages import CommandAck, CommandInt, CommandLong

_MESSAGES = message_ids(
    (
        *("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"),
        *("PARAM_EXT_REQUEST_LIST", "PARAM_EXT_REQUEST_READ", "PARAM_EXT_SET"),
        *("MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"),
        *("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_CLEAR_ALL"),
        *("FILE_TRANSFER_PROTOCOL", "LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END"),
        *("PING", "TIMESYNC"),
    )
)
_COMMANDS = {
    MavCmd.GET_HOME_POSITION,
    MavCmd.GET_MESSAGE_INTERVAL,
    MavCmd.REQUEST_MESSAGE,
    MavCmd.REQUEST_PROTOCOL_VERSION,
    MavCmd.REQUEST_AUTOPILOT_CAPABILITIES,
    *range(521, 535),  # camera and storage: information, mode, zoom, focus
    *(2000, 2001),  # images
    *range(2500, 2506),  # video
}


def withheld(frame: Frame, system: int) -> str | None:
    """Return the name of what may not pass to this vehicle; None for what may."""
    if frame.raw[0] != STX_V2 or is_signed(frame.raw):
        return "signed already, or MAVLink 1"
    match frame.message:
        case CommandLong(command=command) | CommandInt(command=command) if command not in _COMMANDS:
            return f"command {command}"
        case CommandLong() | CommandInt():
            pass
        case _ if message_id(frame.raw) not in _MESSAGES or not frame.verified:
            return f"message {message_id(frame.raw)}"
    # Behind one radio there may be others.
    return None if getattr(frame.message, "target_system", system) in (0, system) else "to another system"


def denial(frame: Frame, system: int, result: MavResult = MavResult.DENIED) -> bytes | None:
    """Return the answer to a command that does not pass, as its addressee would give it; None to what has no answer.

    A command to another system is not answered: we do not speak for vehicles that the port does not lead to.
    """
    message = frame.message
    if not isinstance(message, CommandLong | CommandInt) or message.target_system not in (0, system):
        return None
    answer = CommandAck(
        command=message.command, result=result, target_system=frame.system, target_component=frame.component
    )
    return Encoder(system=system, component=message.target_component or MavComponent.AUTOPILOT1).encode(answer)
