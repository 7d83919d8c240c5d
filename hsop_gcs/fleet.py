"""The hosts: camera aircraft, what they carry and how they are reached."""

from dataclasses import dataclass, field

from hsop_gcs.cameras.rig import CameraRig


@dataclass(frozen=True, slots=True, kw_only=True)
class Host:
    """An aircraft that carries one peripheral-central vision rig."""

    id: str
    system_id: int
    """Its MAVLink system id, 1..255."""
    connection: str
    """``udpin:HOST:PORT`` to listen there, ``udpout:HOST:PORT`` or ``tcp:HOST:PORT`` to speak first, or
    ``serial:DEVICE:BAUD``."""
    rig: CameraRig | None = None
    """None: the fleet's."""
    remote_id: tuple[str, ...] = ()
    """Under which ids others report it: of its Remote ID, its ADS-B transponder, a radar's list of friends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """Where and how fast hosts fly; altitudes in metres above the mission's origin."""

    floor_m: float = 5.0
    ceiling_m: float = 120.0
    speed_mps: float = 8.0
    climb_mps: float = 1.5
    """Up and down."""
    battery_reserve_percent: float = 20.0
    """A host with less is not sent; 0: it does not matter."""
    link_loss_max: float = 0.6
    """A host of whose messages a greater share is lost is not sent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """All hosts of a mission."""

    hosts: tuple[Host, ...]
    limits: FlightLimits = field(default_factory=FlightLimits)
    rig: CameraRig = field(default_factory=CameraRig)
    """Of every host that has none of its own."""

    def rigs(self) -> dict[str, CameraRig]:
        """Return what each host carries, by its id."""
        return {host.id: host.rig or self.rig for host in self.hosts}

    def host_of_system(self, system_id: int) -> Host:
        """Return the host with this MAVLink system id. Raises KeyError if there is none."""
        for host in self.hosts:
            if host.system_id == system_id:
                return host
        raise KeyError(system_id)
