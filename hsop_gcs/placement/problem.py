"""What is asked: threats to localize, hosts to do it with, and the rules (letter, section IV)."""

from dataclasses import dataclass, field
from enum import StrEnum

from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.placement.airspace import Airspace

Point = tuple[float, float, float]
"""East, north, up, metres (or metres per second), local frame."""


class Formulation(StrEnum):
    """Which constraints a placement must keep."""

    LETTER = "letter"
    """As published: plane, at the end points of the threats that a host observes."""
    OPERATIONAL = "operational"
    """In space, along whole paths, with separation, limits and areas."""


class Objective(StrEnum):
    """What is least at the best placement."""

    LETTER = "letter"
    """The cost of Eq. 8."""
    RMS = "rms"
    """The predicted root-mean-square localization error, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Threat:
    """An intruder as the planner sees it: a straight path at constant speed."""

    id: str
    position_m: Point
    velocity_mps: Point = (0.0, 0.0, 0.0)
    size_m: float = 1.0
    weight: float = 1.0

    def predicted_m(self, after_s: float) -> Point:
        """Return where it will be ``after_s`` seconds on (Eq. 7)."""
        (x, y, z), (vx, vy, vz) = self.position_m, self.velocity_mps
        return (x + after_s * vx, y + after_s * vy, z + after_s * vz)


@dataclass(frozen=True, slots=True, kw_only=True)
class AvailableHost:
    """A host that may be placed, and where it is now."""

    id: str
    position_m: Point
    rig: CameraRig | None = None
    """None: that of the problem."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One placement question. Frozen and picklable: a solve may run in another process."""

    threats: tuple[Threat, ...]
    bystanders: tuple[Threat, ...] = ()
    """Threats that nobody has to see, at the same moment: hosts keep clear of their ways as well; operational only."""
    hosts: tuple[AvailableHost, ...] = ()
    """Empty: as many as it takes, named h1, h2, ..."""
    max_hosts: int | None = None
    """No more hosts than this are placed; None: the number of ``hosts``, or no limit without them."""
    rig: CameraRig = field(default_factory=CameraRig)
    """Of every host that has none of its own."""
    horizon_s: float = 10.0
    safety_distance_m: float = 20.0
    formulation: Formulation = Formulation.OPERATIONAL
    objective: Objective = Objective.LETTER
    min_separation_m: float = 10.0
    """Between hover points; this and all that follows counts in the operational formulation only."""
    airspace: Airspace = field(default_factory=Airspace)
    """Where hosts may hover. Without floor and ceiling they keep to the altitudes of the threats."""
    lead_s: float = 0.0
    """The safety distance holds this long before the threats are where they are said to be: the hosts' way there."""
    position_sigma_m: float = 0.0
    """Standard deviation of a host's own position, each axis; counts in the expected error."""
    attitude_sigma_rad: float = 0.0
    """Standard deviation of a camera's attitude, about each axis across its rays; counts in the expected error."""
    max_views: int = 2
    """A threat's fix is fused from up to so many views; the cost is that of its pair."""

    @property
    def rigs(self) -> tuple[CameraRig, ...]:
        """The different rigs that hosts carry, in the order of the hosts."""
        return tuple(dict.fromkeys(host.rig or self.rig for host in self.hosts)) or (self.rig,)

    def rig_of(self, host_id: str) -> CameraRig:
        """Return what a host carries; one that is not among ``hosts`` has the problem's rig."""
        return next((host.rig for host in self.hosts if host.id == host_id and host.rig is not None), self.rig)
