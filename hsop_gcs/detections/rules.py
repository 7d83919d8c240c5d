"""What the detections stage assumes, and when it gives up. Every number can be set."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionRules:
    """How rays find their threats and each other."""

    max_age_s: float = 3.0
    """An older detection is refused: the tracker would take it no more."""
    pose_limit_s: float = 0.5
    """A host's pose is known at a time if telemetry came within this of it."""
    host_sigma_m: float = 0.05
    """Standard deviation of a host's own position, each axis."""
    together_s: float = 0.12
    """Rays of different hosts within this time make one fix: cameras at 5 Hz need not be triggered together."""

    gate_probability: float = 0.999
    """How likely a threat's own ray lies within its gate."""
    impossible_probability: float = 1e-9
    """A ray less likely than this is of another threat, whatever id it bears."""
    unexplained_per_sr: float = 1e-6
    """How densely rays of unknown threats and of nothing are expected; what a threat must beat to explain a ray."""
    sure_odds: float = 1e3
    """A ray goes to a threat only if that is so many times likelier than anything else. Names are asked for at every
    moment until they are sure, and what is once taken for sure is not doubted again."""
    hypotheses: int = 256
    """Ways to explain the rays of one moment that are followed side by side."""
    misfit_probability: float = 1e-4
    """Rays that meet worse than this do not show one threat."""

    merge_after_s: float = 2.0
    """A reported threat that cameras have not seen for so long, and one beside it that only they have, are one."""

    hold_s: float = 0.5
    """How long a ray that no threat explains waits for one of another host to meet."""
    most_held: int = 100
    candidate_speed_mps: float = 5.0
    """How fast, each axis, a threat may move that nothing is known of."""
    nearest_m: float = 1.0
    farthest_m: float = 200.0
    """From each host to a threat that its rays may begin; rays that know a threat's place no better fix nothing."""
    widest_share: float = 0.5
    """Rays whose meeting is less certain than this part of its distance from the nearest host begin nothing."""
