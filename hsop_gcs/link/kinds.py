"""What kind of vehicle an autopilot says it is (HEARTBEAT.type): its name for a person, and whether it can hover."""

from hsop_gcs.link.enums import MavType

MULTICOPTERS = frozenset(
    {
        MavType.QUADROTOR,
        MavType.COAXIAL,
        MavType.HELICOPTER,
        MavType.HEXAROTOR,
        MavType.OCTOROTOR,
        MavType.TRICOPTER,
        MavType.DODECAROTOR,
        MavType.DECAROTOR,
        MavType.GENERIC_MULTIROTOR,
    }
)
"""Aircraft that hover wherever they are stopped."""

VTOLS = frozenset(
    {
        MavType.VTOL_DUOROTOR,
        MavType.VTOL_QUADROTOR,
        MavType.VTOL_TILTROTOR,
        MavType.VTOL_FIXEDROTOR,
        MavType.VTOL_TAILSITTER,
        MavType.VTOL_TILTWING,
        MavType.VTOL_RESERVED5,
    }
)
"""Aircraft that hover only in one of their states (EXTENDED_SYS_STATE.vtol_state)."""

_NAMES = {
    MavType.GENERIC: "vehicle of no told type",
    MavType.VTOL_DUOROTOR: "VTOL duorotor tailsitter",
    MavType.VTOL_QUADROTOR: "VTOL quadrotor tailsitter",
    MavType.VTOL_TILTROTOR: "VTOL tiltrotor",
    MavType.VTOL_FIXEDROTOR: "VTOL with fixed rotors",
    MavType.VTOL_TAILSITTER: "VTOL tailsitter",
    MavType.VTOL_TILTWING: "VTOL tiltwing",
    MavType.VTOL_RESERVED5: "VTOL",
    MavType.VTOL_GYRODYNE: "VTOL gyrodyne",
}


def type_name(vehicle_type: int) -> str:
    """Return the name of a MAV_TYPE for a person."""
    try:
        known = MavType(vehicle_type)
    except ValueError:
        return f"vehicle of type {vehicle_type}"
    return _NAMES.get(known, known.name.lower().replace("_", " "))
